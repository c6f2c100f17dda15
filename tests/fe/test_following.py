"""Continuation of equilibria, seen by its solves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from swgjoint.errors import Outcome
from swgjoint.fe.common.increments import HALVINGS
from swgjoint.fe.common.sampling import follower_in_plane
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.gear.design.design import Design


@dataclass(frozen=True)
class Figures:
    """What a continuation reads of a state."""

    torque: float
    outcome: Outcome = Outcome.CONVERGED
    history: tuple[float, ...] = ()
    wave_generator_angle: float = 0.0
    tooth_force: tuple[float, ...] = (1.0,)


@pytest.mark.parametrize(
    ("torque", "solved"),
    [(0.0, [0.0]), (1.0, [0.5**k for k in range(HALVINGS + 1)])],
)
def test_a_failed_solve_is_not_repeated(torque, solved, monkeypatch):
    """Smaller changes of the torque are tried, if there is a change."""
    loads = []

    def fail(self, start, torque, angle):
        loads.append(torque)
        return replace(start, outcome=Outcome.ACTIVE_SET_CYCLES)

    monkeypatch.setattr(Continuation, "load", fail)
    monkeypatch.setattr(Continuation, "_taken_up", lambda self, state, torque: failed)
    failed = Figures(torque=0.0, outcome=Outcome.SINGULAR)
    reached = Continuation(model=None, ratio=100.0).to_torque(Figures(0.0), torque)
    assert np.allclose(loads, solved)
    assert reached.outcome is (
        Outcome.SINGULAR if torque else Outcome.ACTIVE_SET_CYCLES
    )


@pytest.mark.fe
def test_a_reversed_torque_finds_the_flanks_of_the_other_side():
    """They are farther away than the flanks that a start at its own torque needs."""
    design = Design.load("size-14-50").with_changes({"mesh.refinement": 0.5})
    model = sector_model(design, half="auto")
    follow = Continuation(model=model, ratio=design.ratio)
    loaded = follow.to_torque(follow.engage(follow.deflect()), 60.0)
    assert follow.load(loaded, -10.0, 0.0).outcome.ok


@pytest.mark.fe
def test_a_small_torque_finds_the_flanks_through_the_clearance_of_the_bearing():
    """Balls change over from one side to the other within a hundredth of a pitch."""
    design = Design.load("size-20-50").with_changes(
        {"mesh.refinement": 0.5, "wave_generator.bearing.clearance_um": 7.6}
    )
    follow = follower_in_plane(design)
    free = follow.engage(follow.deflect(1.3350411956776347))
    against, along = (follow.to_torque(free, torque) for torque in (-0.3, 0.3))
    for state, torque in ((against, -0.3), (along, 0.3)):
        assert state.outcome.ok and state.torque == torque
        assert len(state.tooth_force) > 0
    assert follow.output_angle(along) < follow.output_angle(against)
