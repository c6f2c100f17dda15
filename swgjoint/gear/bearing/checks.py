"""Checks that the bearing of the wave generator fits into the flexspline."""

from __future__ import annotations

from math import pi

import numpy as np

from swgjoint.errors import DesignError
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.design.check import Check
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.wave_generator import lobe_height, with_checks
from swgjoint.units import mm, um

THINNEST_RACE = 0.08
"""Smallest accepted thickness of the outer race, divided by the ball diameter [-].

Grooves are usually 0.1 to 0.2 ball diameters deep (not verified against a source), and
flexible races are about 0.25 ball diameters thick. At a thickness of 0.02 the solver
finds no equilibrium."""
WIDEST_RACE = 2.0
"""Largest accepted width of the race, divided by the face width [-]. The models load
the race over its whole width, but the rim ends near the teeth."""


def bearing_checks(design: Design) -> list[Check]:
    """Checks of a bearing: cam, deflection left by the clearances, race, and balls."""
    bearing = design.wave_generator.bearing
    assert bearing is not None
    bore = design.flexspline_inner_radius / mm
    circle = bore - bearing.race_thickness_mm - 0.5 * bearing.ball_diameter_mm
    # chord between neighbours on the undeformed circle
    pitch = 2.0 * circle * np.sin(pi / bearing.balls)
    clearance = float(pitch) - bearing.ball_diameter_mm
    where = f"{design.drive.name}: wave_generator.bearing"
    lobes = lobe_height(design) / mm
    fit_um = bearing.fit_clearance_um or 0.0
    lobes_left = lobes - 0.5 * (bearing.clearance_um + fit_um) * um / mm
    thinnest = THINNEST_RACE * bearing.ball_diameter_mm
    width = BallBearing.from_design(design).race_width / mm
    widest = WIDEST_RACE * design.drive.face_width_mm
    return [
        *_cam(design),
        Check.strict_lower_limit(
            "bearing: deflection left by its clearances",
            lobes_left,
            0.0,
            "mm",
            f"{where}: clearance_um = {bearing.clearance_um:g} and"
            f" fit_clearance_um = {fit_um:g}: half of their sum takes up the whole"
            f" deflection of {lobes:.4g} mm; accepted: a sum below"
            f" {2.0 * lobes * mm / um:.4g} um",
        ),
        Check.lower_limit(
            "bearing: thickness of the race",
            bearing.race_thickness_mm,
            thinnest,
            "mm",
            f"{where}.race_thickness_mm = {bearing.race_thickness_mm:g} mm: the groove"
            f" for balls of {bearing.ball_diameter_mm:g} mm would cut through the race;"
            f" accepted: at least {thinnest:.4g} mm",
        ),
        Check.upper_limit(
            "bearing: width of the race",
            width,
            widest,
            "mm",
            f"{where}.race_width_mm = {width:g}: much wider than the teeth; accepted:"
            f" at most {widest:.4g} mm",
        ),
        Check.strict_lower_limit(
            "bearing: clearance between balls",
            clearance,
            0.0,
            "mm",
            f"{where}.balls = {bearing.balls}: balls of"
            f" {bearing.ball_diameter_mm:g} mm overlap by {-clearance:.4g} mm;"
            " accepted: fewer or smaller balls",
        ),
    ]


def _cam(design: Design) -> list[Check]:
    """Check that the cam inside race and balls is a smooth curve.

    The list is empty if the wave generator cannot be built.
    """
    bearing = BallBearing.from_design(design)
    try:
        outline = with_checks(design)[0]
    except DesignError:
        return []
    inner, _ = bearing.raceways
    depth = bearing.bore_radius - inner
    stations = np.linspace(0.0, outline.perimeter, 721)
    sharpest = 1.0 / float(outline.evaluate(stations)[2].max())
    value = (sharpest - depth) / mm
    return [
        Check.strict_lower_limit(
            "bearing: smallest radius of curvature of the cam",
            value,
            0.0,
            "mm",
            f"{design.drive.name}: wave_generator.bearing: race, balls and"
            f" clearances of {depth / mm:.4g} mm do not fit inside the outline, whose"
            f" radius of curvature falls to {sharpest / mm:.4g} mm; accepted: a smaller"
            " ball_diameter_mm or race_thickness_mm",
        )
    ]
