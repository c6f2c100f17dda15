"""Whether a design can be built, as a list of figures against their limits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from swgjoint.errors import DesignError
from swgjoint.gear.bearing_checks import bearing_checks
from swgjoint.gear.check import Check
from swgjoint.gear.design import Design
from swgjoint.gear.profile import TANGENCY_RAD, ToothProfile, tooth_profile
from swgjoint.gear.wave_generator import lobe_height, with_checks
from swgjoint.units import deg, mm

MEMBERS = ("flexspline", "circular_spline")
CLOSED = 1e-12
"""Largest gap between two segments of a flank that counts as closed [m]."""


def design_checks(design: Design) -> list[Check]:
    """Checks of both teeth, of the wave generator and of their fit.

    Parts that cannot be built at all appear as a failed check without a value.
    """
    checks: list[Check] = []
    profiles: dict[str, ToothProfile] = {}
    for member in MEMBERS:
        try:
            profiles[member] = tooth_profile(design, member)
        except DesignError as error:
            checks.append(_not_built(f"{_name(member)}: tooth", error))
        else:
            checks += _tooth(design, member, profiles[member])
    if len(profiles) == len(MEMBERS):
        checks += _fit(design, profiles)
    try:
        checks += with_checks(design)[1]
    except DesignError as error:
        checks.append(_not_built("wave generator: outline", error))
    if design.cup is not None:
        checks += _cup(design)
    if design.wave_generator.bearing is not None:
        checks += bearing_checks(design)
    return checks


def _name(member: str) -> str:
    return member.replace("_", " ")


def _not_built(name: str, error: DesignError) -> Check:
    return Check(name=f"{name} can be built", ok=False, value=None, fault=str(error))


def _tooth(design: Design, member: str, profile: ToothProfile) -> list[Check]:
    """Closed, tangent, of positive lengths, ending in the middle of the gap."""
    where = f"{design.drive.name}: {member}.profile"
    junctions = profile.junctions()
    gap = max(junction.gap for junction in junctions)
    corner = max((j.corner for j in junctions if not j.edge), default=0.0)
    shortest = min(part.length for part in profile.segments) / mm
    (last,), _, _ = profile.evaluate(profile.stations[-1:])
    beside = abs(float(np.arctan2(last[0], last[1])) - profile.half_pitch)
    name = _name(member)
    return [
        Check.at_most(
            f"{name}: gap between segments",
            gap / mm,
            CLOSED / mm,
            "mm",
            f"{where}: the segments are {gap / mm:.3g} mm apart; accepted:"
            f" {CLOSED / mm:g} mm",
        ),
        Check.at_most(
            f"{name}: corner at a junction",
            corner,
            TANGENCY_RAD,
            "rad",
            f"{where}: a corner of {corner:.3g} rad; accepted: {TANGENCY_RAD:g} rad",
        ),
        Check.above(
            f"{name}: shortest segment",
            shortest,
            0.0,
            "mm",
            f"{where}: a segment of {shortest:.3g} mm; accepted: above 0 mm",
        ),
        Check.at_most(
            f"{name}: end of the flank beside the middle of the gap",
            beside / deg,
            1e-10,
            "deg",
            f"{where}: the flank ends {beside / deg:.3g} deg beside the middle of the"
            " gap; accepted: 1e-10 deg",
        ),
    ]


def _fit(design: Design, profiles: Mapping[str, ToothProfile]) -> list[Check]:
    """Tips clear of the roots at the major axis, and of each other at the minor."""
    drive, w0 = design.drive, lobe_height(design)
    fs, cs = profiles["flexspline"], profiles["circular_spline"]
    checks = []
    for member, tip, key, root in (
        ("flexspline", fs.addendum_radius + w0, "circular_spline", cs.dedendum_radius),
        ("circular_spline", fs.dedendum_radius + w0, "flexspline", cs.addendum_radius),
    ):
        clearance = (root - tip) / mm
        value = getattr(design, member).addendum_coefficient
        checks.append(
            Check.at_least(
                f"{_name(member)}: tip clearance at the major axis",
                # tip and root on the same circle by rounding is no overlap
                clearance if abs(clearance) > 1e-12 else 0.0,
                0.0,
                "mm",
                f"{drive.name}: {member}.addendum_coefficient = {value:g}: the tip"
                f" runs {-clearance:.4g} mm into the root at the major axis; accepted:"
                f" at most {value + clearance / drive.module_mm:.4g}, or a"
                f" larger {key}.dedendum_coefficient",
            )
        )
    # at the minor axis the flexspline of the same length has moved in by about w0
    apart = (cs.addendum_radius - (fs.addendum_radius - w0)) / mm
    value = design.flexspline.addendum_coefficient
    other = design.circular_spline.addendum_coefficient
    checks.append(
        Check.above(
            "teeth: clearance of the tips at the minor axis",
            apart,
            0.0,
            "mm",
            f"{drive.name}: flexspline.addendum_coefficient = {value:g}: the"
            f" teeth stay {-apart:.4g} mm in mesh at the minor axis; accepted: below"
            f" {2 * w0 / mm / drive.module_mm - other:.4g} with"
            f" circular_spline.addendum_coefficient = {other:g}",
        )
    )
    return checks


def _cup(design: Design) -> list[Check]:
    """The fillet fits between cylinder and bore."""
    cup = design.cup
    assert cup is not None
    wall = cup.thickness_coefficient * design.flexspline.rim_mm
    radius = design.flexspline_inner_radius / mm
    room = (
        min(radius - cup.bore_radius_mm, cup.length_mm)
        if cup.kind == "cup"
        else min(cup.bore_radius_mm - radius - wall, cup.length_mm)
    )
    return [
        Check.at_most(
            "cup: fillet",
            cup.fillet_mm,
            room,
            "mm",
            f"{design.drive.name}: cup.fillet_mm = {cup.fillet_mm:g} mm; accepted: at"
            f" most {room:.4g} mm, the room between cylinder and bore",
        )
    ]
