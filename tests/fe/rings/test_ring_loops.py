"""Friction loops of the thin rings, as targets of hysteresis elements."""

from __future__ import annotations

import numpy as np
import pytest
from solved import hundred_elements

from swgjoint.errors import Outcome
from swgjoint.fe.plane.figures.friction_loop import STEPS, loop_torques
from swgjoint.fe.rings import friction_loops
from swgjoint.fe.rings.friction import RubbedPath, friction_path
from swgjoint.fe.rings.friction_loops import path_loop, ring_friction_loops
from swgjoint.gear.design.design import Design
from swgjoint.maps.fit.hysteresis_loops import fit_elements
from swgjoint.maps.unfinished import Unfinished

MU, TOP = 0.1, 60.0
TORQUE = loop_torques(TOP)


@pytest.fixture(scope="module")
def path():
    """Rings of size 25 and ratio 50 at one input angle."""
    with hundred_elements():
        outward = np.unique(TORQUE[TORQUE > 0.0])
        return friction_path(Design.preset("size-25-50"), outward, angles=[0.3])


def test_width_of_the_loop_is_twice_the_friction_torque_over_the_stiffness(path):
    """Within 3 % in the mean; the path has its widths between torques, not at them."""
    loop = path_loop(path, TORQUE, MU, 0.3, STEPS)
    middle = 0.5 * (path.torque[1:-1] + path.torque[2:])
    width = np.interp(middle, TORQUE[-2 * STEPS - 1 :], loop.width)
    # not where the falling branch still sticks after the reversal
    expected = path.widths(MU)[1:]
    # the elastic torque differs from that of a branch by mu R, 5 % of it
    assert width[1:-2] == pytest.approx(expected[1:-2], rel=0.1)
    assert width[1:-2].mean() == pytest.approx(expected[1:-2].mean(), rel=0.03)
    assert loop.gap == pytest.approx(0.0, abs=1e-12)
    assert loop.loss == pytest.approx(0.0, abs=0.02 * loop.width.max())


def test_area_of_the_loop_is_the_work_of_friction(path):
    """Both agree within the steps of the loop, and with the work along the path."""
    loop = path_loop(path, TORQUE, MU, 0.3, STEPS)
    assert loop.area == pytest.approx(loop.friction_work, rel=0.05)
    # friction carries a part of the largest torque, so that the torsion is smaller
    turn = TOP - MU * path.torque_per_mu[-1]
    expected = np.interp(turn, path.torque, path.round_loss(MU))
    assert loop.friction_work == pytest.approx(expected, rel=0.05)
    assert (np.diff(loop.work) >= 0.0).all()


def test_twice_the_friction_doubles_the_loop(path):
    """A small coefficient of friction: the loop is of first order in it."""
    once, twice = (path_loop(path, TORQUE, mu, 0.3, STEPS) for mu in (0.01, 0.02))
    inside = slice(2, -2)
    assert twice.width[inside] == pytest.approx(
        2.0 * once.width[inside], rel=0.02, abs=1e-9
    )


def test_sticking_contacts_are_stiffer_than_the_drive(path):
    """They hold the torsion until they slide."""
    assert (path.sticking > 1.0 / path.compliance[1:]).all()


def known(play: float) -> RubbedPath:
    """K is 1e4, R is mu T, contacts stick with 1e6 N·m/rad; 0.5 to 60 N·m."""
    torque = np.unique(np.append(0.5, TORQUE[TORQUE > 0.0]))
    torsion = play + torque / 1e4
    work = 0.5 * (torque[1:] + torque[:-1]) * np.diff(torsion)
    return RubbedPath(
        torque=torque,
        torsion=torsion,
        series=0.0,
        teeth_work=work,
        race_work=0.0 * work,
        compliance=np.full(torque.size, 1e-4),
        shares={},
        balls=np.ones(torque.size),
        tooth_pairs=np.ones(torque.size),
        outcome=Outcome.CONVERGED,
        sticking=np.full(torque.size - 1, 1e6),
    )


def test_known_friction_gives_a_known_loop():
    """Proportional to the load: T = T_0 (1 + mu) while loading, (1 - mu) unloading."""
    loop = path_loop(known(0.0), TORQUE, MU, 0.0, STEPS)
    grid = TORQUE[-2 * STEPS - 1 :]
    falling, rising = loop.branches(loop.torsion)
    slides = slice(STEPS + 1, 2 * STEPS - 1)
    assert rising[slides] * 1e4 == pytest.approx(grid[slides] / (1 + MU), rel=1e-6)
    assert falling[slides] * 1e4 == pytest.approx(grid[slides] / (1 - MU), rel=1e-6)


def test_clearance_belongs_to_the_elastic_torsion():
    """The loop has no width without load, where no tooth carries force."""
    loop = path_loop(known(1e-3), TORQUE, MU, 0.0, STEPS)
    assert loop.loss == pytest.approx(0.0, abs=1e-8)
    assert loop.elastic_torsion.max() == pytest.approx(1e-3 + TOP / 1e4)


def test_no_friction_gives_no_elements(monkeypatch):
    """Loops without width give elements of no more than rounding."""
    monkeypatch.setattr(
        friction_loops, "friction_path", lambda design, torques, angles: known(1e-4)
    )
    design = Design.preset("size-25-50")
    smooth = fit_elements(ring_friction_loops(design, top=TOP), 1e5)
    assert sum(element.yield_torque for element in smooth) < 1e-12
    rough = design.with_changes({"friction.tooth_coefficient": MU})
    loops = ring_friction_loops(rough, top=TOP)
    assert len(loops) == 2
    assert fit_elements(loops, 1e5)


def test_drives_with_other_errors_and_friction_share_their_paths(monkeypatch, tmp_path):
    """The paths are computed once, and the loops are those without a store."""
    asked = []

    def path(design, torques, angles):
        asked.append(angles)
        return known(1e-4)

    monkeypatch.setattr(friction_loops, "friction_path", path)
    smooth = Design.preset("size-25-50").with_changes(
        {"friction.tooth_coefficient": MU}
    )
    rough = smooth.with_changes(
        {
            "friction.tooth_coefficient": 2.0 * MU,
            "tolerances.circular_spline_ovality_um": 6.0,
        }
    )
    keep = Unfinished(folder=tmp_path)
    ring_friction_loops(smooth, top=TOP, keep=keep)
    assert len(asked) == 2
    shared = ring_friction_loops(rough, top=TOP, keep=keep)
    assert len(asked) == 2
    alone = ring_friction_loops(rough, top=TOP)
    for one, other in zip(shared, alone, strict=True):
        for key in ("torque", "torsion", "elastic_torsion", "stiffness", "work"):
            assert np.array_equal(getattr(one, key), getattr(other, key))


def test_a_stored_path_belongs_to_its_torques(monkeypatch, tmp_path):
    """Loops to another torque compute their path again."""
    keep, design = Unfinished(folder=tmp_path), Design.preset("size-25-50")
    monkeypatch.setattr(friction_loops, "friction_path", lambda *_, **__: known(1e-4))
    ring_friction_loops(design, top=TOP, keep=keep)

    def fail(*_, **__):
        raise LookupError

    monkeypatch.setattr(friction_loops, "friction_path", fail)
    ring_friction_loops(design, top=TOP, keep=keep)
    with pytest.raises(LookupError):
        ring_friction_loops(design, top=0.5 * TOP, keep=keep)
