"""Deviations of a fitted map from its samples and from equilibria unused in the fit."""

from __future__ import annotations

from math import ceil

import numpy as np

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.samples import FullSolves, MapSamples

PER_CYCLE = 24
"""Angles in a cycle of the fastest harmonic at which the stiffness is sampled."""
MOST_ANGLES = 4000
"""Largest number of these angles."""
MOST_PHASES = 3_000_000
"""Largest number of angles times harmonics."""
ROUND_OFF = 1e-9
"""Cycles per input turn, divided by those of the fastest harmonic, below which a
harmonic counts as constant [-]."""


def residual(drive: DriveMap, samples: MapSamples) -> dict[str, float]:
    """Deviations of a map from the samples to which it was fitted.

    Args:
        drive: The fitted map.
        samples: Its samples.

    Returns:
        Largest deviation of e0 without load [rad], and of the torque at the sampled
        positions inside the knots of the map [N·m].
    """
    own = samples.solved_angles
    theta = np.broadcast_to(samples.input_angle, samples.output_error.shape)[:, own]
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    offset = samples.output_error[zero].mean()
    psi = theta / drive.ratio + samples.output_error[:, own] - offset
    e0, _, _ = drive.error_at(drive.phases(theta, psi))
    x = drive.torsion(theta, psi)
    torque = drive.torque(x, theta, psi)
    inside = (x >= drive.torsion_knots[0]) & (x <= drive.torsion_knots[-1])
    wanted = np.broadcast_to(samples.torque[:, None], x.shape)
    error = samples.output_error[zero, own] - offset
    return {
        "kinematic_error_rad": float(np.abs(e0[zero] - error).max()),
        "torque_Nm": float(np.abs(torque - wanted)[inside].max()),
    }


def against_solves(
    drive: DriveMap, samples: MapSamples, solved: FullSolves
) -> dict[str, dict[str, float]]:
    """Deviations of the map of a toleranced drive from equilibria unused in the fit.

    Args:
        drive: The fitted map.
        samples: Its samples, with tolerances.
        solved: Equilibria that the fit did not use.

    Returns:
        ``residual``: largest deviation of the output error [rad], also relative to the
        peak to peak of the superposed unloaded error over the cycle. ``energy_check``:
        peak to peak of the ripple of the input torque over all equilibria, largest
        deviation of the map from it, and their ratio.
    """
    theta = solved.input_angle
    zero = solved.torque == 0.0
    error = output_angle(drive, theta, solved.torque) - theta / drive.ratio
    wrong = solved.output_error - error
    # the zero of the map is the mean of the unloaded error
    wrong -= wrong[zero].mean()
    tolerances = samples.tolerances
    assert tolerances is not None
    turn = float(
        np.ptp(tolerances.table[0, np.flatnonzero(tolerances.torque == 0.0)[0]])
    )
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
    """Smallest and largest stiffness inside the knots at sampled angles [N·m/rad].

    Input and output turn in the ideal ratio over one cycle of the slowest harmonic,
    :data:`PER_CYCLE` steps in each of the fastest, or fewer with :data:`MOST_ANGLES`
    and :data:`MOST_PHASES`. An equilibrium where the stiffness is not positive would be
    unstable.
    """
    cycles = np.abs(drive.angle_orders @ np.array([1.0, 1.0 / drive.ratio]))
    fastest = max(1.0, float(cycles.max()))
    slowest = cycles[cycles > ROUND_OFF * fastest].min(initial=fastest)
    steps = ceil(PER_CYCLE * fastest / slowest)
    most = min(MOST_ANGLES, MOST_PHASES // len(drive.orders))
    theta = np.linspace(0.0, 2.0 * np.pi / slowest, min(steps, most) + 1)
    phases = drive.phases(theta, theta / drive.ratio)
    waves = np.stack([np.cos(phases), np.sin(phases)])
    # the stiffness is quadratic between breakpoints: its coefficients are summed, not
    # its values, because maps with tooth errors have thousands of harmonics
    second = np.array([2.0, 6.0, 12.0]) * drive.potential[..., 2:]
    c = np.tensordot(second, waves, axes=([1, 0], [0, 2]))  # (n_pieces, 3, n_angles)
    width = np.diff(drive.torsion_knots)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = np.clip(np.nan_to_num(-0.5 * c[:, 1] / c[:, 2]), 0.0, width)
    places = 0.0, width, vertex
    extremes = np.stack([c[:, 0] + d * (c[:, 1] + d * c[:, 2]) for d in places])
    return [float(extremes.min()), float(extremes.max())]


def energy_check(drive: DriveMap, samples: MapSamples) -> dict[str, float]:
    """Deviation of the input torque of a map from the simulated one, unused in the fit.

    Args:
        drive: The fitted map.
        samples: Its samples.

    Returns:
        ``input_torque_pp_Nm``: peak to peak of the simulated ripple, the largest of all
        torques; ``input_torque_error_Nm``: largest deviation of the map from the
        ripple; ``relative``: largest ratio of the deviation to the peak to peak at the
        same torque; ``strain_energy_relative``: largest deviation of the energy gained
        from the unloaded state, relative to the largest gain.
    """
    own = samples.solved_angles
    theta = np.broadcast_to(samples.input_angle, samples.output_error.shape)[:, own]
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    offset = samples.output_error[zero].mean()
    psi = theta / drive.ratio + samples.output_error[:, own] - offset
    on_input, on_output = drive.forces(theta, psi)
    # the ripple is the input torque in excess of the output torque over the ratio
    simulated = samples.input_torque[:, own] - samples.torque[:, None] / drive.ratio
    error = np.abs(-on_input - on_output / drive.ratio - simulated)
    inside = (samples.torque > drive.torque_range[0]) & (
        samples.torque < drive.torque_range[1]
    )
    if samples.solved is not None:
        inside &= samples.solved
    if samples.free:  # exclude the corner at the end of the clearance
        inside[[zero - 2, zero - 1, zero + 1, zero + 2]] = False
    ripple = np.ptp(simulated, axis=1)
    inside &= ripple > 0.0
    energy = drive.energy(drive.torsion(theta, psi), theta, psi)
    gain = (samples.energy - samples.energy[zero])[:, own]
    wrong = (energy - energy[zero]) - gain
    return {
        "input_torque_pp_Nm": float(ripple[inside].max()),
        "input_torque_error_Nm": float(error[inside].max()),
        "relative": float((error[inside].max(axis=1) / ripple[inside]).max()),
        "strain_energy_relative": float(np.abs(wrong).max() / np.abs(gain).max()),
    }
