"""Terminal output on the validation of a map, for ``map`` and ``spec``."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table
from swgjoint.view.words import words

_SHOWN_TORQUES = 12
"""Largest number of torques that are listed."""


def validation_table(result: dict[str, Any]) -> list[str]:
    """Table of the differences between a map and unseen finite-element solves.

    Unseen solves are at torques and angles at which the map was not sampled.

    Args:
        result: JSON object of ``swgjoint map``.

    Returns:
        Lines of text; the reason alone if the map is not validated.
    """
    record = result["validation"]
    if record is None:
        return [result["validation_reason"]]
    from swgjoint.maps.sheet.map_validity import QUANTITIES, STIFFNESS

    names = {
        key: f"{name}, % of its peak to peak at that torque"
        for key, name in QUANTITIES.items()
    }
    rows = []
    for key, name in (names | {STIFFNESS: "secant stiffness"}).items():
        if (worst := record.get(key)) is not None:
            shares = (worst.get(part) for part in ("largest", "rms"))
            percents = [None if part is None else 100.0 * part for part in shares]
            rows.append((name, *percents, float(worst["at_Nm"])))
    torques = sorted({float(row["torque_Nm"]) for row in record["rows"]})
    shown = ", ".join(f"{torque:.4g}" for torque in torques[:_SHOWN_TORQUES])
    more = ", ..." if len(torques) > _SHOWN_TORQUES else ""
    return [
        f"validation: map compared with {record['solves']} finite-element solves that"
        f" were not used to build it, at {shown}{more} N·m; errors of the map (not"
        " ripples of the drive) at the torque where each quantity is worst:",
        table(rows, header=("", "largest [%]", "rms [%]", "at [N·m]")),
        *result["validation_notes"],
    ]


def mark_figure(result: dict[str, Any], key: str) -> Any:
    """A value of a spec sheet with its mark if the map differs from unseen solves.

    Args:
        result: JSON object of ``swgjoint spec``.
        key: Key of the value.

    Returns:
        The value itself, or text with the mark ``~`` or ``!`` in front of the value.
    """
    from swgjoint.maps.sheet.validity_marks import mark

    value, doubt = result[key], result["uncertain"].get(key)
    if doubt is None or value is None:
        return value
    return f"{mark(doubt['largest'])} {value:.4g}"


def doubts(result: dict[str, Any]) -> list[str]:
    """Explain the marks of a spec sheet, grouped by reason.

    Args:
        result: JSON object of ``swgjoint spec``.

    Returns:
        Lines of text, one per reason.
    """
    from swgjoint.maps.sheet.map_validity import Difference
    from swgjoint.maps.sheet.validity_marks import mark

    names_by_reason: dict[str, list[str]] = {}
    for key, doubt in result["uncertain"].items():
        difference = Difference.from_json(doubt)
        reason = f"{mark(difference.largest)} the map {difference}"
        names_by_reason.setdefault(reason, []).append(words(key)[0])
    return [f"{why}: {', '.join(names)}" for why, names in names_by_reason.items()]
