"""``swgjoint list``: what is bundled."""

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
"""Keys of a row that the table shows, and what it calls them."""


def configure(parser: argparse.ArgumentParser) -> None:
    """What to list."""
    parser.add_argument(
        "kind",
        choices=KINDS,
        help="drives: catalogue drives; otherwise the bundled files of that kind",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Find them.

    Returns:
        ``kind``, ``rows`` (each with ``name`` and the figures of its kind), ``note``.
    """
    from swgjoint.sim.bundled import NOTES, bundled_rows

    rows = bundled_rows(args.kind)
    return {"kind": args.kind, "rows": rows, "note": NOTES[args.kind]}


def report(result: dict[str, Any]) -> str:
    """A table, then how else one is named."""
    keys = [key for key in HEADERS if key in result["rows"][0]]
    rows = [[_cell(row[key]) for key in keys] for row in result["rows"]]
    header = [HEADERS[key] for key in keys]
    return f"{table(rows, header=header)}\n{result['note']}"


def _cell(value: Any) -> object:
    return ", ".join(map(str, value)) if isinstance(value, list) else value
