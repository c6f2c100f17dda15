"""A small gear in space, built and solved once per worker."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_ring
from swgjoint.gear.design import Design

TORQUE = 5.0


@pytest.fixture(scope="session")
def small_design():
    """40 and 42 teeth with crowning and slope: strains far above those of steel."""
    return Design.load("reference-3d-modified").with_changes(
        {
            "drive.teeth_flexspline": 40,
            "drive.teeth_circular_spline": 42,
            "cup.length_mm": 14.0,
            "cup.bore_radius_mm": 7.0,
            "mesh.refinement": 0.5,
        }
    )


@pytest.fixture(scope="session")
def small_ring(small_design):
    """Half of it, the circular spline elastic."""
    return solid_ring(small_design, half=True)


@pytest.fixture(scope="session")
def small_drive(small_design, small_ring):
    """Follows its equilibria."""
    return SolidContinuation(ring=small_ring, ratio=small_design.ratio)


@pytest.fixture(scope="session")
def deflected(small_drive):
    """On the wave generator, no tooth contact."""
    return small_drive.deflected()


@pytest.fixture(scope="session")
def loaded(small_drive, deflected):
    """At 5 N·m, 0.4 of a pitch on: no position of symmetry."""
    state = small_drive.to_torque(small_drive.meshed(deflected), TORQUE)
    return small_drive.to_angle(state, 0.4 * 2.0 * np.pi / 42)
