"""Radial stiffness of a flexspline, its dependence on the load, and error estimates."""

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
"""Smallest refinement of the coarser mesh [-]."""
SMALL = 1.0
"""Load of the linear model [N]; its stiffness does not depend on the load."""
FINER = replace(
    Orders(),
    teeth=Orders().teeth + 2,
    cup=Orders().cup + 2,
    at_teeth=Orders().at_teeth + 2,
    around=Orders().around + 2,
)
"""Polynomial degrees increased by two, from which the error of the default degrees is
estimated."""


@dataclass(frozen=True, kw_only=True)
class RadialStiffness:
    """Radial stiffness of a cup with a clamped boss between two opposite loads.

    Stiffness is the force of a load divided by the deflection, see
    :mod:`swgjoint.fe.solid.figures.pinched_cup`.
    """

    mid_face: float
    """Linear stiffness for a load in the middle of the face width [N/m]."""
    open_edge: float
    """Linear stiffness for a load at the open edge of the teeth [N/m]."""
    face_width: float
    """Linear stiffness for a load spread evenly over the face width [N/m]."""
    outward: float
    """Secant stiffness at mid-face with large rotations under outward loads ``force``
    [N/m]; the deflection is about the lobe height."""
    inward: float
    """Secant stiffness at mid-face with large rotations under inward loads ``force``
    [N/m]."""
    force: float
    """Magnitude of the loads of the secant stiffnesses [N]: linear stiffness times lobe
    height."""
    finer: float
    """Linear stiffness at mid-face with the polynomial degrees :data:`FINER` on the
    same mesh [N/m]."""
    coarser: float
    """Linear stiffness at mid-face with half of the elements per direction, but with a
    refinement of at least :data:`COARSEST` [N/m]."""
    shell: float
    """Closed-form stiffness at mid-face of a smooth cup with the wall thickness of the
    cup, see :func:`smooth_cup_stiffness` [N/m]."""

    def to_json(self) -> dict[str, Any]:
        """Stiffnesses except that at mid-face [N/mm], and a description of the load."""
        scale = 1e3
        return {
            "load": "two opposite outward forces at mid-face, each on one pitch of the"
            " bore; deflection: mean over the wall above the force; boss clamped",
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
        DesignError: If the design cannot be meshed or has an odd number of teeth.
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
        open_edge: Whether the loads act at the open edge instead of mid-face.
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
