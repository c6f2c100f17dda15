"""What crowning and slope do to the cup of the thesis, for its notebook.

``python tests/benchmarks/micro_geometry.py FILE`` simulates `reference-3d` with none,
each and all of the micro-geometry of `reference-3d-modified` (half of the drive, two
positions over half a pitch, rated torque) and writes contact forces over the face
width, stresses by part and coning to FILE, ``notebooks/micro-geometry.json``. Two
minutes of one core, 1.2 GB.
"""

from __future__ import annotations

import argparse
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from swgjoint import __version__
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.files import write_whole
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.json_text import json_text
from swgjoint.progress import StderrProgress
from swgjoint.units import mm
from swgjoint.view.plots.solid import contact_forces

STEPS = 2
PARTS = {
    "none": (),
    "flexspline crowning": ("flexspline_crowning_um",),
    "wave-generator slope": ("wave_generator_slope_um",),
    "wave-generator crowning": ("wave_generator_crowning_um",),
    "all": (
        "flexspline_crowning_um",
        "wave_generator_slope_um",
        "wave_generator_crowning_um",
    ),
}


def variant(keys: tuple[str, ...]) -> Design:
    """The initial design with these parts of the improved micro-geometry."""
    improved = Design.load("reference-3d-modified").micro_geometry
    changes = {f"micro_geometry.{key}": getattr(improved, key) for key in keys}
    return Design.load("reference-3d").with_changes(changes)


def figures(design: Design) -> dict[str, Any]:
    """Stresses, contact forces over the face width and coning at rated torque."""
    torque = ratings_of(design).rated_torque
    run = simulate_meshing(
        design,
        model="3d",
        torque=torque,
        steps=STEPS,
        turn=0.5 / design.drive.teeth_circular_spline,
        half=True,
        progress=StderrProgress(),
    )
    _, flanks, bore = contact_forces(run.model, run.setup[-1].state)
    found = run.to_json()
    return {
        "design_hash": design.content_hash(),
        "torque_Nm": torque,
        "z_mm": run.model.strip.mesh.teeth.z / mm,
        "tooth_force_N": flanks.sum(axis=0),
        "wave_generator_force_N": bore.sum(axis=0),
        **{
            key: found[key]
            for key in ("flexspline", "parts_MPa", "coning_mm", "nodes", "wall_s")
        },
        "pairs_in_contact": found["per_step"]["pairs_in_contact"],
    }


def main() -> int:
    """Run all variants and write the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    path = parser.parse_args().file
    versions = {name: metadata.version(name) for name in ("numpy", "scipy")}
    result = {
        "command": "python tests/benchmarks/micro_geometry.py",
        "versions": {"swgjoint": __version__, **versions},
        "steps": STEPS,
        "variants": {name: figures(variant(keys)) for name, keys in PARTS.items()},
    }
    write_whole(path, json_text(result) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
