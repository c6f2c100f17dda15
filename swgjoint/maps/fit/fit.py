r"""Fit of the potential to sampled equilibria.

At every angle the samples provide the potential and its first two derivatives by the
torsion at the sampled torques, which are strain energy, torque and tangent stiffness:

.. math:: V = U(T, \varphi) - \overline{U(0, \varphi)}, \quad
    V' = T, \quad V'' = \left(\frac{d\Delta}{dT}\right)^{-1} .

Quintic Hermite interpolation transfers them to common knots, a Fourier transform over
the angle provides the harmonics, and each harmonic becomes a chain of quartics with
these values at the knots. The fit does not use the simulated input torque. That torque
must follow from the derivative of V, which is an independent check of the fit.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.fit_checks import (
    against_solves,
    energy_check,
    residual,
    stiffness_range,
)
from swgjoint.maps.fit.knots import common_knots
from swgjoint.maps.fit.tolerance_modes import (
    Combined,
    combine_modes,
    register_by_torque,
)
from swgjoint.maps.fit.torsion_table import interpolate_on_knots
from swgjoint.maps.fit.validation import validation
from swgjoint.maps.quartic import quartic_chain
from swgjoint.maps.samples import MapSamples
from swgjoint.typing import Array

KEEP = 0.005
"""A harmonic is kept if its kinematic error, or its input-torque ripple at any load,
reaches this fraction of the largest one."""
NARROW = 0.5
"""Factor of this threshold for samples at unequally spaced angles: many weak harmonics
together follow the corners for which angles were added [-]."""

BETWEEN = (0.05, 0.15, 0.35, 0.65)
"""Additional fractions of the repeated peak torque at which harmonics are compared. The
contact moves with the torque, so other harmonics dominate at other torques."""


def fit_map(samples: MapSamples, *, keep: float = KEEP) -> DriveMap:
    """The map fitted to samples; its ``info`` contains residuals and the energy check.

    Args:
        samples: Equilibria over one period of the pattern, with tolerances or without.
        keep: Threshold for harmonics [-], see :data:`KEEP`; zero keeps all. It is
            multiplied by :data:`NARROW` for samples at unequally spaced angles.
    """
    if samples.tolerances is not None:
        samples = replace(samples, tolerances=register_by_torque(samples))
    knots, pattern = _pattern_harmonics(samples)
    if samples.tolerances is None:
        full = _map_of(samples, knots, pattern)
        fitted, record = _select_harmonics(full, samples, keep)
    else:
        combined = combine_modes(
            samples,
            knots,
            pattern.potential,
            pattern.error,
            keep=keep,
        )
        fitted = _map_of(samples, knots, combined)
        record = _tolerance_record(fitted, samples, combined.record, keep)
    sampled = [float(v) for v in samples.torque[[0, -1]]]
    fitted = fitted.with_parts(
        info={**samples.info, **record, "sampled_torque_Nm": sampled}
    )
    info = {
        **fitted.info,
        "stiffness_range_Nm_rad": stiffness_range(fitted),
        "torque_range_Nm": [float(v) for v in fitted.torque_range],
    }
    unseen = validation(fitted, samples)
    if unseen is not None:
        info["validation"] = unseen
    return fitted.with_parts(info=info)


def _pattern_harmonics(samples: MapSamples) -> tuple[Array, Combined]:
    """Knots [rad] and all harmonics of perfect teeth."""
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    unloaded = samples.output_error[zero]
    e0 = unloaded - unloaded.mean()
    torsion = unloaded - samples.output_error  # (n_torques, n_angles)
    energy = samples.energy - samples.energy[zero].mean()

    knots = common_knots(samples, torsion)
    torque = np.broadcast_to(samples.torque[:, None], torsion.shape)
    curve = np.stack([energy, torque, 1.0 / samples.compliance])
    modes = _modes(interpolate_on_knots(torsion, curve, knots))
    return (
        knots,
        Combined(
            orders=np.arange(len(modes))[:, None] * np.array([samples.order]),
            potential=modes,  # (n_modes, 2, 3, n_knots)
            error=np.concatenate([np.zeros((1, 2)), _modes(e0)[1:]]),
            record={},
        ),
    )


def _map_of(samples: MapSamples, knots: Array, harmonics: Combined) -> DriveMap:
    """The map of these harmonics: chains of quartics with a stable continuation."""
    modes = harmonics.potential
    breaks, pieces = quartic_chain(knots, modes)
    ends = modes[:, :, 2][:, :, [0, -1]]
    _clip_ends(ends, knots, modes[0, 0, 1])
    return DriveMap(
        name=samples.name,
        level=samples.level,
        layout=samples.layout,
        teeth_flexspline=samples.teeth_flexspline,
        teeth_circular_spline=samples.teeth_circular_spline,
        torsion_knots=breaks,
        orders=harmonics.orders,
        potential=pieces,
        end_stiffness=ends,
        kinematic_error=harmonics.error,
        ratings=samples.ratings,
        damping_ratio=samples.damping_ratio,
        fields=samples.fields,
    )


def _select_harmonics(
    full: DriveMap, samples: MapSamples, keep: float
) -> tuple[DriveMap, dict[str, Any]]:
    """The map without its weak harmonics, and the record of the fit."""
    strength = harmonic_strength(full)
    if not np.all(samples.solved_angles):
        keep = keep * NARROW
    kept = np.ones(len(strength), dtype=bool)
    largest = strength[1:].max(axis=0, initial=0.0)
    kept[1:] = (strength[1:] > keep * np.maximum(largest, 1e-300)).any(axis=1)
    fitted = full.with_harmonics(kept)
    return fitted, {
        "harmonics": _describe(full, strength, kept),
        "residual": residual(fitted, samples) | {"threshold": keep},
        "energy_check": energy_check(fitted, samples)
        | {"relative_all_harmonics": energy_check(full, samples)["relative"]},
    }


def _tolerance_record(
    drive: DriveMap, samples: MapSamples, tolerances: dict[str, Any], keep: float
) -> dict[str, Any]:
    """Record of the fit of a toleranced drive, and of the drive with perfect teeth."""
    perfect = fit_map(replace(samples, tolerances=None), keep=keep).info
    strength = harmonic_strength(drive)
    checks: dict[str, dict[str, float]] = {}
    if samples.tolerances is not None and samples.tolerances.solved is not None:
        checks = against_solves(drive, samples, samples.tolerances.solved)
    return checks | {
        "harmonics": _describe(drive, strength, np.ones(len(strength), dtype=bool)),
        "tolerances": tolerances,
        "perfect_teeth": {key: perfect[key] for key in ("residual", "energy_check")},
    }


def _modes(values: Array) -> Array:
    """Cosine and sine amplitudes of values over the first axis. (n_modes, 2, ...).

    The highest mode of an even number of values is omitted because its phase is not
    determined.
    """
    n = len(values)
    spectrum = np.fft.rfft(values, axis=0)[: (n + 1) // 2] / n
    spectrum[1:] *= 2.0
    return np.stack([spectrum.real, -spectrum.imag], axis=1)


def _clip_ends(ends: Array, knots: Array, mean_torque: Array) -> None:
    """Limit the end stiffness in place to be positive and bounded at every angle."""
    secant = (mean_torque[-1] - mean_torque[0]) / (knots[-1] - knots[0])
    ends[0, 0] = np.clip(ends[0, 0], 0.1 * secant, 3.0 * secant)
    swing = np.hypot(ends[1:, 0], ends[1:, 1]).sum(axis=0)
    scale = np.minimum(1.0, 0.5 * ends[0, 0] / np.maximum(swing, 1e-300))
    ends[1:] *= scale


def harmonic_strength(drive: DriveMap) -> Array:
    """Kinematic error [rad] and input-torque ripple [N·m] of each harmonic.

    The first column is the amplitude of e0. The other columns are the amplitude of
    T de0/dtheta + dV/dtheta at zero torque and, with both signs, at rated torque, at
    repeated peak torque and at the fractions :data:`BETWEEN` of the peak. Shape
    (n_harmonics, 14).
    """
    columns = [np.hypot(*drive.kinematic_error.T)]
    n_theta = np.abs(drive.angle_orders[:, 0])
    peak = drive.ratings.repeated_peak
    peaks = (drive.ratings.rated_torque, peak, *(part * peak for part in BETWEEN))
    for load in (0.0, *peaks, *(-peak for peak in peaks)):
        x = drive.mean_torsion(load)
        both = load * drive.kinematic_error + drive.coefficients(x)
        columns.append(n_theta * np.hypot(*both.T))
    return np.stack(columns, axis=-1)


def _describe(
    drive: DriveMap, strength: Array, kept: NDArray[np.bool_]
) -> list[dict[str, Any]]:
    """Order, strength and selection of every harmonic, as JSON values."""
    return [
        {
            "alpha": int(p),
            "beta": int(q),
            "per_input_turn": float(abs(n_theta + n_psi / drive.ratio)),
            "kinematic_error_rad": float(error),
            "input_torque_Nm": float(max(ripple)),
            "kept": bool(keep),
        }
        for (p, q), (n_theta, n_psi), (error, *ripple), keep in zip(
            drive.orders, drive.angle_orders, strength, kept, strict=True
        )
    ]
