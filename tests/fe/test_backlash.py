"""Clearance between the teeth: taking it up, passing through it, standing in it."""

from __future__ import annotations

from math import pi

import pytest
from solved import coarse

from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.gear.design.design import Design


def loose(coefficient: float, **changes) -> Design:
    thin = {"circular_spline.thickness_coefficient": coefficient}
    return coarse(**thin, **changes)


@pytest.mark.parametrize("coefficient", [0.95, 0.8])
def test_load_takes_up_the_clearance(coefficient):
    """The flexspline turns back by thesis eq. (6.4) before it resists."""
    design = loose(coefficient)
    run = simulate_meshing(design, torque=1.0, steps=1, half=True)
    rotation = pi / (2.0 * design.drive.teeth_flexspline) * (1.0 - coefficient)
    # 3 %: the equation is for the pitch circles, the teeth touch elsewhere
    assert run.steps[0].output_error == pytest.approx(-rotation, rel=0.03)
    assert run.steps[0].pairs_in_contact > 0


def test_free_output_stands_in_the_middle():
    """Without torque no tooth touches; the place is the mean of both flanks'."""
    design = loose(0.9)
    options = {"steps": 3, "turn": 0.02, "half": True}
    free = simulate_meshing(design, torque=0.0, **options)
    sides = [simulate_meshing(design, torque=t, **options) for t in (0.2, -0.2)]
    mean = 0.5 * sum(side.series("output_error") for side in sides)
    assert free.series("output_error") == pytest.approx(mean, abs=1e-10)
    assert [step.pairs_in_contact for step in free.steps] == [0, 0, 0]
    assert free.series("input_torque") == pytest.approx(0.0, abs=1e-5)


def test_torque_reverses_through_the_clearance():
    """From one flank to the other at a fixed input, and back to the same place."""
    design = loose(0.9)
    follow = Continuation(model=sector_model(design, half=True), ratio=design.ratio)
    first = follow.to_torque(follow.engage(follow.deflect()), 10.0)
    other = follow.to_torque(first, -10.0)
    again = follow.to_torque(other, 10.0)
    assert first.outcome.ok and other.outcome.ok and again.outcome.ok
    # at the first position the drive is its own mirror image
    assert other.rotation == pytest.approx(-first.rotation, abs=1e-10)
    assert again.rotation == pytest.approx(first.rotation, abs=1e-10)


@pytest.mark.parametrize("layout", ["flexspline_fixed", "wave_generator_fixed"])
def test_clearance_is_the_same_in_every_layout(layout):
    """Output and flexspline turn against each other by the same angle."""
    errors = [
        simulate_meshing(
            loose(0.9, **{"drive.layout": name}), torque=5.0, steps=1, half=True
        )
        .steps[0]
        .output_error
        for name in ("circular_spline_fixed", layout)
    ]
    # the output is the other member, and the wave generator turns with it
    assert errors[1] == pytest.approx(errors[0] * 120 / 122, rel=2e-3)
