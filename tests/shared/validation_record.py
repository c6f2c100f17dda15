"""Made-up validation records of maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from swgjoint.maps.drive_map import DriveMap


def made_record(
    rows: Mapping[float, tuple[float, float]],
    stiffness: float = 0.01,
    error: float = 3e-4,
) -> dict[str, Any]:
    """A record with the given largest differences.

    Args:
        rows: By torque [N·m] the parts of the peak to peak that input torque and
            loaded output error miss.
        stiffness: The same of the secant stiffness, relative.
        error: Peak to peak of the loaded output error [rad].
    """
    totals = {}
    for k, key in enumerate(("input_torque", "output_error")):
        at = max(rows, key=lambda torque: rows[torque][k])
        largest = rows[at][k]
        totals[key] = {"largest": largest, "rms": 0.3 * largest, "at_Nm": at}
    return {
        "solves": 11 * len(rows),
        "angles_per_torque": 11,
        "torques_Nm": sorted(rows),
        **totals,
        "secant_stiffness": {"largest": stiffness, "at_Nm": min(rows)},
        "worst": max(total["largest"] for total in totals.values()),
        "rows": [
            {
                "torque_Nm": torque,
                "input_torque_pp_Nm": 5e-3,
                "input_torque_largest": first,
                "input_torque_rms": 0.3 * first,
                "output_error_pp_rad": error,
                "output_error_largest": second,
                "output_error_rms": 0.3 * second,
            }
            for torque, (first, second) in sorted(rows.items())
        ],
    }


def validated_map(
    drive: DriveMap,
    rows: Mapping[float, tuple[float, float]],
    stiffness: float = 0.01,
    error: float = 3e-4,
) -> DriveMap:
    """The map with such a record."""
    record = made_record(rows, stiffness, error)
    return replace(drive, info={**drive.info, "validation": record})
