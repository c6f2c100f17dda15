r"""Fatigue life under a repeated stress history: rainflow, Goodman and Miner.

Rainflow counting divides the history into closed cycles of amplitude
:math:`\sigma_a` and mean :math:`\sigma_m`. The Goodman line converts each to the
amplitude of an equally damaging cycle without mean stress; compressive mean stress is
given no credit:

.. math:: \sigma_{ar} = \frac{\sigma_a}{1 - \max(\sigma_m, 0)/\sigma_u}.

The S-N curve gives the number of cycles to failure, and Miner's rule adds the damage:

.. math:: N = N_e (\sigma_e/\sigma_{ar})^k \text{ if } \sigma_{ar} > \sigma_e,
    \text{ else } \infty, \qquad D = \sum 1/N.

Source:
    ASTM E1049-85, "Standard Practices for Cycle Counting in Fatigue Analysis", 5.4.5
    (rainflow counting of repeating histories); J. Goodman (1899), "Mechanics Applied to
    Engineering"; M. A. Miner (1945), "Cumulative Damage in Fatigue", J. Appl. Mech. 12,
    A159-A164.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.errors import MissingExtraError
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class StressLife:
    """S-N curve of a steel in reversed bending, and its ultimate strength."""

    endurance_limit: float
    """Endurance limit sigma_e: smaller amplitudes cause no damage [Pa]."""
    ultimate_strength: float
    """Ultimate tensile strength sigma_u [Pa]."""
    exponent: float
    """Exponent k of the inclined part of the S-N curve [-]."""
    knee: float
    """Number of cycles N_e at which the curve reaches the endurance limit [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StressCycles:
    """Closed cycles of a stress history."""

    amplitude: Array
    """Half of the range of each cycle [Pa]. Shape (n,)."""
    mean: Array
    """Mean stress of each cycle [Pa]. Shape (n,)."""
    count: Array
    """Number of occurrences of each cycle [-]. Shape (n,)."""


def turning_points(values: Array) -> Array:
    """First, last and all locally extreme values of a signal, in order.

    Args:
        values: Signal, at least one value. Shape (n,).
    """
    x = values[np.r_[True, np.diff(values) != 0.0]]
    if x.size < 3:
        return x
    step = np.diff(x)
    return x[np.r_[True, step[1:] * step[:-1] < 0.0, True]]


def count_cycles(history: Array) -> StressCycles:
    """Rainflow count of a history that repeats itself.

    The history is rearranged to begin and end with its largest absolute value, so that
    every cycle is closed.

    Args:
        history: Stress over one repetition [Pa], at least one value. Shape (n,).

    Raises:
        MissingExtraError: If the package ``rainflow`` is not installed.
    """
    try:
        import rainflow
    except ImportError as error:
        raise MissingExtraError(
            "rainflow counting needs the package rainflow: pip install 'swgjoint[life]'"
        ) from error
    first = int(np.abs(history).argmax())
    closed = np.r_[history[first:], history[: first + 1]]
    found = [
        (0.5 * span, mean, count)
        for span, mean, count, _, _ in rainflow.extract_cycles(turning_points(closed))
    ]
    amplitude, mean, count = np.array(found, dtype=float).reshape(-1, 3).T
    return StressCycles(amplitude=amplitude, mean=mean, count=count)


def equivalent_amplitude(amplitude: Array, mean: Array, ultimate: float) -> Array:
    """Amplitude of an equally damaging cycle without mean stress [Pa]. Shape (n,).

    The result is inf where the mean stress reaches the ultimate strength.

    Args:
        amplitude: Amplitudes of cycles [Pa]. Shape (n,).
        mean: Mean stresses [Pa]. Shape (n,).
        ultimate: Ultimate tensile strength [Pa].
    """
    left = 1.0 - np.maximum(mean, 0.0) / ultimate
    return np.where(left > 0.0, amplitude / np.where(left > 0.0, left, 1.0), np.inf)


def goodman_safety(cycles: StressCycles, steel: StressLife) -> float:
    r"""Smallest Goodman safety factor of all cycles; inf without cycles [-].

    .. math:: 1/S = \sigma_a/\sigma_e + \max(\sigma_m, 0)/\sigma_u

    Args:
        cycles: The cycles.
        steel: The steel.
    """
    mean = np.maximum(cycles.mean, 0.0) / steel.ultimate_strength
    use = cycles.amplitude / steel.endurance_limit + mean
    largest = float(use.max(initial=0.0))
    return 1.0 / largest if largest else float("inf")


def miner_damage(cycles: StressCycles, steel: StressLife) -> float:
    """Damage of one repetition of the history; failure is expected at a sum of 1 [-].

    Args:
        cycles: Cycles of one repetition.
        steel: The steel.
    """
    stress = equivalent_amplitude(
        cycles.amplitude, cycles.mean, steel.ultimate_strength
    )
    use = stress / steel.endurance_limit
    with np.errstate(over="ignore"):  # the damage of absurd stresses is inf
        each = np.where(use > 1.0, use**steel.exponent / steel.knee, 0.0)
    return float(cycles.count @ each) if each.any() else 0.0
