"""Arms with catalogue drives in all joints: in free fall, and under control.

A falling arm without damping, control or joint limits conserves the sum of kinetic,
torsion and gravity energy. Under control, the arm runs its bundled scene. The error is
the largest difference of a link angle from RK4 at a small step. It includes the half
engine step by which the positions of the discrete integrator lead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from swgjoint.bench.stability.joint import (
    Course,
    torsion_energy,
    with_kinematic_error,
)
from swgjoint.bench.stability.rows import DEFAULT, StabilityRow, outcome_of
from swgjoint.errors import ComputationError
from swgjoint.joint.attach import attach
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.region import MAX_SUB_STEPS, check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm, compile_spec
from swgjoint.sim.scene.scene import Scene
from swgjoint.typing import Array
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene

SCENES = ("ur5e-catalogue", "iiwa14-sweep", "kinova-sweep", "panda-sweep")
"""Bundled scenes of the arms."""
STEPS = (5e-4, 1e-3, 2e-3)
"""Time steps [s]."""
FALL = 2.0
"""Duration of a fall [s]."""
FALL_SPEED = 100.0
"""Rotor speed for which the stability region is checked in a fall [rad/s]; the rotors
reach 2000 rad/s."""
SAMPLES = 200
"""Number of energy samples along a fall."""
EXACT_STEP = 1e-4
"""Time step of the RK4 reference [s]."""


@dataclass(frozen=True, kw_only=True)
class ArmTask:
    """One arm and its time steps."""

    scene: str
    """Name of a bundled scene."""
    steps: tuple[float, ...] = STEPS
    """Time steps [s]."""


def run_arm(task: ArmTask) -> list[StabilityRow]:
    """Run the fall and the controlled motion of one arm at all time steps."""
    scene = Scene.load_file(task.scene)
    names = {
        scene.joint_settings(joint).drive or "" for joint in RigidArm(scene.arm).joints
    }
    drives = {
        name: with_kinematic_error(
            DriveMap.from_catalogue(name, kinematic_error_arcmin=0.0)
        )
        for name in names
    }
    exact = run_scene(
        scene,
        overrides={"simulation.step_s": EXACT_STEP, "simulation.integrator": "RK4"},
        drives=drives,
    )
    rows = []
    for step in task.steps:
        rows.append(_fall(task, scene, drives, step))
        overrides = {"simulation.step_s": step}
        try:
            run = run_scene(scene, overrides=overrides, drives=drives)
        except ComputationError as exc:
            refused = "region" in str(exc)
            rows.append(
                StabilityRow(
                    case=task.scene,
                    group="sweep",
                    scheme=DEFAULT,
                    step_s=step,
                    outcome="refused" if refused else "diverged",
                    reason=str(exc),
                )
            )
            continue
        every = round(step / EXACT_STEP)
        off = run.position - exact.position[::every][: len(run.position)]
        parts = run.assembly.sub_steps
        rows.append(
            StabilityRow(
                case=task.scene,
                group="sweep",
                scheme=DEFAULT,
                step_s=step,
                outcome="sub_stepped" if parts > 1 else "ok",
                sub_steps=parts,
                error=float(np.abs(off).max() / arcmin),
                physical_damping_ratio=max(d.damping_ratio for d in drives.values()),
                phase_step=step
                * max(t.attached.natural_frequency for t in run.assembly.transmissions),
                reason="; ".join(dict.fromkeys(run.assembly.outside.values())) or None,
            )
        )
    return rows


def _fall(
    task: ArmTask, scene: Scene, drives: dict[str, DriveMap], step: float
) -> StabilityRow:
    """Row of the arm that is released from the first pose of its scene."""
    arm = RigidArm(scene.arm)
    spec = arm.spec()
    spec.option.timestep = step
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    attached, regions = [], []
    for name in arm.joints:
        section = scene.joint_settings(name)
        got = attach(
            spec,
            joint=name,
            drive=drives[section.drive or ""],
            rotor_inertia=section.rotor_inertia_kgm2 or 0.0,
            damping_ratio=0.0,
            friction=False,
        )
        attached.append(got)
        regions.append(check_region(got, timestep=step, max_input_speed=FALL_SPEED))
    base = StabilityRow(
        case=task.scene,
        group="fall",
        scheme=DEFAULT,
        step_s=step,
        outcome="refused",
        phase_step=step * max(a.natural_frequency for a in attached),
        reason="; ".join(dict.fromkeys(r.exceeded for r in regions if not r.ok))
        or None,
    )
    try:
        parts = max(region.require(MAX_SUB_STEPS) for region in regions)
    except ComputationError as exc:
        return replace(base, reason=str(exc))
    spec.option.timestep = step / parts
    model = compile_spec(spec, where=f"arm {scene.arm!r}")
    start = scene.trajectory.start_deg
    pose = np.radians([start.get(name, 0.0) for name in arm.joints])
    course = _let_go(model, attached, pose, round(FALL / step), parts)
    return replace(
        base,
        outcome=outcome_of(course),
        sub_steps=parts,
        largest_gain=course.gain,
        energy_balance=course.balance,
    )


def _let_go(
    model: mujoco.MjModel,
    attached: list[JointDrive],
    pose: Array,
    steps: int,
    parts: int,
) -> Course:
    """Let an arm fall from a pose.

    Args:
        model: Compiled arm at the sub-step.
        attached: Drives in the order of the joints.
        pose: Initial output angles [rad].
        steps: Number of time steps.
        parts: Number of parts of a time step.

    Returns:
        Course whose energy includes gravity.
    """
    h = float(model.opt.timestep)
    data, weighed = mujoco.MjData(model), mujoco.MjData(model)
    rotor = [int(model.joint(a.rotor).qposadr[0]) for a in attached]
    link = [int(model.joint(a.joint).qposadr[0]) for a in attached]
    for a, r, j, angle in zip(attached, rotor, link, pose, strict=True):
        theta = a.ratio * angle
        error = a.drive.error_at(a.drive.phases(theta, angle))[0]
        data.qpos[r], data.qpos[j] = theta, angle + float(error)
    full = np.zeros((model.nv, model.nv))
    position, velocity = np.empty((2, SAMPLES + 1, model.nv))
    kinetic, height = np.empty((2, SAMPLES + 1))
    for k in range(SAMPLES + 1):
        if k:
            mujoco.mj_step(model, data, steps // SAMPLES * parts)
        # the midpoint rule refers to positions half a step earlier
        weighed.qpos[:] = position[k] = data.qpos - 0.5 * h * data.qvel
        weighed.qvel[:] = velocity[k] = data.qvel
        mujoco.mj_fwdPosition(model, weighed)
        mujoco.mj_fullM(model, weighed, full)
        kinetic[k] = 0.5 * float(weighed.qvel @ full @ weighed.qvel)
        height[k] = float(model.body_mass @ weighed.xipos[:, 2])
    stored = kinetic + torsion_energy(attached, position[:, rotor], position[:, link])
    energy = stored - float(model.opt.gravity[2]) * height
    bad = any(w.number for w in data.warning) or not np.isfinite(energy).all()
    return Course(
        time=np.asarray(np.arange(SAMPLES + 1) * (steps // SAMPLES * parts * h), float),
        position=position,
        velocity=velocity,
        energy=energy,
        scale=float(stored.max()),  # at rest the arm has little energy
        diverged=bool(bad),
        sub_steps=parts,
    )
