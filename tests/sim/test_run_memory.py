"""Memory of a run: refused before it is taken, and bounded by the estimate."""

from __future__ import annotations

import tracemalloc

import pytest
from messages import names

from swgjoint import memory
from swgjoint.cli.main import main
from swgjoint.sim.run_memory import VIEWER, required_memory
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.recording import recording
from swgjoint.view.run import run_scene

DRIVE = {"defaults.drive": "CSG-25-100", "trajectory.settle_s": 0.2}


def test_a_run_that_does_not_fit_is_refused_at_once(monkeypatch, capsys):
    """One line with duration, step, joints and both figures; nothing is simulated."""
    monkeypatch.setattr(memory, "available_memory", lambda: 1e9)
    changes = ["simulation.duration_s=1500", "defaults.drive=CSG-25-100"]
    options = [part for change in changes for part in ("--set", change)]
    assert main(["run", "ur5e-sweep", *options]) == 1
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert names(err, "simulation.duration_s", "1500 s", "6 joints", "GB", "step_s")


def peak(scene: Scene, path) -> float:
    """Largest memory of a run with its figures and its recording [B]."""
    tracemalloc.start()
    try:
        run_scene(scene, recording=path).metrics()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", ["bench", "ur5e-sweep"])
def test_the_estimate_bounds_what_a_step_takes(name, tmp_path, monkeypatch):
    """Arrays of Python per further step are within the estimate, and over a third.

    The recording goes out in parts, of a size that short runs reach as well.
    """
    monkeypatch.setattr(recording, "PART", 4000)
    short, long = (
        Scene.load_file(name, DRIVE | {"simulation.duration_s": duration})
        for duration in (10.0, 22.0)
    )
    peak(short, tmp_path / "first.rrd")  # imports what later runs find there
    grown = peak(long, tmp_path / "a.rrd") - peak(short, tmp_path / "b.rrd")
    joints = 1 if name == "bench" else 6
    bound = required_memory(long, joints) - required_memory(short, joints)
    assert bound / 3 < grown < bound


def test_sub_steps_cost_less_than_steps():
    """What is recorded counts most; a run without steps needs the libraries alone."""
    scene = Scene.load_file("bench", DRIVE)
    none, one, two = (required_memory(scene, 6, sub_steps=n) for n in (1, 2, 3))
    assert two - one == one - none > 0.0
    assert one - none < none - VIEWER
