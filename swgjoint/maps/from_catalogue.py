"""A drive map from a row of the shipped catalogue tables.

Torque against torsion has the slopes K1, K2, K3 on 0..T1, T1..T2 and above. The two
corners are rounded by parabolas that end on the catalogue's lines (:data:`CORNER`), so
torque and stiffness are continuous. What a catalogue states as an upper bound only,
above all the kinematic error, is not in the map; its record says so.
"""

from __future__ import annotations

import re
from math import log
from typing import TypeVar

import numpy as np

from swgjoint.errors import InputError
from swgjoint.maps.catalogue import CatalogueRow, catalogue_rows
from swgjoint.maps.catalogue_stated import stated_figures, stiffness_of
from swgjoint.maps.drive_map import DriveMap, Ratings
from swgjoint.maps.torsion_law import potential_of_stiffness

SHARED_SERIES = ("CSF", "CSG", "SHG", "HFUC", "HFUS", "CHA")
"""Series with the stiffness of ``stiffness.csv``; only CSG has ratings there."""
CORNER = 0.04
"""Half width of a rounded corner, as part of the shorter line beside it. The chord
over a line of slope K beside one of slope K' changes by CORNER |K'/K - 1|/4: less
than 1 % for every shipped row."""
LOBES = 2

_NAME = re.compile(r"([A-Z]+)-(\d{1,4})-(\d{1,4})")
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
