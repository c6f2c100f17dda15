"""A run that diverges because of its controller says so."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import ComputationError
from swgjoint.sim import loop_stability
from swgjoint.sim.loop_stability import explain_divergence, growing_mode
from swgjoint.sim.own_drives import scene_of_run
from swgjoint.sim.simulation import prepare_scene
from swgjoint.view.run import run_scene
from swgjoint.view.validity import step_error

LINK = {
    "defaults.drive": "CSG-25-100",
    "defaults.friction": False,
    "defaults.kinematic_error_arcmin": 0.1,
    "controller.feedback": "link",
    "controller.damping_ratio": 0.7,
    "simulation.duration_s": 0.65,
}
KINDS = {
    "pd": {"controller.kind": "pd"},
    "pid": {"controller.kind": "pid", "controller.integral_limit_Nm": 1e6},
    "computed torque": {"controller.kind": "computed_torque"},
    "late": {"sensors.link.delay_s": 0.004},
    "slow": {"controller.control_period_s": 0.002},
}


def changed(frequency, **changes):
    return {**LINK, "controller.natural_frequency_Hz": frequency, **changes}


@pytest.mark.parametrize("kind", KINDS)
def test_growth_is_that_of_the_run(kind):
    """Frequency and doubling time of the linear loop, before the motion is large."""
    overrides = changed(30.0, **KINDS[kind])
    assembly, _ = prepare_scene("bench", overrides=overrides)
    mode = growing_mode(assembly)
    assert mode is not None and mode.joint == "joint"
    run = run_scene("bench", overrides=overrides)
    speed = run.velocity[:, 0] - run.assembly.trajectory.velocity[-1, 0]
    early, late = (
        np.abs(speed[(run.time >= t) & (run.time < t + 0.1)]).max() for t in (0.3, 0.55)
    )
    doubling = 0.25 * np.log(2.0) / np.log(late / early)
    assert doubling == pytest.approx(mode.doubling, rel=0.05)
    last = speed[run.time > 0.45]
    turns = np.count_nonzero(np.diff(np.sign(last))) / 2.0 / 0.2
    assert turns == pytest.approx(mode.frequency, rel=0.1)


def test_a_stable_loop_is_not_blamed():
    """At a lower frequency the loop is stable and the run does not grow."""
    assembly, _ = prepare_scene("bench", overrides=changed(15.0))
    assert growing_mode(assembly) is None and explain_divergence(assembly) is None


def test_a_run_names_joint_and_keys():
    """The message replaces the one of a divergence without a known cause."""
    overrides = {**changed(60.0), "simulation.duration_s": 3.0}
    named = ("unstable", "joint", "controller.natural_frequency_Hz = 60", "link")
    with pytest.raises(ComputationError, match=naming(*named)):
        run_scene("bench", overrides=overrides)


def test_a_divergence_without_a_growing_mode_keeps_its_message(monkeypatch):
    """The time step remains the first suspect."""
    monkeypatch.setattr(loop_stability, "growing_mode", lambda assembly: None)
    overrides = {**changed(60.0), "simulation.duration_s": 3.0}
    with pytest.raises(ComputationError, match=naming("diverged", "simulation.step_s")):
        run_scene("bench", overrides=overrides)


def test_own_drives_with_a_stated_error():
    """The error of a drive is not added again, so a run can be repeated."""
    assembly, _ = prepare_scene("bench", overrides=changed(8.0))
    scene, drives = scene_of_run(assembly)
    again, _ = prepare_scene(scene, drives=drives)
    (first,), (second,) = assembly.transmissions, again.transmissions
    assert np.array_equal(first.drive.kinematic_error, second.drive.kinematic_error)
    run = run_scene("bench", overrides=changed(8.0))
    assert "joints" in step_error(run)
