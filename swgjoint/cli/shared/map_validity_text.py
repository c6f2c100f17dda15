"""The validation of a map in terminal output: table of ``map``, lines of ``spec``."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table
from swgjoint.view.words import words

_SHOWN_TORQUES = 12


def validation_table(result: dict[str, Any]) -> list[str]:
    """What a map misses at torques and angles that it was not sampled at.

    Args:
        result: Of ``swgjoint map``.
    """
    record = result["validation"]
    if record is None:
        return [result["validation_reason"]]
    from swgjoint.maps.sheet.map_validity import QUANTITIES, STIFFNESS

    names = {key: f"{name}, of its peak to peak" for key, name in QUANTITIES.items()}
    rows = []
    for key, name in (names | {STIFFNESS: "secant stiffness"}).items():
        if (of := record.get(key)) is not None:
            shares = (of.get(part) for part in ("largest", "rms"))
            percents = [None if part is None else 100.0 * part for part in shares]
            rows.append((name, *percents, float(of["at_Nm"])))
    torques = sorted({float(row["torque_Nm"]) for row in record["rows"]})
    shown = ", ".join(f"{torque:.4g}" for torque in torques[:_SHOWN_TORQUES])
    more = ", ..." if len(torques) > _SHOWN_TORQUES else ""
    return [
        f"validation: map against {record['solves']} finite-element solves that it has"
        f" not seen, at {shown}{more} N·m; worst torque of each quantity:",
        table(rows, header=("", "largest [%]", "rms [%]", "at [N·m]")),
        *result["validation_notes"],
    ]


def mark_figure(result: dict[str, Any], key: str) -> Any:
    """A figure of a spec sheet, marked where its map misses unseen solves."""
    from swgjoint.maps.sheet.validity_marks import mark

    value, doubt = result[key], result["uncertain"].get(key)
    if doubt is None or value is None:
        return value
    return f"{mark(doubt['largest'])} {value:.4g}"


def doubts(result: dict[str, Any]) -> list[str]:
    """What the marks of a spec sheet mean, figures of the same reason together."""
    from swgjoint.maps.sheet.map_validity import Difference
    from swgjoint.maps.sheet.validity_marks import mark

    found: dict[str, list[str]] = {}
    for key, doubt in result["uncertain"].items():
        one = Difference.from_json(doubt)
        why = f"{mark(one.largest)} the map {one}"
        found.setdefault(why, []).append(words(key)[0])
    return [f"{why}: {', '.join(names)}" for why, names in found.items()]
