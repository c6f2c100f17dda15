"""Commanded joint motions on the time grid of a run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Commanded position, velocity and acceleration of every joint at every step."""

    time: Array
    """Times of the samples: the start of every step and the end of the last one [s].
    Shape (n,)."""
    position: Array
    """Joint angles [rad]. Shape (n, n_joints)."""
    velocity: Array
    """Joint speeds [rad/s]. Shape (n, n_joints)."""
    acceleration: Array
    """Joint accelerations [rad/s²]. Shape (n, n_joints)."""
    steady: slice
    """Samples that the metrics use: the part at constant joint speed, or, if no joint
    speed is constant, the main part of the motion (a chirp at full amplitude, a path of
    the tool, the time after a step)."""
    steady_velocity: Array
    """Constant speed in that part [rad/s]; zero if the speed is not constant. Shape
    (n_joints,)."""
    arrival: float | None = None
    """Time at which the command comes to rest in its final pose [s]; None if it does
    not."""
    visits: tuple[tuple[int, float], ...] = ()
    """Visits of repeatedly approached poses: number of the pose, and time at the end of
    the rest there [s]."""
    passes: tuple[float, ...] = ()
    """Start times of the passes along one path at constant tool speed [s]."""
    pass_time: float = 0.0
    """Duration of each pass [s]."""
    answer_speed: Array | None = None
    """Largest expected speed of a step response [rad/s], shape (n_joints,); None for
    motions other than a step."""

    def every(self, n: int) -> Trajectory:
        """The same motion with every n-th sample, beginning with the first."""
        return replace(
            self,
            time=self.time[::n],
            position=self.position[::n],
            velocity=self.velocity[::n],
            acceleration=self.acceleration[::n],
            steady=slice(-(-self.steady.start // n), (self.steady.stop - 1) // n + 1),
        )

    @property
    def top_speed(self) -> Array:
        """Largest commanded speed of every joint [rad/s]. Shape (n_joints,).

        For a step, whose commanded speed is zero, it is the expected speed of the step
        response.
        """
        if self.answer_speed is not None:
            return self.answer_speed
        return np.asarray(np.abs(self.velocity).max(axis=0))


def smooth_ramp(x: Array) -> tuple[Array, Array, Array]:
    r"""Integral, value and slope of the smooth step :math:`10x^3 - 15x^4 + 6x^5`.

    The first and second derivatives of the step vanish at both ends. If a velocity
    follows the step, the position is three times continuously differentiable.

    Args:
        x: Argument from 0 to 1.

    Returns:
        Integral from 0, value and slope, each with the shape of ``x``.
    """
    return (
        x**4 * (2.5 - 3.0 * x + x**2),
        x**3 * (10.0 - 15.0 * x + 6.0 * x**2),
        30.0 * x**2 * (1.0 - x) ** 2,
    )


def sweep(
    *,
    start: Array,
    end: Array,
    duration: float,
    step: float,
    hold: float,
    ramp: float,
    settle: float = 0.0,
    sub_steps: int = 1,
) -> Trajectory:
    """Motion of all joints together: rest, ramp, constant speed, ramp, rest.

    Args:
        start: Joint angles at the start [rad]. Shape (n_joints,).
        end: Joint angles at the end [rad]. Shape (n_joints,).
        duration: Total time [s], more than ``2 (hold + ramp) + settle``.
        step: Time step of the scene [s].
        hold: Rest before and after the motion [s].
        ramp: Duration of each ramp [s].
        settle: Time after the first ramp that the metrics leave out [s].
        sub_steps: Number of samples per time step.
    """
    time = time_grid(duration, step, sub_steps)
    top = duration - hold - ramp  # the second ramp starts here
    speed = (end - start) / (top - hold)
    up = np.clip((time - hold) / ramp, 0.0, 1.0)
    down = np.clip((time - top) / ramp, 0.0, 1.0)
    cruise = np.clip(time - hold - ramp, 0.0, top - hold - ramp)
    up_s, up_v, up_a = smooth_ramp(up)
    down_s, down_v, down_a = smooth_ramp(down)
    path = ramp * up_s + cruise + ramp * (down - down_s)
    return Trajectory(
        time=time,
        position=start + path[:, None] * speed,
        velocity=(up_v - down_v)[:, None] * speed,
        acceleration=((up_a - down_a) / ramp)[:, None] * speed,
        steady=window(time, hold + ramp + settle, top),
        steady_velocity=speed,
        arrival=duration - hold,
    )


def constant_speed(
    *,
    start: Array,
    speed: Array,
    duration: float,
    step: float,
    settle: float = 0.0,
    sub_steps: int = 1,
) -> Trajectory:
    """Motion at constant joint speeds from the first instant.

    Args:
        start: Joint angles at the start [rad]. Shape (n_joints,).
        speed: Joint speeds [rad/s]. Shape (n_joints,).
        duration: Total time [s].
        step: Time step of the scene [s].
        settle: Initial time that the metrics leave out [s].
        sub_steps: Number of samples per time step.
    """
    time = time_grid(duration, step, sub_steps)
    return Trajectory(
        time=time,
        position=start + time[:, None] * speed,
        velocity=np.broadcast_to(speed, (time.size, speed.size)).copy(),
        acceleration=np.zeros((time.size, speed.size)),
        steady=window(time, settle, duration),
        steady_velocity=speed,
    )


def time_grid(duration: float, step: float, sub_steps: int = 1) -> Array:
    """Times of all states of a run, including the first and the last [s].

    The duration is rounded to whole time steps.

    Args:
        duration: Total time [s].
        step: Time step of the scene [s].
        sub_steps: Number of samples per time step.

    >>> time_grid(0.004, 0.001).tolist()
    [0.0, 0.001, 0.002, 0.003, 0.004]
    """
    count = round(duration / step) * sub_steps
    return np.asarray(np.arange(count + 1) * (step / sub_steps))


def window(time: Array, first: float, last: float) -> slice:
    """Slice of the samples from one time to another, both included.

    Args:
        time: Increasing times of the samples [s]. Shape (n,).
        first: First time [s].
        last: Last time [s].
    """
    tolerance = 1e-9
    return slice(
        int(np.searchsorted(time, first - tolerance)),
        int(np.searchsorted(time, last + tolerance)),
    )
