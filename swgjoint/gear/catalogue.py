"""Catalogue tables, and default ratings of a design from them."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from functools import lru_cache
from math import log

from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.gear.ratings import Ratings
from swgjoint.models_path import models_path
from swgjoint.units import mm

SIZE = 2.54 * mm
"""Pitch diameter per unit of catalogue size: a tenth of an inch [m]."""
FITS_WITHIN = 2.0
"""A row applies to a design if pitch diameter and ratio are within this factor."""


@dataclass(frozen=True, kw_only=True)
class CatalogueRow:
    """Torques of one component set [N·m], from ``models/catalogue``."""

    size: int
    ratio: int
    rated_torque: float
    repeated_peak: float
    momentary_peak: float
    ratcheting_torque: float
    T1: float
    T2: float
    series: str = "CSG"

    @property
    def name(self) -> str:
        """Name as in catalogues, e.g. ``CSG-25-100``."""
        return f"{self.series}-{self.size}-{self.ratio}"

    @property
    def pitch_diameter(self) -> float:
        """Pitch diameter [m]."""
        return self.size * SIZE


@lru_cache
def table(name: str) -> tuple[dict[str, float | str | None], ...]:
    """Rows of a bundled catalogue table; empty cells are None, numbers are floats.

    Units are in the column names, sources in the comment lines of the file.

    Args:
        name: Name of the table, without ``.csv``.

    Raises:
        InputError: If there is no such table.
    """
    path = models_path() / "catalogue" / f"{name}.csv"
    if not path.is_file():
        raise InputError(f"catalogue table {name!r} not in {path.parent}")
    text = path.read_text(encoding="utf-8").splitlines()
    reader = csv.DictReader(line for line in text if not line.startswith("#"))
    return tuple({k: _cell(v) for k, v in row.items()} for row in reader)


def _cell(text: str) -> float | str | None:
    try:
        return float(text)
    except ValueError:
        return text or None


@lru_cache
def catalogue_rows() -> tuple[CatalogueRow, ...]:
    """Component sets with their ratings and the torque limits T1 and T2 of the size."""
    limits = {row["size"]: (row["T1_Nm"], row["T2_Nm"]) for row in table("stiffness")}
    rows = []
    for row in table("ratings"):
        values = {k: float(v) for k, v in row.items() if isinstance(v, float)}
        low, high = limits[values["size"]]
        assert isinstance(low, float)
        assert isinstance(high, float)
        rows.append(
            CatalogueRow(
                size=int(values["size"]),
                ratio=int(values["ratio"]),
                rated_torque=values["rated_Nm"],
                repeated_peak=values["repeated_peak_Nm"],
                momentary_peak=values["momentary_peak_Nm"],
                ratcheting_torque=values["ratcheting_Nm"],
                T1=low,
                T2=high,
            )
        )
    return tuple(rows)


def named_rows() -> tuple[CatalogueRow, ...]:
    """All drives of the catalogue: the component sets, then the other series.

    Another series has a drive of a size if ``accuracy.csv`` states its accuracy. Its
    ratings are those of the component set of the same size and ratio, because the
    tables contain no ratings of other series.
    """
    rows = catalogue_rows()
    others = dict.fromkeys((row["series"], row["size"]) for row in table("accuracy"))
    return rows + tuple(
        replace(row, series=str(series))
        for series, size in others
        for row in rows
        if series != row.series and size == row.size
    )


def nearest_row(pitch_diameter: float, ratio: float) -> CatalogueRow:
    """Row with the nearest pitch diameter and, among these, the nearest ratio.

    Both distances are factors (logarithmic).

    Args:
        pitch_diameter: Pitch diameter of the flexspline [m].
        ratio: Unsigned ratio with the circular spline fixed [-].

    >>> nearest_row(62e-3, 105).name
    'CSG-25-100'
    """
    return min(
        catalogue_rows(),
        key=lambda row: (
            abs(log(row.pitch_diameter / pitch_diameter)),
            abs(log(row.ratio / ratio)),
        ),
    )


def ratings_of(design: Design) -> Ratings:
    """Ratings of a design: its own keys, and defaults from the nearest catalogue row.

    The row is scaled to the rated torque of the design or, if the design states none,
    with the cube of the pitch diameter. If no row is within a factor of
    :data:`FITS_WITHIN`, T1 and T2 are 0.2 and 0.6 of the rated torque, and the
    ratcheting torque is unknown. The field ``source`` names the rule that was used.
    Defaults are adjusted to the values of the design so that rated torque <= repeated
    peak <= momentary peak.
    """
    given = design.ratings
    ratio = design.drive.teeth_flexspline / design.tooth_difference
    row = nearest_row(design.pitch_diameter, ratio)
    size_factor = design.pitch_diameter / row.pitch_diameter
    if given.rated_torque_Nm is not None:
        scale = given.rated_torque_Nm / row.rated_torque
        rule = f"scaled to the rated torque {given.rated_torque_Nm:g} N·m"
    else:
        scale = size_factor**3
        rule = f"scaled by {scale:.4g}, the cube of the pitch diameters"
    fits = max(
        size_factor, 1.0 / size_factor, ratio / row.ratio, row.ratio / ratio
    ) <= FITS_WITHIN * (1.0 + 1e-12)

    rated = given.rated_torque_Nm or row.rated_torque * scale
    repeated = given.repeated_peak_Nm or row.repeated_peak * scale
    momentary = given.momentary_peak_Nm or row.momentary_peak * scale
    if given.repeated_peak_Nm is None:
        repeated = min(repeated, momentary)
    momentary = max(momentary, repeated)
    if given.rated_torque_Nm is None:
        rated = min(rated, repeated)
    repeated = max(repeated, rated)
    momentary = max(momentary, repeated)
    skips = max(row.ratcheting_torque * scale, momentary) if fits else None
    low, high = (row.T1 * scale, row.T2 * scale) if fits else (0.2 * rated, 0.6 * rated)
    spread = high / low
    if given.T1_Nm is not None:
        low, high = given.T1_Nm, max(high, spread * given.T1_Nm)
    if given.T2_Nm is not None:
        high = given.T2_Nm
        low = low if given.T1_Nm is not None else min(low, high / spread)

    keys = type(given).model_fields
    absent = [key for key in keys if getattr(given, key) is None]
    if skips is not None:
        absent.append("ratcheting_torque_Nm")
    source = "given"
    if absent:
        source = f"default ({', '.join(absent)}): catalogue {row.name} {rule}"
        if not fits:
            source += (
                "; no row fits (pitch diameter"
                f" {design.pitch_diameter / mm:g} mm, ratio {ratio:g}):"
                " T1, T2 are 0.2 and 0.6 of rated"
            )
    return Ratings(
        rated_torque=rated,
        repeated_peak=repeated,
        momentary_peak=momentary,
        T1=low,
        T2=high,
        source=source,
        ratcheting_torque=skips,
    )
