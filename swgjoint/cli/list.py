"""``swgjoint list``: list the bundled drives and files."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.shared.text import table

KINDS = ("drives", "designs", "arms", "scenes", "sweeps", "optimisations")
HEADERS = {
    "name": "",
    "size": "size",
    "ratio": "ratio",
    "rated_torque_Nm": "rated [N·m]",
    "repeated_peak_Nm": "peak [N·m]",
    "momentary_peak_Nm": "momentary [N·m]",
    "K1_Nm_rad": "K1 [N·m/rad]",
    "transmission_accuracy_arcmin": "accuracy [arcmin]",
    "ratings": "torques and K1",
    "teeth": "teeth",
    "module_mm": "module [mm]",
    "pitch_diameter_mm": "diameter [mm]",
    "profile": "profile",
    "wave_generator": "wave generator",
    "cup": "cup",
    "joints": "joints",
    "mass_kg": "mass [kg]",
    "arm": "arm",
    "drives": "drives",
    "motion": "motion",
    "duration_s": "duration [s]",
    "description": "description",
}
"""Column headings by key of a row, in the order of the table."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the kind of files to list."""
    parser.add_argument(
        "kind",
        choices=KINDS,
        help="drives: catalogue drives; every other kind: bundled files of that kind",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Collect the bundled items of one kind.

    Returns:
        ``kind``, ``rows`` (each with ``name`` and the key figures of its kind) and
        ``note`` (how other items of the kind are named).
    """
    from swgjoint.sim.bundled import NOTES, bundled_rows

    rows = bundled_rows(args.kind)
    return {"kind": args.kind, "rows": rows, "note": NOTES[args.kind]}


def report(result: dict[str, Any]) -> str:
    """Format the table and the note below it."""
    keys = [key for key in HEADERS if key in result["rows"][0]]
    rows = [[_cell(row[key]) for key in keys] for row in result["rows"]]
    header = [HEADERS[key] for key in keys]
    return f"{table(rows, header=header)}\n{result['note']}"


def _cell(value: Any) -> object:
    return ", ".join(map(str, value)) if isinstance(value, list) else value
