"""One output turn of a map: transmission error, ripple and order spectrum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, gcd, pi
from types import MappingProxyType

import numpy as np

from swgjoint.arrays import frozen_array
from swgjoint.errors import ComputationError
from swgjoint.maps.ideal_motion import IdealMotion
from swgjoint.maps.potential import Potential
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array

PER_WAVE = 16
"""Samples per shortest strong wave. With a parabola through each extreme, the peak to
peak is then accurate to 0.1 %."""
STRONG = 0.1
"""A wave is strong if it reaches this fraction of the largest one [-]. For the same
error of the peak to peak, weaker waves need fewer samples, in proportion to the square
root of their size."""
AT_LEAST_PER_WAVE = 4
"""Smallest number of samples per shortest wave, strong or not, to avoid aliasing."""
AT_LEAST = 64
"""Smallest number of samples per period."""
CHUNK = 256
"""Number of positions evaluated at once in a period of more than :data:`WHOLE`."""
WHOLE = 500_000
"""Largest number of positions of a period that are evaluated at once, by Fourier
transforms. Each takes 80 bytes for its coefficients, and 120 for its sums in every
interval of the torsion that occurs, usually two to five of them."""
MAX_SAMPLES = 10_000_000
"""Largest number of samples per period."""
FEW, SLOW, FAST = 4096, 64, 7
"""A number of more than ``FEW`` samples per period with a prime factor above ``SLOW``
is raised to one without factors above ``FAST``, because its Fourier transforms take
several times as long."""
LINES = 12
"""Largest number of orders that a sheet lists for each signal."""
FLOOR = 1e-3
"""Lines below this fraction of the strongest one of a signal are omitted [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """A periodic signal of the gear, sampled over its period.

    The period is one cycle of the pattern if the pattern depends only on the input
    angle. Otherwise all members have returned to their initial positions after it.
    """

    period_turns: Fraction
    """Length of the period [input turns]."""
    turns: float
    """Input turns per output turn [-]."""
    signal: Array
    """Signal at equal steps over the period, its end excluded. Shape (n,)."""

    def __post_init__(self) -> None:
        signal = frozen_array(self.signal, "signal", ndim=1)
        object.__setattr__(self, "signal", signal)

    def output_turn(self) -> tuple[Array, Array]:
        """Input angle [rad] and signal over one output turn, both ends included."""
        n = self.signal.size
        step = 2.0 * pi * float(self.period_turns) / n
        index = np.arange(round(2.0 * pi * self.turns / step) + 1)
        return np.asarray(index * step, dtype=np.float64), self.signal[index % n]

    def peak_to_peak(self) -> float:
        """Largest minus smallest value over one output turn, also between samples."""
        n = self.signal.size
        step = float(self.period_turns) / n
        turn = self.signal[: min(n, round(self.turns / step) + 1)]
        # with one more sample at each end, extremes at the ends have two neighbours
        closed = np.concatenate([self.signal[-1:], turn, [self.signal[turn.size % n]]])
        return _peak(closed) + _peak(-closed)

    def rms(self) -> float:
        """Root mean square about the mean, over the period."""
        return float(np.std(self.signal))

    def lines(self) -> tuple[Array, Array]:
        """Orders per input turn and zero-to-peak amplitudes, without the mean."""
        amplitude = 2.0 * np.abs(np.fft.rfft(self.signal)) / self.signal.size
        order = np.arange(amplitude.size) / float(self.period_turns)
        return order[1:], amplitude[1:]


def _peak(values: Array) -> float:
    """Largest value, interpolated by a parabola through it and its neighbours."""
    k = int(np.argmax(values[1:-1])) + 1
    a, b, c = (float(v) for v in values[k - 1 : k + 2])
    bend = a - 2.0 * b + c
    return b if bend >= 0.0 else b - (a - c) ** 2 / (8.0 * bend)


def period_of(drive: Potential) -> tuple[Fraction, int]:
    """Period of the pattern of a map [input turns] and number of samples to resolve it.

    Raises:
        ComputationError: If more than :data:`MAX_SAMPLES` would be needed.
    """
    n_theta, n_psi = drive.angle_orders.T
    # the exact ratio gives the input turns in which the output makes whole turns
    ratio = Fraction(drive.ratio).limit_denominator(drive.teeth_circular_spline)
    if not n_psi.any():
        period = Fraction(1, gcd(*(int(n) for n in n_theta)) or 1)
    else:
        period = Fraction(abs(ratio.numerator))
    orders = np.abs(n_theta + n_psi / drive.ratio)
    size = _strengths(drive)
    strong = STRONG * max(float(size.max(initial=0.0)), 1e-300)
    share = np.sqrt(np.minimum(size / strong, 1.0))
    per_wave = np.maximum(PER_WAVE * share, AT_LEAST_PER_WAVE)
    waves = float((per_wave * orders).max())
    samples = ceil(max(AT_LEAST, float(waves * period)))
    if samples > MAX_SAMPLES:
        raise ComputationError(
            f"map {drive.name!r}: orders to {orders.max():g} per input turn over"
            f" {float(period):g} turns need {samples} samples; accepted: up to"
            f" {MAX_SAMPLES}; remove the highest harmonics"
        )
    if samples > FEW and _largest_factor(samples) > SLOW:
        while _largest_factor(samples) > FAST:
            samples += 1
    return period, samples


def _largest_factor(number: int) -> int:
    """Largest prime factor of a number above one.

    >>> [_largest_factor(n) for n in (2, 15, 47_599, 47_600)]
    [2, 5, 47599, 17]
    """
    factor = 2
    while factor * factor <= number:
        if number % factor:
            factor += 1
        else:
            number //= factor
    return number


def _strengths(drive: Potential) -> Array:
    """Error of each harmonic plus torsion due to its torque [rad]. (n_harmonics,)."""
    size = np.hypot(*drive.kinematic_error.T)
    torsions = [drive.mean_torsion(s * drive.ratings.rated_torque) for s in (-1, 0, 1)]
    torque = np.hypot(*np.moveaxis(drive.coefficients(torsions, 1), -1, 0))
    energy = np.hypot(*np.moveaxis(drive.coefficients(torsions), -1, 0))
    torque = torque + np.abs(drive.angle_orders[:, 1]) * energy
    torque[:, 0] = 0.0  # the mean is not a wave
    return np.asarray(size + torque.max(axis=0) / drive.mean_stiffness)


def _input_angles(drive: Potential) -> tuple[Fraction, Array]:
    """Period of the pattern [input turns] and the input angles that sample it [rad]."""
    period, samples = period_of(drive)
    return period, 2.0 * pi * float(period) * np.arange(samples) / samples


def error_turn(drive: Potential, torque: float = 0.0) -> Turn:
    """Transmission error psi - theta/i [rad] at constant output torque [N·m].

    The motion is slow and in one direction. Without load this is the kinematic error
    plus the small torsion due to the cogging of the unloaded drive.

    Args:
        drive: The map.
        torque: Output torque [N·m].
    """
    return measure_turns(drive, {"error": torque})["error"]


def ripple_turn(drive: Potential, torque: float) -> Turn:
    """Output torque with the output held on its ideal motion [N·m].

    The output angle is theta/i minus the mean torsion at the given torque: the output
    follows the ratio exactly, as with a stiff load that turns at constant speed.

    Args:
        drive: The map.
        torque: Output torque that sets the mean torsion [N·m].
    """
    return measure_turns(drive, ripple={"ripple": torque})["ripple"]


def measure_turns(
    drive: Potential,
    error: Mapping[str, float] = MappingProxyType({}),
    ripple: Mapping[str, float] = MappingProxyType({}),
    progress: Progress = silent,
) -> dict[str, Turn]:
    """Several signals of one output turn, for which the harmonics are summed once.

    Args:
        drive: The map.
        error: Output torques [N·m] of the signals of :func:`error_turn`, by key.
        ripple: Output torques [N·m] of the signals of :func:`ripple_turn`, by key.
        progress: Called with the number of finished positions and their total.
    """
    period, theta = _input_angles(drive)
    signals = {key: np.empty(theta.size) for key in (*error, *ripple)}
    # signals at the same torque share the sums about its mean torsion
    torques = {*error.values(), *ripple.values()}
    lags = {t: drive.mean_torsion(t) if t else 0.0 for t in sorted(torques)}
    name = f"{drive.name}: output turn"
    progress(name, 0, theta.size)
    whole = theta.size <= WHOLE
    size = theta.size if whole else CHUNK
    for k in range(0, theta.size, size):
        part = slice(k, k + size)
        ideal = theta[part] / drive.ratio
        for torque, lag in lags.items():
            at = (
                IdealMotion.over_period(drive, float(period), theta.size, lag)
                if whole
                else IdealMotion.from_map(drive, theta[part], ideal - lag)
            )
            for key in (key for key in error if error[key] == torque):
                signals[key][part] = at.output_angle(torque) - ideal
            for key in (key for key in ripple if ripple[key] == torque):
                signals[key][part] = at.torque(np.zeros(at.theta.shape))[0]
        progress(name, min(k + size, theta.size), theta.size)
    return {
        key: Turn(period_turns=period, turns=abs(drive.ratio), signal=signal)
        for key, signal in signals.items()
    }


def strongest_orders(turns: dict[str, Turn]) -> list[dict[str, float]]:
    """Spectral lines of several signals of one drive.

    Args:
        turns: Signals by key, in the units of the result.

    Returns:
        At most :data:`LINES` lines per signal, the strongest of the first signal first:
        ``order`` per input turn and the zero-to-peak amplitude of every signal there.
    """
    spectra = {key: turn.lines() for key, turn in turns.items()}
    lines: dict[int, None] = {}
    for _, amplitude in spectra.values():
        largest = float(amplitude.max(initial=0.0))
        for k in np.argsort(amplitude)[::-1][:LINES]:
            if amplitude[k] > FLOOR * largest and largest > 0.0:
                lines[int(k)] = None
    order = next(iter(spectra.values()))[0]
    return [
        {"order": float(order[k])}
        | {key: float(amplitude[k]) for key, (_, amplitude) in spectra.items()}
        for k in lines
    ]
