"""A small gear in space, solved once in a run."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.solid import drive3d
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.strip.masters import Orders
from swgjoint.gear.design.design import Design

TORQUE = 5.0
ORDERS = Orders(teeth=3, cup=2, at_teeth=2, around=2, rim=1, wall=1, rim_bending=1)
"""As few masters as place the arcs of sections and fillet: laws hold at any degree."""


@pytest.fixture(scope="session")
def few_masters():
    """The degrees above, for models that a test builds itself."""
    return ORDERS


@pytest.fixture(scope="module")
def few_masters_everywhere():
    """The same in the models that the package builds on the way to a result."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drive3d, "Orders", lambda: ORDERS)
        yield


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
def thin_cup():
    """40 and 42 teeth of module 0.4, the wall as thin as that of XB1-100-80."""
    return Design.load("xb1-100-80").with_changes(
        {
            "drive.teeth_flexspline": 40,
            "drive.teeth_circular_spline": 42,
            "drive.face_width_mm": 5.0,
            "flexspline.rim_mm": 0.3,
            "cup.length_mm": 12.0,
            "cup.fillet_mm": 0.6,
            "cup.bore_radius_mm": 3.0,
            "mesh.refinement": 0.5,
        }
    )


@pytest.fixture(scope="session")
def small_ring(small_design):
    """Half of it, the circular spline elastic."""
    return solid_sector_model(small_design, half=True, orders=ORDERS)


@pytest.fixture(scope="session")
def small_drive(small_design, small_ring):
    """Follows its equilibria."""
    return SolidContinuation(model=small_ring, ratio=small_design.ratio)


@pytest.fixture(scope="session")
def kept_once():
    """``solved.kept``, imported when the run has its folder."""
    from solved import kept

    return kept


@pytest.fixture(scope="session")
def deflected(small_design, small_drive, kept_once):
    """On the wave generator, no tooth contact."""
    name = f"deflected {small_design.content_hash()} {ORDERS}"
    return kept_once(name, small_drive.deflect)


@pytest.fixture(scope="session")
def loaded(small_design, small_drive, deflected, kept_once):
    """At 5 N·m, 0.4 of a pitch on: no position of symmetry."""

    def solve():
        state = small_drive.to_torque(small_drive.engage(deflected), TORQUE)
        return small_drive.to_angle(state, 0.4 * 2.0 * np.pi / 42)

    return kept_once(f"loaded {small_design.content_hash()} {ORDERS}", solve)


@pytest.fixture(scope="module")
def small_pattern(few_masters_everywhere, kept_once):
    """Samples of the small drive for its map, its teeth perfect or not.

    Equilibria of the perfect teeth, eight angles by three torques, are solved once.
    """
    from swgjoint.fe.common import sampling

    solve_mesh_cycle = sampling.solve_mesh_cycle

    def pattern(*args, **settings):
        return kept_once(
            f"pattern of the small drive {ORDERS}",
            lambda: solve_mesh_cycle(*args, **{**settings, "tick": nothing}),
        )

    def sample(design):
        return sampling.sample_map(design, model="3d", angles=8)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sampling, "solve_mesh_cycle", pattern)
        patch.setattr(sampling, "LEVELS", (0.1, 0.35, 1.0))
        patch.setattr(sampling, "FIXED_SOLVES", 8)
        yield sample


def nothing() -> None:
    """A solve is done."""
