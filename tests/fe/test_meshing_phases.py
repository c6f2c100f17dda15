"""Positions of a simulation of meshing within the tooth pitch."""

from __future__ import annotations

import numpy as np
import pytest
from messages import names
from solved import few_teeth

from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.meshing_phases import (
    STEPS,
    alike,
    default_steps,
    overload,
    phases_of,
    spreading_steps,
    spreads,
)
from swgjoint.gear.design.design import Design


def drive(teeth: int, layout: str = "circular_spline_fixed") -> Design:
    """A drive whose pattern has that many pitches a turn."""
    first = teeth - 2 if layout == "circular_spline_fixed" else teeth
    changes = {
        "drive.layout": layout,
        "drive.teeth_flexspline": first,
        "drive.teeth_circular_spline": first + 2,
    }
    return Design.preset("reference-2d").with_changes(changes)


@pytest.mark.parametrize("layout", ["circular_spline_fixed", "wave_generator_fixed"])
def test_every_default_spreads_and_is_35_where_that_does(layout):
    """All tooth counts over half a turn: at least five phases, no gap above a fifth."""
    others = {}
    for teeth in range(62, 401):
        design = drive(teeth, layout)
        steps = default_steps(design, 0.5)
        phases = phases_of(design, steps, 0.5)
        assert np.diff(phases, append=phases[0] + 1.0).max() < 0.2 + 1e-5
        assert (steps == STEPS) == spreads(design, STEPS, 0.5)
        if steps != STEPS and teeth % 2 == 0:
            others[teeth] = steps
    # of odd numbers half a turn is no whole number of pitches
    assert others == {70: 36, 140: 36, 210: 36, 280: 36, 350: 36}


@pytest.mark.parametrize(
    ("teeth", "steps", "turn", "count"),
    [(162, 9, 0.5, 1), (140, 35, 0.5, 1), (140, 28, 0.5, 2), (161, 46, 0.5, 4)],
)
def test_a_number_that_does_not_spread_is_said_with_one_that_does(
    teeth, steps, turn, count
):
    """How few phases, and the nearest number; the phases are those of the angles."""
    design = drive(teeth)
    found = phases_of(design, steps, turn)
    assert len(found) == count
    theta = 2.0 * np.pi * turn * np.arange(steps) / steps
    around = np.exp(1j * teeth * theta)
    assert len(np.unique(around.round(6))) == len(found)
    better = spreading_steps(design, steps, turn)
    line = alike(design, steps, turn)
    assert names(line, str(steps), str(len(found)), str(teeth), f"--steps {better}")
    assert alike(design, better, turn) is None
    assert all(
        not spreads(design, steps + sign * k, turn)
        for k in range(abs(better - steps))
        for sign in (1, -1)
    )


@pytest.mark.parametrize(("steps", "turn"), [(1, 0.5), (2, 0.01), (24, 1 / 122)])
def test_single_positions_and_parts_of_a_pitch_are_wanted(steps, turn):
    """One position, two close ones, a whole pitch in small steps: no warning."""
    assert alike(drive(122), steps, turn) is None


@pytest.mark.fe
def test_positions_a_pitch_apart_are_alike():
    """Two of them have one error; the result says so, and of three it does not."""
    options = {"torque": 20.0, "turn": 2.0 / 62.0, "half": True}
    run = simulate_meshing(few_teeth(), steps=2, **options)
    error = run.series("output_error")
    assert np.ptp(error) < 1e-4 * abs(error[0])
    result = run.to_json()
    assert names(result["warnings"][0], "2", "1", "62", "--steps 3")
    assert result["label"]["positions"] == "on 1 tooth phase"
    assert spreads(run.design, 3, options["turn"])


def test_a_torque_in_another_unit_is_called_by_its_size():
    """A thousand times the rated torque is said; its repeated peak is not."""
    design = few_teeth()
    assert names(overload(design, -2e4), "-20000 N·m", "1000 times", "20 N·m")
    assert overload(design, 60.0) is None
