"""Figures that the bundled catalogue tables state for a drive, and checks of them."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

from swgjoint.errors import InputError
from swgjoint.gear.catalogue import CatalogueRow, table

SIMILAR = 1.6
"""Largest factor between the torsion T1/K1 of a size and the median of its ratio class
[-].

T1 and K1 both grow with the cube of the size, so their quotient is nearly the same for
all sizes. A larger factor indicates a misplaced digit."""

_PER_TABLE = 1e4  # K1 to K3 are in 1e4 N·m/rad
_STATED = (
    "transmission_accuracy_arcmin",
    "hysteresis_loss_arcmin",
    "lost_motion_arcmin",
    "repeatability_arcmin",
)


@dataclass(frozen=True, kw_only=True)
class StatedLosses:
    """Efficiency and no-load torques of one drive as stated in a catalogue."""

    rated_torque: float
    """Rated torque at the output [N·m]."""
    efficiency: float
    """Efficiency at rated torque and 2000 rpm input speed [-]."""
    no_load_running: float
    """No-load running torque at the input, at an input speed of 2000 rpm [N·m]."""
    starting: float
    """Starting torque at the input [N·m]."""
    back_driving: float
    """Back-driving torque at the output [N·m]."""


LOSS_KEYS = (
    "no_load_running_torque_Nm",
    "starting_torque_Nm",
    "back_driving_torque_Nm",
    "efficiency_percent",
)
"""Keys of the losses in the output of ``swgjoint spec``."""
_LOSS_RATIO = 100
"""Reduction ratio of every row of ``losses.csv`` [-]."""
_MILLI = 1e-3
LOSS_CONDITIONS = "+20 C, grease, RT1-H-CS of the same rated torque, second-hand"
"""Test conditions of ``losses.csv``; no-load running torque and efficiency are stated
at an input speed of 2000 rpm."""


def stated_losses(row: CatalogueRow) -> StatedLosses | None:
    """Losses of the drive in ``losses.csv`` with the same size and rated torque.

    The table describes drives of another manufacturer (RT1-H-CS) that have the sizes
    and rated torques of CSG drives at a ratio of 100. Its values were digitised by a
    third party, so they serve as a plausibility check only.

    Returns:
        The losses; None for another series or ratio, or without a matching row.
    """
    if row.series != "CSG" or row.ratio != _LOSS_RATIO:
        return None
    for losses in table("losses"):
        if (losses["size"], losses["rated_Nm"]) == (row.size, row.rated_torque):
            return StatedLosses(
                rated_torque=_number(losses, "rated_Nm"),
                efficiency=0.01 * _number(losses, "efficiency_percent"),
                no_load_running=_MILLI * _number(losses, "no_load_running_mNm"),
                starting=_MILLI * _number(losses, "starting_mNm"),
                back_driving=_number(losses, "back_driving_Nm"),
            )
    return None


def stiffness_of(size: int, ratio: int) -> dict[str, float]:
    """Torsion curve from ``stiffness.csv``: T1, T2 [N·m] and K1 to K3 [N·m/rad].

    Args:
        size: Catalogue size.
        ratio: Reduction ratio, without sign.

    Raises:
        InputError: If the table has no such row, or if the values of the row are
            inconsistent.
    """
    row = _of_class("stiffness", size, ratio)
    if row is None:
        raise InputError(
            f"models/catalogue/stiffness.csv has no row for size {size}, ratio {ratio}"
        )
    values = {
        "T1": _number(row, "T1_Nm"),
        "T2": _number(row, "T2_Nm"),
        **{k: _PER_TABLE * _number(row, f"{k}_1e4Nm_rad") for k in ("K1", "K2", "K3")},
    }
    if faults := _faults(row):
        raise InputError("; ".join(faults))
    return values


def stated_figures(row: CatalogueRow) -> dict[str, float | None]:
    """Stated figures of one drive, other than stiffness and ratings.

    The accuracy table is divided into ratio classes. A class applies from its own ratio
    up to that of the next class of the series. The tables state ratcheting torque,
    buckling torque and inertia only for the CSG series. The losses come from
    :func:`stated_losses`.

    Returns:
        Figures by key, in the unit of the key; None for those that the tables do not
        state.
    """
    accuracy = _of_class("accuracy", row.size, row.ratio, series=row.series) or {}
    figures: dict[str, float | None] = dict.fromkeys(LOSS_KEYS)
    for key in _STATED:
        value = accuracy.get(key)
        figures[key] = value if isinstance(value, float) else None
    if row.series != "CSG":
        return figures | dict.fromkeys(
            ("ratcheting_torque_Nm", "buckling_torque_Nm", "input_inertia_kgm2")
        )
    ratings = next(
        r for r in table("ratings") if (r["size"], r["ratio"]) == (row.size, row.ratio)
    )
    inertia = ratings["input_inertia_1e-4kgm2"]
    losses = stated_losses(row)
    if losses is not None:
        figures |= {
            "no_load_running_torque_Nm": losses.no_load_running,
            "starting_torque_Nm": losses.starting,
            "back_driving_torque_Nm": losses.back_driving,
            "efficiency_percent": 100.0 * losses.efficiency,
        }
    return figures | {
        "ratcheting_torque_Nm": row.ratcheting_torque,
        "buckling_torque_Nm": _number(ratings, "buckling_Nm"),
        "input_inertia_kgm2": 1e-4 * inertia if isinstance(inertia, float) else None,
    }


def _faults(row: dict[str, float | str | None]) -> list[str]:
    """Inconsistencies in one row of ``stiffness.csv``, one message each."""
    where = (
        f"models/catalogue/stiffness.csv, size {row['size']:g}, class"
        f" {row['ratio_class']:g}"
    )
    K1, K2, K3 = (_number(row, f"{k}_1e4Nm_rad") for k in ("K1", "K2", "K3"))
    T1, T2 = _number(row, "T1_Nm"), _number(row, "T2_Nm")
    faults = []
    if not 0.0 < K1 < K2 < K3:
        faults.append(
            f"{where}: expected 0 < K1 < K2 < K3, found {K1:g}, {K2:g}, {K3:g}"
        )
    if not 0.0 < T1 < T2:
        faults.append(f"{where}: expected 0 < T1 < T2, found {T1:g}, {T2:g} N·m")
    torsions = [
        _number(other, "T1_Nm") / _number(other, "K1_1e4Nm_rad")
        for other in table("stiffness")
        if other["ratio_class"] == row["ratio_class"]
    ]
    factor = T1 / K1 / median(torsions)
    if not 1.0 / SIMILAR < factor < SIMILAR:
        faults.append(
            f"{where}: torsion T1/K1 is {factor:.3g} times the median of its class;"
            f" accepted: within a factor {SIMILAR:g}"
        )
    return faults


def _of_class(
    name: str, size: int, ratio: int, *, series: str | None = None
) -> dict[str, float | str | None] | None:
    """Row of a size with the largest ratio class that does not exceed the ratio."""
    rows = [
        row
        for row in table(name)
        if row["size"] == size
        and (series is None or row["series"] == series)
        and _number(row, "ratio_class") <= ratio
    ]
    return max(rows, key=lambda row: _number(row, "ratio_class"), default=None)


def _number(row: dict[str, float | str | None], key: str) -> float:
    value = row[key]
    if not isinstance(value, float):
        raise InputError(f"models/catalogue: {key} is missing in a row ({row})")
    return value
