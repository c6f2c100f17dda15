"""Marks for figures that are uncertain because a map differs from unseen solves.

The figures of a joint (see :func:`swgjoint.sim.figures.metrics.joint_metrics`) and the
rows of a comparison contain the differences of the map as ``map_difference``, and
whether they are acceptable as ``ripple_valid``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from swgjoint.maps.sheet.map_validity import (
    LIMIT,
    QUANTITIES,
    WARNING,
    Difference,
    percent,
)
from swgjoint.units import arcmin

UNCERTAIN, NOT_VALID = "~", "!"
"""Marks of figures above :data:`~swgjoint.maps.sheet.map_validity.WARNING` and above
:data:`~swgjoint.maps.sheet.map_validity.LIMIT`."""


def mark(largest: float | None) -> str:
    """Mark of a figure that depends on a quantity with this relative difference [-]."""
    if largest is None or largest <= WARNING:
        return ""
    return UNCERTAIN if largest <= LIMIT else NOT_VALID


def joint_doubt(
    joint: Mapping[str, Any], quantities: Sequence[str] = tuple(QUANTITIES)
) -> Difference | None:
    """The largest difference of the map of a joint if it exceeds :data:`WARNING`.

    None if it does not, or if the run does not report the ripple of the joint.

    Args:
        joint: Figures of a joint from ``joint_metrics``.
        quantities: Keys of :data:`QUANTITIES` to consider.
    """
    differences = joint["map_difference"]
    if differences is None or joint["ripple_valid"] is None:
        return None
    worst = max(
        (Difference.from_json(differences[key]) for key in quantities),
        key=lambda one: one.largest,
    )
    return worst if worst.largest > WARNING else None


def error_mark(joint: Mapping[str, Any], value: float) -> str:
    """Mark of a peak-to-peak transmission error.

    This figure includes the torsion under a varying load, so the difference of the map
    is taken relative to the displayed value.

    Args:
        joint: Figures of a joint from ``joint_metrics``.
        value: Displayed peak to peak [arcmin].
    """
    doubt = joint_doubt(joint, ("output_error",))
    if doubt is None:
        return ""
    if doubt.peak_to_peak is None or value <= 0.0:
        return mark(doubt.largest)
    return mark(doubt.largest * doubt.peak_to_peak / arcmin / value)


def joints_judged(joints: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """``ripple_valid`` and ``map_difference`` of several joints, the worst of each.

    Both are None if no run reports the ripple of a joint.

    Args:
        joints: Figures of joints from ``joint_metrics``.
    """
    judged = [joint for joint in joints if joint["ripple_valid"] is not None]
    if not judged:
        return {"ripple_valid": None, "map_difference": None}
    return {
        "ripple_valid": all(joint["ripple_valid"] for joint in judged),
        "map_difference": {
            key: max(
                (joint["map_difference"][key] for joint in judged),
                key=lambda one: float(one["largest"]),
            )
            for key in QUANTITIES
        },
    }


def joint_mark(
    joint: Mapping[str, Any], quantities: Sequence[str] = tuple(QUANTITIES)
) -> str:
    """Mark of a figure of a joint; empty if the figure is not uncertain.

    Args:
        joint: Figures of a joint from ``joint_metrics``.
        quantities: Keys of :data:`QUANTITIES` on which the figure depends.
    """
    doubt = joint_doubt(joint, quantities)
    return "" if doubt is None else mark(doubt.largest)


def worst(marks: Collection[str]) -> str:
    """The most severe of several marks."""
    return next((sign for sign in (NOT_VALID, UNCERTAIN) if sign in marks), "")


def mark_legend(marks: Collection[str]) -> str:
    """Legend of the given marks."""
    meaning = {
        UNCERTAIN: f"uncertain, the map differs by more than {percent(WARNING)}",
        NOT_VALID: f"not valid, the map differs by more than {percent(LIMIT)}",
    }
    shown = [f"{sign} {text}" for sign, text in meaning.items() if sign in marks]
    return (
        f"{'; '.join(shown)} of the peak-to-peak value from finite-element solves that"
        " were not used to build it"
    )
