"""The improved cup on its wave generator in CalculiX, on one mesh and on finer ones.

    python tests/peer/solid_study.py --out notebooks/calculix-solid.json

takes eight minutes on a free core and 3 GB.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import calculix
import numpy as np
from solid_replay import MPa, solid_replay
from study import Row, document
from two_teeth import two_teeth

from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.strip.masters import Orders
from swgjoint.files import write_whole
from swgjoint.gear.design.design import Design

um = 1e-6
DESIGN = "reference-3d-modified"
ORDERS = {
    "straight lines through the wall": Orders(
        teeth=6, cup=3, rim=2, rim_bending=6, wall=1
    ),
    "default": Orders(),
}
# refinement, in CalculiX too
TEETH = [(1, True), (2, True), (3, False)]


def deflected(
    design: Design, orders: Orders
) -> tuple[SolidSectorModel, SolidState, float]:
    """On the wave generator alone; seconds of an iteration."""
    model = solid_sector_model(
        design, half=True, elastic_circular_spline=False, orders=orders
    )
    clock = time.process_time()
    state = SolidContinuation(model=model, ratio=design.ratio).deflect()
    assert state.outcome.ok, state.outcome
    return model, state, (time.process_time() - clock) / len(state.history)


def rows(folder: Path) -> Iterator[Row]:
    """All runs."""
    design = Design.load(DESIGN)
    for label, orders in ORDERS.items():
        model, state, seconds = deflected(design, orders)
        clock = time.perf_counter()
        found = solid_replay(design, model, state, folder)
        wall = time.perf_counter() - clock
        radial, tangential = np.concatenate(list(found.shape.values())).T[:2] / um
        ours, theirs = (stress / MPa for stress in found.root_stress)
        by_part = {}
        for segment in model.strip.mesh.segments:
            every = np.arange(segment.mesh.p.shape[1])
            pair = found.stresses(segment.name, every)
            by_part[segment.name] = [float(part[2].max()) / MPa for part in pair]
        yield {
            "compared": "quarter of the cup, refinement 1, C3D8I",
            "orders": label,
            **asdict(orders),
            "masters": model.strip.masters.size,
            "iteration_s": seconds,
            "radial_max_um": np.abs(radial).max(),
            "radial_rms_um": np.sqrt(np.mean(radial**2)),
            "tangential_max_um": np.abs(tangential).max(),
            "root_ours_MPa": ours,
            "root_calculix_MPa": theirs,
            "von_mises_ours_calculix_MPa": by_part,
            "calculix_s": wall,
        }
    for refinement, both in TEETH:
        teeth = two_teeth(design, model, state, 0, refinement=refinement)
        ours = teeth.root_stress(teeth.ours(design)) / MPa
        yield {
            "compared": "two teeth, C3D8I",
            "refinement": refinement,
            "root_ours_MPa": ours,
            "root_calculix_MPa": (
                teeth.root_stress(teeth.theirs(design, folder)) / MPa if both else None
            ),
        }


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    if not calculix.available():
        print("ccx is not on the path: apt-get install calculix-ccx", file=sys.stderr)
        return 1
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for entry in rows(Path(folder)):
            print(entry, flush=True)
            found.append(entry)
    if args.out is not None:
        write_whole(args.out, document(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
