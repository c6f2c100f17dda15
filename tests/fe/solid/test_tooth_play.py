"""Play of the teeth against contacts that are solved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.common.following import is_free
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.figures.tooth_play import play

pytestmark = pytest.mark.fe


@pytest.fixture(scope="module")
def drive(small_design, few_masters):
    """The small gear, its circular spline rigid."""
    model = solid_sector_model(
        small_design, half=True, elastic_circular_spline=False, orders=few_masters
    )
    return SolidContinuation(model=model, ratio=small_design.ratio)


@pytest.fixture(scope="module")
def found(drive):
    """On its wave generator, and its play."""
    state, model = drive.deflect(), drive.model
    return state, play(model, model.frames(state)[0], model.loads(state), drive.ratio)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_solved_output_is_free_over_the_play(drive, found, side):
    """Half of it either way: free just before, in contact just behind."""
    state, free = found
    # the ratio of 20 is 5 % of it
    for share, touches in ((0.995, False), (1.005, True)):
        there = drive.hold_output(drive.rotate_output(state, side * 0.5 * share * free))
        assert there.outcome.ok
        assert is_free(there) is not touches


def test_play_does_not_depend_on_where_in_it_the_output_stands(drive, found):
    """Turned by a tenth of the play, the other side is so much farther."""
    state, free = found
    model = drive.model
    frame = model.frames(state)[0]
    turn = about_z(np.array(0.1 * free)) @ frame.turn
    there = play(model, replace(frame, turn=turn), model.loads(state), drive.ratio)
    assert there == pytest.approx(free, rel=1e-6)


def test_teeth_that_are_far_have_no_end_of_play(drive, found):
    """A flexspline 3 mm smaller passes the circular spline without touching."""
    state, _ = found
    frame = drive.model.frames(state)[0]
    inside = replace(frame, centre=frame.centre - [0.0, 3e-3, 0.0])
    assert play(drive.model, inside, drive.model.loads(state), drive.ratio) == np.inf
