"""The torque beyond the peak at which the samples of a map end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solved import few_teeth, kept

from swgjoint.errors import Outcome
from swgjoint.fe.common import mesh_cycle as pattern
from swgjoint.fe.common import sampling
from swgjoint.fe.common.columns.torque_choice import BEYOND
from swgjoint.fe.common.sampling import effort_of, sample_map
from swgjoint.gear.catalogue import ratings_of
from swgjoint.maps.fit.fit import fit_map

pytestmark = pytest.mark.fe
ANGLES = 6


def design():
    """A drive whose stiffness varies much with the angle."""
    return few_teeth("reference-2d-simplified")


def solved():
    return kept("beyond the peak", lambda: sample_map(design(), angles=ANGLES))


def test_no_angle_leaves_a_map_at_the_peak():
    """One torque more, solved at every angle: all peak torsions are inside the map."""
    given, peak = solved(), ratings_of(design()).repeated_peak
    drive = fit_map(given)
    top = given.torque[-1]
    assert BEYOND[0] * peak <= top - peak <= BEYOND[1] * peak
    assert given.torque[0] == -top
    assert given.solved[-1] and given.solved[0]
    at = int(np.flatnonzero(given.torque == peak)[0])
    zero = int(np.flatnonzero(given.torque == 0.0)[0])
    torsion = given.output_error[zero] - given.output_error[at]
    # the stiffest angle alone would end the map before the softest one is there
    assert np.ptp(torsion) > 0.0
    assert torsion.max() < drive.torsion_knots[-1]
    assert drive.info["sampled_torque_Nm"] == [-top, top]
    assert peak < drive.info["torque_range_Nm"][1] < top


def test_the_record_of_a_map_ends_at_the_peak():
    """Unseen torques are parts of the peak torque, as without a torque beyond it."""
    peak = ratings_of(design()).repeated_peak
    torques = fit_map(solved()).info["validation"]["torques_Nm"]
    assert max(torques) == pytest.approx(0.97 * peak)


def test_a_failed_solve_beyond_the_peak_leaves_the_map_as_it_is(monkeypatch):
    """The map then ends at the peak and counts as complete."""
    peak = ratings_of(design()).repeated_peak
    to_angle = sampling.Continuation.to_angle

    def failing(self, state, angle):
        found = to_angle(self, state, angle)
        if state.torque > 1.001 * peak and angle > 0.0:
            return replace(found, outcome=Outcome.DIVERGED)
        return found

    monkeypatch.setattr(sampling.Continuation, "to_angle", failing)
    monkeypatch.setattr(sampling, "LEVELS", (0.35, 1.0))
    monkeypatch.setattr(sampling, "UNSEEN", (2, 2))
    found = sample_map(design(), angles=2)
    assert found.torque[-1] == peak
    assert not found.info["truncated"]
    assert found.info["sampling"]["solves_per_angle"][0] > 0


def test_levels_alone_decide_what_is_shown(monkeypatch):
    """States of the torque beyond the peak are no part of the fields of the drive."""
    seen = []
    solve = pattern.solve_mesh_cycle

    def kept_pattern(*args, **options):
        seen.append(solve(*args, **options))
        return seen[-1]

    monkeypatch.setattr(sampling, "solve_mesh_cycle", kept_pattern)
    monkeypatch.setattr(sampling, "LEVELS", (0.35, 1.0))
    monkeypatch.setattr(sampling, "UNSEEN", (2, 2))
    given = sample_map(design(), angles=2)
    assert given.torque[-1] > max(seen[0].states)


def test_only_plane_maps_of_perfect_teeth_go_beyond():
    """A torque costs too much in space; maps with errors end where theirs end."""
    options = {"angles": None, "both_signs": False}
    assert effort_of("2d", errors=False, **options).beyond
    assert not effort_of("2d", errors=True, **options).beyond
    assert not effort_of("3d", errors=False, **options).beyond
