"""Gentle default motions for an arm without a scene."""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.typing import Array
from swgjoint.units import deg

SWEEP_TIMING = {"hold_s": 0.25, "ramp_s": 0.5, "settle_s": 0.25}
DURATION = 4.0
"""Of most motions [s]."""
STEP = 1.0
"""Of every joint, and amplitude of the chirp [deg]."""
AXES = ((0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
TOOL_MOTIONS = ("line", "circle", "iso9283")
PLANES = ("+x", "-x", "+y", "-y")


def tables_of(
    kind: str, arm: RigidArm, start: Array, end: Array
) -> tuple[list[dict[str, Any]], float]:
    """Tables ``[trajectory]`` of one kind, the first that works is meant, and a time.

    Motions of the tool are tried in several directions: an arm that is near the end of
    its reach can go one way only. A kind that does not exist, or that needs a file,
    gets the table with which the scene says so.

    Args:
        kind: Kind of the trajectory.
        arm: The arm.
        start: [rad]. Shape (n_joints,).
        end: Where a sweep without collision ends [rad]. Shape (n_joints,).

    Returns:
        The tables, and the duration of the run [s].
    """

    def degrees(values: Array) -> dict[str, float]:
        return dict(zip(arm.joints, (values / deg).tolist(), strict=True))

    way = end - start
    base: dict[str, Any] = {"kind": kind, "start_deg": degrees(start)}
    if kind == "sweep":
        return [base | SWEEP_TIMING | {"end_deg": degrees(end)}], DURATION
    if kind == "constant_speed":
        return [base | {"speed_deg_s": degrees(way / DURATION)}], DURATION
    if kind == "step":
        return [base | {"step_deg": degrees(np.sign(way) * STEP * deg)}], 2.0
    if kind == "trapezoid":
        limits = {"max_speed_deg_s": 30.0, "max_acceleration_deg_s2": 120.0}
        return [base | limits | {"end_deg": degrees(end)}], 3.0
    if kind == "chirp":
        joint = arm.joints[int(np.flatnonzero(way)[0])]
        swing = {"joint": joint, "amplitude_deg": STEP, "from_Hz": 0.5, "to_Hz": 5.0}
        return [base | swing], DURATION
    if kind == "line":
        ways = [[50.0 * x for x in axis] for axis in AXES]
        return [base | {"displacement_mm": way} for way in ways], DURATION
    if kind == "circle":
        sides = [[float(x) for x in axis] for axis in AXES[2:]]
        return [base | {"radius_mm": 50.0, "towards": side} for side in sides], DURATION
    if kind == "iso9283":
        cycles = 3
        return [
            base | {"edge_mm": edge, "plane": plane, "cycles": cycles}
            for edge in (250.0, 100.0)
            for plane in PLANES
        ], 0.2 + 5.0 * cycles
    return [base], DURATION
