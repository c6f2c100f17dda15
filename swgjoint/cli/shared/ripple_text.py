"""Which torque ripple a run prints."""

from __future__ import annotations

from typing import Any


def ripple_line(result: dict[str, Any]) -> str:
    """State quantity, reference and amplitude of the ripple; empty without any.

    Args:
        result: Figures of a run.
    """
    shown = {
        name: joint["ratings"]["rated_Nm"]
        for name, joint in result["joints"].items()
        if joint["ripple_missing"] is None
    }
    if not shown:
        return ""
    names_by_torque: dict[float, list[str]] = {}
    for name, torque in shown.items():
        names_by_torque.setdefault(torque, []).append(name)
    one = len(names_by_torque) == 1
    rated = "; ".join(
        f"{torque:.4g} N·m" + ("" if one else f" ({', '.join(names)})")
        for torque, names in names_by_torque.items()
    )
    return (
        f"ripple: of the output torque, {result['ripple_of']}; in % of the rated"
        f" torque, {rated}; orders with their amplitude, zero to peak"
    )
