"""Checks that a wave generator fits the bore that it deflects."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np

from swgjoint.gear.design.check import Check
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.chain import Chain
from swgjoint.gear.wave_generators.curve import ClosedCurve
from swgjoint.gear.wave_generators.radial import Radial, TableOutline
from swgjoint.gear.wave_generators.rollers import FourRoller
from swgjoint.units import mm

MAX_STRETCH = 2e-3
"""Largest accepted excess of the perimeter over that of the undeformed bore, divided by
the latter [-].

A rim that follows the whole outline is stretched by this amount. A stretch of 0.2 %
corresponds to a hoop stress of 420 MPa in steel. An ellipse with C = 1 stretches the
rim by (w_0/2r)^2, which is 7e-5 for the drive of thesis Table 4.1.
"""
TANGENT = 1e-10
"""Largest corner angle at a junction that counts as tangent [rad]."""


def wave_generator_checks(
    design: Design, outline: ClosedCurve, w0: float
) -> list[Check]:
    """Checks of an outline against the flexspline that it deflects.

    Args:
        design: The drive.
        outline: Outline of its wave generator.
        w0: Radial deflection at the lobe [m].
    """
    drive, spec = design.drive, design.wave_generator
    where = f"{drive.name}: wave_generator"
    bore = design.flexspline_inner_radius
    room = max(_tip_clearance(design), 0.0)
    shown = outline.major / mm
    limit = (bore + w0 + room) / mm
    checks = [
        Check.upper_limit(
            "wave generator: largest radius",
            shown,
            # the semi-major axis itself must pass in spite of round-off
            limit * (1.0 + 1e-12),
            "mm",
            f"{where}.{_radius_key(design)}: the largest radius is {shown:.6g} mm;"
            f" accepted: at most {limit:.6g} mm, the sum of the semi-major axis"
            f" {(bore + w0) / mm:.6g} mm and the tip clearance {room / mm:.4g} mm"
            " of the teeth",
        )
    ]
    stretch = outline.perimeter / (2.0 * pi * bore) - 1.0
    checks.append(
        Check.upper_limit(
            "wave generator: stretch of the bore",
            100.0 * stretch,
            100.0 * MAX_STRETCH,
            "%",
            f"{where}.{_length_key(design)}: the outline is {100 * stretch:.3g} %"
            f" longer than the bore; accepted: at most {100 * MAX_STRETCH:g} %",
        )
    )
    if isinstance(outline, Chain):
        corner = float(np.abs(outline.corners()).max())
        checks.append(
            replace(
                Check.upper_limit(
                    "wave generator: corner at junctions",
                    corner,
                    TANGENT,
                    "rad",
                    f"{where}.kind = {spec.kind!r}: a corner of {corner:.3g} rad;"
                    f" accepted: at most {TANGENT:g} rad",
                ),
                numerical=True,
            )
        )
    if isinstance(outline, FourRoller):
        checks.append(_rollers_clear(design, outline))
    if isinstance(outline, Radial):
        checks.append(_convex(design, outline))
    if isinstance(outline, TableOutline):
        checks.append(_lobes_reach(design, outline))
    return checks


def _tip_clearance(design: Design) -> float:
    """Radial tip clearance at the major axis, from the tooth coefficients [m]."""
    fs, cs = design.flexspline, design.circular_spline
    coefficient = min(
        cs.dedendum_coefficient - fs.addendum_coefficient,
        fs.dedendum_coefficient - cs.addendum_coefficient,
    )
    return coefficient * design.drive.module_mm * mm


def _radius_key(design: Design) -> str:
    """The key that determines the largest radius, with its value."""
    spec = design.wave_generator
    key = "parabola_coefficient_per_mm"
    if spec.kind == "parabolic":
        return f"{key} = {spec.parabola_coefficient_per_mm:g} 1/mm"
    if spec.kind == "asymmetric_parabolic":
        if spec.rotation_deg:
            return f"rotation_deg = {spec.rotation_deg:g} deg"
        if spec.left is None or spec.right is None:
            return f"{key} = {spec.parabola_coefficient_per_mm:g} 1/mm"
        sides = {"left": spec.left, "right": spec.right}
        name = min(sides, key=lambda side: sides[side].parabola_coefficient_per_mm)
        return f"{name}.{key} = {sides[name].parabola_coefficient_per_mm:g} 1/mm"
    if spec.kind == "table":
        return f"radius_mm = {max(spec.radius_mm):g} mm"
    return f"kind = {spec.kind!r}"


def _length_key(design: Design) -> str:
    """The key that determines the length of the outline, with its value."""
    spec = design.wave_generator
    if spec.kind in ("parabolic", "asymmetric_parabolic"):
        return _radius_key(design)
    if spec.kind == "four_roller":
        return f"aperture_deg = {spec.aperture_deg:g} deg"
    if spec.kind == "table":
        return f"radius_mm = {max(spec.radius_mm):g} mm"
    return f"minor_axis_coefficient = {spec.minor_axis_coefficient:g}"


def _rollers_clear(design: Design, outline: FourRoller) -> Check:
    """Check that neighbouring rollers do not touch each other."""
    spec = design.wave_generator
    assert spec.kind == "four_roller"
    x, y = outline.centre
    clearance = 2.0 * (min(x, y) - outline.roller_radius)
    sin = np.sin(outline.aperture)
    limit = outline.major * sin / (1.0 + sin)
    return Check(
        name="wave generator: clearance between rollers, above",
        ok=clearance > 0.0,
        value=clearance / mm,
        unit="mm",
        limit=0.0,
        fault=f"{design.drive.name}: wave_generator.roller_radius_mm ="
        f" {spec.roller_radius_mm:g} mm: rollers at {spec.aperture_deg:g} deg from the"
        f" major axis overlap by {-clearance / mm:.4g} mm; accepted: below"
        f" {limit / mm:.5g} mm, or a larger aperture_deg",
    )


def _convex(design: Design, outline: Radial) -> Check:
    """Check that the outline is nowhere concave."""
    spec = design.wave_generator
    least = outline.least_curvature() * mm
    key = (
        f"minor_axis_coefficient = {spec.minor_axis_coefficient:g}"
        if spec.kind == "cosine"
        else "radius_mm"
    )
    return Check.lower_limit(
        "wave generator: smallest curvature",
        least,
        0.0,
        "1/mm",
        f"{design.drive.name}: wave_generator.{key}: the outline is concave, with a"
        f" smallest curvature of {least:.4g} 1/mm; accepted: at least 0 1/mm",
    )


def _lobes_reach(design: Design, outline: TableOutline) -> Check:
    """Check that every lobe of a table deflects the bore."""
    lobes = 2.0 * pi * np.arange(design.lobes) / design.lobes
    least = float(outline.radius(lobes).min()) / mm
    bore = design.flexspline_inner_radius / mm
    return Check(
        name="wave generator: smallest radius at a lobe, above",
        ok=least > bore,
        value=least,
        unit="mm",
        limit=bore,
        fault=f"{design.drive.name}: wave_generator.radius_mm: the radius is"
        f" {least:.6g} mm at one of the {design.lobes} lobes, of which the first is at"
        " angle 0; accepted: more than the inner radius of the flexspline,"
        f" {bore:.6g} mm",
    )
