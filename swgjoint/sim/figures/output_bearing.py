r"""Tilt, load and life of the output bearings of a run, with keys of the JSON output.

The tilting moment is that of the elastic bearing, tilt stiffness times tilt. The force
on the bearing follows from the motion of everything that it carries,

.. math:: F = m (\ddot r_c - g) - F_\text{tool}

with the mass m and the centre of mass r_c of the link and all bodies beyond it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from swgjoint.gear.bearing.output_bearing import EXPONENT
from swgjoint.sim.actuators import disturbance_at
from swgjoint.sim.scene.feature_sections import ToolForce
from swgjoint.typing import Array
from swgjoint.units import arcmin, hour, rpm

if TYPE_CHECKING:
    from swgjoint.sim.life.loads import TaskLoads
    from swgjoint.sim.run import Run

SLACK = 1.01
"""Tolerance factor on the permissible moment, which catalogues state with two or three
digits [-]."""


def tilting_moment(run: Run, joint: str) -> Array:
    """Tilting moment on the output bearing of a joint [N·m]. Shape (n,).

    Args:
        run: The run.
        joint: Name of a joint with an output bearing.
    """
    k = 2 * list(run.assembly.bearings).index(joint)
    tilt = np.hypot(run.tilt[:, k], run.tilt[:, k + 1])
    return np.asarray(run.assembly.bearings[joint].tilt_stiffness * tilt)


def bearing_loads(run: Run) -> dict[str, Array]:
    """Radial force [N], axial force [N] and moment [N·m] on every output bearing.

    Returns:
        Loads by joint. Shapes (n, 3); magnitudes.
    """
    assembly, model = run.assembly, run.assembly.model
    if not assembly.bearings:
        return {}
    data = mujoco.MjData(model)
    bodies = [int(model.joint(name).bodyid[0]) for name in assembly.bearings]
    hinges = [int(model.joint(name).id) for name in assembly.bearings]
    centre, axis = np.empty((2, run.time.size, len(bodies), 3))
    flexible = assembly.motor_position >= 0
    for k in range(run.time.size):
        data.qpos[assembly.link_position] = run.position[k]
        data.qpos[assembly.motor_position[flexible]] = run.motor_position[k, flexible]
        data.qpos[assembly.tilt_position] = run.tilt[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        centre[k], axis[k] = data.subtree_com[bodies], data.xaxis[hinges]
    acceleration = np.gradient(np.gradient(centre, run.time, axis=0), run.time, axis=0)
    force = model.body_subtreemass[bodies][:, None] * (acceleration - model.opt.gravity)
    beyond = [_carries_tool(run, body) for body in bodies]
    for disturbance in assembly.disturbances:
        if isinstance(disturbance, ToolForce):
            tool = np.outer(disturbance_at(disturbance, run.time), disturbance.force_N)
            force[:, beyond] -= tool[:, None]
    along = np.abs(np.sum(force * axis, axis=2))
    across = np.sqrt(np.maximum(np.sum(force**2, axis=2) - along**2, 0.0))
    return {
        joint: np.column_stack([across[:, k], along[:, k], tilting_moment(run, joint)])
        for k, joint in enumerate(assembly.bearings)
    }


def _carries_tool(run: Run, body: int) -> bool:
    """Whether the tool site is on a body or beyond it."""
    model = run.assembly.model
    site = mujoco.mj_name2id(
        model, mujoco.mjtObj.mjOBJ_SITE, run.assembly.scene.tool_site
    )
    if site < 0:
        return False
    at = int(model.site_bodyid[site])
    while at not in (0, body):
        at = int(model.body_parentid[at])
    return at == body


def bearing_figures(run: Run, j: int) -> dict[str, Any]:
    """Tilt, use of ratings and life of the output bearing of one joint.

    Peak moment, means and life are those of the duty cycle or, without one, of the
    motion of the run repeated without end.

    Args:
        run: The run.
        j: Index of a joint with an output bearing.
    """
    joint, cycle = run.joints[j], run.repeated
    bearing = run.assembly.bearings[joint]
    peak = max(
        float(task.bearings[joint][:, 2].max()) for task in cycle if not task.rest
    )
    limit = bearing.permissible_moment
    means, speed = _mean_loads(cycle, joint, j)
    life = bearing.life(*means, speed)
    tilt = tilting_moment(run, joint)[run.steady] / bearing.tilt_stiffness / arcmin
    missing = None
    if life is None:
        missing = "dynamic_rating_N and pitch_diameter_mm are not stated"
    elif not np.isfinite(life):
        missing = "the joint does not turn"
    return {
        "tilt_arcmin": {
            "mean": float(tilt.mean()),
            "rms": float(np.sqrt(np.mean(tilt**2))),
            "pp": float(np.ptp(tilt)),
        },
        "tilt_stiffness_Nm_arcmin": bearing.tilt_stiffness * arcmin,
        "peak_moment_Nm": peak,
        "permissible_moment_Nm": limit,
        "within": None if limit is None else bool(peak <= SLACK * limit),
        "mean_radial_N": means[0],
        "mean_axial_N": means[1],
        "mean_moment_Nm": means[2],
        "mean_speed_rpm": speed / rpm,
        "L10_h": None if missing or life is None else life / hour,
        "source": bearing.source,
        "missing": missing,
    }


def _mean_loads(
    cycle: Sequence[TaskLoads], joint: str, j: int
) -> tuple[tuple[float, float, float], float]:
    """Mean radial force, axial force and moment, and mean output speed of a cycle."""
    weighted, turned, duration = np.zeros(3), 0.0, 0.0
    for task in cycle:
        share = task.times * task.duration
        duration += share
        if not task.rest:
            speed = np.abs(task.speed[:, j])
            power = task.bearings[joint] ** EXPONENT
            weighted += share * np.mean(speed[:, None] * power, axis=0)
            turned += share * float(speed.mean())
    if not turned:
        return (0.0, 0.0, 0.0), 0.0
    radial, axial, moment = ((weighted / turned) ** (1.0 / EXPONENT)).tolist()
    return (radial, axial, moment), turned / duration
