"""Steps that a joint's integration cannot take are cut into equal parts."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from messages import names, naming

from swgjoint import memory
from swgjoint.errors import ComputationError, InputError
from swgjoint.joint.step_damping import compensation
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.assembly import assemble
from swgjoint.sim.motion.trajectory import sweep
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

STIFF = DriveMap.linear(1e7, teeth_flexspline=120, teeth_circular_spline=122)


def erring(stiffness, error=2e-4, order=4):
    """A spring with one harmonic of kinematic error."""
    linear = DriveMap.linear(
        stiffness,
        teeth_flexspline=120,
        teeth_circular_spline=122,
        rated_torque=stiffness * 2e-3,
    )
    return replace(
        linear,
        orders=np.array([[0, 0], [order, 0]]),
        potential=np.concatenate([linear.potential, 0 * linear.potential]),
        end_stiffness=np.concatenate([linear.end_stiffness, 0 * linear.end_stiffness]),
        kinematic_error=np.array([[0.0, 0.0], [error, 0.0]]),
    )


UR5E = {
    "defaults.drive": "erring",
    "defaults.level": "kinematic",
    # a rotor so light that its position in the error's waves snaps within a step
    "joints.wrist_3_joint.level": "full",
    "joints.wrist_3_joint.drive": "light",
    "joints.wrist_3_joint.rotor_inertia_kgm2": 1e-7,
    "trajectory.hold_s": 0.0,
    "trajectory.ramp_s": 0.15,
    "trajectory.settle_s": 0.0,
    # slow enough for the error's order at every step used
    "trajectory.end_deg": {
        "shoulder_pan_joint": -20.0,
        "shoulder_lift_joint": -110.0,
        "elbow_joint": 97.0,
        "wrist_1_joint": -70.0,
        "wrist_2_joint": -90.0,
        "wrist_3_joint": 2.0,
    },
    "simulation.duration_s": 0.6,
}


def run_ur5e(changes=None, **simulation):
    keys = {f"simulation.{key}": value for key, value in simulation.items()}
    keys |= changes or {}
    drives = {"erring": erring(2e4), "light": erring(2e5)}
    return run_scene("ur5e-sweep", overrides=UR5E | keys, drives=drives)


@pytest.mark.parametrize(
    "changes",
    [
        {"controller": {"kind": "pid", "natural_frequency_Hz": 8.0}},
        {
            "controller": {"kind": "pd", "control_period_s": 4e-3},
            "sensors": {"motor": {"delay_s": 2e-3}},
            "simulation.duration_s": 0.3,
            "trajectory.ramp_s": 0.1,
        },
    ],
    ids=["pid", "sampled"],
)
def test_controllers_go_on_with_sub_steps(changes):
    """Periods, delays and integrals count time, not steps: a finer run is the same."""
    run = run_ur5e(changes, step_s=2e-3)
    n = run.assembly.sub_steps
    assert n >= 2
    fine = run_ur5e(changes, step_s=2e-3 / n)
    np.testing.assert_allclose(run.time, fine.time[::n], rtol=1e-12)
    off = np.abs(run.position - fine.position[::n]).max()
    moved = np.abs(run.position - run.position[0]).max()
    # feed-forward lies on straight lines within a step
    assert off < 1e-5 * moved
    if "sensors" in changes:
        held = run.motor_torque[1:151].reshape(-1, 2, len(run.joints))
        np.testing.assert_array_equal(held[:, 0], held[:, 1])


def test_sub_steps_are_the_steps_of_a_finer_run():
    """With n sub-steps every sample is the n-th of a run at a step of h/n.

    Also at level kinematic, whose torque has the last acceleration of the engine.
    """
    run = run_ur5e(step_s=2e-3)
    n = run.assembly.sub_steps
    assert 2 <= n <= 24
    fine = run_ur5e(step_s=2e-3 / n)
    assert fine.assembly.sub_steps == 1
    assert run.assembly.step == pytest.approx(fine.assembly.step)
    np.testing.assert_allclose(run.time, fine.time[::n], rtol=1e-12)
    # the torques of the rigid arm are on straight lines within a step
    for signal, atol in (
        ("reference", 1e-12),
        ("position", 1e-7),
        ("motor_position", 1e-5),
        ("torsion", 1e-7),
        ("output_torque", 2e-3),
        ("tool_position", 1e-7),
    ):
        np.testing.assert_allclose(
            getattr(run, signal), getattr(fine, signal)[::n], atol=atol, err_msg=signal
        )
    window = run.time[run.steady]
    np.testing.assert_allclose(window[[0, -1]], fine.time[fine.steady][[0, -1]])


def test_harmonics_follow_from_the_step_of_the_scene(bench):
    """What the scene's step cannot carry stays left out, though the sub-step could."""
    drive = erring(2e4)
    keys = {"trajectory__speed_deg_s__joint": 200.0}  # 4 * 209 rad/s * 1 ms = 0.84
    whole = bench(drive, **keys)
    assert [left.order for left in whole.assembly.transmissions[0].attached.unresolved]
    timing = {"integrator": "RK4", "duration_s": 0.5, "step_s": 1e-3}
    cut = bench(erring(3e8), simulation=timing, load__joint__torque_Nm=1.0, **keys)
    assert cut.assembly.sub_steps > 1
    assert [left.order for left in cut.assembly.transmissions[0].attached.unresolved]
    # the same at a step of that length: now the order is in
    timing["step_s"] = 1e-3 / cut.assembly.sub_steps
    fine = bench(erring(3e8), simulation=timing, load__joint__torque_Nm=1.0, **keys)
    assert not fine.assembly.transmissions[0].attached.unresolved


def test_a_run_says_into_how_many_parts_its_steps_are_cut(bench):
    """Metrics, contents and text name the number and the joint's bound."""
    from swgjoint.cli.run import report

    keys = {"simulation": {"integrator": "RK4", "step_s": 0.005, "duration_s": 0.5}}
    run = bench(STIFF, **keys)
    n = run.assembly.sub_steps
    assert n > 1
    assert run.metrics()["sub_steps"] == run.contains["sub_steps"] == n
    assert run.contains["step_s"] == 0.005
    assert run.time.size == 101
    [(joint, what)] = run.contains["sub_stepped_for"].items()
    assert joint == "joint" and "fastest torsion frequency under RK4" in what
    result = {"scene": "s", **run.metrics(), "contains": run.contains, "files": []}
    assert f"every step is divided into {n} sub-steps" in report(result)
    json.dumps(result)
    inside = bench(STIFF)
    assert inside.contains["sub_steps"] == 1
    assert inside.contains["sub_stepped_for"] == {}
    result = {"scene": "s", **inside.metrics(), "contains": inside.contains}
    assert "sub-step" not in report(result | {"files": []})


def test_contacts_and_limits_cut_the_steps_of_a_light_link():
    """The bare flange of the UR5e is cut where its motion runs into a joint limit."""
    keys = {"simulation.step_s": 2e-3, "simulation.duration_s": 2.0}
    free = assemble(Scene.load_file("ur5e-catalogue", keys))
    assert free.sub_steps == 1
    keys["trajectory.start_deg.wrist_3_joint"] = 300.0
    keys["trajectory.end_deg.wrist_3_joint"] = 360.0
    stopped = assemble(Scene.load_file("ur5e-catalogue", keys))
    assert stopped.sub_steps > 1
    assert list(stopped.outside) == ["wrist_3_joint"]
    assert "with contacts" in stopped.outside["wrist_3_joint"]


def test_a_rotor_that_outruns_its_command_is_named(bench):
    """Harmonics are kept by the commanded speed; the metrics have the real one."""
    drive = erring(2e4)
    slow = bench(drive).metrics()
    joint = slow["joints"]["joint"]
    # order 4 at 60 times 3 deg/s, plus what the kinematic error adds
    assert joint["phase_step_rad"] == pytest.approx(1e-3 * 4 * np.pi, rel=0.2)
    assert slow["reasons"] == []
    # a free motor under load: the loop gives almost nothing
    keys = {"stiffness_Nm_rad": 1e-6, "damping_Nms_rad": 0.0, "feedforward": "none"}
    fast = bench(drive, controller=keys, load__joint__torque_Nm=20.0).metrics()
    assert fast["joints"]["joint"]["phase_step_rad"] > 0.75
    assert any(
        names(line, "joint", "rotor", "0.75 rad", "simulation.step_s")
        for line in fast["reasons"]
    )


@pytest.mark.parametrize("level", ["rigid", "linear"])
def test_levels_without_harmonics_outrun_nothing(bench, level):
    """The orders of a map that a level leaves out have no phase in its run."""
    run = bench(erring(2e4), simulation__step_s=5e-3, joints__joint__level=level)
    joint = run.metrics()["joints"]["joint"]
    assert joint["level"] == level
    assert joint["phase_step_rad"] == 0.0


def test_a_scene_may_refuse_sub_steps(bench):
    """With max_sub_steps = 1 the bound is named with the step that would do."""
    keys = {"integrator": "RK4", "step_s": 0.005, "duration_s": 1.0}
    with pytest.raises(
        ComputationError, match=naming("'joint'", "5 ms", "30.7 > 2", "0.32 ms")
    ):
        bench(STIFF, simulation=keys | {"max_sub_steps": 1})


def test_a_run_of_too_many_sub_steps_is_refused(bench, monkeypatch):
    """Sub-steps count in the memory of a run."""
    monkeypatch.setattr(memory, "available_memory", lambda: 5e9)
    keys = {"integrator": "RK4", "step_s": 0.005, "duration_s": 9_900.0}
    with pytest.raises(
        ComputationError,
        match=naming("simulation.duration_s", "9900 s", "22 sub-steps", "GB"),
    ):
        bench(STIFF, simulation=keys)
    with pytest.raises(
        InputError, match=naming("simulation.max_sub_steps", "0", ">= 1", "<= 1000")
    ):
        Scene.load_file("bench", {"simulation.max_sub_steps": 0})


def test_every_nth_sample_of_a_motion_is_the_motion_at_that_step():
    """Times, states and the steady part agree with a motion on the coarse grid."""
    keys = dict(
        start=np.zeros(1),
        end=np.ones(1),
        duration=1.0,
        step=0.003,
        hold=0.1,
        ramp=0.2,
        settle=0.05,
    )
    coarse, fine = sweep(**keys), sweep(**keys, sub_steps=7)
    assert fine.time.size == 7 * (coarse.time.size - 1) + 1
    kept = fine.every(7)
    assert kept.steady == coarse.steady
    for name in ("time", "position", "velocity", "acceleration"):
        np.testing.assert_allclose(
            getattr(kept, name), getattr(coarse, name), atol=1e-12
        )


def test_native_springs_are_compensated_for_the_step_that_is_run():
    """The negative damper of a native joint belongs to the sub-steps of the others.

    That of a longer step would give energy.
    """
    scene = Scene.load_file("ur5e-catalogue").with_changes(
        {
            "simulation.step_s": 0.005,
            "joints.elbow_joint.drive": "erring",
            "joints.wrist_3_joint.level": "native",
        }
    )
    whole = assemble(scene, drives={"erring": erring(1e5, error=1e-3)})
    assert whole.sub_steps > 1
    (native,) = (t.attached for t in whole.transmissions if t.level == "native")
    assert native.compensated_at == whole.step == 0.005 / whole.sub_steps
    tendon = whole.model.tendon(native.tendon).id
    left = native.damping - whole.model.tendon_damping[tendon]
    assert left == pytest.approx(compensation(native, whole.step))
