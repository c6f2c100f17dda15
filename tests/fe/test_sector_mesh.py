"""Meshes of a tooth sector: counts of the thesis, coarse and fine ones."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.plane.sector_mesh import sector_mesh
from swgjoint.fe.solid.strip.mesh import flexspline_strip
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile


def test_mesh_of_the_thesis():
    """181 nodes and 146 elements a tooth."""
    design = Design.load("reference-2d")
    sector = sector_mesh(tooth_profile(design, "flexspline"), 1e-3, 1)
    assert sector.mesh.p.shape[1] == 181
    assert sector.mesh.t.shape[1] == 146


@pytest.mark.parametrize("refinement", [0.5, 0.7, 1, 1.5, 2])
def test_any_refinement_fills_the_sector(refinement):
    """The area does not depend on the mesh but for the facets of the arcs."""
    design = Design.load("reference-2d")
    profile = tooth_profile(design, "flexspline")

    def area(n):
        mesh = sector_mesh(profile, 1e-3, n).mesh
        x, y = mesh.p[:, mesh.t]
        return 0.5 * np.sum(
            (x[2] - x[0]) * (y[3] - y[1]) - (x[3] - x[1]) * (y[2] - y[0])
        )

    assert area(refinement) == pytest.approx(area(8), rel=0.01 / refinement**2)


def test_coarse_strip_has_an_eighth_of_the_elements():
    """Half as many along every edge, rounded up."""
    design = Design.load("reference-3d")
    profile = tooth_profile(design, "flexspline")
    fine = flexspline_strip(design, profile)
    coarse = flexspline_strip(design.with_changes({"mesh.refinement": 0.5}), profile)
    assert fine.elements / 8 < coarse.elements < fine.elements / 5
