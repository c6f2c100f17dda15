"""Torque loops with friction of the teeth: closed, passive, odd, none without it."""

from __future__ import annotations

from dataclasses import fields
from functools import cache, partial

import numpy as np
import pytest
from messages import naming
from solved import kept

import swgjoint.drives.solve_map as solving
from swgjoint.drives.build_map import build_map
from swgjoint.errors import ComputationError
from swgjoint.fe.common.sampling import sample_map
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.figures import friction_loop
from swgjoint.fe.plane.figures.friction_loop import (
    FIRST_STEPS,
    friction_loops,
    loop_torques,
    small_loop_torques,
)
from swgjoint.gear.design.design import Design
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.unfinished import Unfinished

TOP = 40.0


def rubbing(coefficient: float) -> Design:
    # the parabola leaves its flanks room to slide; the ellipse holds the whole rim
    return Design.preset("reference-2d-parabolic").with_changes(
        {"friction.tooth_coefficient": coefficient, "mesh.refinement": 0.5}
    )


@cache
def loop(coefficient: float, steps: int = 4):
    """The loop half a pitch from the symmetric position, where it is symmetric, too."""
    design = rubbing(coefficient)
    (found,) = kept(
        f"friction loop {coefficient} {steps}",
        lambda: friction_loops(design, top=TOP, positions=1, steps=steps),
    )
    return found


def test_path_ends_with_a_round():
    """Zero, T, -T, T in all; every torque of the round twice, from both sides."""
    torque = loop_torques(TOP, 8)
    assert torque.size == 3 * FIRST_STEPS + 6 * 8 + 1
    assert torque[0] == 0.0 and torque[-1] == torque[-33] == TOP
    assert torque.max() == -torque.min() == TOP
    np.testing.assert_array_equal(torque[-33:-16][::-1], torque[-17:])


def test_small_loops_follow_from_the_top_downwards():
    """Means top - a, rated, half and zero, each run twice; larger ones are left out."""
    path = np.concatenate([[TOP], *small_loop_torques(TOP, 16.0)])
    for mean, end in ((36.0, 33), (16.0, 69), (8.0, 105), (0.0, 141)):
        last = path[end - 17 : end]
        assert (
            last.min() == mean - 4.0 and last.max() == last[0] == last[-1] == mean + 4.0
        )
        np.testing.assert_array_equal(last, path[end - 33 : end - 16])
    assert len(small_loop_torques(TOP, TOP)) == 3


def test_a_loop_that_is_kept_is_not_solved_again(monkeypatch, tmp_path):
    """It comes back bit for bit; one along other torques does not count."""
    one = loop(0.1)
    keep = Unfinished(folder=tmp_path)
    values = {item.name: getattr(one, item.name) for item in fields(one)}
    keep.write("friction-loop-0000", values)

    def unsolved(*args):
        raise ComputationError("solved again")

    monkeypatch.setattr(friction_loop, "_along", unsolved)
    shown = []
    options = {"top": TOP, "positions": 1, "steps": 4, "keep": keep}
    options["progress"] = lambda stage, done, total: shown.append((done, total))
    (found,) = friction_loops(rubbing(0.1), **options)
    total = shown[0][1]
    assert shown == [(0, total), (total, total)]
    for key, value in values.items():
        assert np.array_equal(getattr(found, key), value)
    with pytest.raises(ComputationError, match="solved again"):
        friction_loops(rubbing(0.1), **{**options, "top": 0.9 * TOP})


def test_every_equilibrium_is_reported():
    """One at a time, up to the total, which is known before the first."""
    shown = []
    design = Design.preset("reference-2d").with_changes(
        {"friction.tooth_coefficient": 0.1, "mesh.refinement": 0.5}
    )
    friction_loops(
        design,
        top=1.0,
        positions=1,
        steps=4,
        progress=lambda stage, done, total: shown.append((done, total)),
    )
    # nine torques of the elastic path, and the path with friction
    total = 9 + 3 * FIRST_STEPS + 6 * 4 + 1
    assert shown == [(k, total) for k in range(total + 1)]


def test_loop_closes_and_encloses_the_work_of_friction():
    """The second round ends where it began; its area is what friction took."""
    one = loop(0.1)
    assert abs(one.gap) < 1e-6 * np.ptp(one.torsion)
    assert one.friction_work > 0.0
    # the solver leaves 1e-12 J where nothing slips
    assert np.diff(one.work).min() > -1e-8 * one.friction_work
    # four steps a quarter leave 18 %
    assert one.area == pytest.approx(one.friction_work, rel=0.2)
    assert one.loss > 0.0


@pytest.mark.slow
def test_area_comes_to_the_work_with_more_steps():
    """The balance of the round closes as the steps do: 18 % at 4, 2 % at 12."""
    loops = [loop(0.1, steps) for steps in (4, 12)]
    few, many = (abs(one.area / one.friction_work - 1.0) for one in loops)
    assert many < 0.4 * few and many < 0.05


def test_loop_is_odd():
    """With a symmetric wave generator the loop is its own image under both signs."""
    one = loop(0.1)
    n = one.quarter
    falling, rising = one.branches(one.torsion)
    zero = 0.5 * (falling[n] + rising[n])
    np.testing.assert_allclose(
        falling - zero, -(rising - zero)[::-1], rtol=0, atol=1e-3 * one.width.max()
    )


@pytest.mark.slow
def test_without_friction_there_is_no_width():
    """A coefficient of zero gives the conservative curve on every branch."""
    one = loop(0.0)
    travel = np.ptp(one.torsion)
    np.testing.assert_allclose(
        one.torsion, one.elastic_torsion, rtol=0, atol=1e-7 * travel
    )
    assert one.friction_work == 0.0 and np.abs(one.width).max() < 1e-7 * travel


@pytest.mark.slow
def test_width_grows_with_a_small_coefficient():
    """Width and work are proportional to mu while friction changes the loads little."""
    once, twice = loop(0.01), loop(0.02)
    assert twice.friction_work == pytest.approx(2.0 * once.friction_work, rel=0.1)
    assert twice.width.mean() == pytest.approx(2.0 * once.width.mean(), rel=0.1)


def test_nothing_is_lost_where_nothing_slips():
    """After a reversal the teeth stick: a small cycle returns and takes no work."""
    design = rubbing(0.1)
    follow = Continuation(model=sector_model(design, half=True), ratio=design.ratio)
    state = follow.to_torque(follow.engage(follow.deflect()), 30.0)
    small = [follow.to_torque(state, 29.9)]
    for torque in (29.98, 29.9, 29.98, 29.9):
        small.append(follow.to_torque(small[-1], torque))
    assert all(one.outcome.ok for one in small)
    work = [one.friction_work for one in small]
    angle = [one.rotation for one in small]
    assert np.ptp(work[1:]) < 1e-7 * loop(0.1).friction_work
    assert angle[4] == pytest.approx(angle[2], abs=1e-12)
    assert abs(angle[1] - angle[2]) > 1e-7


@pytest.mark.slow
def test_map_has_the_hysteresis_of_its_teeth(monkeypatch):
    """The map of a design with friction: a potential without, elements on top of it."""
    design, given = rubbing(0.1), []

    def sampled(*args: object, **keys: object) -> object:
        given.append(sample_map(*args, **keys))
        return given[-1]

    monkeypatch.setattr(solving, "sample_map", sampled)
    few = partial(friction_loops, positions=2)
    monkeypatch.setattr(solving, "friction_loops", few)
    drive = build_map(design, angles=4, cache=False)
    smooth = fit_map(given[0])
    np.testing.assert_array_equal(drive.potential, smooth.potential)
    assert smooth.hysteresis == () and len(drive.hysteresis) > 0
    report = drive.info["friction_loop"]
    taken = np.array(report["round_area_map_J"])
    # one set of elements for all positions, whose work differs by half
    assert taken.mean() == pytest.approx(np.mean(report["friction_work_J"]), rel=0.05)
    assert report["residual_width_rms_arcmin"] < 0.3 * report["width_rms_arcmin"]
    sheet = drive.spec_sheet(only=["hysteresis_loss_arcmin"])
    loss = np.mean(report["hysteresis_loss_arcmin"])
    assert sheet["hysteresis_loss_arcmin"] == pytest.approx(loss, rel=0.5)
    assert "tooth friction" in sheet["validity"]["hysteresis"]


def test_free_output_is_refused():
    """Clearance of the teeth: no torsion belongs to zero torque, and that is said."""
    thin = Design.load("reference-2d-simplified").with_changes(
        {"flexspline.thickness_coefficient": 0.95, "friction.tooth_coefficient": 0.1}
    )
    with pytest.raises(
        ComputationError, match=naming("equilibrium", "0.02575 rad", "clearance")
    ):
        friction_loops(thin, top=TOP, positions=1, steps=4)


def test_map_without_a_loop_says_why(monkeypatch, synthetic_map):
    """Where friction cannot be solved the map keeps its potential, with the reason."""

    def fails(*_: object, **__: object) -> None:
        raise ComputationError("no equilibrium at 3 N·m")

    monkeypatch.setattr(solving, "friction_loops", fails)
    drive = solving._with_friction(rubbing(0.1), synthetic_map, lambda *_: None, None)
    sheet = drive.spec_sheet(only=["hysteresis_loss_arcmin"])
    assert sheet["hysteresis_loss_arcmin"] is None
    assert "no equilibrium at 3 N·m" in sheet["missing"]["hysteresis_loss_arcmin"]
