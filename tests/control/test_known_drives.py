"""Controllers know the drives that are simulated: every level, friction on and off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.motor_side import MotorPID, rigid_plan
from swgjoint.drives.sections import LEVELS
from swgjoint.joint.prescribed import error_of_motor
from swgjoint.sim.assembly import assemble
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.task import task_of
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene

SCENE = {
    "name": "known",
    "arm": "two-link",
    "defaults": {"drive": "CSG-25-100", "rotor_inertia_kgm2": 1e-4},
    "trajectory": {
        "kind": "sweep",
        "hold_s": 0.2,
        "ramp_s": 0.3,
        "end_deg": {"shoulder": 12.0, "elbow": -20.0},
    },
    "controller": {
        "natural_frequency_Hz": 8.0,
        "damping_ratio": 1.0,
        "feedforward": "gravity_inertia",
    },
    "simulation": {"duration_s": 1.2},
}


def scene_of(level: str, friction: bool) -> Scene:
    return Scene.from_data(SCENE).with_level(level).with_friction(friction)


def unrubbed_plan(task):
    """The scene's own feed-forward: a rigid gear, no friction."""
    drives = tuple(replace(drive, friction=None) for drive in task.joints.drives)
    return rigid_plan(replace(task, joints=replace(task.joints, drives=drives)))


def error_of(scene: Scene, plan=None) -> np.ndarray:
    """Link against command, rms of every joint [arcmin]."""
    controller = None if plan is None else MotorPID(plan, frequency=8.0)
    run = run_scene(scene, controller=controller)
    return np.sqrt(np.mean((run.position - run.reference) ** 2, axis=0)) / arcmin


@pytest.mark.parametrize("friction", [True, False])
@pytest.mark.parametrize("level", LEVELS)
def test_a_controller_of_ones_own_does_what_the_scenes_does(level, friction):
    """The same law within 5 %; with the told drives in its plan it is better."""
    scene = scene_of(level, friction)
    own = error_of(scene)
    assert error_of(scene, unrubbed_plan) == pytest.approx(own, rel=0.05)
    told = error_of(scene, flexible_plan)
    assert (told < 0.2 * own).all()


@pytest.mark.parametrize("hysteresis", [True, False])
@pytest.mark.parametrize("friction", [True, False])
@pytest.mark.parametrize("level", LEVELS)
def test_a_drive_is_told_as_the_model_has_it(level, friction, hysteresis):
    """Friction, hysteresis, error and stiffness at the levels that have them alone."""
    keys = {
        "joints.elbow": {"drive": "CHA-25-100", "hysteresis": hysteresis},
        "defaults.friction": friction,
        "defaults.level": level,
    }
    whole = assemble(Scene.from_data(SCENE, overrides=keys))
    lossy, erring = level in ("native", "full"), level in ("kinematic", "full")
    told = task_of(whole).joints.drives
    for drive, transmission in zip(told, whole.transmissions, strict=True):
        whole_map = transmission.drive
        assert (drive.friction is not None) == (
            friction and lossy and whole_map.friction is not None
        )
        assert bool(drive.hysteresis) == (lossy and bool(whole_map.hysteresis))
        assert bool(drive.kinematic_error.any()) == erring
        assert drive.ratings == whole_map.ratings
        assert (drive.ratio, drive.name) == (whole_map.ratio, whole_map.name)
        softness = drive.mean_torsion(10.0) / whole_map.mean_torsion(10.0)
        rigid = level in ("rigid", "kinematic")
        assert softness < 2e-3 if rigid else 0.5 < softness < 1.5
    assert bool(told[1].hysteresis) == (lossy and hysteresis)
    if level == "native" and friction:
        # Coulomb and bending in one constant, as the rotor's friction loss is
        model, rotor = whole.model, whole.transmissions[0].attached.rotor
        loss = model.dof_frictionloss[model.joint(rotor).dofadr[0]]
        for load in (0.0, 50.0):
            slip = told[0].friction.yield_torque(100.0, load / told[0].ratio)
            assert slip == pytest.approx(loss, rel=1e-12)


def test_a_plan_knows_that_a_drive_has_no_torsion():
    """At rigid and kinematic the motor stands where the gear alone puts it."""
    for level in ("rigid", "kinematic"):
        task = task_of(assemble(scene_of(level, True)))
        plan, joints = flexible_plan(task), task.joints
        for j, drive in enumerate(joints.drives):
            error = error_of_motor(drive, plan.angle[:, j])
            link = plan.angle[:, j] / drive.ratio + error
            np.testing.assert_allclose(link, task.position[:, j], atol=1e-12)
        rigid = rigid_plan(task)
        if level == "rigid":
            np.testing.assert_allclose(plan.torque, rigid.torque, atol=1e-6)
