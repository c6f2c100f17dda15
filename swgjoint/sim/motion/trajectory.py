"""Commanded joint motions on the time grid of a run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Position, velocity and acceleration of every joint at every step."""

    time: Array
    """Start of every step and the end of the last one [s]. Shape (n,)."""
    position: Array
    """Joint angles [rad]. Shape (n, n_joints)."""
    velocity: Array
    """Joint speeds [rad/s]. Shape (n, n_joints)."""
    acceleration: Array
    """Joint accelerations [rad/s²]. Shape (n, n_joints)."""
    steady: slice
    """Samples of the constant-speed part that the metrics use."""
    steady_velocity: Array
    """Speed in that part [rad/s], zero if no speed is constant. Shape (n_joints,)."""
    arrival: float | None = None
    """Time at which the command comes to rest at its last pose [s]; None if never."""
    visits: tuple[tuple[int, float], ...] = ()
    """Repeatedly visited poses: number of the pose and end of the rest there [s]."""
    passes: tuple[float, ...] = ()
    """Start times of passes along one path at constant tool speed [s]."""
    pass_time: float = 0.0
    """Duration of each pass [s]."""
    answer_speed: Array | None = None
    """Speed of a step response, whose commanded speed is zero [rad/s]. Shape
    (n_joints,)."""

    def every(self, n: int) -> Trajectory:
        """The same motion at every n-th sample, the first included."""
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

        For a step, whose commanded speed is zero, it is that of the step response.
        """
        if self.answer_speed is not None:
            return self.answer_speed
        return np.asarray(np.abs(self.velocity).max(axis=0))


def smooth_ramp(x: Array) -> tuple[Array, Array, Array]:
    r"""Integral, value and slope of the smooth step :math:`10x^3 - 15x^4 + 6x^5`.

    The slope and the second derivative of the step vanish at both ends, so a velocity
    that follows it gives a three times continuously differentiable position.

    Args:
        x: Argument from 0 to 1.

    Returns:
        Integral, value and slope, each of the shape of ``x``.
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
    """Rest, smooth ramp to constant speed, smooth ramp to rest; all joints together.

    Args:
        start: Joint angles at the start [rad]. Shape (n_joints,).
        end: Joint angles at the end [rad]. Shape (n_joints,).
        duration: Total time [s], more than ``2 (hold + ramp) + settle``.
        step: Time step of the scene [s].
        hold: Rest before and after the motion [s].
        ramp: Time of each ramp [s].
        settle: Time after the first ramp that the metrics leave out [s].
        sub_steps: Samples per time step.
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
    """Constant speed from the first instant.

    Args:
        start: Joint angles at the start [rad]. Shape (n_joints,).
        speed: Joint speeds [rad/s]. Shape (n_joints,).
        duration: Total time [s].
        step: Time step of the scene [s].
        settle: Initial time that the metrics leave out [s].
        sub_steps: Samples per time step.
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
    """Times of all states of a run, first and last included [s].

    Args:
        duration: Total time [s].
        step: Time step of the scene [s].
        sub_steps: Samples per time step.

    >>> time_grid(0.004, 0.001).tolist()
    [0.0, 0.001, 0.002, 0.003, 0.004]
    """
    count = round(duration / step) * sub_steps
    return np.asarray(np.arange(count + 1) * (step / sub_steps))


def window(time: Array, first: float, last: float) -> slice:
    """Samples between two times, both included.

    Args:
        time: Increasing times [s]. Shape (n,).
        first: First time [s].
        last: Last time [s].
    """
    tolerance = 1e-9
    return slice(
        int(np.searchsorted(time, first - tolerance)),
        int(np.searchsorted(time, last + tolerance)),
    )
