"""Run time of the 2D model over teeth, mesh, torque, positions and drives of a lot."""

from __future__ import annotations

import time
from functools import cache
from typing import Any

from swgjoint.errors import SwgError
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.tolerances.lot import perfect_positions, sample_lot
from swgjoint.fe.tolerances.rest import Rest
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design

DESIGN = "reference-2d"
"""Design of all sweeps but that of the number of teeth."""
LOT = "reference-2d-tolerances"
"""Design of the drives of a lot."""
POSITIONS = 3
"""Number of positions after the first one, which counts as set-up."""


def _measure(
    design: Design, *, part: float = 1.0, positions: int = POSITIONS
) -> dict[str, Any]:
    """CPU time of one position and of the set-up, for a model of half the teeth.

    The positions are a third of a pitch apart.
    """
    marks = [time.process_time()]
    torque = part * ratings_of(design).rated_torque
    row: dict[str, Any] = {"model": "2d", "torque_Nm": torque}
    try:
        run = simulate_meshing(
            design,
            torque=torque,
            steps=positions + 1,
            turn=(positions + 1) / POSITIONS / design.drive.teeth_circular_spline,
            half=True,
            progress=lambda *_: marks.append(time.process_time()),
        )
    except SwgError as error:
        return row | {"outcome": str(error)}
    return row | {
        "seconds": (marks[-1] - marks[1]) / positions,
        "setup_s": marks[1] - marks[0],
        "nodes": run.nodes,
        "iterations": sum(step.iterations for step in run.steps[1:]) / positions,
        "outcome": run.outcome.name.lower(),
    }


def teeth(count: float) -> dict[str, Any]:
    """Run time with a number of teeth of the flexspline, at constant pitch diameter.

    The wave generator is rigid.
    """
    design = Design.load(f"size-25-{int(count) // 2}")
    return _measure(design.with_changes({"wave_generator.bearing": None}))


def mesh(refinement: float) -> dict[str, Any]:
    """Run time with a mesh refinement; the row has the number of nodes as size."""
    design = Design.load(DESIGN).with_changes({"mesh.refinement": refinement})
    row = _measure(design)
    return row | ({"size": float(row["nodes"])} if "nodes" in row else {})


def torque(part: float) -> dict[str, Any]:
    """Vary the torque; ``part`` is the torque divided by the rated torque."""
    return _measure(Design.load(DESIGN), part=part)


def angles(count: float) -> dict[str, Any]:
    """Vary the number of equally spaced positions; the time is that of all of them."""
    row = _measure(Design.load(DESIGN), positions=int(count))
    each = row.get("seconds")
    return row | {"seconds": None if each is None else each * count}


def lot(count: float) -> dict[str, Any]:
    """Run time of a lot with a number of drives, without that of the perfect drive."""
    design = Design.load(LOT)
    drives = [
        design.with_changes({"tolerances.seed": seed}) for seed in range(int(count))
    ]
    perfect = _perfect_positions()
    begin = time.process_time()
    sample_lot(drives, perfect)
    return {"model": "2d", "seconds": time.process_time() - begin}


@cache
def _perfect_positions() -> list[Rest]:
    """The perfect drive of the lot, which all sizes share."""
    return perfect_positions(Design.load(LOT))
