"""The record of a map against unseen equilibria: differences that are put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from known_samples import N, samples_of
from messages import names

from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.fit.validation import EXTREME, validation
from swgjoint.maps.samples import FullSolves
from swgjoint.maps.sheet.map_validity import map_validation, percent, validation_summary

OFFSET = 5e-6
"""Mean unloaded error of ``samples_of`` [rad]."""


def judged(error=0.0, moment=0.0, shortfall=""):
    """A map and samples whose unseen equilibria are those of the map, or off by these.

    At 11 and 33 N·m; what is off is off at one angle of 33 N·m.
    """
    samples = samples_of()
    drive = fit_map(samples)
    theta = np.tile(2.0 * np.pi / N * (np.arange(5) + 0.38) / 5, 3)
    torque = np.repeat([0.0, 11.0, 33.0], 5)
    psi = output_angle(drive, theta, torque)
    on_input, _ = drive.forces(theta, psi)
    wrong = np.zeros(15)
    wrong[12] = 1.0
    unseen = FullSolves(
        input_angle=theta,
        torque=torque,
        output_error=psi - theta / drive.ratio + OFFSET + error * wrong,
        input_torque=-on_input + moment * wrong,
    )
    return drive, replace(samples, unseen=unseen, shortfall=shortfall)


def test_equilibria_of_the_map_itself_are_met():
    """Nothing is off but round-off; zero torque, which was sampled, has no row."""
    record = validation(*judged())
    assert record["torques_Nm"] == [11.0, 33.0]
    assert record["solves"] == 15
    for key in ("input_torque", "output_error"):
        assert record[key]["largest"] < 1e-9
    assert record["secant_stiffness"]["largest"] < 1e-9


@pytest.mark.parametrize("part", [0.1, 0.5])
def test_what_is_off_counts_in_the_peak_to_peak_at_its_torque(part):
    """Largest at 33 N·m, its root mean square over five angles; 11 N·m is clean."""
    _, given = judged()
    clean = validation(*judged())["rows"][1]
    heights = clean["input_torque_pp_Nm"], clean["output_error_pp_rad"]
    # half of the peak to peak widens it; the share is of what the solves then have
    drive, samples = judged(error=part * heights[1], moment=-part * heights[0])
    record = validation(drive, samples)
    at_11, at_33 = record["rows"]
    for key, unit in (("input_torque", "Nm"), ("output_error", "rad")):
        wanted = part * clean[f"{key}_pp_{unit}"] / at_33[f"{key}_pp_{unit}"]
        assert record[key]["at_Nm"] == 33.0
        assert record[key]["largest"] == pytest.approx(wanted, rel=1e-6)
        assert at_33[f"{key}_rms"] == pytest.approx(wanted / 5**0.5, rel=1e-6)
        assert at_11[f"{key}_largest"] < 1e-9
        # one angle of five is off: their rms times the extreme of many
        expected = EXTREME * wanted / 5**0.5
        assert record[key]["expected"] == pytest.approx(expected, rel=1e-6)
    assert given.unseen is not None


def test_solves_at_the_worst_positions_count_in_the_largest_difference_only():
    """They replace the estimate; as the worst ones they do not belong to a mean."""
    drive, samples = judged()
    clean = validation(drive, samples)
    torque, theta = np.array([20.0, 33.0]), 2.0 * np.pi / N * np.array([0.11, 0.72])
    psi = output_angle(drive, theta, torque)
    on_input, _ = drive.forces(theta, psi)
    height = clean["rows"][1]["output_error_pp_rad"]
    worst = FullSolves(
        input_angle=theta,
        torque=torque,
        output_error=psi - theta / drive.ratio + OFFSET + np.array([0.0, 0.1 * height]),
        input_torque=-on_input,
    )
    record = validation(drive, replace(samples, worst=worst))
    assert record["output_error"]["largest"] == pytest.approx(0.1, rel=0.1)
    assert record["output_error"]["at_Nm"] == 33.0
    assert record["input_torque"]["largest"] < 1e-9
    assert record["torques_Nm"] == [11.0, 20.0, 33.0]
    assert record["solves"] == clean["solves"] + 2
    assert record["worst_solves"] == 2 and clean["worst_solves"] == 0
    assert "output_error_rms" not in record["rows"][1]
    for key in ("input_torque", "output_error"):
        assert record[key]["rms"] < 1e-9
        assert "expected" not in record[key] and "expected" in clean[key]


def test_a_fitted_map_carries_a_record_that_can_be_read():
    """With the reason why sampling ended."""
    _, samples = judged(error=1e-6, shortfall="angles are off by 7 %")
    found, reason = map_validation(fit_map(samples))
    assert reason is None and found is not None
    assert found.reason == "angles are off by 7 %"
    assert found.totals["output_error"].torque == 33.0
    total = found.totals["output_error"]
    assert total.expected == pytest.approx(EXTREME * 2**0.5 * total.rms)
    assert names(validation_summary(found), "expected", percent(total.expected))


def test_torques_beyond_the_map_do_not_judge_it():
    """An equilibrium above the range has no row; without any there is no record."""
    drive, samples = judged()
    beyond = replace(samples.unseen, torque=np.full(15, 90.0))
    assert validation(drive, replace(samples, unseen=beyond)) is None
    assert validation(drive, replace(samples, unseen=None)) is None


def test_a_record_without_the_estimate_is_read_as_before():
    """Maps of earlier versions carry none."""
    _, samples = judged(error=1e-6)
    drive = fit_map(samples)
    record = drive.info["validation"]
    for key in ("input_torque", "output_error"):
        del record[key]["expected"]
    found, reason = map_validation(drive)
    assert reason is None and found is not None
    assert found.totals["input_torque"].expected is None
    assert "expected" not in validation_summary(found)


def test_the_estimate_is_the_largest_of_independent_normal_differences():
    """The median largest of 24 normal values, over their own rms, is within 20 %."""
    values = np.random.default_rng(7).normal(size=(4000, 24))
    part = np.abs(values).max(axis=1) / np.sqrt((values**2).mean(axis=1))
    assert EXTREME == pytest.approx(np.median(part), rel=0.2)
