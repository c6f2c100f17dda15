"""Kinematic error from a noisy record of one turn, and what it is good for."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.kinematic_error import (
    JointRecord,
    KinematicErrorTable,
    TurnRecorder,
    compensate,
    identify_kinematic_error,
)
from swgjoint.control.motor_side import MotorPID
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import arcmin

ORDERS = [(2, 0), (0, 2), (4, 0), (1, 1)]
AMPLITUDES = np.array([[0.10, 0.05], [-0.08, 0.06], [0.0, 0.03], [0.02, 0.0]]) * arcmin
TABLE = KinematicErrorTable(orders=ORDERS, amplitudes=AMPLITUDES)
LAYOUTS = ["circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed"]


def linear(layout="circular_spline_fixed"):
    return DriveMap.linear(
        2e4, layout=layout, teeth_flexspline=120, teeth_circular_spline=122
    )


def synthetic_record(drive, noise, seed=0, turns=1.0, torsion=1e-3):
    """Motor and link angles of a slow motion under a load that turns the output."""
    psi = np.linspace(0.0, 2.0 * np.pi * turns, 20_000)
    true, theta = TABLE.apply_to(drive), drive.ratio * psi
    for _ in range(30):
        error = true.error_at(true.phases(theta, psi))[0]
        theta = drive.ratio * (psi - error + torsion)
    scatter = noise * np.random.default_rng(seed).standard_normal(psi.size)
    return JointRecord(motor_angle=theta, link_angle=psi + scatter)


@pytest.mark.parametrize("layout", LAYOUTS[:2])
def test_a_noisy_record_tells_the_harmonics(layout):
    """Those that are there within the stated error, and no others."""
    record = synthetic_record(linear(layout), noise=0.05 * arcmin)
    found = identify_kinematic_error(record, linear(layout))
    assert sorted(map(tuple, found.orders.tolist())) == sorted(ORDERS)
    place = [found.orders.tolist().index(list(pq)) for pq in ORDERS]
    off = found.amplitudes[place] - AMPLITUDES
    # sqrt(2 / 20000) of the noise
    assert found.deviation == pytest.approx(5e-4 * arcmin, rel=0.05)
    assert np.abs(off).max() < 4.0 * found.deviation


def test_the_table_is_the_error_of_a_map(synthetic_map):
    """Its error in place of the map's own, nothing else changed."""
    changed = TABLE.apply_to(synthetic_map)
    theta, psi = np.random.default_rng(2).uniform(-4.0, 4.0, (2, 50))
    phases = np.stack([p * theta + q * (theta - psi) for p, q in ORDERS], axis=-1)
    expected = np.cos(phases) @ AMPLITUDES[:, 0] + np.sin(phases) @ AMPLITUDES[:, 1]
    got = changed.error_at(changed.phases(theta, psi))[0]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-15)
    torsion = np.full(50, 1e-3)
    np.testing.assert_allclose(
        changed.torque(torsion, theta, psi),
        synthetic_map.torque(torsion, theta, psi),
        rtol=1e-12,
    )


def test_records_that_do_not_tell_are_refused():
    """Too short, too coarse: one line with what is accepted."""
    short = synthetic_record(linear(), 0.0, turns=0.5)
    with pytest.raises(
        InputError, match=naming("record", "180 deg", "20000", "360 deg")
    ):
        identify_kinematic_error(short, linear())
    whole = synthetic_record(linear(), 0.0)
    coarse = JointRecord(
        motor_angle=whole.motor_angle[::20], link_angle=whole.link_angle[::20]
    )
    with pytest.raises(
        InputError, match=naming("record", "1000 samples", "359.7 deg", "1950")
    ):
        identify_kinematic_error(coarse, linear())
    with pytest.raises(InputError, match=naming("record", "orders", "speed")):
        identify_kinematic_error(whole, linear(), orders=[(2, 0), (2, 0)])


def test_a_table_from_another_load_compensates_the_link(turn):
    """Recorded with noise at 40 N·m, used at 20 N·m: a twentieth is left."""
    known, plant = linear(), TABLE.apply_to(linear())
    record = TurnRecorder(MotorPID())
    turn(plant, known, record, speed=12.0, duration=30.5, load=40.0, step=2e-3,
         sensors__link__noise_arcsec=2.0)  # fmt: skip
    table = identify_kinematic_error(record.record(skip=100), known)
    left = []
    for plan in (flexible_plan, compensate([table])):
        pid = MotorPID(plan)
        run = turn(plant, known, pid, speed=12.0, duration=8.0, step=2e-3)
        error = (run.position - run.reference)[500:, 0]
        left.append(np.ptp(error))
    assert left[0] > 0.3 * arcmin
    assert left[1] < 0.05 * left[0]


def test_a_record_needs_a_link_encoder(turn):
    """Without one the line says which key gives it."""
    with pytest.raises(
        InputError, match=naming("link encoder", "controller.feedback", "'link'")
    ):
        turn(linear(), linear(), TurnRecorder(MotorPID()), speed=1.0, duration=0.1,
             controller__feedback="motor")  # fmt: skip
