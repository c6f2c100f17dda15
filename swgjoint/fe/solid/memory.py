"""Estimate of the memory that a 3D model needs, before it is built."""

from __future__ import annotations

from swgjoint.fe.solid.strip.masters import Orders, strip_masters
from swgjoint.fe.solid.strip.mesh import StripMesh
from swgjoint.memory import INTERPRETER, require_memory

BYTES = 8
"""Memory of a floating-point number [B]."""
FILL = 28.0
"""Entries of a segment's sparse factor divided by the number of unknowns to the power
4/3 [-]; 27 for the toothed segment in the mesh of the thesis."""
CONTACTS = 400
"""Number of tooth contact points in an iteration; no observed run had more."""
COPIES = 4
"""Number of arrays of the size of the system or of its right-hand sides that are in
memory at the same time."""
OFFSETS = 9
"""Number of teeth of the circular spline that a loaded tooth displaces, itself
included."""


def required_memory(
    strip: StripMesh, circular_spline: StripMesh | None, sectors: int, orders: Orders
) -> float:
    """Estimate the peak memory of a model and its solution [B].

    Measured peaks are 50 to 100 % of the estimate.

    Args:
        strip: Mesh of a sector of the flexspline.
        circular_spline: Mesh of a sector of the circular spline; None if it is rigid.
        sectors: Number of sectors of the flexspline in the model.
        orders: Polynomial degrees of the displacements of faces and sections.
    """
    # the toothed segment is the largest one
    nodes = strip.teeth.segment.mesh.p.shape[1]
    loaded = 3 * (strip.teeth.flank.size + strip.teeth.bore.size)
    # condensation of the teeth: right-hand sides, their solution, stored results
    condensing = BYTES * (3 * 3 * nodes * loaded + FILL * (3 * nodes) ** (4 / 3))
    kept = BYTES * (3 * nodes * loaded + loaded**2)
    # equilibrium: the matrices of all sectors; stresses: nodes of all sectors
    size = 3 * strip_masters(strip, orders).size
    solving = BYTES * sectors * size * (size + CONTACTS) * COPIES
    stresses = BYTES * sectors * nodes * (3 + 2 * 6 + 9)
    if circular_spline is not None:
        spline_nodes = circular_spline.teeth.segment.mesh.p.shape[1]
        flank = 2 * circular_spline.teeth.flank.size
        face = 6 * len(circular_spline.teeth.segment.first)
        building = 2 * 3 * spline_nodes * (flank + face) + FILL * (
            3 * spline_nodes
        ) ** (4 / 3)
        held = OFFSETS * (3 * spline_nodes * flank + flank**2)
        kept += BYTES * held
        condensing = max(condensing, BYTES * building)
    return float(INTERPRETER + kept + max(condensing, solving + stresses))


def require_solid_memory(name: str, required: float) -> None:
    """Reject a 3D model that would not fit in memory.

    Args:
        name: Name of the drive.
        required: Memory that the model needs [B].

    Raises:
        ComputationError: If the model does not fit; the message states the required and
            the available memory and how to need less.
    """
    require_memory(
        f"{name}: the 3d model",
        required,
        less="a smaller mesh.refinement, --half or --model 2d",
    )
