"""Radial stiffness of a flexspline, its dependence on the load and its error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from swgjoint.fe.solid.figures.pinched_cup import pinched_cup
from swgjoint.fe.solid.strip.masters import Orders
from swgjoint.gear.design.design import Design
from swgjoint.gear.shell_theory import ShellDimensions, cup_stiffness
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.progress import Progress, silent
from swgjoint.units import mm

COARSEST = 0.5
"""Least refinement of a mesh [-]."""
SMALL = 1.0
"""Load of the linear model, whose stiffness does not depend on it [N]."""
FINER = replace(
    Orders(),
    teeth=Orders().teeth + 2,
    cup=Orders().cup + 2,
    at_teeth=Orders().at_teeth + 2,
    around=Orders().around + 2,
)
"""Higher degrees of the displacements of faces and sections, to estimate the error."""


@dataclass(frozen=True, kw_only=True)
class RadialStiffness:
    """Force of a lobe over its deflection with a clamped boss [N/m]."""

    mid_face: float
    """Linear stiffness for a load in the middle of the face width [N/m]."""
    open_edge: float
    """Linear stiffness for a load at the open end [N/m]."""
    face_width: float
    """Linear stiffness for a load spread evenly over the face width [N/m]."""
    outward: float
    """Secant stiffness with large rotations for a load pulling apart at mid-face, at
    about the deflection of the lobes [N/m]."""
    inward: float
    """Secant stiffness with large rotations for a load pressing together at mid-face
    [N/m]."""
    force: float
    """Load of the secant stiffnesses [N]."""
    finer: float
    """Linear stiffness at mid-face with higher degrees of the displacements of faces
    and sections on the same mesh [N/m]."""
    coarser: float
    """Linear stiffness at mid-face with half of the elements per direction [N/m]."""
    shell: float
    """Closed form of a smooth cup with the wall thickness of the cup, at mid-face
    [N/m]."""

    def to_json(self) -> dict[str, Any]:
        """Stiffnesses [N/mm] with a description of load and deflection."""
        scale = 1e3
        return {
            "load": "two opposite radial forces at mid-face, outward on the bore over"
            " one pitch; deflection: mean over the wall above; boss clamped",
            "open_edge_N_mm": self.open_edge / scale,
            "spread_over_face_width_N_mm": self.face_width / scale,
            "large_rotations": {
                "force_N": self.force,
                "outward_N_mm": self.outward / scale,
                "inward_N_mm": self.inward / scale,
            },
            "finer_displacements_N_mm": self.finer / scale,
            "half_the_elements_N_mm": self.coarser / scale,
            "smooth_shell_N_mm": self.shell / scale,
        }


def radial_stiffness(design: Design, *, progress: Progress = silent) -> RadialStiffness:
    """Compute the radial stiffness of a design's flexspline.

    Args:
        design: The drive, with a ``[cup]``.
        progress: Called after every part.

    Raises:
        DesignError: If it cannot be meshed or has an odd number of teeth.
        ComputationError: If a solve fails or the model does not fit in memory.
    """
    stage, parts = "radial stiffness", 4
    half = max(COARSEST, 0.5 * design.mesh.refinement)
    coarse = design.with_changes({"mesh.refinement": half})
    coarser = pinched_cup(coarse).pull(SMALL).stiffness
    finer = pinched_cup(design, orders=FINER).pull(SMALL).stiffness
    progress(stage, 1, parts)
    cup = pinched_cup(design)
    mid, edge, spread = (
        cup.pull(SMALL, place).stiffness
        for place in ("mid_face", "open_edge", "face_width")
    )
    progress(stage, 2, parts)
    force = mid * lobe_height(design)
    secants = []
    for sign in (1.0, -1.0):
        secants.append(cup.pull(sign * force, nonlinear=True).stiffness)
        progress(stage, 2 + len(secants), parts)
    return RadialStiffness(
        mid_face=mid,
        open_edge=edge,
        face_width=spread,
        outward=secants[0],
        inward=secants[1],
        force=force,
        finer=finer,
        coarser=coarser,
        shell=smooth_cup_stiffness(design),
    )


def smooth_cup_stiffness(design: Design, *, open_edge: bool = False) -> float:
    """Closed-form radial stiffness of a smooth cup of uniform wall thickness [N/m].

    Args:
        design: The drive, with a ``[cup]``.
        open_edge: Whether the load acts at the open end instead of mid-face.
    """
    assert design.cup is not None
    shell = ShellDimensions.from_design(design)
    width = design.drive.face_width_mm * mm
    wall = design.cup.thickness_coefficient * shell.wall
    length = width + shell.length - 0.5 * wall  # to the middle of the diaphragm
    return cup_stiffness(
        shell.youngs_modulus,
        shell.poisson_ratio,
        wall,
        design.flexspline_inner_radius + 0.5 * wall,
        length,
        length if open_edge else length - 0.5 * width,
    )
