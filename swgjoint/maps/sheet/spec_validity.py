"""Figures of a spec sheet that the validation of the map shows to be uncertain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from swgjoint.maps.sheet.map_validity import (
    LIMIT,
    STIFFNESS,
    WARNING,
    Difference,
    map_validation,
    percent,
)

if TYPE_CHECKING:
    from swgjoint.maps.potential import Potential

RIPPLE_KEYS = ("ripple_rms_percent", "ripple_pp_percent")
"""Keys of the figures that are removed if the ripple is not valid."""
STIFFNESS_KEYS = ("K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad")
"""Keys of the figures to which the difference of the secant stiffness applies."""


def judge_figures(
    drive: Potential, values: dict[str, Any], missing: dict[str, str]
) -> dict[str, Difference]:
    """Differences from unseen solves that make figures uncertain, by key of the figure.

    Ripple and transmission accuracy are judged at the torque at which they are read,
    K1 to K3 by the largest difference of the secant stiffness at any torque. If the
    difference at rated torque exceeds :data:`~swgjoint.maps.sheet.map_validity.LIMIT`,
    the ripple figures are removed from ``values``, and ``missing`` gives the reason.

    Args:
        drive: The map.
        values: Figures by key, modified in place.
        missing: Reasons by key, modified in place.
    """
    record, _ = map_validation(drive)
    if record is None:
        return {}
    rated = drive.ratings.rated_torque
    no_load, loaded = (record.worst_between(load, load) for load in (0.0, rated))
    worst = max(loaded.values(), key=lambda one: one.largest)
    if worst.largest > LIMIT:
        for key in RIPPLE_KEYS:
            if values.get(key) is not None:
                values[key] = None
                missing[key] = (
                    f"not valid: the map {worst} (accepted: {percent(LIMIT)})"
                )
        for line in values.get("orders") or ():
            line["ripple_percent"] = None
    of = {
        **dict.fromkeys((*RIPPLE_KEYS, "orders"), worst),
        "transmission_accuracy_arcmin": no_load["output_error"],
        "transmission_accuracy_rated_arcmin": loaded["output_error"],
    }
    if STIFFNESS in record.totals:
        of |= dict.fromkeys(STIFFNESS_KEYS, record.totals[STIFFNESS])
    return {key: one for key, one in of.items() if one.largest > WARNING}
