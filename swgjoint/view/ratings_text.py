"""Ratings that a rule supplied, marked where they are shown."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from swgjoint.gear.ratings import rule_of
from swgjoint.view.words import words


def sheet_words(key: str, source: str) -> tuple[str, str]:
    """Name and unit of a figure of a spec sheet, marked if it is a rating by rule.

    Args:
        key: Key of the figure.
        source: Source of the ratings.

    >>> sheet_words("T1_Nm", "default (T1_Nm): catalogue CSG-32-50 scaled by 0.8")
    ('T1', 'N·m, by rule')
    """
    name, unit = words(key)
    return name, f"{unit}, by rule" if key in rule_of(source)[0] else unit


def rule_mark(key: str, source: str) -> str:
    """Mark after a rating in a message; empty if the rating is stated.

    Args:
        key: Key of the rating.
        source: Source of the ratings.
    """
    return ", by rule" if key in rule_of(source)[0] else ""


def rule_lines(drives: Iterable[tuple[str, str]]) -> list[str]:
    """State the ratings by rule of drives, one line for each drive and source.

    Args:
        drives: Name and source of the ratings of each drive; both may repeat.
    """
    lines = []
    for name, source in dict.fromkeys(drives):
        keys, rule = rule_of(source)
        if keys:
            torques = ", ".join(words(key)[0] for key in keys)
            lines.append(f"ratings of {name} by rule: {torques}: {rule}")
    return lines


def joint_rule_lines(joints: dict[str, Any]) -> list[str]:
    """State the ratings by rule of the drives of a run.

    Args:
        joints: Figures by joint.
    """
    return rule_lines((j["drive"], j["ratings"]["source"]) for j in joints.values())
