"""Outlines of a drive as text: DXF (R12 polylines) and CSV, both in mm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.wave_generators.wave_generator import WaveGenerator
from swgjoint.typing import Array
from swgjoint.units import mm

Curves = Mapping[str, Sequence["Curve"]]
"""Curves by layer: flexspline, circular_spline, wave_generator."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """One polyline."""

    points: Array
    """Points of shape (n, 2) [m]; a closed curve does not repeat its first point."""
    closed: bool
    """Whether the last point is connected to the first."""


def tooth_curve(profile: ToothProfile, per_segment: int = 48) -> Curve:
    """One tooth from the middle of one gap to the middle of the next.

    The curve is in the frame of the profile, with the tooth on +y and the gear axis at
    the origin. It runs from the root of the right flank over the tip to the root of the
    left flank and contains every junction of segments.

    Args:
        profile: Profile of the tooth.
        per_segment: Number of points per segment of the profile.

    Returns:
        An open curve that is symmetric about the y axis.
    """
    stations = profile.stations
    parts = [
        np.linspace(a, b, per_segment, endpoint=False) for a, b in pairwise(stations)
    ]
    right, _, _ = profile.evaluate(np.concatenate([*parts, stations[-1:]]))
    left = right * np.array([-1.0, 1.0])
    return Curve(points=np.concatenate([right[::-1], left[1:]]), closed=False)


def wave_generator_curves(outline: WaveGenerator, count: int = 2880) -> list[Curve]:
    """Closed outlines of a wave generator, counter-clockwise.

    There is one outline that starts on +y, or one per roller. With 2880 points, an
    outline of 60 mm radius has chord errors of 0.04 um.

    Args:
        outline: The wave generator.
        count: Number of points per outline.
    """
    return [
        Curve(points=points[:-1], closed=True) for points in outline.outlines(count + 1)
    ]


def dxf_text(curves: Curves) -> str:
    """Text of a DXF file (AutoCAD R12) in mm, with one POLYLINE per curve.

    Every key of ``curves`` becomes a layer with its name in upper case.
    """
    lines = ["0", "SECTION", "2", "HEADER", "9", "$ACADVER", "1", "AC1009"]
    lines += ["9", "$INSUNITS", "70", "4", "0", "ENDSEC"]
    lines += ["0", "SECTION", "2", "TABLES", "0", "TABLE", "2", "LAYER"]
    lines += ["70", str(len(curves))]
    for colour, layer in enumerate(curves, start=1):
        lines += ["0", "LAYER", "2", layer.upper(), "70", "0"]
        lines += ["62", str(colour), "6", "CONTINUOUS"]
    lines += ["0", "ENDTAB", "0", "ENDSEC", "0", "SECTION", "2", "ENTITIES"]
    for layer, members in curves.items():
        name = layer.upper()
        for curve in members:
            lines += ["0", "POLYLINE", "8", name, "66", "1"]
            lines += ["10", "0.0", "20", "0.0", "30", "0.0"]
            lines += ["70", "1" if curve.closed else "0"]
            for x, y in curve.points / mm:
                lines += ["0", "VERTEX", "8", name]
                lines += ["10", _figure(x), "20", _figure(y), "30", "0.0"]
            lines += ["0", "SEQEND", "8", name]
    lines += ["0", "ENDSEC", "0", "EOF"]
    return "\n".join(lines) + "\n"


def curves_csv(curves: Sequence[Curve]) -> str:
    """CSV text with the columns curve (from 0), x_mm and y_mm.

    Closed curves do not repeat their first point.
    """
    lines = ["curve,x_mm,y_mm"]
    for index, curve in enumerate(curves):
        lines += [
            f"{index},{_figure(x)},{_figure(y)}"
            for x, y in (curve.points / mm).tolist()
        ]
    return "\n".join(lines) + "\n"


def _figure(value: float) -> str:
    """Number with 12 decimals; 1e-12 mm is less than the round-off of the geometry."""
    return f"{value + 0.0:.12f}"
