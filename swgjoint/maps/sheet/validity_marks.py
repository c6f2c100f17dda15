"""Signs of figures that depend on a map which differs from unseen solves.

Figures of a joint, see :func:`swgjoint.sim.figures.metrics.joint_metrics`, carry what
its map misses under ``map_difference`` and ``ripple_valid``; so do rows of a
comparison.
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
    """The sign of a figure that depends on a quantity which is off by that much."""
    if largest is None or largest <= WARNING:
        return ""
    return UNCERTAIN if largest <= LIMIT else NOT_VALID


def joint_doubt(
    joint: Mapping[str, Any], quantities: Sequence[str] = tuple(QUANTITIES)
) -> Difference | None:
    """The worst difference of a joint's map where it exceeds :data:`WARNING`.

    None where the run tells no ripple of the joint.

    Args:
        joint: Figures of a joint, as ``joint_metrics`` makes them.
        quantities: Keys of :data:`QUANTITIES` that count.
    """
    found = joint["map_difference"]
    if found is None or joint["ripple_valid"] is None:
        return None
    worst = max(
        (Difference.from_json(found[key]) for key in quantities),
        key=lambda one: one.largest,
    )
    return worst if worst.largest > WARNING else None


def error_mark(joint: Mapping[str, Any], value: float) -> str:
    """The sign of a peak to peak of the transmission error.

    Torsion that follows the load adds to it, so that the difference counts over the
    figure that is shown.

    Args:
        joint: Figures of a joint.
        value: The figure [arcmin].
    """
    doubt = joint_doubt(joint, ("output_error",))
    if doubt is None:
        return ""
    if doubt.peak_to_peak is None or value <= 0.0:
        return mark(doubt.largest)
    return mark(doubt.largest * doubt.peak_to_peak / arcmin / value)


def joints_judged(joints: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """``ripple_valid`` and ``map_difference`` of several joints: the worst of them."""
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
    """The sign of a figure of a joint that depends on some quantities, or nothing."""
    doubt = joint_doubt(joint, quantities)
    return "" if doubt is None else mark(doubt.largest)


def worst(marks: Collection[str]) -> str:
    """The gravest of several signs."""
    return next((sign for sign in (NOT_VALID, UNCERTAIN) if sign in marks), "")


def mark_legend(marks: Collection[str]) -> str:
    """What the signs of figures mean, those that are there."""
    meaning = {
        UNCERTAIN: f"uncertain, the map differs by more than {percent(WARNING)}",
        NOT_VALID: f"not valid, the map differs by more than {percent(LIMIT)}",
    }
    told = [f"{sign} {text}" for sign, text in meaning.items() if sign in marks]
    return (
        f"{'; '.join(told)} of the peak to peak from finite-element solves that it has"
        " not seen"
    )
