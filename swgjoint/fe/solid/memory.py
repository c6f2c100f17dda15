"""Memory that a 3D model will take, before it is built."""

from __future__ import annotations

import os
from pathlib import Path

from swgjoint.errors import ComputationError
from swgjoint.fe.solid.masters import Orders, strip_masters
from swgjoint.fe.solid.strip_mesh import StripMesh

BYTES = 8
FILL = 28.0
"""Entries of a sparse factor of a segment over its unknowns to the power 4/3: 27 with
the teeth in the mesh of the thesis."""
CONTACTS = 400
"""Tooth contact points that an iteration carries along, more than any seen."""
COPIES = 4
"""Arrays of the size of the system or of its right-hand sides that live at once."""
OFFSETS = 9
"""Teeth of the circular spline that feel a loaded one."""
INTERPRETER = 0.25e9
"""Python with its libraries [B]."""


def required_memory(
    strip: StripMesh, ring: StripMesh | None, sectors: int, orders: Orders
) -> float:
    """Estimate of the peak [B]; measured peaks lie between a half of it and all of it.

    Args:
        strip: Mesh of the flexspline.
        ring: Mesh of the circular spline; None if it is rigid.
        sectors: Teeth of the flexspline in the model.
        orders: Degrees of the displacements of faces and sections.
    """
    nodes = strip.teeth.segment.mesh.p.shape[1]
    loaded = 3 * (strip.teeth.flank.size + strip.teeth.bore.size)
    # condensation of the teeth: right-hand sides, their solution, what is kept
    condensing = BYTES * (3 * 3 * nodes * loaded + FILL * (3 * nodes) ** (4 / 3))
    kept = BYTES * (3 * nodes * loaded + loaded**2)
    size = 3 * strip_masters(strip, orders).size
    solving = BYTES * sectors * size * (size + CONTACTS) * COPIES
    stresses = BYTES * sectors * nodes * (3 + 2 * 6 + 9)
    if ring is not None:
        own = ring.teeth.segment.mesh.p.shape[1]
        flank = 2 * ring.teeth.flank.size
        face = 6 * len(ring.teeth.segment.first)
        building = 2 * 3 * own * (flank + face) + FILL * (3 * own) ** (4 / 3)
        held = OFFSETS * (3 * own * flank + flank**2)
        kept += BYTES * held
        condensing = max(condensing, BYTES * building)
    return float(INTERPRETER + kept + max(condensing, solving + stresses))


def available_memory() -> float | None:
    """Free memory of this machine or container [B]; None where it cannot be told."""
    found = []
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                found.append(1024.0 * float(line.split()[1]))
        limit = Path("/sys/fs/cgroup/memory.max").read_text().strip()
        used = float(Path("/sys/fs/cgroup/memory.current").read_text())
        if limit != "max":
            found.append(float(limit) - used)
    except (OSError, ValueError, IndexError):
        pass
    if not found and hasattr(os, "sysconf") and "SC_AVPHYS_PAGES" in os.sysconf_names:
        found.append(float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")))
    return min(found) if found else None


def require_memory(name: str, required: float) -> None:
    """Refuse a model that would not fit.

    Raises:
        ComputationError: With both figures and what would need less.
    """
    free = available_memory()
    if free is not None and required > free:
        raise ComputationError(
            f"{name}: the 3d model needs about {required / 1e9:.1f} GB, of which"
            f" {free / 1e9:.1f} GB are free; try a smaller mesh.refinement, --half or"
            " --model 2d"
        )
