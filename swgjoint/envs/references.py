r"""Seeded smooth motions of one joint that start at rest.

All motions are four times continuously differentiable, as the feed-forward of a
flexible joint requires (Spong 1987). They are built from the smooth step

.. math:: s(x) = x^5\,(126 - 420 x + 540 x^2 - 315 x^3 + 70 x^4), \quad 0 \le x \le 1,

whose first four derivatives vanish at both ends.

Source:
    Spong (1987), "Modeling and control of elastic joint robots", J. Dyn. Sys. Meas.
    Control 109, 310-319.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swgjoint.kernels import kernels
from swgjoint.typing import Array

Motion = tuple[Array, Array, Array]
"""Position [rad], velocity [rad/s], acceleration [rad/s²]; shapes (n,)."""

RAMP = 0.4
"""Time over which an oscillation grows from rest [s]."""
HOLD = 0.05
"""Rest before and after a move from point to point [s]."""
FREQUENCIES = (0.3, 2.0)
"""Frequency range of the oscillations [Hz], below the first mode of all arm joints."""
QUICKEST = 0.012
"""Ratio of the largest speed to the largest acceleration of motions [s]. This
acceleration limits only point-to-point moves in episodes shorter than 0.6 s."""
PARTS = 5
"""Number of oscillations in a multisine."""

_STEP = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
_STEPS = [p.coef[::-1].tolist() for p in (_STEP, _STEP.deriv(), _STEP.deriv(2))]
"""Coefficients of the smooth step and its derivatives, highest power first."""


def smooth_step(time: Array, duration: float) -> Motion:
    """Smooth step from 0 to 1 that starts at time 0, and its first two derivatives.

    Args:
        time: Increasing times [s]. Shape (n,).
        duration: Duration of the step [s].

    Returns:
        Step [-] and its derivatives [1/s] and [1/s²]. Shapes (n,).
    """
    x = np.asarray(time) / duration
    first, last = np.searchsorted(x, 0.0, side="right"), np.searchsorted(x, 1.0)
    step, slope, bend = np.zeros((3, x.size))
    step[last:] = 1.0
    inside = x[first:last]
    for values, (highest, *others) in zip((step, slope, bend), _STEPS, strict=True):
        value = values[first:last]
        value += highest
        for one in others:
            value *= inside
            if one:
                value += one
    slope /= duration
    bend /= duration**2
    return step, slope, bend


class Instants:
    """Times at which motions are sampled, with what all motions have in common."""

    def __init__(self, time: Array) -> None:
        """Prepare the times.

        Args:
            time: Increasing times from 0 on [s]. Shape (n,).
        """
        self.time: Array = np.asarray(time, float)
        self.ramp = smooth_step(self.time, RAMP)
        """Factor w with which oscillations grow from rest, and its derivatives."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Oscillation:
    """Sum of sines that starts at rest at angle 0 and grows over :data:`RAMP`.

    Arrays have shape (n_sines,).
    """

    frequency: Array
    """Frequencies [Hz]."""
    phase: Array
    """Phases at time 0 [rad]."""
    weight: Array
    """Amplitudes [-]."""

    def sample(self, instants: Instants, part: slice) -> Motion:
        """Motion of size 1 at some of the instants.

        Args:
            instants: Times of the motion.
            part: Range of the instants.
        """
        omega = 2.0 * np.pi * self.frequency
        # one row for each sine, so that its values follow each other in memory
        angle = omega[:, None] * instants.time[part]
        angle += self.phase[:, None]
        sin, cos = np.sin(angle), np.cos(angle, out=angle)
        # the offset makes y itself start at 0, in addition to the factor w
        offset = (self.weight * np.sin(omega * 0.0 + self.phase)).sum()
        ramp = [one[part] for one in instants.ramp]
        if (native := kernels()) is not None:
            motion = np.empty((3, angle.shape[1]))
            given = self.weight, omega, float(offset), *ramp
            native.grow_oscillation(sin, cos, *given, motion)
            return motion[0], motion[1], motion[2]
        sin *= self.weight[:, None]
        cos *= self.weight[:, None]
        y = _sum(sin) - offset
        sin *= -(omega**2)[:, None]
        cos *= omega[:, None]
        y_1, y_2 = _sum(cos), _sum(sin)
        w, w_1, w_2 = ramp
        return w * y, w_1 * y + w * y_1, w_2 * y + 2.0 * w_1 * y_1 + w * y_2


@dataclass(frozen=True, kw_only=True, eq=False)
class Move:
    """Move and return over half its distance, with a rest around each."""

    turn: float
    """Time at which the return begins [s]."""
    end: float
    """Time at which it ends [s]."""

    @classmethod
    def draw(cls, end: float, rng: np.random.Generator) -> Move:
        """Draw the time of the return.

        Args:
            end: Time at which it ends [s].
            rng: Random generator.
        """
        return cls(turn=rng.uniform(0.3, 0.6) * end, end=end)

    def sample(self, instants: Instants, part: slice) -> Motion:
        """Motion of size 1 at some of the instants.

        Args:
            instants: Times of the motion.
            part: Range of the instants.
        """
        time, second = instants.time[part], self.end - self.turn
        if (native := kernels()) is not None:
            motion, steps = np.empty((3, time.size)), []
            for delay, whole in ((0.0, self.turn), (self.turn, second)):
                duration = whole - 2.0 * HOLD
                steps.append(np.array([delay, HOLD, duration, duration**2]))
            native.move_back(time, *steps, motion)
            return motion[0], motion[1], motion[2]
        there = smooth_step(time - HOLD, self.turn - 2.0 * HOLD)
        back = smooth_step(time - self.turn - HOLD, second - 2.0 * HOLD)
        a, b, c = (x - 0.5 * y for x, y in zip(there, back, strict=True))
        return a, b, c


def _sum(rows: Array) -> Array:
    """Sum of all rows in their order. Shape (n,)."""
    total: Array = rows[0].copy()
    for row in rows[1:]:
        total += row
    return total


def _sinusoid(end: float, rng: np.random.Generator) -> Oscillation:
    """Draw one oscillation."""
    frequency = rng.uniform(*FREQUENCIES, 1)
    phase = rng.uniform(0, 2 * np.pi, 1)
    return Oscillation(frequency=frequency, phase=phase, weight=np.ones(1))


def _multisine(end: float, rng: np.random.Generator) -> Oscillation:
    """Draw a sum of oscillations of equal speed with random frequencies and phases."""
    low, high = map(float, np.log(FREQUENCIES))
    frequency = np.exp(rng.uniform(low, high, PARTS))
    phase = rng.uniform(0, 2 * np.pi, PARTS)
    return Oscillation(frequency=frequency, phase=phase, weight=1.0 / frequency)


KINDS: dict[str, Callable[[float, np.random.Generator], Oscillation | Move]] = {
    "sinusoid": _sinusoid,
    "multisine": _multisine,
    "point_to_point": Move.draw,
}
"""Functions that draw a motion of some duration [s], by the name of its kind."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnMotion:
    """One motion and its size."""

    shape: Oscillation | Move
    size: float
    """Factor of the motion [rad]."""

    def sample(self, instants: Instants, part: slice) -> Motion:
        """The motion at some of the instants.

        Args:
            instants: Times for which the motion was drawn.
            part: Range of the instants.
        """
        q, v, a = self.shape.sample(instants, part)
        return self.size * q, self.size * v, self.size * a


def draw_motion(
    instants: Instants,
    rng: np.random.Generator,
    *,
    kinds: tuple[str, ...],
    max_speed: float,
    max_angle: float,
    max_acceleration: float,
) -> tuple[DrawnMotion, Motion]:
    """Draw a motion with 40 to 100 % of the largest amplitude that the limits allow.

    Args:
        instants: Times of the motion.
        rng: Random number generator.
        kinds: Names of :data:`KINDS`, one of which is drawn.
        max_speed: Largest speed [rad/s].
        max_angle: Largest distance from the start [rad].
        max_acceleration: Largest acceleration [rad/s²].

    Returns:
        The motion, and its values at all instants.
    """
    kind = kinds[int(rng.integers(len(kinds)))]
    shape = KINDS[kind](float(instants.time[-1]), rng)
    motion = shape.sample(instants, slice(None))
    limits = (max_angle, max_speed, max_acceleration)
    tops = [max(float(one.max()), -float(one.min())) for one in motion]
    size = min(limit / top for limit, top in zip(limits, tops, strict=True))
    size *= rng.uniform(0.4, 1.0) * (2.0 * int(rng.integers(2)) - 1.0)
    q, v, a = motion
    return DrawnMotion(shape=shape, size=size), (size * q, size * v, size * a)
