"""Motions defined by the tool: line, circle, and the pose cycle of ISO 9283."""

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
"""Horizontal unit vectors (x, y) by name."""
ORDER = (5, 4, 3, 2, 1)
"""Numbers of the poses of one cycle, in the order of the standard."""
POSE_SHARE = 0.8
"""Distance of P2 to P5 from the centre of the cube, relative to the distance of the
corners. These poses are a tenth of the diagonal away from its ends."""


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
    """Motion back and forth on a straight line with a rest at both ends.

    The motion fills the time grid. The constant-speed parts of the forward strokes are
    the passes from which the path figures are computed.

    Args:
        time: Time grid [s]. Shape (n,).
        kinematics: Kinematics of the tool.
        start: Joint angles at the start of the line [rad]. Shape (n_joints,).
        displacement: Vector from the start to the far end [m]. Shape (3,).
        cycles: Number of cycles back and forth.
        hold: Rest at the start and at every turning point [s].
        ramp: Duration of each acceleration and of each deceleration [s].
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
    """Motion along a circle at constant speed between smooth ramps.

    The motion fills the time grid. The whole turns at constant speed, counted from the
    end of the first ramp, are the passes from which the path figures are computed.

    Args:
        time: Time grid [s]. Shape (n,).
        kinematics: Kinematics of the tool.
        start: Joint angles at the start [rad]. Shape (n_joints,).
        radius: Radius of the circle [m].
        normal: Axis of the circle, about which the tool moves right-handed. Shape (3,).
        towards: Direction from the start to the centre, not parallel to ``normal``; its
            component perpendicular to ``normal`` is used. Shape (3,).
        cycles: Number of turns.
        hold: Rest before and after the motion [s].
        ramp: Duration of the acceleration and of the deceleration [s].
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
    """Positions of the poses P1 to P5 of ISO 9283 (1998) [m]. Shape (5, 3).

    The diagonal plane of the cube contains two opposite horizontal edges and the two
    space diagonals between them. P1 is the centre of the cube. P2 to P5 are on the
    diagonals, a tenth of a diagonal away from the corners, in the order of the corners
    around the plane.

    Args:
        centre: Centre of the cube [m]. Shape (3,).
        edge: Edge length of the cube [m].
        plane: Direction in which the plane rises, a key of :data:`DIRECTIONS`.
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
    """Cycles from P1 to P5, P4, P3, P2 and back to P1, with a rest at each pose.

    Between the poses all joints move together in a smooth point-to-point motion. All
    moves take the same time, such that the motion fills the time grid.

    Args:
        time: Time grid [s]. Shape (n,).
        kinematics: Kinematics of the tool.
        start: Joint angles at P1 [rad]. Shape (n_joints,).
        edge: Edge length of the cube [m].
        plane: Direction in which the diagonal plane rises, see :func:`cube_poses`.
        cycles: Number of cycles.
        hold: Rest before the first cycle [s].
        rest: Rest at every pose [s].
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
        x[x > 1.0 - 1e-9] = 1.0  # remove round-off of the time at the end of a move
        x = x[: int(np.searchsorted(x, 1.0)) + 1]
        # the position follows the smooth step itself, not its integral
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
    """Spline of joint angles that displaces the tool by ``way`` [m] on a straight line.

    Its parameter runs from 0 at ``start`` to 1.
    """
    origin, _ = kinematics.pose(start)
    return follow(kinematics, start, lambda s: origin + s[:, None] * way, length=1.0)


def _even(t: Array, way: float, ramp: float) -> tuple[Array, Array, Array]:
    """Law from 0 to 1 over time ``way`` [s] with smooth ramps, and its derivatives."""
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
    """Joint motion from a path as a function of its parameter, and the parameter's law.

    The law contains the parameter and its first and second derivatives over time.
    """
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
