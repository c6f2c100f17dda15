"""What rubs in a thin-ring drive: laws of the sliding work."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming
from solved import hundred_elements

from swgjoint.errors import InputError, Outcome
from swgjoint.fe.rings.friction import RubbedPath, friction_path
from swgjoint.fe.rings.loading import solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import thin_ring
from swgjoint.fe.rings.sliding import weighted_median
from swgjoint.gear.design.design import Design

ANGLES = [0.3]
TORQUES = [20.0, 40.0, 80.0]


@pytest.fixture(scope="module", autouse=True)
def few_elements():
    """The laws hold for rings of any number of elements."""
    with hundred_elements():
        yield


@pytest.fixture(scope="module")
def design():
    """100 teeth, rim of 0.0125 pitch diameters: it differs least with the phase."""
    return Design.preset("size-25-50").with_changes({"flexspline.rim_mm": 0.79375})


@pytest.fixture(scope="module")
def path(design):
    """Along three torques at one wave-generator angle."""
    return friction_path(design, TORQUES, angles=ANGLES)


def test_torsion_is_from_the_middle_of_the_play(design, path):
    """A torque and its opposite turn the rings by as much, whatever the play."""
    assert path.outcome is Outcome.CONVERGED
    model = thin_ring(design)
    rest = solve_unloaded(model, ANGLES[0])
    ends, small = [], path.torque[0]
    for sign in (1.0, -1.0):
        state = solve_loaded(model, rest, sign * small)
        ends.append([state.rotation])
        for torque in path.torque[1:]:
            state = solve_loaded(model, state, sign * torque)
            ends[-1].append(state.rotation)
    up, down = np.array(ends)
    rings = path.torsion - path.series * path.torque
    # the teeth mesh at another phase under the opposite torque
    assert rings == pytest.approx(0.5 * (down - up), rel=0.02)


@pytest.mark.slow
def test_work_adds_up_along_the_path(design, path):
    """Half way in between the same slides: 5 % of the work, as forces are not linear.

    With mu = 1 it would still be less than what the torque puts in.
    """
    finer = friction_path(design, [20.0, 30.0, 40.0, 60.0, 80.0], angles=ANGLES)
    for key in ("teeth_work", "race_work"):
        coarse, fine = getattr(path, key), getattr(finer, key)
        assert (coarse > 0.0).all()
        sums = [fine[1:3].sum(), fine[3:].sum()]
        assert sums == pytest.approx(coarse[1:], rel=0.05)
    gain = np.trapezoid(path.torque, path.torsion)
    assert (path.teeth_work + path.race_work).sum() < gain


def test_similar_drives_rub_in_proportion(design, path):
    """Twice all lengths, clearances too: eight times torque and work, same torsion."""
    bearing = design.wave_generator.bearing
    large = Design.preset("size-50-50").with_changes(
        {
            "wave_generator.bearing.clearance_um": 2.0 * bearing.clearance_um,
            "flexspline.rim_mm": 2.0 * design.flexspline.rim_mm,
        }
    )
    found = friction_path(large, [8.0 * t for t in TORQUES], angles=ANGLES)
    # 1e-4: profiles of the family are rounded to a nanometre
    assert found.torsion[1:] == pytest.approx(path.torsion[1:], rel=1e-4)
    assert found.race_work[1:] == pytest.approx(8.0 * path.race_work[1:], rel=1e-3)
    assert found.teeth_work[1:] == pytest.approx(8.0 * path.teeth_work[1:], rel=1e-3)


def known():
    """R is 3 mu, K is 100, the play 0.1 rad; 5 to 35 N·m."""
    torsion = np.array([0.1, 0.2, 0.4])
    return RubbedPath(
        torque=100.0 * (torsion - 0.05),
        torsion=torsion,
        series=0.0,
        teeth_work=2.0 * np.diff(torsion),
        race_work=1.0 * np.diff(torsion),
        compliance=np.full(3, 0.01),
        shares={},
        balls=np.ones(3),
        tooth_pairs=np.ones(3),
        outcome=Outcome.CONVERGED,
    )


def test_a_loop_of_known_friction():
    """Width 2 R/K, without load the play besides; round work."""
    made, torsion = known(), known().torsion
    assert made.torque_per_mu == pytest.approx(3.0)
    assert made.widths(0.1) == pytest.approx(2 * 0.3 / 100.0)
    assert made.hysteresis_loss(0.1) == pytest.approx(2 * (0.05 + 0.3 / 100.0))
    # four branches of the round: out and back to either side
    assert made.round_loss(0.1) == pytest.approx(4 * 0.3 * (torsion - 0.1))


def test_a_path_says_nothing_beyond_its_end():
    """One line with what it reaches, instead of the last torsion."""
    assert known().torsion_at(35.0) == pytest.approx(0.4)
    assert known().torsion_at(0.0) == pytest.approx(0.05)
    for torque in (35.1, -0.1, float("nan")):
        with pytest.raises(
            InputError, match=naming("torque", f"{torque:g} N·m", "0", "35 N·m")
        ):
            known().torsion_at(torque)
    with pytest.raises(InputError, match=naming("torque", "36 N·m", "0", "35 N·m")):
        known().hysteresis_loss(12.0)


def test_the_race_creeps_to_where_least_work_is():
    """The weighted median is no worse than any other place."""
    rng = np.random.default_rng(3)
    values, weight = rng.normal(size=40), rng.uniform(size=40)
    best = weighted_median(values, weight)

    def work(place):
        return float(weight @ np.abs(values - place))

    assert work(best) <= min(work(v) for v in [*values, *np.linspace(-3, 3, 301)])
    assert weighted_median(values, np.zeros(40)) == 0.0
