"""Validity of the figures of many designs in terminal output."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def validity_lines(validity: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """State for every task the level, the torque and what is not modelled.

    Args:
        validity: By task, see :func:`swgjoint.explore.sweep.validity.validity_of`.
    """
    lines = []
    for task, label in validity.items():
        absent = [
            f"not modelled, {part}: {why}"
            for part, why in label["not_modelled"].items()
        ]
        text = "; ".join([f"level {label['level']}, {label['torque']}", *absent])
        lines.append(f"validity of {task}: {text}")
    return lines
