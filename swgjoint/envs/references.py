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

import numpy as np

from swgjoint.typing import Array

Motion = tuple[Array, Array, Array]
"""Position [rad], velocity [rad/s], acceleration [rad/s²]; shapes (n,)."""

RAMP = 0.4
"""Time over which an oscillation grows from rest [s]."""
HOLD = 0.05
"""Rest before and after a move from point to point [s]."""
FREQUENCIES = (0.3, 2.0)
"""Frequency range of the oscillations [Hz], below the first mode of all arm joints."""
PARTS = 5
"""Number of oscillations in a multisine."""

_STEP = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
_STEP_1, _STEP_2 = _STEP.deriv(), _STEP.deriv(2)


def smooth_step(time: Array, duration: float) -> Motion:
    """Smooth step from 0 to 1 that starts at time 0, and its first two derivatives.

    Args:
        time: Times [s]. Shape (n,).
        duration: Duration of the step [s].

    Returns:
        Step [-] and its derivatives [1/s] and [1/s²]. Shapes (n,).
    """
    x = np.clip(np.asarray(time) / duration, 0.0, 1.0)
    return _STEP(x), _STEP_1(x) / duration, _STEP_2(x) / duration**2


def _oscillation(time: Array, frequency: Array, phase: Array, weight: Array) -> Motion:
    """Sum of sines that starts at rest at angle 0 and grows over :data:`RAMP`."""
    omega = 2.0 * np.pi * frequency
    angle = omega * time[:, None] + phase
    sin, cos = weight * np.sin(angle), weight * np.cos(angle)
    # the offset makes y itself start at 0, in addition to the factor w
    y = sin.sum(axis=1) - sin[0].sum()
    y_1, y_2 = (omega * cos).sum(axis=1), (-(omega**2) * sin).sum(axis=1)
    w, w_1, w_2 = smooth_step(time, RAMP)
    return w * y, w_1 * y + w * y_1, w_2 * y + 2.0 * w_1 * y_1 + w * y_2


def sinusoid(time: Array, rng: np.random.Generator) -> Motion:
    """Draw one oscillation.

    Args:
        time: Times from 0 on [s]. Shape (n,).
        rng: Random number generator.
    """
    frequency = rng.uniform(*FREQUENCIES, 1)
    return _oscillation(time, frequency, rng.uniform(0, 2 * np.pi, 1), np.ones(1))


def multisine(time: Array, rng: np.random.Generator) -> Motion:
    """Draw a sum of oscillations of equal speed with random frequencies and phases.

    Args:
        time: Times from 0 on [s]. Shape (n,).
        rng: Random number generator.
    """
    low, high = map(float, np.log(FREQUENCIES))
    frequency = np.exp(rng.uniform(low, high, PARTS))
    phase = rng.uniform(0, 2 * np.pi, PARTS)
    return _oscillation(time, frequency, phase, 1.0 / frequency)


def point_to_point(time: Array, rng: np.random.Generator) -> Motion:
    """Draw a move and a return over half its distance, with a rest around each.

    Args:
        time: Times from 0 on [s]. Shape (n,).
        rng: Random number generator.
    """
    first = rng.uniform(0.3, 0.6) * time[-1]
    second = time[-1] - first
    there = smooth_step(time - HOLD, first - 2.0 * HOLD)
    back = smooth_step(time - first - HOLD, second - 2.0 * HOLD)
    a, b, c = (x - 0.5 * y for x, y in zip(there, back, strict=True))
    return a, b, c


KINDS: dict[str, Callable[[Array, np.random.Generator], Motion]] = {
    "sinusoid": sinusoid,
    "multisine": multisine,
    "point_to_point": point_to_point,
}
"""Functions that draw a motion, by the name of its kind."""


def draw_motion(
    time: Array,
    rng: np.random.Generator,
    *,
    kinds: tuple[str, ...],
    max_speed: float,
    max_angle: float,
    max_acceleration: float,
) -> Motion:
    """Draw a motion with 40 to 100 % of the largest amplitude that the limits allow.

    Args:
        time: Times from 0 on [s]. Shape (n,).
        rng: Random number generator.
        kinds: Names of :data:`KINDS`, one of which is drawn.
        max_speed: Largest speed [rad/s].
        max_angle: Largest distance from the start [rad].
        max_acceleration: Largest acceleration [rad/s²].
    """
    kind = kinds[int(rng.integers(len(kinds)))]
    position, velocity, acceleration = KINDS[kind](time, rng)
    size = min(
        max_speed / float(np.abs(velocity).max()),
        max_angle / float(np.abs(position).max()),
        max_acceleration / float(np.abs(acceleration).max()),
    )
    size *= float(rng.uniform(0.4, 1.0) * rng.choice([-1.0, 1.0]))
    return size * position, size * velocity, size * acceleration
