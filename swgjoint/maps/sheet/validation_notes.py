"""Entries of a result that report the validation of its map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.map_validity import (
    map_validation,
    validation_json,
    validation_lines,
    validation_summary,
)
from swgjoint.maps.sheet.spec_sheet import needs_turn


def validation_of_map(drive: Potential) -> dict[str, Any]:
    """``validation``, ``validation_reason`` and ``validation_notes`` of a map."""
    record, _ = map_validation(drive)
    notes = [] if record is None else validation_lines(record)
    return {**validation_json(drive), "validation_notes": notes}


def validation_of_sheet(drive: Potential | None, keys: Sequence[str]) -> dict[str, Any]:
    """The entries of :func:`validation_of_map` for a spec sheet.

    An unusable record is always noted. Otherwise there are notes only if a key is a
    figure of an output turn: the warnings or, without any, a summary of the validation.

    Args:
        drive: The map; None if no key needs one.
        keys: Keys of the sheet.
    """
    if drive is None:
        reason = "no key needs a map"
        return {
            "validation": None,
            "validation_reason": reason,
            "validation_notes": [],
        }
    result = validation_of_map(drive)
    record, _ = map_validation(drive)
    if record is None and drive.info.get("validation") is not None:
        result["validation_notes"] = [result["validation_reason"]]
    elif not needs_turn(keys):
        result["validation_notes"] = []
    elif record is not None:
        result["validation_notes"] = result["validation_notes"] or [
            validation_summary(record)
        ]
    return result
