"""Values that the catalogue prints for a component set."""

from __future__ import annotations

import numpy as np

from swgjoint.errors import InputError
from swgjoint.gear.catalogue import CatalogueRow, catalogue_rows, table
from swgjoint.maps.sheet.loop import LOST_MOTION_TORQUE, largest_torque
from swgjoint.typing import Array

STIFFNESS = ("K1", "K2", "K3")
RATIO_CLASS = 80
"""Highest ratio class of the stiffness and accuracy tables; it includes larger ratios.
"""


def catalogue_row(size: int, ratio: int) -> CatalogueRow:
    """Ratings of a component set.

    Args:
        size: Size of the drive, its pitch diameter in tenths of an inch.
        ratio: Ratio of the drive, positive.

    Raises:
        InputError: If the catalogue does not list the component set.
    """
    for row in catalogue_rows():
        if (row.size, row.ratio) == (size, ratio):
            return row
    raise InputError(f"the catalogue has no size {size}, ratio {ratio}")


def edges(row: CatalogueRow) -> tuple[float, float, float, float]:
    """Torques 0, T1, T2 and the end of the standard loop [N·m]."""
    return 0.0, row.T1, row.T2, largest_torque(row)


def torques_of(row: CatalogueRow) -> tuple[float, ...]:
    """Torques of a loading path, increasing: lost motion, rated, segment ends [N·m]."""
    lost = LOST_MOTION_TORQUE * row.rated_torque
    return tuple(sorted({lost, row.rated_torque, *edges(row)[1:]}))


def catalogue_stiffness(row: CatalogueRow) -> Array:
    """Printed K1, K2, K3 [N·m/rad], shape (3,).

    Raises:
        ValueError: If the catalogue has no stiffness for this size and ratio.
    """
    ratio_class = float(min(row.ratio, RATIO_CLASS))
    for line in table("stiffness"):
        if (line["size"], line["ratio_class"]) == (float(row.size), ratio_class):
            values = [line[f"{key}_1e4Nm_rad"] for key in STIFFNESS]
            return 1e4 * np.array([float(v) for v in values if v is not None])
    raise ValueError(f"no stiffness of size {row.size}, ratio {row.ratio}")


def catalogue_buckling_torque(size: int) -> float:
    """Printed torque at which the cup of a component set buckles [N·m].

    It is the same for all ratios of a size.

    Raises:
        ValueError: If the catalogue does not list the size.
    """
    for line in table("ratings"):
        torque = line["buckling_Nm"]
        if line["size"] == float(size) and isinstance(torque, float):
            return torque
    raise ValueError(f"no buckling torque of size {size}")


def printed_accuracy(row: CatalogueRow) -> dict[str, float | None]:
    """Printed upper bounds of transmission accuracy, hysteresis loss and lost motion.

    The keys state the unit; a value that is not printed is None.
    """
    ratio_class = float(min(row.ratio, RATIO_CLASS))
    keys = ("transmission_accuracy_arcmin", "hysteresis_loss_arcmin")
    for line in table("accuracy"):
        same = (line["size"], line["ratio_class"]) == (float(row.size), ratio_class)
        if line["series"] == "CHA" and same:
            return {
                key: None if line[key] is None else float(line[key])  # type: ignore[arg-type]
                for key in (*keys, "lost_motion_arcmin")
            }
    return dict.fromkeys((*keys, "lost_motion_arcmin"))
