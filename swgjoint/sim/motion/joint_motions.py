"""Motions defined by joint angles: step, trapezoid, chirp, and points from a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swgjoint.csv_columns import header_of, read_columns
from swgjoint.errors import InputError
from swgjoint.sim.motion.trajectory import Trajectory, smooth_ramp, window
from swgjoint.typing import Array
from swgjoint.units import deg

CLOSEST, LONGEST = 1e-6, 1e4
"""Shortest accepted time between two points of a file and longest accepted motion [s].
They equal the shortest step and the longest duration of a simulation."""
LARGEST = 1e4
"""Largest accepted angle in a file [rad], more than a thousand turns."""


def step(
    time: Array, *, start: Array, jump: Array, at: float, answer_speed: Array
) -> Trajectory:
    """A discontinuous step of the reference between two positions at rest.

    Args:
        time: Time grid [s]. Shape (n,).
        start: Joint angles before the step [rad]. Shape (n_joints,).
        jump: Height of the step [rad]. Shape (n_joints,).
        at: Time of the step [s]; a sample at this time already has the new reference.
        answer_speed: Expected largest speed of the step response [rad/s]. Shape
            (n_joints,).
    """
    after = time >= at - 1e-9
    position = start + after[:, None] * jump
    return Trajectory(
        time=time,
        position=position,
        velocity=np.zeros_like(position),
        acceleration=np.zeros_like(position),
        steady=window(time, at, time[-1]),
        steady_velocity=np.zeros_like(start),
        arrival=at,
        answer_speed=np.abs(answer_speed),
    )


def trapezoid(
    time: Array,
    *,
    start: Array,
    end: Array,
    hold: float,
    max_speed: float,
    max_acceleration: float,
    where: str = "trajectory",
) -> Trajectory:
    """Point-to-point motion with a trapezoidal velocity profile, between two rests.

    All joints follow the same law from 0 to 1, which is the fastest that keeps every
    joint within its limits. The velocity is continuous, but the acceleration is not.

    Args:
        time: Time grid [s]. Shape (n,).
        start: Joint angles at the start [rad]. Shape (n_joints,).
        end: Joint angles at the end [rad]. Shape (n_joints,).
        hold: Rest before the motion [s].
        max_speed: Speed limit of every joint [rad/s].
        max_acceleration: Acceleration limit of every joint [rad/s²].
        where: Start of the message.

    Raises:
        InputError: If start and end are the same.
    """
    way = float(np.abs(end - start).max())
    if way == 0.0:
        raise InputError(
            f"{where}.end_deg: equal to start_deg; accepted: another angle"
        )
    speed, acceleration = max_speed / way, max_acceleration / way
    ramp = min(speed / acceleration, acceleration**-0.5)
    speed = acceleration * ramp
    cruise = max(1.0 / speed - ramp, 0.0)
    first, second = hold + ramp, hold + ramp + cruise
    up = np.clip(time - hold, 0.0, ramp)
    even = np.clip(time - first, 0.0, cruise)
    down = np.clip(time - second, 0.0, ramp)
    path = 0.5 * acceleration * up**2 + speed * (even + down)
    path -= 0.5 * acceleration * down**2
    rate = acceleration * (up - down)
    bend = acceleration * (
        ((time >= hold) & (time < first)).astype(float)
        - ((time >= second) & (time < second + ramp)).astype(float)
    )
    steady = window(time, first, second)
    travels = steady.stop - steady.start >= 16
    return Trajectory(
        time=time,
        position=start + path[:, None] * (end - start),
        velocity=rate[:, None] * (end - start),
        acceleration=bend[:, None] * (end - start),
        steady=steady if travels else window(time, hold, second + ramp),
        steady_velocity=speed * (end - start) if travels else np.zeros_like(start),
        arrival=second + ramp,
    )


def speed_steps(
    time: Array, *, start: Array, joint: int, speeds: Array, hold: float, ramp: float
) -> Trajectory:
    """One joint turns at several speeds of equal duration, with ramps between them.

    Args:
        time: Time grid [s]. Shape (n,).
        start: Joint angles at the start [rad]. Shape (n_joints,).
        joint: Index of the joint.
        speeds: Joint speeds in their order [rad/s]. Shape (m,).
        hold: Rest before and after the motion [s].
        ramp: Duration of every change of speed [s].
    """
    count = len(speeds)
    plateau = (time[-1] - 2.0 * hold - (count + 1) * ramp) / count
    position = np.tile(start, (time.size, 1))
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    for k, change in enumerate(np.diff(speeds, prepend=0.0, append=0.0)):
        since = time - hold - k * (ramp + plateau)
        path, share, slope = smooth_ramp(np.clip(since / ramp, 0.0, 1.0))
        position[:, joint] += change * (ramp * path + np.maximum(since - ramp, 0.0))
        velocity[:, joint] += change * share
        acceleration[:, joint] += change * slope / ramp
    last = time[-1] - hold - ramp
    return Trajectory(
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        steady=window(time, last - plateau, last),
        steady_velocity=np.where(np.arange(start.size) == joint, speeds[-1], 0.0),
        arrival=last + ramp,
    )


def chirp(
    time: Array,
    *,
    start: Array,
    joint: int,
    amplitude: float,
    first_frequency: float,
    last_frequency: float,
    hold: float,
    ramp: float,
) -> Trajectory:
    r"""Oscillation of one joint with linearly changing frequency.

    .. math:: q = q_0 + A\,w(t)\sin\phi(t), \quad
        \dot\phi = 2\pi\left(f_0 + (f_1 - f_0)\,t/T\right)

    Here t and T are time and duration of the oscillation. The factor w rises smoothly
    from 0 to 1 during the first ramp and falls to 0 during the last. The position is
    twice continuously differentiable.

    Args:
        time: Time grid [s]. Shape (n,).
        start: Joint angles at the start [rad]. Shape (n_joints,).
        joint: Index of the joint.
        amplitude: Amplitude of the joint angle [rad].
        first_frequency: Frequency at the start of the oscillation [Hz].
        last_frequency: Frequency at the end of the oscillation [Hz].
        hold: Rest before and after the oscillation [s].
        ramp: Time in which the amplitude grows, and time in which it decays [s].
    """
    length = time[-1] - 2.0 * hold
    t = np.clip(time - hold, 0.0, length)
    growth = np.pi * (last_frequency - first_frequency) / length
    phase = 2.0 * np.pi * first_frequency * t + growth * t**2
    rate = 2.0 * np.pi * first_frequency + 2.0 * growth * t
    _, up, up_1 = smooth_ramp(np.clip(t / ramp, 0.0, 1.0))
    _, down, down_1 = smooth_ramp(np.clip((length - t) / ramp, 0.0, 1.0))
    up_2, down_2 = (
        60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
        for x in (np.clip(s / ramp, 0.0, 1.0) for s in (t, length - t))
    )
    # the two ramps do not overlap, so one factor is 1 while the other changes
    w, w_1 = up * down, (up_1 - down_1) / ramp
    w_2 = (up_2 + down_2) / ramp**2
    sine, cosine = np.sin(phase), np.cos(phase)
    position = np.tile(start, (time.size, 1))
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    position[:, joint] += amplitude * w * sine
    velocity[:, joint] = amplitude * (w_1 * sine + w * rate * cosine)
    acceleration[:, joint] = amplitude * (
        w_2 * sine
        + 2.0 * w_1 * rate * cosine
        + w * (2.0 * growth * cosine - rate**2 * sine)
    )
    return Trajectory(
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        steady=window(time, hold + ramp, time[-1] - hold - ramp),
        steady_velocity=np.zeros_like(start),
        arrival=float(time[-1] - hold),
    )


def spline_motion(
    time: Array, *, points_time: Array, points: Array, hold: float
) -> Trajectory:
    """Smooth motion through given points, between two rests.

    The motion is a quintic spline that starts and ends with zero speed and
    acceleration, so the position is twice continuously differentiable.

    Args:
        time: Time grid [s]. Shape (n,).
        points_time: Increasing times of the points [s]; the first point is reached at
            the end of the rest. Shape (m,).
        points: Joint angles [rad]. Shape (m, n_joints).
        hold: Rest before the motion [s].
    """
    from scipy.interpolate import make_interp_spline

    still = [(1, np.zeros(points.shape[1])), (2, np.zeros(points.shape[1]))]
    spline = make_interp_spline(
        points_time - points_time[0], points, k=5, bc_type=(still, still)
    )
    length = float(points_time[-1] - points_time[0])
    t = np.clip(time - hold, 0.0, length)
    moving = ((time > hold) & (time < hold + length))[:, None]
    return Trajectory(
        time=time,
        position=np.asarray(spline(t)),
        velocity=np.where(moving, spline(t, 1), 0.0),
        acceleration=np.where(moving, spline(t, 2), 0.0),
        steady=window(time, hold, min(hold + length, time[-1])),
        steady_velocity=np.zeros(points.shape[1]),
        arrival=hold + length if hold + length <= time[-1] + 1e-9 else None,
    )


def read_points(
    path: str | Path, joints: tuple[str, ...], start: Array
) -> tuple[Array, Array]:
    """Read the points of a motion from a CSV file.

    Args:
        path: File with the columns ``time_s`` and ``<joint>_deg`` or ``<joint>_rad``;
            joints without a column remain at their start angle.
        joints: Names of all joints of the arm.
        start: Joint angles at the start [rad]. Shape (n_joints,).

    Returns:
        Times [s], shape (m,), and joint angles [rad], shape (m, n_joints).

    Raises:
        InputError: If the file cannot be used; the message names the file and the line
            or column.
    """
    accepted = {
        name: {f"{name}_deg": deg, f"{name}_rad": 1.0} for name in joints
    }  # fmt: skip
    header = header_of(path)
    unknown = [
        cell
        for cell in header
        if cell != "time_s" and not any(cell in units for units in accepted.values())
    ]
    moved = [
        name
        for name, units in accepted.items()
        if any(cell in units for cell in header)
    ]
    if header and (unknown or not moved):
        fault = f"column {unknown[0][:40]!r}" if unknown else "no column of a joint"
        raise InputError(
            f"{path}: {fault}; accepted: time_s and <joint>_deg or <joint>_rad of"
            f" {', '.join(joints)}"
        )
    columns = read_columns(
        path, {"time": {"time_s": 1.0}, **{name: accepted[name] for name in moved}}
    )
    time = columns["time"]
    if time.size < 2 or not (np.diff(time) > 0.0).all():
        raise InputError(
            f"{path}: time_s does not increase from line to line; accepted: two or more"
            " points at increasing times"
        )
    nearest, length = float(np.diff(time).min()), float(time[-1] - time[0])
    if nearest < CLOSEST or length > LONGEST:
        raise InputError(
            f"{path}: time_s: smallest interval {nearest:.3g} s, duration"
            f" {length:.3g} s; accepted: intervals of at least {CLOSEST:g} s, duration"
            f" of at most {LONGEST:g} s"
        )
    for name in moved:
        largest = float(np.abs(columns[name]).max())
        if largest > LARGEST:
            raise InputError(
                f"{path}: {name}: an angle of {largest / deg:.3g} deg; accepted: up to"
                f" {LARGEST / deg:.3g} deg"
            )
    points = np.tile(start, (time.size, 1))
    for name in moved:
        points[:, joints.index(name)] = columns[name]
    return time, points
