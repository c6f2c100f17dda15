"""The cup that CalculiX gets in space: every node and element once."""

from __future__ import annotations

import numpy as np
from solid_replay import QuarterCup

from swgjoint.fe.solid.drive3d import solid_ring
from swgjoint.gear.design import Design


def design():
    """40 teeth on a thin rim: the strains are half a per cent."""
    return Design.load("reference-3d-modified").with_changes(
        {
            "drive.teeth_flexspline": 40,
            "drive.teeth_circular_spline": 42,
            "flexspline.rim_mm": 0.4,
            "cup.length_mm": 14.0,
            "cup.bore_radius_mm": 7.0,
        }
    )


def test_quarter_has_every_node_and_element_once():
    """Elements of ten strips, no two nodes at one place, nothing inside out."""
    ring = solid_ring(design(), half=True, elastic_circular_spline=False)
    cup, strip = QuarterCup.of(ring), ring.strip.mesh
    assert len(cup.cells) == 10 * strip.elements
    assert np.unique(np.round(cup.points, 10), axis=0).shape == cup.points.shape
    assert np.unique(cup.cells).size == len(cup.points)
    corner = cup.points[cup.cells]
    edges = [corner[:, k] - corner[:, 0] for k in (1, 3, 4)]
    assert np.einsum("ei,ei->e", np.cross(edges[0], edges[1]), edges[2]).min() > 0.0
