"""Replay states in CalculiX, print the table and write it to a file.

    python tests/peer/study.py --out notebooks/calculix.json

takes three quarters of an hour; ``--quick`` takes two minutes on coarser meshes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import date
from importlib.metadata import version
from pathlib import Path

import calculix
import numpy as np
from own_contact import own_contact
from replay import MPa, Replay, replay, um
from states import (
    DESIGNS,
    POSITIONS,
    TORQUE,
    deflected,
    design_of,
    loaded,
    model_of,
    turned_to,
)

import swgjoint
from swgjoint.files import write_whole
from swgjoint.json_text import json_text

Row = dict[str, object]

# refinement of our mesh, that of CalculiX, its element
WAVE_GENERATOR = [
    (4, 1, "CPE8R"),
    (8, 1, "CPE8R"),
    (12, 1, "CPE8R"),
    (12, 2, "CPE8R"),
    (12, 1, "CPE8"),
    (12, 2, "CPE8"),
]
MESHED = [
    (4, 1, "CPE8R"),
    (8, 1, "CPE8R"),
    (12, 1, "CPE8R"),
    (12, 2, "CPE8R"),
    (12, 1, "CPE8"),
    (12, 2, "CPE8"),
]
QUICK = [(4, 1, "CPE8R"), (4, 1, "CPE8")]
PENALTIES = (1e15, 1e16)  # Pa/m: 1 micrometre of overlap carries 1 or 10 GPa
CONTACT_MESH = (4, 1, "CPE8R")


def row(label: str, mesh: tuple[int, int, str], found: Replay, wall: float) -> Row:
    """Figures of one run, micrometres and MPa."""
    ours, theirs, element = mesh
    radial, tangential = (part / um for part in found.shape)
    root = [stress / MPa for stress in found.root_stress]
    return {
        "state": label,
        "ours_refinement": ours,
        "calculix_refinement": theirs,
        "element": element,
        "radial_max_um": np.abs(radial).max(),
        "two_lobe_um": found.two_lobe / um,
        "radial_rms_um": np.sqrt(np.mean(radial**2)),
        "tangential_max_um": np.abs(tangential).max(),
        "tangential_rms_um": np.sqrt(np.mean(tangential**2)),
        "root_ours_MPa": root[0],
        "root_calculix_MPa": root[1],
        "calculix_s": wall,
    }


def rows(folder: Path, quick: bool) -> Iterator[Row]:
    """All runs."""
    for kind in DESIGNS:
        for mesh in QUICK if quick else WAVE_GENERATOR:
            ours, theirs, element = mesh
            start = deflected(kind, ours, False)
            clock = time.perf_counter()
            found = replay(
                design_of(kind, ours),
                model_of(kind, ours, False),
                start,
                folder,
                element=element,
                refinement=theirs,
                quarter=True,
            )
            yield row(kind, mesh, found, time.perf_counter() - clock)
    for pitches in POSITIONS:
        for mesh in QUICK if quick else MESHED:
            ours, theirs, element = mesh
            start = turned_to("elliptical", ours, pitches)
            clock = time.perf_counter()
            found = replay(
                design_of("elliptical", ours),
                model_of("elliptical", ours, True),
                start,
                folder,
                element=element,
                refinement=theirs,
                quarter=False,
            )
            label = f"elliptical, {TORQUE:g} N·m, {pitches:g} pitch"
            entry = row(label, mesh, found, time.perf_counter() - clock)
            entry["moment_of_forces_Nm"] = found.model.copies * found.moment
            yield entry
    yield from contact_rows(folder, quick)


def contact_rows(folder: Path, quick: bool) -> Iterator[Row]:
    """Contact forces and CalculiX's own contact on one mesh, rigid circular spline."""
    ours, theirs, element = CONTACT_MESH
    design, model = design_of("elliptical", ours), model_of("elliptical", ours, False)
    states = {"elliptical": deflected("elliptical", ours, False)}
    if not quick:
        label = f"elliptical, {TORQUE:g} N·m, rigid circular spline"
        states[label] = loaded("elliptical", ours, False)
    for label, state in states.items():
        quarter = label == "elliptical"
        clock = time.perf_counter()
        found = replay(
            design,
            model,
            state,
            folder,
            element=element,
            refinement=theirs,
            quarter=quarter,
        )
        entry = row(label, CONTACT_MESH, found, time.perf_counter() - clock)
        yield entry | {"own_contact_Pa_per_m": None}
        for penalty in PENALTIES[: 1 if quick else 2]:
            clock = time.perf_counter()
            found = own_contact(
                design,
                model,
                state,
                folder,
                element=element,
                refinement=theirs,
                penalty=penalty,
                quarter=quarter,
            )
            wall = time.perf_counter() - clock
            entry = row(label, CONTACT_MESH, found, wall)
            entry["own_contact_Pa_per_m"] = penalty
            if not quarter:  # the teeth hold the output in both codes
                entry["rotation_ours_urad"] = 1e6 * state.rotation
                entry["rotation_calculix_urad"] = 1e6 * found.rotation
            yield entry


def line(entry: Row) -> str:
    """One line of the table."""
    penalty = entry.get("own_contact_Pa_per_m")
    how = "our forces" if penalty is None else f"own contact {penalty:.0e} Pa/m"
    return (
        f"{entry['state']:<45} {how:<23} {entry['ours_refinement']:>3}"
        f" {entry['element']:>6} {entry['calculix_refinement']}"
        f" {entry['radial_max_um']:8.3f} {entry['radial_rms_um']:7.3f}"
        f" {entry['tangential_max_um']:8.3f} {entry['tangential_rms_um']:7.3f}"
        f" {entry['root_ours_MPa']:8.2f} {entry['root_calculix_MPa']:8.2f}"
        f" {entry['calculix_s']:6.1f}"
    )


HEADER = (
    f"{'state':<45} {'loaded by':<23} {'our':>3} {'CalculiX':>8}"
    f" {'radial':>8} {'rms':>7} {'tangent.':>8} {'rms':>7} [um]"
    " root MPa ours, theirs   s"
)


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    if not calculix.available():
        print("ccx is not on the path: apt-get install calculix-ccx", file=sys.stderr)
        return 1
    print(HEADER)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for entry in rows(Path(folder), args.quick):
            print(line(entry), flush=True)
            found.append(entry)
    if args.out is not None:
        write_whole(args.out, document(found))
    return 0


def document(found: list[Row]) -> str:
    """The rows with date and versions."""
    versions = {"calculix": calculix.version(), "swgjoint": swgjoint.__version__}
    for name in ("numpy", "scipy", "scikit-fem"):
        versions[name] = version(name)
    header = {"date": date.today().isoformat(), "versions": versions}
    return json_text({**header, "rows": found}) + "\n"


if __name__ == "__main__":
    sys.exit(main())
