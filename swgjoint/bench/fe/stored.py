"""Stored results of the long settings of ``swgjoint bench fe``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.bench.fe.setting import POSITIONS, Found
from swgjoint.gear.design.design import Design
from swgjoint.models_path import models_path
from swgjoint.provenance import provenance
from swgjoint.store import json_content, read_kept

LONG = ("3d, refinement 1, linear", "3d, refinement 1.4")
"""Keys of the settings that take most of the time and up to 5 GB. They are read from
the file, or left out if it does not contain them; only ``recompute`` solves them."""
WITNESS = "3d, refinement 0.5"
"""Key of a setting that is stored and also solved in every run, to detect changes."""
DRIFT = 1e-3
"""Relative change of the witness from which on the file does not match the code [-]."""
FILE = "bench-fe-reference.json"


@dataclass(frozen=True, kw_only=True)
class _Stored:
    """Part of the file that is read."""

    design_hash: str
    positions: int
    command: str
    provenance: dict[str, Any]
    settings: dict[str, dict[str, float | list[float] | None]]


def load_stored(design: Design, path: Path | None = None) -> dict[str, Any]:
    """Read the stored settings of a design.

    Args:
        design: Design of the benchmark.
        path: Stored file; None for the bundled one.

    Returns:
        Content of the file; empty if it does not exist, or belongs to another design
        or another number of positions.
    """
    path = path or models_path() / "studies" / FILE
    kept = read_kept(path, _read)
    if kept is None:
        return {}
    of_this = (kept["design_hash"], kept["positions"])
    return kept if of_this == (design.content_hash(), POSITIONS) else {}


def _read(data: bytes) -> dict[str, Any]:
    kept = json_content(data, _Stored)
    settings = {key: _found(values) for key, values in kept.settings.items()}
    return {**vars(kept), "settings": settings}


def _found(values: dict[str, Any]) -> Found:
    arrays = {
        key: None if values[key] is None else np.array(values[key], float)
        for key in ("kinematic_error", "rim_shape")
    }
    return Found(**(values | arrays))


def to_store(design: Design, found: dict[str, Found | str]) -> dict[str, Any]:
    """Content of the stored file for a design.

    Args:
        design: Design of the benchmark.
        found: Results of the settings by key.
    """
    kept = {key: found.get(key) for key in (*LONG, WITNESS)}
    return {
        "what": "stored settings of swgjoint bench fe",
        "command": "swgjoint bench fe --recompute --out DIR",
        "design": design.drive.name,
        "design_hash": design.content_hash(),
        "positions": POSITIONS,
        "provenance": provenance(),
        "settings": {k: v for k, v in kept.items() if isinstance(v, Found)},
    }


def describe_stored(
    kept: dict[str, Any], found: dict[str, Found | str]
) -> dict[str, Any]:
    """Provenance of the stored file, and its deviation from the present code.

    Args:
        kept: Content of the stored file.
        found: Results of the settings by key.

    Returns:
        ``settings`` (keys of the stored long settings), ``command``, ``provenance``,
        ``witness``, ``drift`` (largest relative change of stiffness and stress of the
        witness), ``pace`` (its present CPU time divided by the stored one) and
        ``of_this_code`` (whether the drift is below :data:`DRIFT`).
    """
    was, now = kept["settings"].get(WITNESS), found.get(WITNESS)
    drift = pace = None
    if isinstance(was, Found) and isinstance(now, Found):
        pairs = [(was.stiffness, now.stiffness), (was.tensile, now.tensile)]
        drift = max(abs(b / a - 1.0) for a, b in pairs if a and b)
        pace = now.cpu_s / was.cpu_s if now.cpu_s and was.cpu_s else None
    return {
        "settings": [key for key in LONG if key in kept["settings"]],
        "command": kept["command"],
        "provenance": kept["provenance"],
        "witness": WITNESS,
        "drift": drift,
        "pace": pace,
        "of_this_code": drift is not None and drift < DRIFT,
    }
