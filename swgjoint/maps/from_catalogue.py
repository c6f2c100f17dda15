"""A drive map from a row of the shipped catalogue tables.

Torque against torsion has the slopes K1, K2, K3 on 0..T1, T1..T2 and above. The two
corners are rounded by parabolas that end on the catalogue's lines (:data:`CORNER`), so
torque and stiffness are continuous. What a catalogue states as an upper bound only,
above all the kinematic error, is not in the map; its record says so.
"""

from __future__ import annotations

import re
from math import log
from statistics import median
from typing import Any, TypeVar

import numpy as np

from swgjoint.errors import InputError
from swgjoint.maps.catalogue import CatalogueRow, catalogue_rows, table
from swgjoint.maps.drive_map import DriveMap, Ratings
from swgjoint.maps.torsion_law import potential_of_stiffness

SHARED_SERIES = ("CSF", "CSG", "SHG", "HFUC", "HFUS", "CHA")
"""Series with the stiffness of ``stiffness.csv``; only CSG has ratings there."""
CORNER = 0.04
"""Half width of a rounded corner, as part of the shorter line beside it. The chord
over a line of slope K beside one of slope K' changes by CORNER |K'/K - 1|/4: less
than 1 % for every shipped row."""
LOBES = 2
SIMILAR = 1.6
"""Torsion at T1 varies by less than this factor about the median of its ratio class:
T1 and K1 both grow with the cube of the size, so a misplaced digit stands out."""

_PER_TABLE = 1e4  # K1 to K3 are in 1e4 N·m/rad
_NAME = re.compile(r"([A-Z]+)-(\d{1,4})-(\d{1,4})")
_STATED = (
    "transmission_accuracy_arcmin",
    "hysteresis_loss_arcmin",
    "lost_motion_arcmin",
    "repeatability_arcmin",
)
_NO_ERROR = (
    "a catalogue states transmission accuracy as an upper bound only: the map has no"
    " kinematic error"
)

Map = TypeVar("Map", bound=DriveMap)


def catalogue_names() -> list[str]:
    """Every name that :func:`map_from_catalogue` accepts."""
    return [row.name for row in catalogue_rows()]


def is_catalogue_name(text: str) -> bool:
    """Whether a reference means the catalogue: it begins with a series."""
    series = "|".join(SHARED_SERIES)
    name = re.match(rf"(?:{series})(?:[-\s\d]|$)", text, re.IGNORECASE)
    return name is not None and not text.endswith(".toml")


def find_row(name: str) -> CatalogueRow:
    """The row of a name such as ``CSG-25-100``: series, size, ratio.

    Raises:
        InputError: With the nearest names, if no row with ratings has that name.
    """
    rows = {row.name: row for row in catalogue_rows()}
    wanted = name.strip().upper()
    if wanted in rows:
        return rows[wanted]
    parts = _NAME.fullmatch(wanted)
    if parts is None:
        why = "is no catalogue name; accepted: SERIES-SIZE-RATIO"
    elif parts[1] in SHARED_SERIES and parts[1] != "CSG":
        why = f"has no ratings in models/catalogue (series {parts[1]}); has: CSG"
    else:
        why = "is not in models/catalogue/ratings.csv"
    # nearest by factor in size, then in ratio; 100 where the name says none
    digits = [max(1, int(text)) for text in re.findall(r"\d{1,4}", wanted)]
    size, ratio = ([*digits, 100] if digits else [25, 100])[:2]
    near = sorted(
        rows,
        key=lambda key: (
            abs(log(rows[key].size / size)) + abs(log(rows[key].ratio / ratio))
        ),
    )[:3]
    raise InputError(f"catalogue drive {name[:60]!r} {why}; nearest: {', '.join(near)}")


def stiffness_of(size: int, ratio: int) -> dict[str, float]:
    """Row of ``stiffness.csv`` for a size and ratio: T1, T2 [N·m], K1 to K3 [N·m/rad].

    Raises:
        InputError: If the table has no such row or the row contradicts itself.
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
    """What the tables state of one drive beside stiffness and ratings; None if not.

    A ratio class holds from its own ratio up to the next class of the series.
    """
    accuracy = _of_class("accuracy", row.size, row.ratio, series="CSG") or {}
    figures: dict[str, float | None] = {}
    for key in _STATED:
        value = accuracy.get(key)
        figures[key] = value if isinstance(value, float) else None
    ratings = next(
        r for r in table("ratings") if (r["size"], r["ratio"]) == (row.size, row.ratio)
    )
    inertia = ratings["input_inertia_1e-4kgm2"]
    return figures | {
        "ratcheting_torque_Nm": row.ratcheting_torque,
        "buckling_torque_Nm": _number(ratings, "buckling_Nm"),
        "input_inertia_kgm2": 1e-4 * inertia if isinstance(inertia, float) else None,
    }


def catalogue_faults() -> list[str]:
    """Contradictions in the shipped tables, one line each; none in a sound release.

    K1 < K2 < K3 and T1 < T2; torsion T1/K1 similar over the sizes of a ratio class;
    rated <= repeated peak <= momentary peak, T2 below the repeated peak.
    """
    faults = [fault for row in table("stiffness") for fault in _faults(row)]
    for row in catalogue_rows():
        if not row.rated_torque <= row.repeated_peak <= row.momentary_peak:
            faults.append(f"{row.name}: torques of ratings.csv do not increase")
        if row.T2 >= row.repeated_peak:
            faults.append(f"{row.name}: T2 {row.T2:g} N·m is above the repeated peak")
    return faults


def catalogue_gaps() -> list[dict[str, Any]]:
    """Rows with values that the tables do not hold: ``row`` and ``missing``."""
    gaps = []
    for row in catalogue_rows():
        absent = [key for key, value in stated_figures(row).items() if value is None]
        if absent:
            gaps.append({"row": row.name, "missing": absent})
    rated = {row.size for row in catalogue_rows()}
    smallest = min(row.ratio for row in catalogue_rows())
    for line in table("stiffness"):
        size, ratio = int(_number(line, "size")), int(_number(line, "ratio_class"))
        if size not in rated or ratio < smallest:
            gaps.append({"row": f"stiffness {size}-{ratio}", "missing": ["ratings"]})
    for line in table("accuracy"):
        if line["series"] != "CSG":
            name = f"{line['series']}-{line['size']:g}-{line['ratio_class']:g}"
            gaps.append({"row": f"accuracy {name}", "missing": ["ratings"]})
    return gaps


def map_from_catalogue(name: str, cls: type[Map]) -> Map:
    """The map of a catalogue drive; see :meth:`DriveMap.from_catalogue`.

    Two-lobe gearing with the circular spline fixed: z_fs = 2 ratio, z_cs = z_fs + 2.

    Raises:
        InputError: If the name is unknown or the tables contradict themselves.
    """
    row = find_row(name)
    s = stiffness_of(row.size, row.ratio)
    top = max(row.momentary_peak, 1.5 * s["T2"])
    knots, stiffness = three_lines(
        s["T1"], s["T2"], s["K1"], s["K2"], s["K3"], largest=top
    )
    potential, ends = potential_of_stiffness(knots, stiffness)
    stated = stated_figures(row)
    teeth = LOBES * row.ratio
    return cls(
        name=row.name,
        level="catalogue",
        layout="circular_spline_fixed",
        teeth_flexspline=teeth,
        teeth_circular_spline=teeth + LOBES,
        torsion_knots=knots,
        orders=np.zeros((1, 2), dtype=np.int64),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=np.zeros((1, 2)),
        ratings=Ratings(
            rated_torque=row.rated_torque,
            repeated_peak=row.repeated_peak,
            momentary_peak=row.momentary_peak,
            T1=s["T1"],
            T2=s["T2"],
            source=f"catalogue {row.name}",
        ),
        info={
            "source": f"catalogue {row.name}: models/catalogue/*.csv",
            "stated": stated
            | {f"{k}_Nm_rad": s[k] for k in ("K1", "K2", "K3")}
            | {f"{k}_Nm": s[k] for k in ("T1", "T2")},
            "corner": CORNER,
            "missing": _missing(stated),
        },
    )


def three_lines(
    T1: float, T2: float, K1: float, K2: float, K3: float, *, largest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Knots [rad] and stiffness there [N·m/rad] of three lines with rounded corners.

    Slopes K1 to T1, K2 to T2 and K3 beyond, odd in the torsion. Between the two ends of
    a corner the stiffness is linear; by the trapezoid the torque then ends on the next
    line exactly.

    Args:
        T1: End of the first line [N·m].
        T2: End of the second line [N·m].
        K1: Slope of the first line [N·m/rad].
        K2: Slope of the second line [N·m/rad].
        K3: Slope of the third line [N·m/rad].
        largest: Torque at the last knot, above T2 [N·m].
    """
    lengths = [T1 / K1, (T2 - T1) / K2, (largest - T2) / K3]
    first = lengths[0]
    second = first + lengths[1]
    w1, w2 = CORNER * min(lengths[:2]), CORNER * min(lengths[1:])
    half = [first - w1, first + w1, second - w2, second + w2, sum(lengths)]
    values = [K1, K2, K2, K3, K3]
    return (
        np.array([-x for x in reversed(half)] + half),
        np.array(values[::-1] + values),
    )


def _missing(stated: dict[str, float | None]) -> dict[str, str]:
    """Why the map cannot tell a figure, with what the catalogue says instead."""

    def says(key: str) -> str:
        value = stated[key]
        return (
            "the catalogue tables state none for it"
            if value is None
            else f"the catalogue states {value:g} arcmin"
        )

    bound = f"{_NO_ERROR}; {says('transmission_accuracy_arcmin')}"
    return {
        "transmission_accuracy_arcmin": bound,
        "transmission_accuracy_rated_arcmin": bound,
        "orders": _NO_ERROR,
        "ripple_rms_percent": _NO_ERROR,
        "ripple_pp_percent": _NO_ERROR,
        "hysteresis_loss_arcmin": "the map is conservative, without friction or"
        f" hysteresis; {says('hysteresis_loss_arcmin')}",
        "repeatability_arcmin": "the map is conservative, without friction or"
        f" hysteresis; {says('repeatability_arcmin')}",
    }


def _faults(row: dict[str, float | str | None]) -> list[str]:
    """Contradictions in one row of ``stiffness.csv``."""
    where = (
        f"models/catalogue/stiffness.csv, size {row['size']:g}, class"
        f" {row['ratio_class']:g}"
    )
    K1, K2, K3 = (_number(row, f"{k}_1e4Nm_rad") for k in ("K1", "K2", "K3"))
    T1, T2 = _number(row, "T1_Nm"), _number(row, "T2_Nm")
    faults = []
    if not 0.0 < K1 < K2 < K3:
        faults.append(f"{where}: needed 0 < K1 < K2 < K3, has {K1:g}, {K2:g}, {K3:g}")
    if not 0.0 < T1 < T2:
        faults.append(f"{where}: needed 0 < T1 < T2, has {T1:g}, {T2:g} N·m")
    alike = [
        _number(other, "T1_Nm") / _number(other, "K1_1e4Nm_rad")
        for other in table("stiffness")
        if other["ratio_class"] == row["ratio_class"]
    ]
    factor = T1 / K1 / median(alike)
    if not 1.0 / SIMILAR < factor < SIMILAR:
        faults.append(
            f"{where}: torsion T1/K1 is {factor:.3g} times the median of its class;"
            f" accepted: within a factor {SIMILAR:g}"
        )
    return faults


def _of_class(
    name: str, size: int, ratio: int, *, series: str | None = None
) -> dict[str, float | str | None] | None:
    """Row of the size and of the largest ratio class that is not above the ratio."""
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
