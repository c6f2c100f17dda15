"""Assumed rotor inertia of drives."""

from __future__ import annotations

from math import log
from pathlib import Path
from typing import TYPE_CHECKING

from swgjoint.drives.references import find_drive
from swgjoint.errors import InputError
from swgjoint.gear.catalogue import ratings_of, table
from swgjoint.maps.drive_map import DriveMap

if TYPE_CHECKING:
    from swgjoint.gear.design.design import Design

LINEAR_DRIVE = "linear"
"""Level of a drive of a single stiffness, which need not be a gear."""


def rotor_inertia_of(
    drive: str | Path | Design | DriveMap,
) -> float | None:
    """Rotor inertia of a drive, twice the inertia of its wave generator.

    This assumes a motor whose inertia equals that of the wave generator. The inertia of
    the wave generator is that of the catalogue drive with the nearest ratio and rated
    torque. Between geometrically similar drives, torques grow with the third and
    inertias with the fifth power of the diameter, so it is scaled by the ratio of the
    rated torques to the power of 5/3.

    Args:
        drive: Design, map or catalogue drive, or its name.

    Returns:
        Inertia of rotor and wave generator [kg·m²]; None for a drive of a single
        stiffness, and for names that are no drive.

    >>> rotor_inertia_of("CSG-25-100") == rotor_inertia_of("size-25-100")
    True
    """
    try:
        found = find_drive(drive)
    except InputError:
        return None  # loading the drive reports what is wrong with the name
    if isinstance(found, DriveMap):
        if found.level == LINEAR_DRIVE:
            return None
        ratio, torque = abs(found.ratio), found.ratings.rated_torque
    else:
        ratio = found.drive.teeth_flexspline / found.tooth_difference
        torque = ratings_of(found).rated_torque

    def apart(row: dict[str, float | str | None]) -> tuple[float, float]:
        """Distance of a row of the catalogue in ratio, then in rated torque."""
        return (
            abs(log(float(row["ratio"] or 1.0) / ratio)),
            abs(log(float(row["rated_Nm"] or 1.0) / torque)),
        )

    rows = [one for one in table("ratings") if one["input_inertia_1e-4kgm2"]]
    row = min(rows, key=apart)
    own, rated = row["input_inertia_1e-4kgm2"], row["rated_Nm"]
    assert isinstance(own, float)
    assert isinstance(rated, float)
    return float(f"{2e-4 * own * (torque / rated) ** (5.0 / 3.0):.4g}")
