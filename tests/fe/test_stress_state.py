"""The stress across the face width in the plane model of a design."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from skfem import MeshQuad

from swgjoint.fe.common.stress_state import (
    confinement,
    second_moment,
    stress_state_label,
)
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector, sector_model
from swgjoint.fe.plane.stress import circular_spline_stress, flexspline_stress
from swgjoint.fe.rings.sections import rim_section
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile

KINDS = ("plane_stress", "auto", "plane_strain")


def design_of(kind, **changes):
    return Design.load("reference-2d").with_changes(
        {"mesh.refinement": 0.5, "mesh.stress_state": kind} | changes
    )


def bending(kind):
    """E I of the toothed rim."""
    design = design_of(kind)
    element = sector(design, "flexspline", tooth_profile(design, "flexspline"))
    return rim_section(element).bending


def test_two_lobe_stiffness_of_a_rim():
    """Plane strain bends with E/(1 - nu^2), a mixture with E/(1 - c nu^2).

    Stresses under given moments do not depend on the constants in the plane (Michell).
    """
    nu = design_of("auto").material_of("flexspline").poisson_ratio
    design = design_of("auto")
    share = confinement(design, "flexspline", tooth_profile(design, "flexspline"))
    assert 0.6 < share < 0.7
    free = bending("plane_stress")
    # 0.1 %: the faces stay plane
    assert bending("plane_strain") / free == pytest.approx(1 / (1 - nu**2), rel=1e-3)
    assert bending("auto") / free == pytest.approx(1 / (1 - share * nu**2), rel=1e-3)


def test_confinement_does_not_depend_on_the_mesh():
    """Refining the mesh of a drive changes nothing else."""
    coarse, fine = design_of("auto"), design_of("auto", **{"mesh.refinement": 2})
    for member in ("flexspline", "circular_spline"):
        profile = tooth_profile(coarse, member)
        assert confinement(coarse, member, profile) == confinement(
            fine, member, profile
        )


def test_free_circular_spline_can_bend_across():
    """A circular spline in a housing keeps more of its axial stress than a free one."""
    fixed = design_of("auto")
    free = design_of("auto", **{"circular_spline.outer_rim": "free"})
    profile = tooth_profile(fixed, "circular_spline")
    assert (
        0.0
        < confinement(free, "circular_spline", profile)
        < confinement(fixed, "circular_spline", profile)
        < 1.0
    )


def test_second_moment_of_a_rectangle():
    """A sector without tooth or curvature has p t^3/12."""
    flat = MeshQuad.init_tensor(np.linspace(-1.0, 1.0, 6), np.linspace(7.0, 10.0, 4))
    assert second_moment(SimpleNamespace(mesh=flat)) == pytest.approx(
        2.0 * 3.0**3 / 12.0
    )


def test_axial_stress_follows_the_plane():
    """It is nu (xx + yy) in plane strain, c nu (xx + yy) with auto, else zero."""
    for kind in KINDS:
        design = design_of(kind)
        model = sector_model(design, half=True)
        follow = Continuation(model=model, ratio=design.ratio)
        state = follow.to_torque(follow.engage(follow.deflect()), 20.0)
        assert state.outcome.ok
        for member, stress in (
            ("flexspline", flexspline_stress(model, state)),
            ("circular_spline", circular_spline_stress(model, state)),
        ):
            nu = design.material_of(member).poisson_ratio
            share = confinement(design, member, tooth_profile(design, member))
            axial = share * nu * (stress[..., 0] + stress[..., 1])
            assert np.abs(stress).max() > 0.0
            assert stress[..., 3] == pytest.approx(
                axial, abs=1e-12 * np.abs(stress).max()
            )


def test_label_names_what_was_assumed():
    """Both members with their share, or the limit that the design asks for."""
    assert stress_state_label(design_of("plane_stress")) == "plane stress"
    assert stress_state_label(design_of("plane_strain")) == "plane strain"
    design = design_of("auto")
    told = stress_state_label(design)
    for member in ("flexspline", "circular_spline"):
        share = confinement(design, member, tooth_profile(design, member))
        assert f"{share:.2f} ({member.replace('_', ' ')})" in told
