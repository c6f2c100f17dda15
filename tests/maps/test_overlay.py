"""A measured loop over a prediction: what differs is what was made to differ."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from messages import names

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.overlay import overlay
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.sheet.loop import TorqueLoop, torque_loop
from swgjoint.units import arcmin

FIGURES = ("hysteresis_loss_arcmin", "lost_motion_arcmin")
RUBBING = (
    Jenkin(stiffness=1e4, yield_torque=2.0),
    Jenkin(stiffness=4e3, yield_torque=6.0),
)


@pytest.mark.parametrize("elements", [(), RUBBING])
@pytest.mark.parametrize("rounds", [1, 2])
def test_the_loop_of_a_map_leaves_nothing(synthetic_map, elements, rounds):
    """Played by a map and laid over it, any zero, once or twice: round-off is left."""
    drive = replace(synthetic_map, hysteresis=elements)
    loop = torque_loop(drive)
    own = TorqueLoop(
        torque=np.tile(loop.torque, rounds),
        torsion=np.tile(loop.torsion, rounds) - 3e-3,
    )
    laid = overlay(drive, own)
    found = laid.as_dict()
    assert laid.shift == pytest.approx(3e-3, abs=2e-12)
    # Newton settles to 8 eps of the span, 12 arcmin; where the second round begins
    # the torque left at zero, 1e-9 of rated, is 1e-8 arcmin
    assert found["largest_arcmin"] < (1e-10 if rounds == 1 else 2e-8)
    assert found["history"] == ("run before" if elements else "at rest")
    for row in found["segments"]:
        ours, theirs = row["K_predicted_Nm_rad"], row["K_measured_Nm_rad"]
        assert ours == pytest.approx(theirs, rel=1e-9)
    sheet = drive.spec_sheet([*FIGURES, "K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad"])
    for row in found["segments"]:
        key = f"{row['segment']}_Nm_rad"
        assert row["K_measured_Nm_rad"] == pytest.approx(sheet[key], rel=1e-9)
    wanted = sheet["hysteresis_loss_arcmin"] or 0.0
    assert found[FIGURES[0]]["measured"] == pytest.approx(wanted, abs=1e-9)
    assert found[FIGURES[1]]["predicted"] == pytest.approx(sheet[FIGURES[1]], rel=1e-9)


def test_a_first_loading_from_rest_is_told_from_a_loop_run_before(synthetic_map):
    """The part of the record before the drive has forgotten its start is predicted."""
    drive = replace(synthetic_map, hysteresis=RUBBING)
    leg = np.linspace(0.0, 80.0, 41)
    torque = np.concatenate([leg, leg[-2::-1], -leg[1:], -leg[-2::-1]])
    quiet = TorqueLoop(torque=torque, torsion=torque / 2e4)
    first = overlay(drive, replace(quiet, torsion=_at_rest(drive, quiet)))
    assert first.history == "at rest"
    # the torque left at zero, 1e-9 of rated
    assert np.abs(first.residual).max() < 1e-11


def _at_rest(drive: DriveMap, loop: TorqueLoop) -> np.ndarray:
    """Torsion along a path from rest, in small steps of the elements."""
    from swgjoint.maps.equilibrium import output_angle
    from swgjoint.maps.sliders import Sliders

    free = float(output_angle(drive, 0.0, 0.0))
    sliders = Sliders.relax(drive.hysteresis, float(drive.torsion(0.0, free)))
    found = []
    for torque in loop.torque:
        psi = float(output_angle(drive, 0.0, torque, sliders))
        sliders = sliders.move_to(float(drive.torsion(0.0, psi)))
        found.append(free - psi)
    return np.array(found)


def test_a_softer_drive_shows_in_the_segments(synthetic_map):
    """Torsion 10 % more: no shift, K 1/1.1 of ours, residual a tenth of the torsion."""
    loop = torque_loop(synthetic_map)
    laid = overlay(synthetic_map, replace(loop, torsion=1.1 * loop.torsion))
    found = laid.as_dict()
    assert laid.shift == pytest.approx(0.0, abs=1e-9)
    assert found["largest_arcmin"] == pytest.approx(
        0.1 * np.abs(loop.torsion).max() / arcmin, rel=1e-6
    )
    for row in found["segments"]:
        ratio = row["K_predicted_Nm_rad"] / row["K_measured_Nm_rad"]
        assert ratio == pytest.approx(1.1, rel=1e-9)
        at_end = 0.1 * loop.mid_line([row["to_Nm"], -row["to_Nm"]]) / arcmin
        # the two signs differ a little: the map has harmonics of the output angle
        assert row["largest_arcmin"] == pytest.approx(np.abs(at_end).max(), rel=1e-5)
        assert row["rms_arcmin"] < row["largest_arcmin"]


def test_noise_comes_back_as_the_residual(synthetic_map):
    """Noise of 0.02 arcmin and of 0.1 N·m on the samples: rms 0.02 arcmin in all."""
    rng = np.random.default_rng(5)
    drive = replace(synthetic_map, hysteresis=RUBBING)
    loop = torque_loop(drive)
    noise = 0.02 * arcmin * rng.standard_normal(loop.torque.size)
    laid = overlay(drive, replace(loop, torsion=loop.torsion + 1e-3 + noise))
    rms = laid.as_dict()["rms_arcmin"]
    assert rms == pytest.approx(np.sqrt(np.mean(noise**2)) / arcmin, rel=0.01)
    shaken = loop.torque + 0.1 * rng.standard_normal(loop.torque.size)
    laid = overlay(drive, TorqueLoop(torque=shaken, torsion=loop.torsion))
    soft = np.sqrt(np.mean((0.1 / 2e4) ** 2)) / arcmin
    assert laid.as_dict()["rms_arcmin"] < soft


def test_a_short_record_says_what_it_does_not_reach(synthetic_map):
    """Up to between T1 and T2: K1 alone, samples in two; beyond the map is said."""
    loop = torque_loop(synthetic_map)
    low = 0.2 * loop.torque
    scale = TorqueLoop(torque=low, torsion=low / 2e4)
    first, second, third = overlay(synthetic_map, scale).as_dict()["segments"]
    assert first["K_measured_Nm_rad"] == pytest.approx(2e4)
    assert (second["from_Nm"], second["to_Nm"]) == (10.0, 30.0)
    assert second["K_measured_Nm_rad"] is None
    assert third["samples"] == 0 and third["rms_arcmin"] is None
    assert third["K_predicted_Nm_rad"] is None
    far = TorqueLoop(torque=4.0 * loop.torque, torsion=4.0 * loop.torque / 2e4)
    assert overlay(synthetic_map, far).beyond_range
    assert not overlay(synthetic_map, scale).beyond_range


def test_no_figure_is_read_where_there_are_no_samples(synthetic_map):
    """K across a gap in the torque, and what is read about zero there, are None."""
    leg = np.linspace(20.0, 80.0, 31)
    torque = np.concatenate([leg, leg[::-1], -leg, -leg[::-1]])
    found = overlay(synthetic_map, TorqueLoop(torque=torque, torsion=torque / 2e4))
    found = found.as_dict()
    first, second, third = found["segments"]
    assert first["samples"] == 0
    assert first["K_measured_Nm_rad"] is None and first["K_predicted_Nm_rad"] is None
    for row in (second, third):
        assert row["K_measured_Nm_rad"] == pytest.approx(2e4)
    for key in FIGURES:
        assert found[key] == {"measured": None, "predicted": None}
    # a gap on one side of zero alone hides as much
    torque = np.concatenate([leg, leg[::-1], np.linspace(0.0, -80.0, 41)])
    one_sided = overlay(synthetic_map, TorqueLoop(torque=torque, torsion=torque / 2e4))
    assert one_sided.segments()[0]["K_measured_Nm_rad"] is None
    assert one_sided.as_dict()[FIGURES[1]]["measured"] is None


def test_readings_more_than_a_tenth_off_are_said(synthetic_map):
    """Torsion 12 % more: loss and lost motion are named with both values; 8 %: none."""
    drive = replace(synthetic_map, hysteresis=RUBBING)
    once = torque_loop(drive)
    loop = TorqueLoop(torque=np.tile(once.torque, 2), torsion=np.tile(once.torsion, 2))
    assert overlay(drive, loop).warnings() == []
    near = overlay(drive, replace(loop, torsion=1.08 * loop.torsion))
    assert near.as_dict()["warnings"] == []
    lines = overlay(drive, replace(loop, torsion=1.12 * loop.torsion)).warnings()
    loss, motion, whole = lines
    assert names(whole, "rms", "11%")
    sheet = drive.spec_sheet([*FIGURES])
    for line, key in ((loss, FIGURES[0]), (motion, FIGURES[1])):
        told = [float(value) for value in re.findall(r"([\d.]+) arcmin", line)]
        assert told == pytest.approx([sheet[key], 1.12 * sheet[key]], rel=0.02)
        assert names(line, "11%")


def test_a_loop_that_the_map_does_not_follow_is_said(synthetic_map):
    """Drift of a fifth of the torsion, with equal figures around zero, is one line."""
    once = torque_loop(synthetic_map)
    drift = 0.2 * np.sin(np.pi * once.torque / np.abs(once.torque).max())
    bent = replace(once, torsion=once.torsion + drift * np.ptp(once.torsion))
    laid = overlay(synthetic_map, bent)
    (line,) = [one for one in laid.warnings() if names(one, "rms")]
    rms = np.sqrt(np.mean(laid.residual**2))
    assert names(line, f"{rms / arcmin:.4g} arcmin", "noise, drift, play")
