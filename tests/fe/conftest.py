"""Plane drives that several files share, each solved once in a run."""

from __future__ import annotations

import pytest
from solved import coarse, kept

from swgjoint.fe.common.sampling import sample_map
from swgjoint.fe.tolerances.rest import influences


@pytest.fixture(scope="session")
def coarse_samples():
    """Of the simplified wave generator, whose teeth move more than the ellipse's."""
    design = coarse("reference-2d-simplified")
    return kept("samples circular_spline_fixed", lambda: sample_map(design, angles=12))


@pytest.fixture(scope="session")
def perfect_influences():
    """The perfect drive without load at one position, and its influences."""
    return kept("perfect influences", lambda: influences(coarse(), phases=1))
