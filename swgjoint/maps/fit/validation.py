"""Validation record of a map: its differences from equilibria that the fit did not use.

:mod:`swgjoint.maps.sheet.map_validity` reads the record.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.sample_curves import curves_at, input_torque_at
from swgjoint.maps.fit.tolerance_modes import pitches_per_turn, relative_amplitudes
from swgjoint.maps.potential import Potential
from swgjoint.maps.samples import FullSolves, MapSamples
from swgjoint.maps.sheet.map_validity import QUANTITIES, STIFFNESS, UNITS
from swgjoint.typing import Array

EXTREME = 2.5
"""Assumed ratio of the largest of many differences to their root mean square [-].

It is sqrt(2 ln n) for n = 24 independent normal differences, about the number of
positions in a pitch at which a map may deviate. For 14 of 22 records of six designs,
the estimate with this ratio is 0.7 to 1.5 times the largest difference at other
equilibria. The largest difference of the record itself is within these limits for 12.
"""


def validation(drive: Potential, samples: MapSamples) -> dict[str, Any] | None:
    """Record of the differences between a map and equilibria unused in its fit.

    Differences of input torque and output error are relative to their peak to peak in
    the finite elements at the same torque, over the samples and the unused (unseen)
    equilibria together. With tooth errors the unseen equilibria are a few full solves
    of the toleranced drive, and the superposed values over the whole cycle replace the
    samples.

    ``largest`` is the largest difference at the torques and angles of all these
    equilibria, at ``at_Nm`` and ``input_angle_rad``. Among them are those at which the
    map is likely to be least accurate (``samples.worst``); they are left out of
    ``rms``. Without them, ``largest`` is the largest difference at a few angles of each
    torque, and ``expected`` estimates the largest one at more angles: :data:`EXTREME`
    times the root mean square at the worst torque, which scatters less. With tooth
    errors it is at least ``largest``, because half of the positions are those where the
    drive is softest, see :mod:`swgjoint.fe.tolerances.unseen`. Neither applies between
    the torques of the record then.

    Args:
        drive: The map.
        samples: Samples of the fit, with unseen equilibria.

    Returns:
        The record; None without unseen equilibria within the torque range of the map
        or without ripple in them.
    """
    toleranced = samples.tolerances
    solved = samples.unseen if toleranced is None else toleranced.solved
    if solved is None:
        return None
    regular = np.ones(solved.torque.size, dtype=bool)
    if toleranced is None and samples.worst is not None:
        solved = solved.together_with(samples.worst)
        regular = np.arange(solved.torque.size) < regular.size
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    offset = float(samples.output_error[zero].mean())
    psi = output_angle(drive, solved.input_angle, solved.torque)
    predicted = psi - solved.input_angle / drive.ratio
    heights = None
    if toleranced is not None:
        deviation = solved.output_error - predicted
        offset = float(deviation[solved.torque == 0.0].mean())
        _, heights = relative_amplitudes(toleranced, pitches_per_turn(samples))
    wrong = solved.output_error - offset - predicted
    missed = _input_torque(drive, solved, psi) - solved.input_torque
    rows, angles = [], []
    # the input torque within a clearance depends on where the output stands in it
    mean_clearance = toleranced is not None and toleranced.onsets
    low, high = drive.torque_range
    for torque in np.unique(solved.torque):
        # without tooth errors, zero torque was sampled and only the angles are unseen
        if not low < torque < high or (torque == 0.0 and toleranced is None):
            continue
        at = solved.torque == torque
        error, moment = solved.output_error[at], solved.input_torque[at]
        if toleranced is None or heights is None:
            others = _over_angle(samples, float(torque))
        else:
            known = _at_torque(toleranced.torque, heights, torque)
            others = [np.array([0.0, here]) for here in known]
            # only the differences count
            error, moment = error - error.min(), moment - moment.min()
        error, moment = (
            np.concatenate(pair) for pair in zip((error, moment), others, strict=True)
        )
        row: dict[str, float] = {"torque_Nm": float(torque), "angles": int(at.sum())}
        angle: dict[str, float] = {}
        for key, values, difference in (
            ("input_torque", moment, missed[at]),
            ("output_error", error, wrong[at]),
        ):
            if key == "input_torque" and torque == 0.0 and mean_clearance:
                continue
            height = float(np.ptp(values))
            row[f"{key}_pp_{UNITS[key]}"] = height
            if height > 0.0:
                row[f"{key}_largest"] = float(np.abs(difference).max() / height)
                angle[key] = float(solved.input_angle[at][np.abs(difference).argmax()])
                squares = difference[regular[at]] ** 2
                if squares.size:
                    row[f"{key}_rms"] = float(np.sqrt(squares.mean()) / height)
        rows.append(row)
        angles.append(angle)
    if not all(any(f"{key}_largest" in row for row in rows) for key in QUANTITIES):
        return None
    record: dict[str, Any] = {
        "solves": int(solved.torque.size),
        "worst_solves": int(np.count_nonzero(~regular)),
        "torques_Nm": [row["torque_Nm"] for row in rows],
        "rows": rows,
    }
    for key in QUANTITIES:
        judged = [row for row in rows if f"{key}_largest" in row]
        worst = max(judged, key=lambda row: row[f"{key}_largest"])
        angle = angles[rows.index(worst)]
        means = [row[f"{key}_rms"] ** 2 for row in judged if f"{key}_rms" in row]
        record[key] = {
            "largest": worst[f"{key}_largest"],
            "at_Nm": worst["torque_Nm"],
            "input_angle_rad": angle[key],
            "rms": float(np.sqrt(np.mean(means))),
        }
        if regular.all():
            record[key]["expected"] = max(
                EXTREME * float(np.sqrt(max(means))),
                worst[f"{key}_largest"] if toleranced is not None else 0.0,
            )
    # below the rated torque, tooth errors turn the output as far as the load does
    least = 0.0 if toleranced is None else samples.ratings.rated_torque
    stiffness = _stiffness(drive, solved, wrong, least)
    if stiffness is not None:
        record[STIFFNESS] = stiffness
    if samples.shortfall and toleranced is None:
        record["reason"] = samples.shortfall
    return record


def _input_torque(drive: Potential, solved: FullSolves, psi: Array) -> Array:
    """Input torque of the map at its own equilibria, at output angles psi [N·m]."""
    on_input, on_output = drive.forces(solved.input_angle, psi)
    return np.asarray(-on_input - (on_output + 0.0) / drive.ratio) + (
        solved.torque / drive.ratio
    )


def _over_angle(samples: MapSamples, torque: float) -> list[Array]:
    """Output error [rad] and input torque [N·m] at all sampled angles, each (n,).

    At most torques of a map the input torque was not solved, but the strain energy
    gives it.
    """
    error, potential = curves_at(samples, torque)
    theta = samples.input_angle
    return [error, input_torque_at(samples, torque, potential, theta)]


def _at_torque(torques: Array, heights: Array, torque: float) -> list[float]:
    """Peak to peak of output error [rad] and input torque [N·m] over the tooth cycle.

    Between the torques of the superposition it is interpolated.

    Args:
        torques: These torques [N·m].
        heights: Peak to peak of input torque and output error at them, see
            :func:`swgjoint.maps.fit.tolerance_modes.relative_amplitudes`.
        torque: Torque [N·m].
    """
    known = np.isfinite(heights)
    return [
        float(np.interp(torque, torques[at], row[at]))
        for row, at in zip(heights[::-1], known[::-1], strict=True)
    ]


def _stiffness(
    drive: Potential, solved: FullSolves, wrong: Array, least: float
) -> dict[str, float] | None:
    """Largest relative difference of the secant stiffness.

    The secant starts at the unloaded equilibrium at the same angle. None if no angle
    has both an unloaded equilibrium and one under a torque of at least ``least``.
    """
    worst: dict[str, float] | None = None
    rest = {
        theta: k
        for k, (theta, torque) in enumerate(
            zip(solved.input_angle, solved.torque, strict=True)
        )
        if torque == 0.0
    }
    low, high = drive.torque_range
    for k, (theta, torque) in enumerate(
        zip(solved.input_angle, solved.torque, strict=True)
    ):
        judged = torque != 0.0 and abs(torque) >= least and low < torque < high
        if not judged or theta not in rest:
            continue
        torsion = solved.output_error[rest[theta]] - solved.output_error[k]
        of_map = torsion - wrong[rest[theta]] + wrong[k]
        # at one torque the stiffness ratio is the inverse of the torsion ratio
        part = float(abs(torsion / of_map - 1.0))
        if worst is None or part > worst["largest"]:
            worst = {"largest": part, "at_Nm": float(torque)}
    return worst
