"""Stress state of the 2D models: plane stress, plane strain or a state in between."""

from __future__ import annotations

from math import pi

import numpy as np

from swgjoint.fe.plane.sector_mesh import SectorMesh, sector_mesh
from swgjoint.fe.plane.superelement import condense
from swgjoint.fe.rings.sections import rim_section
from swgjoint.gear.design.design import Design, MemberName
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.gear.wide_ring import RimAcross, edge_confinement, rim_confinement
from swgjoint.units import mm

COARSE = 0.5
"""Mesh refinement of the sector that determines the rim stiffness [-]. It does not
depend on the mesh of the drive, so that the stress state stays the same when that mesh
is refined. The rim stiffness is within 1 % of the converged value."""


def confinement(design: Design, member: MemberName, profile: ToothProfile) -> float:
    """Confinement of a member: 0 in plane stress, 1 in plane strain [-].

    Args:
        design: The drive; its ``mesh.stress_state`` selects the state. With ``auto`` a
            rim that can bend follows :func:`swgjoint.gear.wide_ring.rim_confinement`. A
            circular spline with a fixed outside cannot bend; it follows
            :func:`swgjoint.gear.wide_ring.edge_confinement`.
        member: Flexspline or circular spline.
        profile: Tooth profile of this member.
    """
    chosen = design.mesh.stress_state
    if chosen != "auto":
        return 1.0 if chosen == "plane_strain" else 0.0
    rim, width = getattr(design, member).rim_mm * mm, design.drive.face_width_mm * mm
    module = design.drive.module_mm * mm
    if member == "circular_spline" and design.circular_spline.outer_rim == "fixed":
        return edge_confinement(width, module, rim)
    return rim_confinement(width, module, rim, rim_across(design, member, profile))


def rim_across(design: Design, member: MemberName, profile: ToothProfile) -> RimAcross:
    """Stiffness of a toothed rim around the axis and across the width.

    Args:
        design: The drive.
        member: Flexspline or circular spline.
        profile: Tooth profile of this member.
    """
    material = design.material_of(member)
    mesh = sector_mesh(profile, getattr(design, member).rim_mm * mm, COARSE)
    section = rim_section(
        condense(
            mesh,
            profile,
            youngs_modulus=material.youngs_modulus,
            poisson_ratio=material.poisson_ratio,
            width=1.0,
        )
    )
    pitch = 2.0 * pi * section.neutral_radius / profile.teeth
    return RimAcross(
        radius=section.neutral_radius,
        bending=section.bending,
        stretching=section.stretching,
        across=material.youngs_modulus * second_moment(mesh) / pitch,
    )


def second_moment(mesh: SectorMesh) -> float:
    """Second moment of area of a sector about the tangent through its centroid [m^4].

    It determines the bending stiffness of one pitch of the toothed rim across the
    width.
    """
    # two triangles per quadrilateral, exact for the polygon of the mesh
    corners = np.concatenate([mesh.mesh.t[[0, 1, 2]], mesh.mesh.t[[0, 2, 3]]], axis=1)
    x, y = mesh.mesh.p[:, corners]
    area = 0.5 * np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    first = float((area * y.mean(axis=0)).sum())
    second = float((area / 12.0 * ((y**2).sum(axis=0) + y.sum(axis=0) ** 2)).sum())
    return second - first**2 / float(area.sum())


def stress_state_label(design: Design) -> str:
    """Stress state that the 2D models of a design assume, for the validity label."""
    chosen = design.mesh.stress_state
    if chosen != "auto":
        return chosen.replace("_", " ")
    members: tuple[MemberName, ...] = ("flexspline", "circular_spline")
    values = " and ".join(
        f"{confinement(design, name, tooth_profile(design, name)):.2f}"
        f" ({name.replace('_', ' ')})"
        for name in members
    )
    return f"{values} of the way from plane stress to plane strain"
