"""Motions that the tool makes: line, circle, and the pose cycle of ISO 9283."""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.sim.motion.inverse_kinematics import ToolKinematics, follow
from swgjoint.sim.motion.trajectory import Trajectory, smooth_ramp, window
from swgjoint.typing import Array

DIRECTIONS = {
    "+x": (1.0, 0.0),
    "-x": (-1.0, 0.0),
    "+y": (0.0, 1.0),
    "-y": (0.0, -1.0),
}
ORDER = (5, 4, 3, 2, 1)
"""Poses of one cycle in the order of the standard."""
POSE_SHARE = 0.8
"""Of the way from the centre of the cube to a corner: P2 to P5 lie a tenth of the
diagonal inside its ends."""


def line(
    time: Array,
    kinematics: ToolKinematics,
    *,
    start: Array,
    displacement: Array,
    cycles: int,
    hold: float,
    ramp: float,
) -> Trajectory:
    """Forth and back on a straight line, resting at either end.

    The motion fills the time. Runs for path figures are the parts at constant speed of
    the ways forth.

    Args:
        time: [s]. Shape (n,).
        kinematics: Of the arm.
        start: Joint angles at the start of the line [rad]. Shape (n_joints,).
        displacement: From start to end [m]. Shape (3,).
        cycles: How often forth and back.
        hold: Rest at the start and at every end [s].
        ramp: Time of speeding up, and of slowing down [s].
    """
    path = _straight(kinematics, start, displacement)
    way = (time[-1] - hold) / (2 * cycles) - hold
    period = 2.0 * (way + hold)
    legs = [hold + period * k for k in range(cycles)]
    s, v, a = np.zeros((3, time.size))
    for first in legs:
        for begin, sign in ((first, 1.0), (first + way + hold, -1.0)):
            value, rate, bend = _even(time - begin, way, ramp)
            s, v, a = s + sign * value, v + sign * rate, a + sign * bend
    return _along(
        time,
        path,
        (s, v, a),
        steady=(hold, time[-1] - hold),
        arrival=float(time[-1] - hold),
        passes=tuple(first + ramp for first in legs),
        pass_time=way - 2.0 * ramp,
    )


def circle(
    time: Array,
    kinematics: ToolKinematics,
    *,
    start: Array,
    radius: float,
    normal: Array,
    towards: Array,
    cycles: int,
    hold: float,
    ramp: float,
) -> Trajectory:
    """Round a circle at constant speed between smooth ramps.

    The motion fills the time. Runs for path figures are the whole turns at constant
    speed, counted from where the ramp ends.

    Args:
        time: [s]. Shape (n,).
        kinematics: Of the arm.
        start: Joint angles at the start [rad]. Shape (n_joints,).
        radius: [m].
        normal: Axis. Shape (3,).
        towards: Direction from the start to the centre. Shape (3,).
        cycles: Turns.
        hold: Rest before and after [s].
        ramp: Time of speeding up, and of slowing down [s].
    """
    origin, _ = kinematics.pose(start)
    axis = normal / np.linalg.norm(normal)
    inward = towards - (towards @ axis) * axis
    inward /= np.linalg.norm(inward)
    centre, along = origin + radius * inward, np.cross(axis, -inward)

    def place(turns: Array) -> Array:
        angle = 2.0 * np.pi * turns[:, None]
        return np.asarray(
            centre + radius * (np.sin(angle) * along - np.cos(angle) * inward)
        )

    path = follow(kinematics, start, place, length=float(cycles), nodes=64 * cycles)
    way = time[-1] - 2.0 * hold
    s, v, a = (cycles * x for x in _even(time - hold, way, ramp))
    turn = (way - ramp) / cycles
    whole = int((way - 2.0 * ramp) / turn + 1e-9)
    return _along(
        time,
        path,
        (s, v, a),
        steady=(hold + ramp, time[-1] - hold - ramp),
        arrival=float(time[-1] - hold),
        passes=tuple(hold + ramp + turn * k for k in range(whole)),
        pass_time=turn,
    )


def cube_poses(centre: Array, edge: float, plane: str) -> Array:
    """P1 to P5 of ISO 9283 (1998) [m]. Shape (5, 3).

    The diagonal plane of the cube holds two opposite edges that are level and both
    space diagonals between them; P1 is the centre, P2 to P5 lie on the diagonals in the
    order of the corners, a tenth of a diagonal away from them.

    Args:
        centre: Of the cube [m]. Shape (3,).
        edge: [m].
        plane: Direction in which the plane rises, see :data:`DIRECTIONS`.
    """
    x, y = DIRECTIONS[plane]
    rising, level = np.array([x, y, 1.0]), np.array([-y, x, 0.0])
    corners = [level - rising, -level - rising, rising - level, rising + level]
    offsets = np.vstack([np.zeros(3), *corners])
    return np.asarray(centre + 0.5 * edge * POSE_SHARE * offsets)


def iso9283(
    time: Array,
    kinematics: ToolKinematics,
    *,
    start: Array,
    edge: float,
    plane: str,
    cycles: int,
    hold: float,
    rest: float,
) -> Trajectory:
    """From P1 again and again to P5, P4, P3, P2 and P1, with a rest at each.

    Between the poses the joints move together and smoothly, point to point; the moves
    share the time that the rests leave.

    Args:
        time: [s]. Shape (n,).
        kinematics: Of the arm.
        start: Joint angles of P1 [rad]. Shape (n_joints,).
        edge: Of the cube [m].
        plane: See :func:`cube_poses`.
        cycles: How often.
        hold: Rest before the first cycle [s].
        rest: At every pose [s].
    """
    centre, _ = kinematics.pose(start)
    poses = cube_poses(centre, edge, plane)
    angles = {1: start}
    for number, pose in enumerate(poses[1:], 2):
        angles[number] = np.asarray(_straight(kinematics, start, pose - centre)(1.0))
    move = (time[-1] - hold) / (5 * cycles) - rest
    position = np.tile(start, (time.size, 1))
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    visits, last, begin = [], 1, hold
    for number in ORDER * cycles:
        way = angles[number] - angles[last]
        first = int(np.searchsorted(time, begin))
        x = np.clip((time[first:] - begin) / move, 0.0, 1.0)
        x[x > 1.0 - 1e-9] = 1.0  # round-off of the time is no motion
        x = x[: int(np.searchsorted(x, 1.0)) + 1]
        # the integral of the smooth ramp's slope: a smooth step of the position
        _, value, slope = smooth_ramp(x)
        bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
        here = slice(first, first + x.size)
        position[here] = angles[last] + value[:, None] * way
        velocity[here] = slope[:, None] * way / move
        acceleration[here] = bend[:, None] * way / move**2
        position[here.stop :] = angles[number]
        begin += move + rest
        visits.append((number, begin))
        last = number
    return Trajectory(
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        steady=window(time, hold, time[-1]),
        steady_velocity=np.zeros_like(start),
        arrival=visits[-1][1] - rest,
        visits=tuple(visits),
    )


def _straight(kinematics: ToolKinematics, start: Array, way: Array) -> Any:
    """Joint angles over 0 to 1 from the tool at ``start`` to ``way`` [m] from there."""
    origin, _ = kinematics.pose(start)
    return follow(kinematics, start, lambda s: origin + s[:, None] * way, length=1.0)


def _even(t: Array, way: float, ramp: float) -> tuple[Array, Array, Array]:
    """Law from 0 to 1 in ``way`` seconds with smooth ramps, and its derivatives."""
    speed = 1.0 / (way - ramp)
    up_s, up_v, up_a = smooth_ramp(np.clip(t / ramp, 0.0, 1.0))
    down_s, down_v, down_a = smooth_ramp(np.clip((t - way + ramp) / ramp, 0.0, 1.0))
    down = np.clip((t - way + ramp) / ramp, 0.0, 1.0)
    even = np.clip(t - ramp, 0.0, way - 2.0 * ramp)
    return (
        speed * (ramp * up_s + even + ramp * (down - down_s)),
        speed * (up_v - down_v),
        speed / ramp * (up_a - down_a),
    )


def _along(
    time: Array,
    path: Any,
    law: tuple[Array, Array, Array],
    *,
    steady: tuple[float, float],
    **rest: Any,
) -> Trajectory:
    """Joint motion from a path over its parameter and the parameter over time."""
    s, v, a = (x[:, None] for x in law)
    slope, bend = path(s[:, 0], 1), path(s[:, 0], 2)
    return Trajectory(
        time=time,
        position=np.asarray(path(s[:, 0])),
        velocity=np.asarray(slope * v),
        acceleration=np.asarray(bend * v**2 + slope * a),
        steady=window(time, *steady),
        steady_velocity=np.zeros(slope.shape[1]),
        **rest,
    )
