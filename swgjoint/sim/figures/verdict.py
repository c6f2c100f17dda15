"""Verdict on the figures of a run, with its reasons.

A run is ``NOT VALID`` if its model does not apply:

- Bodies collide, so that torque ripple and tool error have no reference.
- A torque leaves the range of the map of its drive.
- Teeth would skip.
- A rotor turns so fast that the step does not resolve the kept orders.
- At the torques of the run, the ripple of a map differs too much from finite-element
  results that were not used in the fit of the map.
- The energy balance does not close.
- The run of a task of the duty cycle is not valid.

A drive that exceeds its ratings is a fault of the design, not of the figures, and
causes a warning only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from swgjoint.maps.sheet.map_validity import LIMIT, percent
from swgjoint.maps.sheet.validity_marks import joint_doubt
from swgjoint.units import mm

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

VALID, NOT_VALID = "VALID", "NOT VALID"
PHASE_STEP = 0.5
"""Largest phase advance per step of a resolved order [rad]."""
FAST = 1.5
"""Phase advance per step, relative to :data:`PHASE_STEP`, above which a run is not
valid."""
POSES = 400
"""Largest number of recorded states that are checked for collisions."""
ENERGY_SHARE, ENERGY_FLOOR = 0.1, 1e-3
"""Largest accepted balance error: the first value is relative to the sum of work,
losses and stored energy; the second, which applies if that sum is small, is relative to
the sum of the rated torques times 1 rad. Bundled scenes reach 0.4 % of the former."""
NEXT = "; next: "
"""Text in a reason before its remedy, which terminals show in a line of its own."""
MAPPED = ("native", "full")
"""Levels at which the torque follows the map."""


@dataclass(frozen=True, kw_only=True)
class Collision:
    """Two bodies that touch during a run."""

    bodies: tuple[str, str]
    """Names of the bodies."""
    time: float
    """Time of the first checked state with the contact [s]."""
    depth: float
    """Largest penetration [m]."""

    def to_json(self) -> dict[str, Any]:
        """Values under the keys of the JSON output."""
        return {
            "bodies": list(self.bodies),
            "time_s": self.time,
            "depth_mm": self.depth / mm,
        }


def collisions(run: Run) -> list[Collision]:
    """Pairs of bodies that touch in a run, the deepest penetration first.

    Up to :data:`POSES` recorded states are checked.
    """
    assembly, model = run.assembly, run.assembly.model
    if not (model.geom_contype.any() and model.geom_conaffinity.any()):
        return []
    data = mujoco.MjData(model)
    flexible = assembly.motor_position >= 0
    contacts: dict[tuple[int, int], tuple[float, float]] = {}
    count = min(POSES, run.time.size)
    for k in np.linspace(0, run.time.size - 1, count).astype(int):
        data.qpos[assembly.link_position] = run.position[k]
        data.qpos[assembly.motor_position[flexible]] = run.motor_position[k, flexible]
        data.qpos[assembly.tilt_position] = run.tilt[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        contact = data.contact
        for geoms, depth in zip(contact.geom, -contact.dist, strict=True):
            if depth <= 0.0 or (geoms < 0).any():
                continue
            first, second = sorted(int(b) for b in model.geom_bodyid[geoms])
            time, most = contacts.get((first, second), (float(run.time[k]), 0.0))
            contacts[first, second] = (time, max(most, float(depth)))
    return sorted(
        (
            Collision(
                bodies=(model.body(first).name, model.body(second).name),
                time=time,
                depth=depth,
            )
            for (first, second), (time, depth) in contacts.items()
        ),
        key=lambda one: -one.depth,
    )


def judge_run(
    run: Run, joints: Mapping[str, Any], energy: Mapping[str, float]
) -> dict[str, Any]:
    """Verdict on a run under the keys of the JSON output.

    Args:
        run: The run.
        joints: Figures of its joints, see :meth:`swgjoint.sim.run.Run.metrics`.
        energy: Its energy balance [J], see :mod:`swgjoint.sim.figures.energy`.

    Returns:
        ``verdict``, ``reasons`` and ``collisions``.
    """
    touching = collisions(run)
    reasons = []
    if touching and not run.assembly.scene.metrics.contacts_expected:
        reasons.append(_collision_reason(touching))
    for name, joint in joints.items():
        reasons += joint_reasons(name, joint)
    rated = sum(joint["ratings"]["rated_Nm"] for joint in joints.values())
    reasons += energy_reasons(energy, rated)
    reasons += [reason for task in run.cycle for reason in task.reasons]
    return {
        "verdict": NOT_VALID if reasons else VALID,
        "reasons": reasons,
        "collisions": [one.to_json() for one in touching],
    }


def joint_reasons(name: str, joint: Mapping[str, Any]) -> list[str]:
    """Reasons why the figures of one joint are not valid, one line each.

    Args:
        name: Name of the joint.
        joint: Its figures, see :func:`swgjoint.sim.figures.metrics.joint_metrics`.
    """
    lines = []
    ratings = joint["ratings"]
    if not ratings["within_map"] and joint["level"] in MAPPED:
        low, high = ratings["map_range_Nm"]
        lines.append(
            f"{name}: torque of up to {ratings['peak_Nm']:.4g} N·m leaves the range of"
            f" the map of its drive ({low:.4g} to {high:.4g} N·m); the run extrapolates"
            " the map linearly"
        )
    if skips := ratings["ratcheting"]:
        lines.append(
            f"{name}: teeth would skip at {skips['time_s']:.4g} s with"
            f" {skips['torque_Nm']:.4g} N·m; ratcheting torque"
            f" {ratings['ratcheting_Nm']:.4g} N·m"
        )
    if joint["ripple_valid"] is False and (doubt := joint_doubt(joint)):
        seen = _range(joint["map_difference"]["torque_range_Nm"])
        lines.append(
            f"{name}: torque ripple not valid at {seen}: the map of {joint['drive']}"
            f" {doubt}; accepted: {percent(LIMIT)}{NEXT}{_remedy(name, joint)}"
        )
    if joint["phase_step_rad"] > FAST * PHASE_STEP:
        lines.append(
            f"{name}: its rotor turned faster than commanded, so that the phase of the"
            f" highest order of its drive advanced by {joint['phase_step_rad']:.2g} rad"
            f" per step; accepted: up to {FAST * PHASE_STEP:g} rad; use a smaller"
            " simulation.step_s"
        )
    return lines


def _remedy(name: str, joint: Mapping[str, Any]) -> str:
    """What to do about a map that differs too much at the torques of a run."""
    if joint["source"] == "ring":
        first = (
            "a 2D map, which also has the teeth (one to three CPU minutes; for a"
            f" design: --set joints.{name}.model=2d)"
        )
    else:
        # without --model, meshing computes a design with a cup in 3D
        model = f" --model {joint['source']}" if joint["source"] in ("2d", "3d") else ""
        first = (
            f"'swgjoint meshing DESIGN{model} --torque NM' computes the ripple at one"
            " torque"
        )
    start = joint["map_difference"]["valid_from_Nm"]
    if start is None:
        return f"{first}; or --set joints.{name}.level=linear, which has no ripple"
    return f"{first}; or a load of at least {start:.2g} N·m, where this map is valid"


def _range(torques: Sequence[float]) -> str:
    """Range of torques from the smallest to the largest."""
    low, high = torques
    return f"{low:.4g} to {high:.4g} N·m"


def energy_reasons(energy: Mapping[str, float], rated: float) -> list[str]:
    """One line if the balance error is too large for errors of integration and sums.

    Args:
        energy: Energy balance [J], see :func:`judge_run`.
        rated: Sum of the rated torques [N·m].
    """
    works = ("motor_work_J", "load_work_J", "dissipated_J")
    turnover = sum(abs(energy[key]) for key in works) + abs(energy["stored_J"])
    missing = energy["balance_error_J"]
    if abs(missing) <= max(ENERGY_SHARE * turnover, ENERGY_FLOOR * rated):
        return []
    return [
        f"the energy balance has an error of {missing:.3g} J, compared with"
        f" {turnover:.3g} J of work, losses and stored energy: a joint pushes against"
        " its stops, or the step is too long; use another motion or a smaller"
        " simulation.step_s"
    ]


def _collision_reason(touching: list[Collision]) -> str:
    """One line with the deepest collisions."""
    some = [
        f"{' and '.join(one.bodies)} ({one.depth / mm:.3g} mm deep, from"
        f" {one.time:.3g} s)"
        for one in touching[:3]
    ]
    more = f" and {len(touching) - 3} other pairs" if len(touching) > 3 else ""
    return (
        f"bodies collide: {', '.join(some)}{more}; use another start or travel, or"
        " metrics.contacts_expected = true if contact is part of the task"
    )
