"""The doctor tells what is there and what is missing."""

from __future__ import annotations

import json
import sys
import sysconfig
import tomllib
from pathlib import Path

import mujoco
import pytest
from messages import names, naming

from swgjoint.cli import doctor
from swgjoint.cli.main import main
from swgjoint.errors import ComputationError
from swgjoint.joint import plugin
from swgjoint.joint.attach import attach
from swgjoint.maps.drive_map import DriveMap


def run(capsys) -> tuple[int, dict]:
    status = main(["doctor", "--json"])
    return status, json.loads(capsys.readouterr().out)


def by_name(result: dict) -> dict[str, dict]:
    return {check["name"]: check for check in result["checks"]}


def test_plugin_and_models_are_there(capsys):
    """The engine plugin loads, bundled models and cache are found."""
    _, result = run(capsys)
    checks = by_name(result)
    for name in ("python", "engine plugin", "bundled models", "cache"):
        assert checks[name]["ok"], checks[name]


def test_ok_is_about_required_parts(capsys):
    """``ok`` and the status follow the required checks alone."""
    status, result = run(capsys)
    required = [check["ok"] for check in result["checks"] if check["required"]]
    assert result["ok"] == all(required)
    assert status == (0 if result["ok"] else 1)
    assert {c["name"] for c in result["checks"] if not c["required"]} == {
        "compiled loops",
        *(f"extra {name}" for name in doctor.EXTRAS),
    }


def test_compiled_loops_are_there(capsys, monkeypatch):
    """They are built wherever Python has its headers, and numpy can replace them."""
    _, result = run(capsys)
    if (Path(sysconfig.get_path("include")) / "Python.h").exists():
        assert by_name(result)["compiled loops"]["ok"]
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    status, result = run(capsys)
    assert status == 0 and not by_name(result)["compiled loops"]["ok"]


def test_plugin_that_does_not_load(capsys, monkeypatch):
    """A plugin for another MuJoCo makes the installation unusable, with the reason."""

    def load():
        raise ComputationError("needs mujoco 4.0.0: pip install mujoco==4.0.0")

    monkeypatch.setattr(plugin, "load", load)
    status, result = run(capsys)
    assert status == 1
    assert not result["ok"]
    assert "pip install mujoco==4.0.0" in by_name(result)["engine plugin"]["detail"]


def test_another_mujoco(capsys, monkeypatch):
    """With another version doctor and a scene's joint say which is needed, and how."""
    plugin.load.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(mujoco, "__version__", "4.1.0")
        status, result = run(capsys)
        assert status == 1
        detail = by_name(result)["engine plugin"]["detail"]
        assert names(detail, "4.1.0", "4.0.0", "pip install mujoco==4.0.0")
        spec = mujoco.MjSpec.from_string(
            '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body>'
            "</worldbody></mujoco>"
        )
        drive = DriveMap.linear(1e4)
        with pytest.raises(
            ComputationError, match=naming("4.1.0", "pip install mujoco==4.0.0")
        ):
            attach(spec, joint="j", drive=drive, rotor_inertia=1e-4)
        # what needs no plugin still works
        attach(spec, joint="j", drive=drive, level="linear", rotor_inertia=1e-4)
    _, result = run(capsys)
    assert by_name(result)["engine plugin"]["ok"]


@pytest.mark.parametrize("command", ["demo", "run ur5e-sweep"])
def test_another_mujoco_is_reported_before_maps_are_built(
    command, capsys, monkeypatch, tmp_path
):
    """One line with both versions and the remedy, not after minutes."""

    def build(*args, **kwargs):
        raise AssertionError("a map is built")

    monkeypatch.setattr("swgjoint.drives.build_map.build_map", build)
    monkeypatch.setattr(mujoco, "__version__", "4.1.0")
    plugin.load.cache_clear()
    assert main([*command.split(), "--out", str(tmp_path / "out")]) == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert names(line, "4.1.0", "4.0.0", "pip install mujoco==4.0.0")


def test_the_pinned_mujoco_is_the_one_of_the_plugin():
    """Build and run time require the version that the package states."""
    path = Path(__file__).parents[2] / "pyproject.toml"
    project = tomllib.loads(path.read_text(encoding="utf-8"))
    pin = f"mujoco=={plugin.MUJOCO_VERSION}"
    assert pin in project["build-system"]["requires"]
    assert pin in project["project"]["dependencies"]


def test_mujoco_that_is_missing(capsys, monkeypatch):
    """Without mujoco the doctor still answers."""
    monkeypatch.delitem(sys.modules, "swgjoint.joint.plugin")
    monkeypatch.delattr("swgjoint.joint.plugin")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    _, result = run(capsys)
    assert "cannot be imported" in by_name(result)["engine plugin"]["detail"]


def test_cache_folder(capsys, monkeypatch, tmp_path):
    """The cache is where the variable says, off when it is empty, or refused."""
    for value, ok, word in (
        (str(tmp_path / "new" / "deep"), True, "deep"),
        ("", True, "disabled"),
        ("/dev/null/x", False, "not writable"),
    ):
        monkeypatch.setenv("SWGJOINT_CACHE", value)
        _, result = run(capsys)
        check = by_name(result)["cache"]
        assert (check["ok"], word in check["detail"]) == (ok, True)
    assert list(tmp_path.iterdir()) == []


def test_missing_extras_say_how_to_get_them(monkeypatch, capsys):
    """An absent optional part names its modules and the pip command."""
    monkeypatch.setattr(doctor, "EXTRAS", {"none": ("no_such_module",)})
    _, result = run(capsys)
    check = by_name(result)["extra none"]
    assert not check["ok"]
    assert check["detail"].endswith("pip install 'swgjoint[none]'")


def test_required_packages_come_from_the_metadata(monkeypatch):
    """Requirements of the base install, not those of extras."""
    monkeypatch.setattr(
        doctor.metadata,
        "requires",
        lambda name: [
            "numpy>=2.0",
            "mujoco==4.0.0",
            'cma>=4 ; extra == "tune"',
            "a [b]",
        ],
    )
    assert doctor.required_packages() == ["swgjoint", "numpy", "mujoco", "a"]


@pytest.mark.parametrize("ok", [True, False])
def test_report(ok):
    """The table has a line per check and a verdict."""
    check = {"name": "x", "ok": ok, "required": True, "detail": "why"}
    text = doctor.report({"ok": ok, "checks": [check]})
    assert text.splitlines()[0].split() == ["x", "ok" if ok else "MISSING", "why"]
    assert ("not usable" in text) is not ok
