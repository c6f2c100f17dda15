"""Run time of driven joints over number of joints, batch size and harmonics."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.joint.attach import attach_all
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.fitting import Fitting
from swgjoint.maps.drive_map import DriveMap

STEP = 1e-3
"""Time step [s]."""
DRIVE = "CSG-25-100"
"""Catalogue drive of all joints."""
HARMONICS = 4
"""Number of harmonics of the map in chains and batches."""
ARM = 6
"""Number of joints of each arm in a batch."""
ROTOR = 1e-4
"""Rotor inertia [kg·m²]."""
REPEATS = 5
"""Number of timed repetitions."""
SPEED = 1e-3
"""Speed of the links, slow enough for the time step to resolve all harmonics [rad/s].
"""


def map_with(harmonics: int) -> DriveMap:
    """Map of a catalogue drive with orders 1 to n, without hysteresis.

    Each order has a torque ripple of 2 %/n and a kinematic error.
    """
    base = DriveMap.from_catalogue(DRIVE, kinematic_error_arcmin=0.0)
    base = replace(base, hysteresis=())
    n = 1 + harmonics
    potential = np.zeros((n, *base.potential.shape[1:]))
    ends = np.zeros((n, *base.end_stiffness.shape[1:]))
    error = np.zeros((n, 2))
    potential[0], ends[0] = base.potential[0], base.end_stiffness[0]
    part = 0.02 / harmonics
    potential[1:], ends[1:] = part * base.potential[0], part * base.end_stiffness[0]
    error[1:, 0] = 1e-5 / np.arange(1, n) / harmonics
    orders = [(0, 0), *((k, 0) for k in range(1, n))]
    return replace(
        base,
        orders=np.array(orders),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=error,
    )


def chain_spec(
    joints: int, *, level: str = "full", harmonics: int = HARMONICS
) -> tuple[mujoco.MjSpec, list[JointDrive]]:
    """Chain of equal links with alternating axes and a drive in every joint.

    Args:
        joints: Number of joints.
        level: Level of the joints, see :func:`swgjoint.joint.attach.attach`.
        harmonics: Number of harmonics of the map.

    Returns:
        Specification without gravity, and the drives in the order of the joints.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.gravity = [0, 0, 0]
    body, drive = spec.worldbody, map_with(harmonics)
    for k in range(joints):
        body = body.add_body(name=f"link{k}", pos=[0, 0, 0.1])
        body.add_joint(name=f"j{k}", axis=[[0, 0, 1], [0, 1, 0]][k % 2])
        # without a position, a saved file would contain no inertia
        body.mass, body.inertia, body.ipos = 0.5, [0.05, 0.05, 0.05], [0, 0, 0]
        body.explicitinertial = True
    fitting = Fitting(drive=drive, level=level, rotor_inertia=ROTOR, friction=False)
    got = attach_all(spec, {f"j{k}": fitting for k in range(joints)})
    return spec, list(got.values())


def chain_model(
    joints: int, *, level: str = "full", harmonics: int = HARMONICS
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compiled chain with all links rotating slowly.

    Args:
        joints: Number of joints.
        level: Level of the joints, see :func:`swgjoint.joint.attach.attach`.
        harmonics: Number of harmonics of the map.
    """
    spec, drives = chain_spec(joints, level=level, harmonics=harmonics)
    model = spec.compile()
    data = mujoco.MjData(model)
    for one in drives:
        data.joint(one.joint).qvel = SPEED
        if one.rotor:
            data.joint(one.rotor).qvel = SPEED * one.ratio
    return model, data


def best(work: Callable[[], object], count: int) -> float:
    """CPU time of one unit of work: shortest of several calls after a warm-up [s].

    Args:
        work: Function to time.
        count: Number of units in one call.
    """
    work()
    took = []
    for _ in range(REPEATS):
        begin = time.process_time()
        work()
        took.append(time.process_time() - begin)
    return min(took) / count


def _step_seconds(model: mujoco.MjModel, start: mujoco.MjData, steps: int) -> float:
    """CPU time of one step [s]; every repetition continues the motion."""
    mujoco.mj_step(model, start, 50)

    def work() -> None:
        mujoco.mj_step(model, data, steps)

    data = copy.copy(start)
    took = best(work, steps)
    if not np.isfinite(data.qpos).all() or any(w.number for w in data.warning):
        raise ComputationError(
            f"the chain of {model.nv} degrees of freedom diverged at a step of"
            f" {1e3 * model.opt.timestep:g} ms"
        )
    return took


def chain(joints: float) -> dict[str, Any]:
    """CPU time of one step of a chain at level ``full``.

    ``against_rigid`` is the time of a rigid chain divided by this time.
    """
    n = int(joints)
    steps = max(20, 4000 // n**2)
    rigid = _step_seconds(*chain_model(n, level="rigid"), steps)
    full = _step_seconds(*chain_model(n), steps)
    return {
        "model": "full",
        "seconds": full,
        "steps_per_s": 1.0 / full,
        "against_rigid": rigid / full,
    }


def batch(arms: float) -> dict[str, Any]:
    """CPU time of one step of a whole batch, and step rates per arm.

    ``steps_per_s`` refers to CPU time, the rates for one and two threads to wall time.
    """
    from mujoco.batch import Batch

    n = int(arms)
    model, data = chain_model(ARM)
    steps = max(2, 2048 // n)
    out: dict[str, Any] = {"model": "full"}
    for threads in (1, 2):
        many = Batch(model, n, nthread=threads)
        many.qpos[:] = data.qpos
        many.qvel[:] = data.qvel

        begin = time.perf_counter()
        seconds = best(lambda many=many: many.step(nstep=steps), steps)  # type: ignore[misc]
        wall = (time.perf_counter() - begin) / ((REPEATS + 1) * steps)
        if threads == 1:
            out |= {"seconds": seconds, "steps_per_s": n / seconds}
        out[f"wall_steps_per_s_{threads}_threads"] = n / wall
    return out


def step_with_harmonics(count: float) -> dict[str, Any]:
    """CPU time of one step of a single joint at level ``full``."""
    seconds = _step_seconds(*chain_model(1, harmonics=int(count)), 2000)
    return {"model": "full", "seconds": seconds, "steps_per_s": 1.0 / seconds}


def evaluation(count: float) -> dict[str, Any]:
    """CPU time of one torque of a map, evaluated at 1000 states at once."""
    drive, rng = map_with(int(count)), np.random.default_rng(1)
    low, high = drive.torsion_knots[[0, -1]]
    torsion = rng.uniform(low, high, 1000)
    theta, psi = rng.uniform(0.0, 6.0, (2, 1000))
    seconds = best(lambda: drive.torque(torsion, theta, psi), 1000)
    return {"model": "map", "seconds": seconds}
