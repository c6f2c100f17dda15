"""Maps of the thin rings: energy, ball passage, refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from messages import naming
from solved import hundred_elements, kept, ring_path

from swgjoint.cli.main import main
from swgjoint.drives.build_map import build_map
from swgjoint.errors import DesignError
from swgjoint.fe.rings import sampling
from swgjoint.fe.rings.loading import solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import thin_ring
from swgjoint.fe.rings.sampling import ball_passage, sample_thin_rings
from swgjoint.gear.design.design import Design
from swgjoint.maps.file import map_bytes
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.unfinished import Unfinished
from swgjoint.units import arcsec

LEVELS = (0.1, 0.35, 1.01)
"""Fewer torques than in a map for use, which has ten."""


def sampled(angles):
    """Positions of the balls of one drive."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sampling, "LEVELS", LEVELS)
        return sample_thin_rings(Design.load("size-25-100"), angles=angles)


@cache
def samples():
    """Three of them."""
    return kept("ring samples size-25-100, 3 positions", lambda: sampled(3))


def test_energy_of_the_samples_is_torque_over_torsion():
    """Strain energy rises by the integral of the torque, which the fit does not use."""
    given, drive = samples(), fit_map(samples(), keep=0.0)
    assert drive.info["energy_check"]["strain_energy_relative"] < 1e-4
    assert not drive.info["truncated"]
    assert given.free
    mean = given.input_torque.mean(axis=1)
    assert mean == pytest.approx(given.torque / drive.ratio, rel=0.01, abs=2e-4)


class Stop(Exception):
    """An interruption."""


def test_an_interrupted_ring_map_goes_on_bit_for_bit(monkeypatch, tmp_path):
    """Positions of the balls that were finished are read; only the others are asked."""
    monkeypatch.setattr(sampling, "LEVELS", (0.1, 1.01))
    monkeypatch.setattr(sampling, "UNSEEN", (0.5,))
    design, solve = Design.load("size-25-100"), sampling._position
    solved, asked = {}, []

    def once(model, phase, *others):
        asked.append(phase)
        if phase not in solved:
            solved[phase] = solve(model, phase, *others)
        return solved[phase]

    def stop(stage: str, done: int, total: int) -> None:
        if "unseen" in stage:
            raise Stop

    monkeypatch.setattr(sampling, "_position", once)
    keep = Unfinished(folder=tmp_path)
    with hundred_elements():
        with pytest.raises(Stop):
            sample_thin_rings(design, angles=2, keep=keep, progress=stop)
        before = len(asked)
        found = sample_thin_rings(design, angles=2, keep=keep)
        again = asked[before:]
        whole = sample_thin_rings(design, angles=2)
    assert (before, len(again)) == (3, 2) and not set(asked[:before]) & set(again)
    took = {"sampling_wall_s": 0.0}
    assert map_bytes(replace(fit_map(found), info=took)) == map_bytes(
        replace(fit_map(whole), info=took)
    )


@pytest.mark.slow
def test_derivative_of_the_map_is_the_unseen_input_torque():
    """Five positions leave a tenth of the ripple of the input torque."""
    drive = fit_map(sampled(5), keep=0.0)
    assert drive.info["energy_check"]["relative"] < 0.15


def test_stiffness_of_the_map_is_that_of_the_rings():
    """The map's mean torsion is the path's, its stiffness rises with load."""
    drive = fit_map(samples(), keep=0.0)
    found = ring_path()
    assert found.torque[-2:] == pytest.approx([48.0, 96.0])
    assert [drive.mean_torsion(t) for t in found.torque[-2:]] == pytest.approx(
        list(found.torsion[-2:]), rel=5e-3
    )
    x = np.array([drive.mean_torsion(t) for t in (0.0, 14.0, 48.0, 150.0)])
    slope = np.diff([0.0, 14.0, 48.0, 150.0]) / np.diff(x)
    assert (np.diff(slope) > 0.0).all()


def test_ball_passage_is_an_order_of_the_map():
    """23 balls pass two lobes 46 times a cage turn, 25.5 times an input turn."""
    design = Design.load("size-25-100")
    passage = ball_passage(design, thin_ring(design))
    assert passage.per_cage_turn == 46
    # the cage turns at 0.549 of the flexspline, seen from the cam
    assert passage.per_input_turn == pytest.approx(46 * 0.5493 * 1.01, rel=1e-3)
    drive = fit_map(samples())
    assert {tuple(o) for o in drive.orders} >= {(0, 0), (passage.carried_as, 0)}


@pytest.mark.slow
def test_odd_ball_counts_run_smoother():
    """With 22 balls both lobes meet a ball at once; with 23 they take turns."""
    swing = {}
    for balls in (22, 23):
        design = Design.load("size-25-100").with_changes(
            {"wave_generator.bearing.balls": balls}
        )
        model = thin_ring(design)
        count = ball_passage(design, model).per_cage_turn
        found = [
            solve_loaded(model, solve_loaded(model, rest, 1.0), 48.0)
            for k in range(3)
            if (
                rest := solve_unloaded(model, 0.0, -2 * np.pi / count * k / 3)
            ).outcome.ok
        ]
        assert len(found) == 3
        assert all(state.outcome.ok for state in found)
        swing[balls] = np.ptp([state.rotation for state in found])
    assert swing[22] > 4.0 * swing[23]
    assert swing[23] < 2.0 * arcsec


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("reference-2d", {}, ("wave_generator.bearing", "table", "2d model")),
    ],
)
def test_what_a_ring_map_lacks_is_refused(name, changes, message):
    """One line that names the key, before anything is solved."""
    design = Design.load(name).with_changes(changes)
    with pytest.raises(DesignError, match=naming(name, *message)):
        build_map(design, model="ring", cache=False)


@pytest.mark.slow
def test_spec_by_the_rings(capsys, monkeypatch, tmp_path):
    """The sheet of a design at level ring has three stiffnesses that rise."""
    monkeypatch.setattr(sampling, "PHASES", 3)
    monkeypatch.setattr(sampling, "LEVELS", LEVELS)
    # a coarse map that others must not find
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    keys = "K1_Nm_rad,K2_Nm_rad,K3_Nm_rad,lost_motion_arcmin"
    arguments = ["spec", "size-17-50", "--model", "ring", "--only", keys, "--json"]
    assert main(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["validity"]["level"] == "ring"
    assert 0.0 < found["K1_Nm_rad"] < found["K2_Nm_rad"] < found["K3_Nm_rad"]
    assert 0.1 < found["lost_motion_arcmin"] < 3.0
