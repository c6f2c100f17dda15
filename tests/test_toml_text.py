"""Tables written as TOML are read back as they were."""

from __future__ import annotations

import tomllib

import pytest

from swgjoint.models_path import bundled_names
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.text import scene_toml
from swgjoint.toml_text import toml_text


def test_everything_that_toml_knows_comes_back():
    """Odd keys, lists of tables, empty tables, texts with quotes."""
    data = {
        "name": 'a "b" \x7f \\',
        "odd key.with dots": 1e-9,
        "list": [{"a": 1, "b c": [True, 2.5]}, {}],
        "table": {"inner": {"x/y": -3}, "empty": {}},
    }
    assert tomllib.loads(toml_text(data)) == data


@pytest.mark.parametrize("name", bundled_names("scenes", ".toml"))
def test_bundled_scenes_come_back(name):
    """As a scene that sets the same."""
    scene = Scene.load_file(name)
    again = Scene.from_toml(scene_toml(scene))
    wanted = scene.model_dump(exclude_none=True)
    found = again.model_dump(exclude_none=True)
    assert {**found, "arm": ""} == {**wanted, "arm": ""}


def test_a_written_scene_is_read_from_anywhere(tmp_path, monkeypatch):
    """Files that it names stand with whole paths, disturbances as tables."""
    (tmp_path / "motion.csv").write_text("time_s,joint\n0,0\n1,10\n2,0\n")
    monkeypatch.chdir(tmp_path)
    scene = Scene.load_file(
        "bench",
        [
            'trajectory={kind="csv", file="motion.csv"}',
            "load={}",
            'disturbance=[{kind="joint_pulse", joint="joint", torque_Nm=1.0,'
            " start_s=0.5, duration_s=0.2}]",
        ],
    )
    text = scene_toml(scene)
    monkeypatch.chdir("/")
    again = Scene.from_toml(text)
    assert str(tmp_path / "motion.csv") in text
    assert again.model_dump()["disturbance"] == scene.model_dump()["disturbance"]
