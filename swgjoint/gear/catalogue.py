"""Catalogue tables, and default ratings of designs that do not state their own."""

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
"""Largest factor between the pitch diameters, and between the ratios, of a design and a
catalogue row that applies to it [-]."""


@dataclass(frozen=True, kw_only=True)
class CatalogueRow:
    """Torques of one component set at the output [N·m], from ``models/catalogue``."""

    size: int
    """Size: pitch diameter in tenths of an inch."""
    ratio: int
    """Reduction ratio, without sign [-]."""
    rated_torque: float
    """Rated torque [N·m]."""
    repeated_peak: float
    """Limit for repeated peak torque [N·m]."""
    momentary_peak: float
    """Limit for momentary peak torque [N·m]."""
    ratcheting_torque: float
    """Torque at which the teeth ratchet [N·m]."""
    T1: float
    """Torque at the end of the first line of the torsion curve [N·m]."""
    T2: float
    """Torque at the end of the second line of the torsion curve [N·m]."""
    series: str = "CSG"
    """Catalogue series."""

    @property
    def name(self) -> str:
        """Name as written in catalogues, such as ``CSG-25-100``."""
        return f"{self.series}-{self.size}-{self.ratio}"

    @property
    def pitch_diameter(self) -> float:
        """Pitch diameter [m]."""
        return self.size * SIZE


@lru_cache
def table(name: str) -> tuple[dict[str, float | str | None], ...]:
    """Rows of a bundled catalogue table; empty cells are None, numbers are floats.

    The column names contain the units. The comment lines of the file state the sources.

    Args:
        name: Name of the table's file in ``models/catalogue``, without ``.csv``.

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
    """Every component set with its ratings and the torques T1 and T2 of its size."""
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
    """Every drive with a catalogue name: the component sets, then the other series.

    A drive of another series is listed if ``accuracy.csv`` states the accuracy of this
    series for its size. The tables contain no ratings of the other series, so each of
    their drives has the ratings of the component set of the same size and ratio.
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
    """Row with the nearest pitch diameter and, among equals, the nearest ratio.

    Nearness is measured by the factor between two values.

    Args:
        pitch_diameter: Pitch diameter of the flexspline [m].
        ratio: Reduction ratio, positive [-].
    """
    return min(
        catalogue_rows(),
        key=lambda row: (
            abs(log(row.pitch_diameter / pitch_diameter)),
            abs(log(row.ratio / ratio)),
        ),
    )


def ratings_of(design: Design) -> Ratings:
    """Ratings of a design: its own values, completed from the nearest catalogue row.

    The row is scaled to the rated torque of the design or, without one, by the cube of
    the ratio of pitch diameters. If the nearest row differs by more than
    :data:`FITS_WITHIN`, it supplies only the rated and the peak torques; T1 and T2 are
    then 0.2 and 0.6 of the rated torque, and the ratcheting torque is None. Default
    values are adjusted to the design's own values where necessary, so that the torques
    remain in increasing order. The field ``source`` of the result describes the rule.
    """
    stated = design.ratings
    ratio = design.drive.teeth_flexspline / design.tooth_difference
    row = nearest_row(design.pitch_diameter, ratio)
    size_factor = design.pitch_diameter / row.pitch_diameter
    if stated.rated_torque_Nm is not None:
        scale = stated.rated_torque_Nm / row.rated_torque
        rule = f"scaled to the rated torque {stated.rated_torque_Nm:g} N·m"
    else:
        scale = size_factor**3
        rule = f"scaled by {scale:.4g}, the cube of the ratio of pitch diameters"
    fits = max(
        size_factor, 1.0 / size_factor, ratio / row.ratio, row.ratio / ratio
    ) <= FITS_WITHIN * (1.0 + 1e-12)

    rated = stated.rated_torque_Nm or row.rated_torque * scale
    repeated = stated.repeated_peak_Nm or row.repeated_peak * scale
    momentary = stated.momentary_peak_Nm or row.momentary_peak * scale
    if stated.repeated_peak_Nm is None:
        repeated = min(repeated, momentary)
    momentary = max(momentary, repeated)
    if stated.rated_torque_Nm is None:
        rated = min(rated, repeated)
    repeated = max(repeated, rated)
    momentary = max(momentary, repeated)
    ratcheting = max(row.ratcheting_torque * scale, momentary) if fits else None
    low, high = (row.T1 * scale, row.T2 * scale) if fits else (0.2 * rated, 0.6 * rated)
    spread = high / low
    if stated.T1_Nm is not None:
        low, high = stated.T1_Nm, max(high, spread * stated.T1_Nm)
    if stated.T2_Nm is not None:
        high = stated.T2_Nm
        low = low if stated.T1_Nm is not None else min(low, high / spread)

    keys = type(stated).model_fields
    absent = [key for key in keys if getattr(stated, key) is None]
    if ratcheting is not None:
        absent.append("ratcheting_torque_Nm")
    source = "given"
    if absent:
        source = f"default ({', '.join(absent)}): catalogue {row.name} {rule}"
        if not fits:
            source += (
                "; no row fits (pitch diameter"
                f" {design.pitch_diameter / mm:g} mm, ratio {ratio:g}):"
                " T1 and T2 are 0.2 and 0.6 of rated torque"
            )
    return Ratings(
        rated_torque=rated,
        repeated_peak=repeated,
        momentary_peak=momentary,
        T1=low,
        T2=high,
        source=source,
        ratcheting_torque=ratcheting,
    )
