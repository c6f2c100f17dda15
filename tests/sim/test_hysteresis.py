"""Runs with hysteresis at level full: start, torque on the link, losses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
LOSSY = replace(
    LINEAR, damping_ratio=0.0, hysteresis=(Jenkin(stiffness=2e4, yield_torque=3.0),)
)


@pytest.mark.parametrize("level", ["full", "native"])
def test_a_run_starts_relaxed_under_its_load(bench, level):
    """The balance of the spring stands: torsion T/K from the first instant."""
    run = bench(LOSSY, defaults__level=level)
    np.testing.assert_allclose(run.torsion, 20.0 / 2e4, rtol=1e-6)
    np.testing.assert_allclose(run.output_torque, 20.0, rtol=1e-6)


@pytest.mark.parametrize("level", ["full", "native"])
def test_torque_of_a_sweep_has_the_hysteresis(bench, level):
    """There and back: recorded torque is load and inertia, and slipping took work.

    The torque on the link is read from the recorded states by playing the elements; it
    must be what moves the link, load plus 1 kg·m² times the acceleration.
    """
    sweep = {"kind": "sweep", "hold_s": 0.1, "ramp_s": 0.05, "end_deg": {"joint": 20.0}}
    timing = {"duration_s": 1.0, "step_s": 2e-4}
    run = bench(LOSSY, defaults__level=level, trajectory=sweep, simulation=timing)
    # the mean of two accelerations stands between two recorded states
    acceleration = np.gradient(run.velocity[:, 0], 2e-4)
    needed = 20.0 + acceleration
    moves = slice(10, -10)
    torque = run.output_torque[moves, 0]
    swing = np.ptp(torque)
    assert swing > 6.0  # both ways beyond the yield torque
    off = torque - needed[moves]
    assert np.sqrt(np.mean(off**2)) < 0.05 * swing
    # without the elements the same torsion would give another torque
    spring = 2e4 * run.torsion[moves, 0]
    assert np.abs(torque - spring).max() == pytest.approx(3.0, rel=1e-3)


def test_a_run_says_where_hysteresis_is(bench):
    """In the label of `full`; among what the simpler levels leave out."""
    full = bench(LOSSY).contains
    assert full["joints"]["joint"]["hysteresis_elements"] == 1
    linear = bench(LOSSY, defaults__level="linear").contains
    assert linear["joints"]["joint"]["hysteresis_elements"] == 0
    assert any("hysteresis" in item["part"] for item in linear["left_out"])


def test_torque_of_a_sweep_follows_the_load(bench):
    """Elements with yield curves: played on the record, they still move the link.

    The played law takes each sample's elastic torque, the scheme that of the middle of
    a step.
    """
    curve = ((10.0, 6.0), (30.0, 1.0))
    element = Jenkin(stiffness=6e4, yield_torque=1.0, yield_curve=curve)
    sweep = {"kind": "sweep", "hold_s": 0.1, "ramp_s": 0.05, "end_deg": {"joint": 20.0}}
    run = bench(
        replace(LOSSY, hysteresis=(element,)),
        trajectory=sweep,
        simulation={"duration_s": 1.0, "step_s": 2e-4},
    )
    moves = slice(10, -10)
    needed = (20.0 + np.gradient(run.velocity[:, 0], 2e-4))[moves]
    torque = run.output_torque[moves, 0]
    off = torque - needed
    assert np.sqrt(np.mean(off**2)) < 0.05 * np.ptp(torque)
    # the element carries more than its yield torque without load
    spring = 2e4 * run.torsion[moves, 0]
    assert np.abs(torque - spring).max() > 2.0
    native = bench(
        replace(LOSSY, hysteresis=(element,)), defaults__level="native"
    ).contains
    assert any("with the load" in item["part"] for item in native["left_out"])


def test_stored_energy_is_that_of_the_slipping_torque(bench, synthetic_map):
    """T²/(2 k) of one element whose yield torque follows an angle-dependent torque."""
    element = Jenkin(
        stiffness=6e4, yield_torque=1.0, yield_curve=((10.0, 3.0), (30.0, 9.0))
    )
    run = bench(
        replace(synthetic_map, hysteresis=(element,)),
        trajectory={
            "kind": "sweep",
            "hold_s": 0.1,
            "ramp_s": 0.05,
            "end_deg": {"joint": 20.0},
        },
        simulation={"duration_s": 1.0, "step_s": 5e-4},
    )
    slipping = run.slipping_torque[:, 0]
    assert np.abs(slipping[-1]) > 1.0
    stored = (slipping[-1] ** 2 - slipping[0] ** 2) / (2.0 * element.stiffness)
    assert run.hysteresis_energy[0] == pytest.approx(stored, rel=1e-9)
