"""Logs with mistakes of users: units, signs, wrapped angles, too little motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.gear.ratings import rule_of
from swgjoint.identify.identification import identify
from swgjoint.identify.log import BenchLog
from swgjoint.maps.hysteresis import stretches
from swgjoint.units import deg

RATIO = -100.0
T1, T2, K1, K2, K3 = 14.0, 48.0, 31000.0, 50000.0, 57000.0
OPTIONS = {
    "teeth_flexspline": 200,
    "teeth_circular_spline": 202,
    "ratings": 87.0,
    "corners": (T1, T2),
}


def log_of(turns: float = 10.0, noise: float = 0.0) -> BenchLog:
    """Eight seconds of a drive of three lines with a Jenkin element and a 2nd order.

    Args:
        turns: Half the travel of the motor in turns.
        noise: Deviation of the torsion [rad].
    """
    t = 1e-3 * np.arange(8000)
    theta = 2.0 * np.pi * turns * np.sin(1.3 * t)
    torsion = 1.6e-3 * np.sin(3.1 * t) + 6e-4 * np.sin(7.7 * t)
    size = np.abs(torsion)
    first, second = T1 / K1, T1 / K1 + (T2 - T1) / K2
    torque = np.sign(torsion) * (
        K1 * np.minimum(size, first)
        + K2 * np.clip(size - first, 0.0, second - first)
        + K3 * np.maximum(size - second, 0.0)
    )
    torque += 5e4 * stretches(torsion, 2.0 / 5e4)
    error = 2e-4 * np.cos(2.0 * theta)
    slope = -4e-4 * np.sin(2.0 * theta)
    rate = np.gradient(theta, t)
    rng = np.random.default_rng(1)
    return BenchLog(
        time=t,
        motor_angle=theta,
        link_angle=theta / RATIO + error - torsion + noise * rng.standard_normal(8000),
        output_torque=torque,
        motor_torque=4e-5 * np.gradient(rate, t)
        + (1.0 / RATIO + slope) * torque
        + (0.02 + 0.05 * np.abs(torque / RATIO)) * np.sign(rate)
        + 2e-4 * rate,
        where="bench.csv",
    )


def test_the_log_of_these_tests_has_no_doubts():
    """Stiffness within 1 %: the mistakes below are those of the changed channels."""
    found = identify(log_of(), **OPTIONS)
    assert found.doubts == ()
    for name, true in (("K1", K1), ("K2", K2), ("K3", K3)):
        assert found.estimates[name].value == pytest.approx(true, rel=0.01)
    by_rule, _ = rule_of(found.drive.ratings.source)
    assert by_rule == ("repeated_peak_Nm", "momentary_peak_Nm")  # the corners are given


@pytest.mark.parametrize(
    ("channel", "factor", "told"),
    [
        ("motor_torque", -1.0, "0.01"),
        ("motor_torque", 1e3, "-10"),
        ("output_torque", 1e3, "-1e-05"),
    ],
)
def test_two_torques_that_contradict_each_other_are_named(channel, factor, told):
    """A wrong sign or unit of one of them: the factor that it has and should have."""
    log = log_of()
    log = replace(log, **{channel: factor * getattr(log, channel)})
    line = naming("bench.csv", "motor_torque", told, "output_torque", "-0.01")
    with pytest.raises(InputError, match=line):
        identify(log, **OPTIONS)


@pytest.mark.parametrize("channel", ["motor_torque", "output_torque"])
def test_one_torque_in_mNm_is_doubted(channel):
    """A thousand times the torque: no drive reaches it, and K1 has no bounds."""
    log = log_of(noise=3e-6)
    torques = {"motor_torque": None, "output_torque": None}
    torques[channel] = 1e3 * getattr(log, channel)
    doubts = identify(replace(log, **torques), **OPTIONS).doubts
    assert any("times the rated 87 N·m" in line for line in doubts)
    assert any(line.startswith("the log does not determine K") for line in doubts)


def test_a_rated_torque_far_below_the_log_is_doubted():
    """A hundredth of the rated torque, as with a wrong decimal point."""
    doubts = identify(
        log_of(noise=3e-6), **{**OPTIONS, "ratings": 0.87, "corners": None}
    ).doubts
    assert any("times the rated 0.87 N·m" in line for line in doubts)


@pytest.mark.parametrize("channel", ["motor_angle", "link_angle"])
def test_angles_of_a_single_turn_encoder_are_refused(channel):
    """The channel, the size of its jump and the time."""
    log = log_of(turns=70.0)
    log = replace(log, **{channel: np.mod(getattr(log, channel), 360 * deg)})
    with pytest.raises(InputError, match=naming("bench.csv", channel, "deg", " s")):
        identify(log, **OPTIONS)


def test_a_gap_in_time_is_no_jump_of_an_angle():
    """A pause of the logger of one second: its duration and its beginning."""
    log = log_of()
    there = (log.time < 3.0) | (log.time >= 4.0)
    keys = ("time", "motor_angle", "link_angle", "output_torque", "motor_torque")
    cut = replace(log, **{key: getattr(log, key)[there] for key in keys})
    with pytest.raises(InputError, match=naming("bench.csv", "no sample", "2.999 s")):
        identify(cut, **OPTIONS)


@pytest.mark.parametrize("channel", ["motor_angle", "link_angle"])
def test_a_lost_reading_of_an_encoder_is_refused(channel):
    """One zero in a channel is named by its time, not as a stiffness without data."""
    log = log_of()
    values = getattr(log, channel).copy()
    values[2000] = 0.0
    told = naming("bench.csv", channel, "jumps by", "2 s")
    with pytest.raises(InputError, match=told):
        identify(replace(log, **{channel: values}), **OPTIONS)


@pytest.mark.parametrize("turns", [0.0, 0.1])
def test_less_than_a_turn_of_the_input_tells_no_kinematic_error(turns):
    """A locked or almost locked input: the note names the travel and the remedy.

    A tenth of a turn either way gave an order of one wave that the drive has not.
    """
    log = replace(log_of(turns=turns, noise=1e-6), motor_torque=None)
    found = identify(log, **OPTIONS)
    assert not any(name.startswith("error") for name in found.estimates)
    (note,) = [note for note in found.notes if "no kinematic error" in note]
    assert f"{2 * turns:.2g} turns" in note and "--orders" in note
    if turns == 0.0:
        assert found.doubts == ()
        assert found.estimates["K3"].value == pytest.approx(K3, rel=0.01)


def test_a_small_negative_damping_is_a_note():
    """Encoder noise delays the element: 0.1 % of the torque are no reason for doubt."""
    found = identify(log_of(noise=4e-6), **OPTIONS)
    damping = found.estimates["damping"]
    assert damping.high < 0.0 and 0.0 < found.effects["damping"] < 0.01
    assert any(note.startswith("damping -") for note in found.notes)
    # the stiffness is 3 % too low, more than its interval of 1 %
    assert any("noise of the angles shifts hysteresis" in note for note in found.notes)
    assert found.doubts == ()


def taken(log: BenchLog, kept) -> BenchLog:
    """The log with some of its samples."""
    channels = ("time", "motor_angle", "link_angle", "output_torque", "motor_torque")
    return replace(log, **{name: getattr(log, name)[kept] for name in channels})


@pytest.mark.parametrize(
    ("kept", "window"),
    [
        (slice(None, None, 2), 0.005),  # two and three samples per window in turn
        (slice(None), 0.0044),
        (np.random.default_rng(4).random(8000) > 0.3, 0.01),  # lost samples
    ],
)
def test_uneven_windows_leave_the_inertia(kept, window):
    """Windows of unequal samples have the rotor, stiffness and error of equal ones."""
    even = identify(log_of(), **OPTIONS)
    found = identify(taken(log_of(), kept), window=window, **OPTIONS)
    assert found.doubts == ()
    for name in ("rotor_inertia", "K1", "error_2_0_cos", "friction_viscous"):
        value = found.estimates[name].value
        assert value == pytest.approx(even.estimates[name].value, rel=0.05), name


def test_jitter_of_the_clock_of_a_logger_is_left_out():
    """Times within a quarter of a step of even ones change nothing but the times."""
    log = log_of()
    stray = 2.5e-4 * np.random.default_rng(4).uniform(-1.0, 1.0, len(log.time))
    late = replace(log, time=log.time + stray)
    assert late.fill_windows(0.005) is late
    found, even = (identify(one, **OPTIONS) for one in (late, log))
    for name in ("rotor_inertia", "K1"):
        value = found.estimates[name].value
        assert value == pytest.approx(even.estimates[name].value, rel=0.01)
