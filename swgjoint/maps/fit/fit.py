r"""Fit of the potential to sampled equilibria.

At every angle the samples give the potential and its first two derivatives by the
torsion at the sampled torques (strain energy, torque and tangent stiffness):

.. math:: V = U(T, \varphi) - \overline{U(0, \varphi)}, \quad
    V' = T, \quad V'' = \left(\frac{d\Delta}{dT}\right)^{-1} .

Quintic Hermite interpolation transfers them to common knots, a Fourier transform over
the angle gives the harmonics, and each harmonic becomes a chain of quartics with these
values at the knots. The fit does not use the simulated input torque, which must follow
as the derivative of V.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.tolerance_modes import combine_modes
from swgjoint.maps.fit.torsion_table import interpolate_on_knots
from swgjoint.maps.fit.validation import validation
from swgjoint.maps.quartic import quartic_chain
from swgjoint.maps.samples import FullSolves, MapSamples, ToleranceSamples
from swgjoint.typing import Array

KEEP = 0.005
"""A harmonic is kept if its kinematic error, or its input-torque ripple at any load,
reaches this fraction of the largest one."""

BETWEEN = (0.05, 0.15, 0.35, 0.65)
"""Additional fractions of the repeated peak torque at which harmonics are weighed;
contact moves with the torque, so each torque has other harmonics."""

END_STEPS = 6
"""Newton steps to the torsion at which the mean torque equals the largest one."""
LADDER = 12
"""Largest number of knots across the end of a clearance."""


def fit_map(samples: MapSamples, *, keep: float = KEEP) -> DriveMap:
    """Fit the potential map; its ``info`` contains residuals and the energy check.

    Args:
        samples: Equilibria over one period.
        keep: Threshold for harmonics, see :data:`KEEP`; zero keeps all.
    """
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    unloaded = samples.output_error[zero]
    e0 = unloaded - unloaded.mean()
    torsion = unloaded - samples.output_error  # (n_torques, n_angles)
    energy = samples.energy - samples.energy[zero].mean()

    knots = _knots(samples, torsion)
    torque = np.broadcast_to(samples.torque[:, None], torsion.shape)
    curve = np.stack([energy, torque, 1.0 / samples.compliance])
    modes = _modes(
        interpolate_on_knots(torsion, curve, knots)
    )  # (n_modes, 2, 3, n_knots)
    error_modes = np.concatenate([np.zeros((1, 2)), _modes(e0)[1:]])
    orders = np.arange(len(modes))[:, None] * np.array([samples.order])
    toleranced = None
    if samples.tolerances is not None:
        toleranced = combine_modes(
            samples, knots, modes, error_modes, coarse=_coarse(samples), keep=keep
        )
        orders, modes = toleranced.orders, toleranced.potential
        error_modes = toleranced.error
    count = len(modes)
    chains = [
        [quartic_chain(knots, modes[k, c]) for c in range(2)] for k in range(count)
    ]
    breaks = chains[0][0][0]
    potential = np.array([[chain[1] for chain in pair] for pair in chains])
    ends = modes[:, :, 2][:, :, [0, -1]]
    _clip_ends(ends, knots, modes[0, 0, 1])

    full = DriveMap(
        name=samples.name,
        level=samples.level,
        layout=samples.layout,
        teeth_flexspline=samples.teeth_flexspline,
        teeth_circular_spline=samples.teeth_circular_spline,
        torsion_knots=breaks,
        orders=orders,
        potential=potential,
        end_stiffness=ends,
        kinematic_error=error_modes,
        ratings=samples.ratings,
        damping_ratio=samples.damping_ratio,
        fields=samples.fields,
    )
    info = dict(samples.info)
    if toleranced is not None:
        perfect = fit_map(replace(samples, tolerances=None), keep=keep).info
        strength = harmonic_strength(full)
        checks: dict[str, dict[str, float]] = {}
        if samples.tolerances is not None and samples.tolerances.solved is not None:
            checks = against_solves(full, samples, samples.tolerances.solved)
        info |= checks | {
            "harmonics": _describe(full, strength, np.ones(count, dtype=bool)),
            "tolerances": toleranced.record,
            "perfect_teeth": {
                key: perfect[key] for key in ("residual", "energy_check")
            },
        }
        fitted = full
    else:
        strength = harmonic_strength(full)
        kept = np.ones(count, dtype=bool)
        largest = strength[1:].max(axis=0, initial=0.0)
        kept[1:] = (strength[1:] > keep * np.maximum(largest, 1e-300)).any(axis=1)
        fitted = full.with_harmonics(kept)
        info |= {
            "harmonics": _describe(full, strength, kept),
            "residual": residual(fitted, samples) | {"threshold": keep},
            "energy_check": energy_check(fitted, samples)
            | {"relative_all_harmonics": energy_check(full, samples)["relative"]},
        }
    info |= {
        "stiffness_range_Nm_rad": stiffness_range(fitted),
        "torque_range_Nm": [float(v) for v in fitted.torque_range],
        "sampled_torque_Nm": [float(v) for v in samples.torque[[0, -1]]],
    }
    record = validation(fitted, samples)
    if record is not None:
        info["validation"] = record
    return replace(fitted, info=info)


def _knots(samples: MapSamples, torsion: Array) -> Array:
    """Torsions at which the curves of all angles are compared [rad]."""
    zero = at = int(np.flatnonzero(samples.torque == 0.0)[0])
    found = samples.tolerances
    if found is None:
        # the mean torsions, ends inside the sampled range of every angle
        knots = torsion.mean(axis=1)
        knots[0], knots[-1] = torsion[0].max(), torsion[-1].min()
        # stiff angles may end before the mean torsion of a torque close to the last one
        least = 0.3 * np.abs(np.diff(torsion.mean(axis=1))[[0, -1]])
        inside = (knots > knots[0] + least[0]) & (knots < knots[-1] - least[1])
        inside[[0, -1]] = True
        at -= int((~inside[:zero]).sum())
        knots = knots[inside]
    else:
        # with tooth errors the stiffness varies so much that stiff positions would end
        # the range far below the largest torque: their curves are continued instead
        error = found.table[0]
        rest = error[int(np.flatnonzero(found.torque == 0.0)[0])]
        mean = PchipInterpolator(found.torque, (rest - error).mean(axis=1))
        ends = found.torque[[0, -1]]
        knots = mean(np.clip(samples.torque, *ends))
        _end_at_largest_torque(knots, found, rest - error)
    knots[at] = 0.0
    if found is None and samples.free:
        up = _clearance_knots(knots[at + 3 :], torsion[zero + 1 : zero + 3])
        down = _clearance_knots(-knots[: at - 2][::-1], -torsion[zero - 2 : zero][::-1])
        knots = np.concatenate([-down[::-1], [0.0], up])
    return np.asarray(knots)


def _end_at_largest_torque(
    knots: Array, found: ToleranceSamples, torsion: Array
) -> None:
    """Scale the knots of each sign to end at the largest sampled mean torque.

    Stiff positions are continued up to there and raise the mean at the mean torsion.
    """
    torque = np.broadcast_to(found.torque[:, None], torsion.shape)
    curve = np.stack([found.table[1], torque, 1.0 / found.table[2]])
    for end, sign in ((0, -1.0), (-1, 1.0)):
        last = knots[[end]].copy()
        for _ in range(END_STEPS):
            _, reached, slope = interpolate_on_knots(torsion, curve, last).mean(axis=0)
            last += (found.torque[end] - reached) / slope
        side = knots * sign > 0.0
        knots[side] *= last / knots[end]


def _coarse(samples: MapSamples) -> NDArray[np.bool_]:
    """Mask of the knots at which tooth errors, sampled at few torques, are compared."""
    assert samples.solved is not None
    coarse = np.array(samples.solved)
    if samples.free:  # the ends of the clearance
        zero = int(np.flatnonzero(samples.torque == 0.0)[0])
        coarse[zero - 2 : zero + 3] = True
    coarse[[0, -1]] = True
    return coarse


def _clearance_knots(beyond: Array, ends: Array) -> Array:
    """Knots of one side with a ladder across the end of the clearance.

    The end varies with the angle by more than the elastic torsion of a stiff drive. The
    ladder spans from the torsion where no angle has left the clearance to the one where
    all have left it, in steps of the transition of a single angle.

    Args:
        beyond: Usual knots, from the first torque after the one that takes up the
            clearance [rad]. Shape (n,).
        ends: Torsion at the end of the clearance and where the clearance is taken up
            [rad]. Shape (2, n_angles).
    """
    first, last = float(ends[0].min()), float(ends[1].max())
    step = float((ends[1] - ends[0]).mean())
    count = min(LADDER, int(np.ceil((last - first) / step)))
    ladder = np.linspace(first, last, count + 1)
    kept = beyond[beyond > last + 0.5 * (ladder[1] - ladder[0])]
    return np.concatenate([ladder, kept])


def _modes(values: Array) -> Array:
    """Cosine and sine amplitudes over the first axis. (n_modes, 2, ...).

    The highest mode of an even count is omitted because its phase is not determined.
    """
    n = len(values)
    spectrum = np.fft.rfft(values, axis=0)[: (n + 1) // 2] / n
    spectrum[1:] *= 2.0
    return np.stack([spectrum.real, -spectrum.imag], axis=1)


def _clip_ends(ends: Array, knots: Array, mean_torque: Array) -> None:
    """Keep the continuation stable: a positive, bounded slope at every angle."""
    secant = (mean_torque[-1] - mean_torque[0]) / (knots[-1] - knots[0])
    ends[0, 0] = np.clip(ends[0, 0], 0.1 * secant, 3.0 * secant)
    swing = np.hypot(ends[1:, 0], ends[1:, 1]).sum(axis=0)
    scale = np.minimum(1.0, 0.5 * ends[0, 0] / np.maximum(swing, 1e-300))
    ends[1:] *= scale


def harmonic_strength(drive: DriveMap) -> Array:
    """Kinematic error [rad] and input-torque ripple [N·m] of each harmonic.

    The ripple is the amplitude of T de0/dtheta + dV/dtheta, at zero, rated and repeated
    peak torque and the fractions :data:`BETWEEN` of the peak, with both signs. Shape
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


def residual(drive: DriveMap, samples: MapSamples) -> dict[str, float]:
    """Deviations of the map from the samples it was fitted to.

    Args:
        drive: The fitted map.
        samples: Its samples.

    Returns:
        Largest deviation of e0 [rad] and of the torque at the sampled positions [N·m],
        inside the range of the map.
    """
    theta = np.broadcast_to(samples.input_angle, samples.output_error.shape)
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    offset = samples.output_error[zero].mean()
    psi = theta / drive.ratio + samples.output_error - offset
    e0, _, _ = drive.error_at(drive.phases(theta, psi))
    x = drive.torsion(theta, psi)
    torque = drive.torque(x, theta, psi)
    inside = (x >= drive.torsion_knots[0]) & (x <= drive.torsion_knots[-1])
    wanted = np.broadcast_to(samples.torque[:, None], x.shape)
    error = samples.output_error[zero] - offset
    return {
        "kinematic_error_rad": float(np.abs(e0[zero] - error).max()),
        "torque_Nm": float(np.abs(torque - wanted)[inside].max()),
    }


def against_solves(
    drive: DriveMap, samples: MapSamples, solved: FullSolves
) -> dict[str, dict[str, float]]:
    """Deviations of the map of a toleranced drive from unseen equilibria.

    Args:
        drive: The fitted map.
        samples: Its samples, with tolerances.
        solved: Equilibria that the fit did not use.

    Returns:
        ``residual``: largest deviation of the output error [rad], and the same relative
        to the peak to peak of the superposition over the cycle. ``energy_check``: as
        :func:`energy_check`, at the solved torques.
    """
    theta = solved.input_angle
    zero = solved.torque == 0.0
    error = output_angle(drive, theta, solved.torque) - theta / drive.ratio
    wrong = solved.output_error - error
    # the map has its zero at the mean of the unloaded error
    wrong -= wrong[zero].mean()
    found = samples.tolerances
    assert found is not None
    turn = float(np.ptp(found.table[0, np.flatnonzero(found.torque == 0.0)[0]]))
    psi = theta / drive.ratio + error
    on_input, on_output = drive.forces(theta, psi)
    simulated = solved.input_torque - solved.torque / drive.ratio
    ripple = -on_input - on_output / drive.ratio
    missed = float(np.abs(ripple - simulated).max())
    spread = float(np.ptp(simulated))
    return {
        "residual": {
            "output_error_rad": float(np.abs(wrong).max()),
            "relative_to_turn": float(np.abs(wrong).max() / turn),
        },
        "energy_check": {
            "input_torque_pp_Nm": spread,
            "input_torque_error_Nm": missed,
            "relative": missed / spread,
        },
    }


def stiffness_range(drive: DriveMap) -> list[float]:
    """Smallest and largest stiffness over torsion and angle [N·m/rad].

    A stiffness that is not positive would make an equilibrium unstable.
    """
    knots = drive.torsion_knots
    x = np.linspace(knots[0], knots[-1], 12 * knots.size)[:, None]
    theta = np.linspace(0.0, 2.0 * np.pi / max(1, drive.orders.max()), 97)
    stiffness = drive.stiffness(x, theta, theta / drive.ratio)
    return [float(stiffness.min()), float(stiffness.max())]


def energy_check(drive: DriveMap, samples: MapSamples) -> dict[str, float]:
    """Deviation of the map's input torque from the simulated one, unused in the fit.

    Args:
        drive: The fitted map.
        samples: Its samples.

    Returns:
        ``input_torque_pp_Nm``: largest peak-to-peak of the simulated ripple over the
        torques; ``input_torque_error_Nm``: largest deviation of the map from it;
        ``relative``: their ratio; ``strain_energy_relative``: largest deviation of the
        energy gain over no load, relative to the largest gain.
    """
    theta = np.broadcast_to(samples.input_angle, samples.output_error.shape)
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    psi = theta / drive.ratio + samples.output_error - samples.output_error[zero].mean()
    on_input, on_output = drive.forces(theta, psi)
    # the ripple is what the input feels beyond the output's torque over the ratio
    simulated = samples.input_torque - samples.torque[:, None] / drive.ratio
    error = np.abs(-on_input - on_output / drive.ratio - simulated)
    inside = (samples.torque > drive.torque_range[0]) & (
        samples.torque < drive.torque_range[1]
    )
    if samples.solved is not None:
        inside &= samples.solved
    if samples.free:  # the corner at the end of the clearance
        inside[[zero - 2, zero - 1, zero + 1, zero + 2]] = False
    ripple = np.ptp(samples.input_torque, axis=1)
    inside &= ripple > 0.0
    energy = drive.energy(drive.torsion(theta, psi), theta, psi)
    gain = samples.energy - samples.energy[zero]
    wrong = (energy - energy[zero]) - gain
    return {
        "input_torque_pp_Nm": float(ripple[inside].max()),
        "input_torque_error_Nm": float(error[inside].max()),
        "relative": float((error[inside].max(axis=1) / ripple[inside]).max()),
        "strain_energy_relative": float(np.abs(wrong).max() / np.abs(gain).max()),
    }


def _describe(
    drive: DriveMap, strength: Array, kept: NDArray[np.bool_]
) -> list[dict[str, Any]]:
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
