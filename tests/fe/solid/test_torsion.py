"""Torsion in space under torque: sign, tangent, play, series springs, layouts."""

from __future__ import annotations

import numpy as np
import pytest
from solved import BEARING, kept

from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.figures.torsion import SMALL, solid_torsion

pytestmark = pytest.mark.fe

TORQUES = (2.0, 5.0)


@pytest.fixture(scope="module")
def design(small_design):
    """The small gear behind a boss half as stiff as itself."""
    return small_design.with_changes({"boss.torsional_stiffness_Nm_rad": 8e3})


def solved(design, **settings):
    """Torsion, and what the solver met as (torque, output angle, compliance)."""
    followed, to_torque = [], SolidContinuation.to_torque

    def seen(self, state, torque):
        found = to_torque(self, state, torque)
        followed.append((torque, self.output_angle(found), found.compliance))
        return found

    def solve():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(SolidContinuation, "to_torque", seen)
            return solid_torsion(design, TORQUES, **settings), followed

    return kept(f"torsion {design.content_hash()} {TORQUES} {settings}", solve)


@pytest.fixture(scope="module")
def on_balls_followed(design, few_masters_everywhere):
    """On its bearing."""
    return solved(design.with_changes(BEARING), bearing="free")


@pytest.fixture(scope="module")
def on_balls(on_balls_followed):
    """The torsion alone."""
    return on_balls_followed[0]


@pytest.fixture(scope="module")
def rigid(design, few_masters_everywhere):
    """Rigid wave generator, flexspline fixed: the circular spline is the output."""
    return solved(design.with_changes({"drive.layout": "flexspline_fixed"}))[0]


def test_torsion_follows_the_load_and_its_tangent(on_balls):
    """T forwards gives torsion above zero, and the chord lies between the tangents."""
    assert on_balls.torque == pytest.approx(TORQUES)
    assert (on_balls.torsion > 0.0).all()
    chord = np.diff(on_balls.torsion)[0] / np.diff(TORQUES)[0]
    low, high = sorted(on_balls.compliance)
    # tooth contacts that begin in between bend the curve by a percent
    assert 0.99 * low < chord < 1.01 * high
    assert low > 0.0


def test_half_the_play_is_torsion_before_the_teeth_resist(on_balls):
    """Taken up without torque; the curve rises from there in proportion to the load.

    Contacts that begin on the way bend it by a few percent of the play.
    """
    tangents = on_balls.torsion - on_balls.compliance * on_balls.torque
    assert 0.5 * on_balls.torsion[1] < on_balls.half_play < on_balls.torsion[0]
    assert tangents == pytest.approx(on_balls.half_play, rel=0.05)


def test_what_is_in_series_counts_once(on_balls_followed):
    """Torsion and tangent are those of the solver and of a boss of 8000 N·m/rad."""
    on_balls, followed = on_balls_followed
    torque, angle, compliance = np.array(followed).T
    assert torque == pytest.approx([SMALL * TORQUES[0], *TORQUES])
    assert on_balls.torsion == pytest.approx(-angle[1:] + torque[1:] / 8e3, rel=1e-9)
    assert on_balls.compliance == pytest.approx(compliance[1:] + 1 / 8e3, rel=1e-9)


def test_teeth_and_race_press_where_the_cone_opens(on_balls):
    """Centres lie inside the face, those of the teeth at the open end, below zero."""
    assert (on_balls.tooth_centre > -0.5).all()
    assert (on_balls.tooth_centre < -0.05).all()
    assert (np.abs(on_balls.bore_centre) < 0.5).all()
    assert (on_balls.balls >= 4).all()
    assert (np.diff(on_balls.tooth_force) > 0.0).all()


@pytest.mark.slow
def test_the_layout_of_the_design_is_solved(design, on_balls, rigid):
    """The circular spline under T loads the teeth by 1 - 1/i of a flexspline under T.

    The wave generator takes the rest; on balls or rigid the teeth carry alike to 1 %.
    """
    other = design.with_changes({"drive.layout": "flexspline_fixed"})
    share = 1.0 - 1.0 / other.ratio
    assert share == pytest.approx(20.0 / 21.0)
    assert rigid.tooth_force == pytest.approx(share * on_balls.tooth_force, rel=0.02)
    assert (rigid.balls == 0).all()
    assert (rigid.torsion > rigid.half_play).all()
    chord = np.diff(rigid.torsion)[0] / np.diff(TORQUES)[0]
    assert rigid.compliance == pytest.approx(chord, rel=0.01)
