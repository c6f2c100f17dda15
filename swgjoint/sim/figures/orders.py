r"""Order analysis: spectral lines in cycles per turn of the wave generator.

The signal is resampled at equal steps of the input angle, and a cubic trend is removed.
The lines are then found one by one in a Hann-windowed spectrum, strongest first. Their
amplitudes result from one least-squares fit of all lines and the trend,

.. math:: x(\theta) = \sum_{j<4} c_j \theta^j
    + \sum_k a_k \cos(n_k \theta) + b_k \sin(n_k \theta),

so they are reduced neither by the window nor by an order between two bins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.typing import Array

TREND_DEGREE = 3
"""Degree of the polynomial trend in the input angle."""
PADDING = 8
"""Smallest factor by which zero padding extends the record."""
SKIRT = 4.0
"""Smallest distance between the orders of two lines, times the number of input turns of
the record. It is twice the half width of the main lobe of the Hann window, because the
amplitude of a line varies along a motion, which widens the line."""


@dataclass(frozen=True, kw_only=True)
class OrderLine:
    """One line of an order spectrum."""

    order: float
    """Cycles per turn of the wave generator."""
    amplitude: float
    """Zero-to-peak amplitude in the unit of the signal."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderSpectrum:
    """Hann-windowed amplitude spectrum over order, for plots."""

    order: Array
    """Cycles per turn of the wave generator. Shape (n,)."""
    amplitude: Array
    """Zero-to-peak amplitude of a single line at that order, in the unit of the signal.
    Shape (n,)."""


def resample(angle: Array, signal: Array) -> tuple[Array, Array] | None:
    """Resample a signal at equal steps of the angle.

    Args:
        angle: Input angle [rad], monotonic except for small vibration. Shape (n,).
        signal: Signal in any unit. Shape (n,).

    Returns:
        Angle from zero [rad] and signal, both of shape (n,). None if there are fewer
        than 16 samples, or if the angle covers less than half a turn or decreases too
        often.
    """
    from scipy.interpolate import CubicSpline

    travel = (angle - angle[0]) * np.sign(angle[-1] - angle[0])
    if travel.size < 16 or travel[-1] < np.pi:
        return None
    # keep new maxima of the angle only: if the drive vibrates, the signal would
    # otherwise not be a function of the angle
    keep = np.concatenate([[True], travel[1:] > np.maximum.accumulate(travel)[:-1]])
    if keep.mean() < 0.5:
        return None
    grid = np.linspace(0.0, travel[-1], travel.size)
    return grid, np.asarray(CubicSpline(travel[keep], signal[keep])(grid))


def order_spectrum(angle: Array, signal: Array) -> OrderSpectrum | None:
    """Amplitude spectrum over orders of the input angle.

    Args:
        angle: Input angle [rad]. Shape (n,).
        signal: Signal in any unit. Shape (n,).

    Returns:
        The spectrum; None where :func:`resample` returns None.
    """
    even = resample(angle, signal)
    return None if even is None else _spectrum(even[0], _detrend(*even))


def strongest_lines(
    angle: Array,
    signal: Array,
    *,
    highest: float,
    count: int = 3,
    floor: float = 0.0,
) -> tuple[OrderLine, ...]:
    """The strongest spectral lines of a signal, strongest first.

    Args:
        angle: Input angle [rad]. Shape (n,).
        signal: Signal in any unit. Shape (n,).
        highest: Highest order to search, usually the highest that the step resolves.
        count: Largest number of lines.
        floor: Amplitude up to which lines count as noise, in the unit of the signal.

    Returns:
        At most ``count`` lines; none where :func:`resample` returns None. Orders below
        one half or below two cycles per record belong to the trend.
    """
    even = resample(angle, signal)
    if even is None:
        return ()
    grid, values = even
    turns = grid[-1] / (2.0 * np.pi)
    lowest = lowest_order(turns)
    orders: list[float] = []
    residual, amplitudes = _fit(grid, values, orders)
    while len(orders) < count:
        spectrum = _spectrum(grid, residual)
        allowed = (spectrum.order >= lowest) & (spectrum.order <= highest)
        for known in orders:  # exclude the skirts of known lines
            allowed &= np.abs(spectrum.order - known) > SKIRT / turns
        if not allowed.any():
            break
        peak = int(np.argmax(np.where(allowed, spectrum.amplitude, -1.0)))
        if spectrum.amplitude[peak] <= floor:
            break
        orders.append(_refine(spectrum, peak))
        residual, amplitudes = _fit(grid, values, orders)
    lines = [
        OrderLine(order=order, amplitude=float(amplitude))
        for order, amplitude in zip(orders, amplitudes, strict=True)
        if amplitude > floor
    ]
    return tuple(sorted(lines, key=lambda line: -line.amplitude))


def lowest_order(turns: float) -> float:
    """Lowest order that lines of a record can have; slower waves belong to the trend.

    Args:
        turns: Input turns of the record.
    """
    return max(0.5, 2.0 / turns) if turns > 0.0 else float("inf")


def _detrend(grid: Array, values: Array) -> Array:
    """Signal without its cubic trend."""
    return _fit(grid, values, [])[0]


def _fit(grid: Array, values: Array, orders: list[float]) -> tuple[Array, Array]:
    """Residual of the joint fit of trend and lines, and amplitudes of the lines."""
    x = 2.0 * grid / grid[-1] - 1.0
    columns = [np.polynomial.legendre.legvander(x, TREND_DEGREE)]
    for order in orders:
        columns += [np.cos(order * grid)[:, None], np.sin(order * grid)[:, None]]
    basis = np.hstack(columns)
    # normal equations suffice for few, well-conditioned columns, and are ten times
    # faster than lstsq of the basis
    weights = np.linalg.lstsq(basis.T @ basis, basis.T @ values, rcond=1e-12)[0]
    pairs = weights[TREND_DEGREE + 1 :].reshape(-1, 2)
    return values - basis @ weights, np.hypot(pairs[:, 0], pairs[:, 1])


def _spectrum(grid: Array, values: Array) -> OrderSpectrum:
    """Hann-windowed, zero-padded amplitude spectrum over orders."""
    window = np.hanning(values.size)
    size = int(2 ** np.ceil(np.log2(PADDING * values.size)))
    amplitude = 2.0 * np.abs(np.fft.rfft(window * values, size)) / window.sum()
    step = grid[1] - grid[0]
    return OrderSpectrum(
        order=2.0 * np.pi * np.fft.rfftfreq(size, step), amplitude=amplitude
    )


def _refine(spectrum: OrderSpectrum, peak: int) -> float:
    """Order of a peak between the bins, by a parabola through the log amplitude."""
    if peak == 0 or peak == spectrum.order.size - 1:
        return float(spectrum.order[peak])
    near = np.log(np.maximum(spectrum.amplitude[peak - 1 : peak + 2], 1e-300))
    bend = near[0] - 2.0 * near[1] + near[2]
    shift = 0.5 * (near[0] - near[2]) / bend if bend < 0.0 else 0.0
    spacing = spectrum.order[1] - spectrum.order[0]
    return float(spectrum.order[peak] + np.clip(shift, -0.5, 0.5) * spacing)
