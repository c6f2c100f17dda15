"""A family of parametric drives with the proportions of catalogue component sets.

``size-NN-RRR`` is a drive with a pitch diameter of NN/10 inch and ratio RRR, with the
circular spline fixed. For every size, all lengths are the same multiples of the pitch
diameter d or of the module, so members of one ratio are geometrically similar. The rim
and the wall of the cup follow from what a maker sizes by strength.
"""

from __future__ import annotations

import re
from math import inf
from typing import Any

from swgjoint.errors import DesignError
from swgjoint.toml_text import toml_text

SIZES = (8, 100)
RATIOS = (30, 200)
"""Smallest and largest size and ratio. The number of teeth of the flexspline is twice
the ratio."""

# Lengths as multiples of the pitch diameter d; lengths of the thesis are divided by its
# pitch diameter of 120 mm. FACE to GROOVE, but for rim and wall, are proportions from a
# study of catalogue component sets with a "hard" cup. The study assumed them because it
# had no drawings of cups and flexible bearings.
FACE = 0.20
# Rim under the teeth, per tooth and without teeth: a rim sized by fatigue is thinner at
# low ratios, whose deflection is larger. Textbook rule (75 + z/4) 1e-4 d, cited from
# memory and not confirmed by a source.
RIM = 0.0075
RIM_PER_TOOTH = 0.25e-4
# Thinnest wall that bears the buckling torques of the catalogue's sizes 14 to 32, which
# need 0.0067 to 0.0072 d (swgjoint/gear/torsional_buckling.py, knock-down factor 0.67)
WALL = 0.0072
SMOOTH_CUP = 0.60 - FACE  # cylinder behind the teeth; the whole cup is 0.60 d long
BORE_RADIUS = 0.58 * 0.5
BALL = 0.083
RACE = 0.021
RACE_WIDTH = 0.145
GROOVE = 0.8  # second moment of area of the race section over that of its rectangle
BALLS = 23  # an odd number, so that the two lobes do not pass balls at the same time
BEARING_BORE = 0.71
RING_RIM = 2.0 / 120.0  # thesis Table 4.1
FILLET = 2.0 / 120.0  # thesis Table 7.3
# lengths as multiples of the module: improved quadruple arc of thesis Table 6.7
PROFILE = {
    "tip_radius_mm": 0.5,
    "addendum_radius_mm": 1.0,
    "straight_mm": 0.0,
    "dedendum_radius_mm": 20.0,
    "root_radius_mm": 0.6,
}
# Thesis 7.13: 100, 90 and 45 um for w0 = 1 mm, a face width of 10 mm and a flexspline
# 50 mm long. These values are scaled by the coning over the face width,
# w0 times face width over length [um].
CONING = 1.0e3 * 10.0 / 50.0
MICRO_GEOMETRY = {
    "wave_generator_crowning_um": 100.0 / CONING,
    "wave_generator_slope_um": 90.0 / CONING,
    "flexspline_crowning_um": 45.0 / CONING,
}
# Radial internal clearance of ball bearings, normal class of ISO 5753-1: largest bore
# of the band [mm], smallest and largest clearance [um]. The last band of this table is
# also used for all larger bores.
CLEARANCE = (
    (18.0, (3, 18)),
    (30.0, (5, 20)),
    (40.0, (6, 20)),
    (50.0, (6, 23)),
    (65.0, (8, 28)),
    (80.0, (10, 30)),
    (100.0, (12, 36)),
    (120.0, (15, 41)),
    (140.0, (18, 48)),
    (160.0, (18, 53)),
    (inf, (20, 61)),
)

_NAME = re.compile(r"size-(\d{1,4})-(\d{1,4})")


def family_member(name: str) -> tuple[int, int] | None:
    """Size and ratio from a name ``size-NN-RRR``; None for any other name.

    Raises:
        DesignError: If the size or the ratio is outside the range of the family.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    size, ratio = int(match[1]), int(match[2])
    faults = [
        f"design {name!r}: {quantity} {value}; accepted: {low} to {high}"
        for quantity, value, (low, high) in (
            ("size", size, SIZES),
            ("ratio", ratio, RATIOS),
        )
        if not low <= value <= high
    ]
    if faults:
        raise DesignError("\n".join(faults))
    return size, ratio


def family_design(size: int, ratio: int) -> dict[str, Any]:
    """Tables of the design file for one drive of the family.

    Args:
        size: Pitch diameter in tenths of an inch.
        ratio: Reduction ratio, half the number of flexspline teeth.
    """
    d = 2.54 * size  # mm
    teeth = 2 * ratio
    module = d / teeth
    rim = RIM + RIM_PER_TOOTH * teeth
    profile = {
        "kind": "qca",
        **{k: _figure(v * module) for k, v in PROFILE.items()},
        "straight_split": 0.5,
    }
    member = {
        "addendum_coefficient": 0.6,
        "dedendum_coefficient": 0.8,
        "pressure_angle_deg": 20.0,
        "thickness_coefficient": 1.0,
        "profile": profile,
    }
    coning = 1.0e3 * module * FACE / (FACE + SMOOTH_CUP)  # um, w0 = module
    bore = BEARING_BORE * d
    clearance = next(band for limit, band in CLEARANCE if bore <= limit)
    return {
        "drive": {
            "name": f"size-{size}-{ratio}",
            "source": "family by rule, swgjoint.gear.design.family: pitch diameter"
            " size/10 inch, rim by fatigue, wall by torsional buckling, other"
            " proportions of a study of component sets (hard cup), tooth profile of"
            " thesis Table 6.7, micro-geometry of thesis 7.13 scaled by the coning",
            "layout": "circular_spline_fixed",
            "teeth_flexspline": teeth,
            "teeth_circular_spline": teeth + 2,
            "module_mm": round(module, 9),
            "face_width_mm": _figure(FACE * d),
        },
        "material": {"youngs_modulus_GPa": 210.0, "poisson_ratio": 0.29},
        "flexspline": {"rim_mm": _figure(rim * d), **member},
        "circular_spline": {"rim_mm": _figure(RING_RIM * d), **member},
        "wave_generator": {
            "kind": "elliptical",
            "minor_axis_coefficient": 1.0,
            "bearing": {
                "balls": BALLS,
                "ball_diameter_mm": _figure(BALL * d),
                "race_thickness_mm": _figure(RACE * d),
                "clearance_um": 0.5 * sum(clearance),
                "race_width_mm": _figure(RACE_WIDTH * d),
                "groove_inertia_factor": GROOVE,
            },
        },
        "cup": {
            "kind": "cup",
            "length_mm": _figure(SMOOTH_CUP * d),
            "thickness_coefficient": _figure(WALL / rim),
            "fillet_mm": _figure(FILLET * d),
            "bore_radius_mm": _figure(BORE_RADIUS * d),
        },
        "micro_geometry": {
            **{k: round(v * coning, 1) for k, v in MICRO_GEOMETRY.items()},
            "crowning_kind": "parabolic",
        },
    }


def family_text(size: int, ratio: int) -> str:
    """Text of the design file for one drive of the family, as in the bundled files.

    Args:
        size: Pitch diameter in tenths of an inch.
        ratio: Reduction ratio, half the number of flexspline teeth.
    """
    head = (
        "# Generated by swgjoint/gear/design/family.py, which states the source of\n"
        "# every proportion; the proportions are the same for all sizes. Ratings come\n"
        "# from the catalogue row of this size and ratio.\n"
    )
    return head + toml_text(family_design(size, ratio))


def _figure(value: float) -> float:
    """Value rounded to 1e-6 (1 nm for lengths in mm), for short numbers in files."""
    return round(value, 6)
