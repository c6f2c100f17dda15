"""Harmonics that manufacturing errors of the teeth add to a map.

Along the motion the tooth phases of both members advance together: z_cs alpha and
z_fs beta both change by 2 pi per pitch. One record over the cycle of the teeth
therefore contains all harmonics (p, q). Pairs (p, q) with the same number of waves in
the cycle cannot be distinguished in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from swgjoint.maps.fit.torsion_table import interpolate_on_knots, refine_over_torque
from swgjoint.maps.samples import MapSamples, ToleranceSamples
from swgjoint.typing import Array, Index, Mask

KEEP_TORQUE = 0.05
"""A harmonic of the perfect pattern of a toleranced drive is kept if its input torque
reaches this fraction of the largest one [-]."""
LEFT_OUT = 0.01
"""Largest root mean square of the input torque, and of the output error, that the
harmonics left out contribute at any sampled torque, as a fraction of the peak-to-peak
value there [-]. Random tooth errors spread both over thousands of harmonics of similar
size, and so do the few pitches at which four or five contacts carry the load. In the
reference drive, values of 0.015, 0.01, 0.008 and 0.004 keep 4560, 7269, 8789 and 13469
harmonics, and the output error is off by 2.9, 1.4, 1.0 and 0.9 % (root mean square at
24 positions and the worst torque)."""
ALIKE = 20.0
"""Largest ratio of the compliances of the linearised and the nonlinear drive without
tooth errors [-]. If it is larger, only one of them has clearance at that torque."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ToleranceModes:
    """Harmonics over the tooth cycle: values with tooth errors minus those without."""

    waves: Index
    """Number of waves of each harmonic in the cycle. Shape (n,)."""
    orders: Index
    """Orders (p, q). Shape (n, 2)."""
    potential: Array
    """Cosine and sine amplitudes of V [J], V' [N·m] and V'' [N·m/rad] at the knots.

    Shape (n, 2, 3, n_knots).
    """
    error: Array
    """Cosine and sine amplitudes of e0 [rad]. Shape (n, 2)."""


def tolerance_modes(samples: MapSamples, knots: Array) -> ToleranceModes:
    """All harmonics that tooth errors add over the cycle of the teeth.

    Args:
        samples: Samples whose tolerances are registered by torque.
        knots: Torsion of the knots [rad]. Shape (n_knots,).
    """
    tolerances = samples.tolerances
    assert tolerances is not None
    zero = tolerances.zero

    def tabulated(table: Array) -> Array:
        """Curves at the knots and unloaded error by angle (n_angles, 3 n_knots + 1)."""
        error, energy, compliance = table
        torsion = error[zero] - error
        torque = np.broadcast_to(tolerances.torque[:, None], torsion.shape)
        curve = np.stack([energy, torque, 1.0 / compliance])
        if not tolerances.onsets:
            torsion, curve = refine_over_torque(torsion, curve)
        curve = interpolate_on_knots(torsion, curve, knots)
        # the unloaded error is the last column
        return np.concatenate(
            [curve.reshape(len(curve), -1), error[zero][:, None]], axis=1
        )

    change = tabulated(tolerances.table)
    change -= np.tile(tabulated(tolerances.perfect), (tolerances.pitches, 1))
    spectrum = np.fft.rfft(change, axis=0)[: (len(change) + 1) // 2] / len(change)
    spectrum[1:] *= 2.0
    modes = np.stack([spectrum.real, -spectrum.imag], axis=1)
    waves = np.arange(len(modes))
    return ToleranceModes(
        waves=waves,
        orders=orders_of(waves, samples),
        potential=modes[:, :, :-1].reshape(len(modes), 2, 3, knots.size),
        error=modes[:, :, -1],
    )


def register_by_torque(samples: MapSamples) -> ToleranceSamples:
    """Samples with tooth errors and without, both based on the nonlinear solves.

    Tooth errors are superposed on a linearised drive. Its stiffness differs from that
    of the nonlinear drive, the more so the larger the torque. The changes due to the
    errors are therefore taken at equal torque and added to the nonlinear solves.

    Args:
        samples: Samples with tolerances.

    Returns:
        The samples with both tables changed. They are returned as they are, of the
        linearised drive, if they have a clearance, whose width is then the mean one at
        all angles, or if only the nonlinear solves have it.
    """
    tolerances = samples.tolerances
    assert tolerances is not None
    if tolerances.onsets:
        return tolerances
    torque, shape = samples.torque[:, None], samples.output_error.shape
    # the output error is the derivative of the complementary potential
    curve = np.stack(
        [
            samples.energy + torque * samples.output_error,
            samples.output_error,
            -samples.compliance,
        ]
    )
    at = tolerances.torque
    potential, error, bend = interpolate_on_knots(
        np.broadcast_to(torque, shape), curve, at
    ).transpose(1, 2, 0)
    nonlinear = _at_phases(
        np.stack([error, potential - at[:, None] * error, -bend]), tolerances.phases
    )
    ratio = nonlinear[2] / tolerances.perfect[2]
    if not ((ratio > 1.0 / ALIKE) & (ratio < ALIKE)).all():
        return tolerances
    per_pitch = (3, at.size, tolerances.pitches, tolerances.phases)
    moved = (nonlinear - tolerances.perfect)[:, :, None]
    table = tolerances.table.reshape(per_pitch) + moved
    return replace(
        tolerances, table=table.reshape(tolerances.table.shape), perfect=nonlinear
    )


def _at_phases(values: Array, phases: int) -> Array:
    """Values over a pitch (..., n_angles) at other equal steps (..., phases)."""
    n = values.shape[-1]
    if n % phases == 0:
        return values[..., :: n // phases]
    modes = np.fft.rfft(values)[..., : (n + 1) // 2] / n
    modes[..., 1:] *= 2.0
    turn = 2j * np.pi * np.arange(modes.shape[-1]) / phases
    return np.asarray((modes @ np.exp(np.outer(turn, np.arange(phases)))).real)


def orders_of(waves: Index, samples: MapSamples) -> Index:
    """Orders (p, q) of harmonics from their number of waves in the cycle. Shape (n, 2).

    Each result is the nearest multiple of the tooth order of the perfect pattern plus a
    low order of alpha and beta. Among the low orders with the same number of waves, the
    one with the smallest |p| + |q| is taken.

    Args:
        waves: Number of waves in the cycle. Shape (n,).
        samples: Samples with tolerances.
    """
    tolerances = samples.tolerances
    assert tolerances is not None
    cycle, z_fs, z_cs = (
        tolerances.pitches,
        samples.teeth_flexspline,
        samples.teeth_circular_spline,
    )
    tooth = np.round(waves / cycle).astype(np.int64)
    rest = waves - tooth * cycle
    if cycle % z_fs:  # only the circular spline has errors
        low = np.stack([rest, np.zeros_like(rest)], axis=-1)
    elif cycle % z_cs:  # only the flexspline has errors
        low = np.stack([np.zeros_like(rest), rest], axis=-1)
    else:
        # p a + q b = rest, where a and b have no common factor
        a, b = cycle // z_cs, cycle // z_fs
        first = rest * pow(a, -1, b) % b if b > 1 else np.zeros_like(rest)
        p = first[:, None] + b * np.arange(-a - 1, a + 2)
        q = (rest[:, None] - a * p) // b
        best = (np.abs(p) + np.abs(q)).argmin(axis=1)[:, None]
        low = np.concatenate(
            [np.take_along_axis(p, best, 1), np.take_along_axis(q, best, 1)], axis=1
        )
    pattern = np.array(tolerances.order or samples.order, dtype=np.int64)
    return np.asarray(tooth[:, None] * pattern + np.sign(pattern.sum()) * low)


@dataclass(frozen=True, kw_only=True, eq=False)
class Combined:
    """Harmonics of the perfect pattern and those kept of the tooth errors."""

    orders: Index
    """Orders (p, q), the mean first. Shape (n, 2)."""
    potential: Array
    """Cosine and sine amplitudes of V, V', V'' at the knots, as in
    :class:`ToleranceModes`. Shape (n, 2, 3, n_knots)."""
    error: Array
    """Cosine and sine amplitudes of e0 [rad]. Shape (n, 2)."""
    record: dict[str, Any]
    """Figures of the kept and dropped harmonics; JSON values."""


def combine_modes(
    samples: MapSamples,
    knots: Array,
    potential: Array,
    error: Array,
    *,
    keep: float,
) -> Combined:
    """Harmonics of a toleranced drive: the perfect pattern plus its tooth errors.

    Args:
        samples: Samples with tolerances.
        knots: Torsion of the knots [rad]. Shape (n_knots,).
        potential: Potential of the perfect pattern, as in :class:`Combined`.
        error: Kinematic error of the perfect pattern, as in :class:`Combined`.
        keep: A harmonic is kept if its e0 exceeds this fraction of the largest one [-].
            Further ones are kept until :data:`LEFT_OUT` is met, or those that the
            samples name; zero keeps all of them.
    """
    tolerances, count = samples.tolerances, len(potential)
    assert tolerances is not None
    modes = tolerance_modes(samples, knots)
    cycle = tolerances.pitches
    # harmonics that repeat with every pitch belong to the perfect pattern
    whole = modes.waves[: count * cycle : cycle]
    potential, error = potential.copy(), error.copy()
    potential[: whole.size] += modes.potential[whole]
    error[: whole.size] += modes.error[whole]
    potential[0, 0, 0] -= np.interp(0.0, knots, potential[0, 0, 0])
    error[0] = 0.0
    sampled = modes.waves if tolerances.waves is None else tolerances.waves
    others = np.setdiff1d(sampled, modes.waves[::cycle])
    pattern = np.arange(count)
    # errors may have an order of a pattern that is not that of the teeth
    own = pattern[1:, None] * np.array([samples.order])
    shared = (modes.orders[others][:, None] == own).all(axis=-1)
    for k, wave in zip(
        np.nonzero(shared)[1] + 1, others[shared.any(axis=1)], strict=True
    ):
        potential[k] += modes.potential[wave]
        error[k] += modes.error[wave]
    others = others[~shared.any(axis=1)]
    orders = np.concatenate(
        [pattern[:, None] * np.array([samples.order]), modes.orders[others]]
    )
    potential = np.concatenate([potential, modes.potential[others]])
    error = np.concatenate([error, modes.error[others]])

    # amplitudes of e0 and of the input torque T de0/dtheta + dV/dtheta at every knot
    teeth = pitches_per_turn(samples)
    per_turn = np.concatenate(
        [pattern * abs(sum(samples.order)), others * teeth / cycle]
    )
    work = potential[:, :, 0] + potential[0, 0, 1] * error[:, :, None]
    ripple = per_turn[:, None] * np.hypot(work[:, 0], work[:, 1])
    size = np.hypot(*error.T)
    # only at zero torsion do all positions have a solved torque; elsewhere the
    # interpolation adds noise to the high orders
    ripple = ripple[:, int(np.argmin(np.abs(knots)))]
    kept = size > keep * size.max()
    if keep:
        kept[:count] |= ripple[:count] > KEEP_TORQUE * ripple.max()
        if tolerances.waves is None:
            parts, _ = relative_amplitudes(tolerances, teeth)
            kept[count:] |= ~weakest(parts[others], kept[count:], LEFT_OUT)
        else:  # the samples name the harmonics
            kept[count:] = True
    else:
        kept[:] = True
    kept[0] = True

    def left(power: Array) -> float:
        """Root mean square of the dropped harmonics relative to that of all [-]."""
        return float(np.sqrt(power[~kept].sum() / max(power.sum(), 1e-300)))

    return Combined(
        orders=orders[kept],
        potential=potential[kept],
        error=error[kept],
        record={
            "cycle_pitches": cycle,
            "positions_per_pitch": tolerances.phases,
            "free_positions": tolerances.free,
            "kept": int(kept.sum()),
            "dropped": int((~kept).sum()),
            "dropped_kinematic_error_rms": left(size**2),
            "dropped_error_rms_rad": float(
                np.hypot(np.sqrt(0.5 * np.sum(size[~kept] ** 2)), tolerances.dropped)
            ),
            "dropped_input_torque_rms": left(ripple**2),
            "transmission_error": [
                {"torque_Nm": float(torque), "peak_to_peak_rad": float(np.ptp(row))}
                for torque, row in zip(
                    tolerances.torque, tolerances.table[0], strict=True
                )
            ],
        },
    )


def pitches_per_turn(samples: MapSamples) -> int:
    """Number of pitches of the tolerances per input turn."""
    assert samples.tolerances is not None
    return abs(sum(samples.tolerances.order or samples.order))


def relative_amplitudes(
    tolerances: ToleranceSamples, teeth: int
) -> tuple[Array, Array]:
    """Amplitudes of the harmonics of input torque and output error under load.

    At a constant torque T the ripple of the input torque is the derivative of the
    complementary potential U + T e by theta, where e is the output error. Within a
    clearance, the input torque depends on where the output stands and is not evaluated.

    Args:
        tolerances: Samples over the cycle of the teeth, registered by torque.
        teeth: Number of pitches per input turn.

    Returns:
        Amplitudes as a fraction of the peak-to-peak value at the same torque [-], by
        number of waves in the cycle (n_waves, n_rows), and the peak-to-peak values of
        the input torque [N·m] and the output error [rad] (2, n_torques), NaN where they
        are not evaluated.
    """
    error, energy = tolerances.table[:2]
    torque, count = tolerances.torque[:, None], error.shape[1]
    tables = np.stack([energy + torque * error, error])
    spectra = np.fft.rfft(tables)[..., : (count + 1) // 2]
    spectra[..., 0] = 0.0
    per_turn = np.arange(spectra.shape[-1]) * teeth / tolerances.pitches
    spectra[0] *= 1j * per_turn
    height = np.ptp(np.fft.irfft(spectra, count), axis=-1)
    if tolerances.onsets:
        height[0, tolerances.zero - 1 : tolerances.zero + 2] = np.nan
    rows = height > 0.0
    return 2.0 / count * np.abs(spectra[rows]).T / height[rows], height


def weakest(parts: Array, kept: Mask, most: float) -> Mask:
    """Mask of the weakest harmonics, which may be left out together (n,).

    Args:
        parts: Relative amplitudes of the harmonics (n, n_rows) [-].
        kept: Mask of harmonics that are kept in any case (n,).
        most: Largest root mean square of those left out in any row [-].
    """
    order = np.argsort(np.where(kept, np.inf, parts.max(axis=1)), kind="stable")
    power = 0.5 * np.cumsum(parts[order] ** 2, axis=0)
    out = np.zeros(len(parts), dtype=bool)
    out[order] = (power <= most**2).all(axis=1)
    return out & ~kept
