"""Slow default motions for an arm that has no scene file."""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.typing import Array
from swgjoint.units import deg

SWEEP_TIMING = {"hold_s": 0.25, "ramp_s": 0.5, "settle_s": 0.25}
"""Times of the sweep."""
DURATION = 4.0
"""Duration of most motions [s]."""
STEP = 1.0
"""Step height of every joint, and amplitude of the chirp [deg]."""
AXES = ((0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
"""Candidate directions of a line in the world frame; the last four also of a circle."""
TOOL_MOTIONS = ("line", "circle", "iso9283")
"""Kinds of trajectory that move the tool along a path."""
PLANES = ("+x", "-x", "+y", "-y")
"""Candidate planes of the ISO 9283 cycle."""


def tables_of(
    kind: str, arm: RigidArm, start: Array, end: Array
) -> tuple[list[dict[str, Any]], float]:
    """Candidate tables ``[trajectory]`` for one kind of motion, and the duration.

    The caller uses the first table that the arm can follow. Motions of the tool have
    candidates in several directions, because an arm near the limit of its reach can
    move in some directions only. For an unknown kind, or one that needs a file, the
    table is incomplete, and validation of the scene reports what is missing.

    Args:
        kind: Kind of the trajectory.
        arm: The arm.
        start: Joint angles at the start [rad]. Shape (n_joints,).
        end: Joint angles at the end of a collision-free sweep [rad]. Shape (n_joints,).

    Returns:
        The tables, best first, and the duration of the run [s].
    """

    def degrees(values: Array) -> dict[str, float]:
        return dict(zip(arm.joints, (values / deg).tolist(), strict=True))

    way = end - start
    base: dict[str, Any] = {"kind": kind, "start_deg": degrees(start)}
    if kind == "sweep":
        return [base | SWEEP_TIMING | {"end_deg": degrees(end)}], DURATION
    if kind == "constant_speed":
        return [base | {"speed_deg_s": degrees(way / DURATION)}], DURATION
    if kind == "speed_steps":
        j = int(np.flatnonzero(way)[0])
        speed = float(2.0 * way[j] / DURATION / deg)
        return [base | {"joint": arm.joints[j], "speeds_deg_s": [speed, -speed]}], 4.0
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
