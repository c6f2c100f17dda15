"""Fields of an equilibrium in space, from the frames of the teeth."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.solid.figures.axial_section import sector_points
from swgjoint.fe.solid.figures.shape_fields import solid_fields, solid_surface


def test_shape_and_forces_are_those_of_the_equilibrium(small_ring, loaded):
    """Turned back to where it stands, every node is where the solver has it."""
    surface = solid_surface(small_ring)
    found = solid_fields(small_ring, loaded, surface)
    for sector in (0, 7):
        angle = 2.0 * np.pi / 40 * sector + loaded.rotation
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        there = (surface.points + found.displacement[sector]) @ turn.T
        solved = np.concatenate(sector_points(small_ring, loaded, sector))
        assert there == pytest.approx(solved[surface.nodes], abs=1e-12)
    # the teeth's moment, at their arm to within the depth of the tooth
    radius = np.hypot(*surface.points[surface.triangles[0], :2].T).max()
    turned = -2.0 * found.tooth_force[:, 0].sum() * radius
    assert turned == pytest.approx(loaded.tooth_moment, rel=0.1)
    # on the bore the wave generator pushes outwards
    assert found.wave_generator_force[:, 1].min() >= 0.0
    assert found.wave_generator_force[:, 1].max() > 10.0
    assert found.von_mises.max() > 1e8


def test_the_surface_closes_over_open_edge_and_cup(small_ring):
    """It reaches from the bore of the teeth to that of the diaphragm; no node alone."""
    surface = solid_surface(small_ring)
    radius, z = np.hypot(*surface.points[:, :2].T), surface.points[:, 2]
    assert np.unique(surface.triangles).size == len(surface.nodes)
    assert radius.min() < 8e-3
    assert np.ptp(z) > 20e-3
    image = surface.points[surface.mirrored] * np.array([-1.0, 1.0, 1.0])
    assert image == pytest.approx(surface.points, abs=1e-12)
