"""Extreme designs and loads end with a balanced result or a clear outcome."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming
from solved import few_teeth
from strips import open_gaps

from swgjoint.errors import ComputationError, Outcome
from swgjoint.fe.common.sampling import follower_in_plane
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.newton_step import Load
from swgjoint.gear.design.design import Design


def teeth(flexspline: int, rim: float = 1.0) -> dict:
    return {
        "drive.teeth_flexspline": flexspline,
        "drive.teeth_circular_spline": flexspline + 2,
        "flexspline.rim_mm": rim,
    }


RUBBING = {"friction.tooth_coefficient": 0.1}
SLACK = {"circular_spline.thickness_coefficient": 0.8}
CASES = {
    "thin rim": ("reference-2d", {"flexspline.rim_mm": 0.2}, 20.0),
    "thick rim": ("reference-2d", {"flexspline.rim_mm": 3.0}, 20.0),
    "40 teeth": ("reference-2d", teeth(40), 5.0),
    "400 teeth": ("reference-2d", teeth(400), 100.0),
    "hundred times the rated torque": ("reference-2d", {}, 2000.0),
    "against it": ("reference-2d", {}, -2000.0),
    "a fifth of backlash": ("reference-2d", SLACK, 20.0),
    "a fifth of backlash, no torque": ("reference-2d", SLACK, 0.0),
    "rollers 20 deg apart": (
        "reference-2d-four-roller",
        {"wave_generator.aperture_deg": 20.0},
        20.0,
    ),
    "minor axis far away": (
        "reference-2d-simplified",
        {"wave_generator.minor_axis_coefficient": 0.8},
        20.0,
    ),
    "rollers and friction": ("reference-2d-four-roller", RUBBING, 20.0),
    "friction and backlash": ("reference-2d", RUBBING | SLACK, 20.0),
}


MILD = {
    "thick rim",
    "40 teeth",
    "400 teeth",
    "against it",
    "a fifth of backlash",
    "rollers 20 deg apart",
    "friction and backlash",
}
"""Cases that have a sharper sister; they run in the second tier."""


@pytest.mark.fe
@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=[pytest.mark.slow] if c in MILD else []) for c in CASES],
)
def test_extreme_designs_run_and_balance(case):
    """Moments balance; nothing penetrates, nothing pulls."""
    name, changes, torque = CASES[case]
    design = Design.preset(name).with_changes(changes)
    run = simulate_meshing(design, torque=torque, steps=2, turn=0.01, half=True)
    for step in run.steps:
        state = step.state
        # the middle of a clearance is held by a torque of the size of round-off
        total = step.tooth_moment + step.wave_generator_torque
        assert total == pytest.approx(torque, abs=1e-6 * max(1.0, abs(torque)))
        assert (state.tooth_force >= 0.0).all()
        assert (state.pressure >= -1e-9).all()
        assert np.abs(open_gaps(run.model, state)).max(initial=0.0) < 1e-10


@pytest.mark.fe
@pytest.mark.parametrize(
    ("torque", "shown", "times"),
    [(100_000.0, "100000 N·m", "5000"), (1e6, "1e+06 N·m", "5e+04")],
)
def test_a_load_out_of_reach_ends_with_advice(torque, shown, times):
    """Thousands of times the rated torque: what failed, and what to try.

    At a thousand times, round-off decides whether the active set settles. At fifty
    thousand times, the search diverges to infinite gaps.
    """
    design = few_teeth()
    with pytest.raises(
        ComputationError, match=naming("reference-2d", shown, times, "20 N·m")
    ) as found:
        simulate_meshing(design, torque=torque, steps=1, half=True)
    advice = {outcome.value for outcome in Outcome if not outcome.ok}
    assert any(each in str(found.value) for each in advice)


@pytest.mark.fe
def test_a_rim_that_would_snap_off_its_outline_rests_on_it():
    """Where the usual start diverges, too: the energy converges with the mesh."""
    changes = {**teeth(80, 1.6), "wave_generator.kind": "simplified"}
    changes["wave_generator.minor_axis_coefficient"] = 0.97
    energy = []
    for refinement in (0.5, 1.0, 2.0):
        design = Design.load("reference-2d").with_changes(
            {**changes, "mesh.refinement": refinement}
        )
        follow = follower_in_plane(design)
        usual = follow.solver(
            follow.model,
            follow.model.initial_guess(),
            Load(rotation=0.0, teeth=False),
        )
        assert usual.outcome.ok == (refinement == 2.0)
        state = follow.deflect()
        assert state.outcome.ok
        assert (state.pressure >= 0.0).all()
        energy.append(state.energy)
    assert energy[0] - energy[1] > 1.5 * (energy[1] - energy[2]) > 0.0
    assert energy[0] < 1.05 * energy[2]
