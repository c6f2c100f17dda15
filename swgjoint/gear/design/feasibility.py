"""Feasibility of a design, as a list of figures compared with their limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from swgjoint.errors import DesignError
from swgjoint.gear.bearing.checks import bearing_checks
from swgjoint.gear.design.check import Check
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.profile import TANGENCY_RAD, ToothProfile
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.gear.wave_generators.wave_generator import lobe_height, with_checks
from swgjoint.units import deg, mm, um

if TYPE_CHECKING:
    from swgjoint.gear.teeth.tooth_path import ToothPath

MEMBERS = ("flexspline", "circular_spline")
"""The toothed members."""
CLOSED = 1e-12
"""Largest accepted gap between two segments of a flank [m]."""
OVERLAP = 0.01
"""Largest accepted overlap of rigid flanks, as a fraction of the module [-].

Elastic deformation must take up this overlap. The limit is a rule of thumb: in all
bundled designs, teeth without backlash overlap by 0.05 to 0.32 % of the module, and
finite elements confirm the stresses and torques of these designs.
"""

PARTS = ("flexspline", "circular_spline", "teeth", "wave_generator", "cup", "bearing")
"""Parts of a design that are checked; ``teeth`` is the fit of both members."""


def design_checks(design: Design) -> list[Check]:
    """Checks of the teeth of both members, of their fit, and of the other parts.

    A tooth or an outline that cannot be built at all appears as a failed check without
    a value. The engagement of the teeth is checked by :func:`engagement_checks`.
    """
    built = {member: _built(design, member) for member in MEMBERS}
    return [check for part in PARTS for check in _part(design, part, built)]


def part_checks(design: Design, part: str, *, bounds: bool = True) -> list[Check]:
    """Checks of one part; none if the design does not have that part.

    Args:
        design: The drive.
        part: One of :data:`PARTS`. ``teeth`` is the fit of both members, which is
            checked only if both can be built.
        bounds: Whether the message for a tooth that cannot be built states which values
            would be accepted; the search for them takes time.
    """
    needed = MEMBERS if part == "teeth" else (part,) if part in MEMBERS else ()
    built = {member: _built(design, member, bounds=bounds) for member in needed}
    return _part(design, part, built)


def _built(
    design: Design, member: str, *, bounds: bool = True
) -> ToothProfile | DesignError:
    try:
        return tooth_profile(design, member, bounds=bounds)
    except DesignError as error:
        return error


def _part(
    design: Design, part: str, built: Mapping[str, ToothProfile | DesignError]
) -> list[Check]:
    if part in MEMBERS:
        profile = built[part]
        if isinstance(profile, DesignError):
            return [_not_built(f"{_name(part)}: tooth", profile)]
        return _tooth(design, part, profile)
    if part == "teeth":
        profiles = {m: p for m, p in built.items() if isinstance(p, ToothProfile)}
        return _fit(design, profiles) if len(profiles) == len(MEMBERS) else []
    if part == "wave_generator":
        try:
            return with_checks(design)[1]
        except DesignError as error:
            return [_not_built("wave generator: outline", error)]
    if part == "cup":
        return _cup(design) if design.cup is not None else []
    return bearing_checks(design) if design.wave_generator.bearing is not None else []


def _name(member: str) -> str:
    return member.replace("_", " ")


def _not_built(name: str, error: DesignError) -> Check:
    return Check(name=f"{name} can be built", ok=False, value=None, fault=str(error))


def _tooth(design: Design, member: str, profile: ToothProfile) -> list[Check]:
    """Checks of the junctions, the segment lengths and the end point of a flank."""
    where = f"{design.drive.name}: {member}.profile"
    junctions = profile.junctions()
    gap = max(junction.gap for junction in junctions)
    corner = max((j.corner for j in junctions if not j.edge), default=0.0)
    shortest = min(part.length for part in profile.segments) / mm
    (last,), _, _ = profile.evaluate(profile.stations[-1:])
    offset = abs(float(np.arctan2(last[0], last[1])) - profile.half_pitch)
    name = _name(member)
    return [
        _round_off(
            Check.upper_limit(
                f"{name}: gap between segments",
                gap / mm,
                CLOSED / mm,
                "mm",
                f"{where}: the segments are {gap / mm:.3g} mm apart; accepted:"
                f" {CLOSED / mm:g} mm",
            )
        ),
        _round_off(
            Check.upper_limit(
                f"{name}: corner at a junction",
                corner,
                TANGENCY_RAD,
                "rad",
                f"{where}: a corner of {corner:.3g} rad; accepted:"
                f" {TANGENCY_RAD:g} rad",
            )
        ),
        Check.strict_lower_limit(
            f"{name}: shortest segment",
            shortest,
            0.0,
            "mm",
            f"{where}: a segment of {shortest:.3g} mm; accepted: above 0 mm",
        ),
        _round_off(
            Check.upper_limit(
                f"{name}: angle between the end of the flank and the middle of the gap",
                offset / deg,
                1e-10,
                "deg",
                f"{where}: the flank ends {offset / deg:.3g} deg from the middle of"
                " the gap; accepted: 1e-10 deg",
            )
        ),
    ]


def _round_off(check: Check) -> Check:
    return replace(check, numerical=True)


def engagement_checks(design: Design, path: ToothPath) -> list[Check]:
    """Checks of the clearance of the rigid flanks and the angle of their engagement.

    Args:
        design: The drive.
        path: Passage of a flexspline tooth of the drive through a tooth space.
    """
    limit = -OVERLAP * design.drive.module_mm * mm
    least = path.smallest_clearance
    where = path.where[path.worst].replace("_", " ")
    theta = float(path.theta[path.worst]) / deg
    # clearance that each flank gains per unit of the thickness coefficient
    opened = 0.25 * np.pi * design.drive.module_mm * mm
    opened *= np.cos(design.circular_spline.pressure_angle_deg * deg)
    value = design.circular_spline.thickness_coefficient
    return [
        Check.lower_limit(
            f"teeth: clearance of rigid flanks ({where}, {theta:.3g} deg from the"
            " lobe)",
            least / um,
            limit / um,
            "µm",
            f"{design.drive.name}: circular_spline.thickness_coefficient = {value:g}:"
            f" the rigid flanks overlap by {-least / um:.4g} µm at {theta:.3g} deg from"
            f" the lobe ({where}); accepted: at most {-limit / um:.4g} µm, 1 % of the"
            " module, which needs a coefficient of about"
            f" {value - (limit - least) / opened:.4g} if nothing else changes",
        ),
        Check.strict_lower_limit(
            "teeth: angle of engagement",
            path.engaged / deg,
            0.0,
            "deg",
            f"{design.drive.name}: flexspline.addendum_coefficient ="
            f" {design.flexspline.addendum_coefficient:g}: the teeth never engage;"
            " accepted: a larger value",
        ),
    ]


def _fit(design: Design, profiles: Mapping[str, ToothProfile]) -> list[Check]:
    """Checks of tip clearance at the major and of disengagement at the minor axis."""
    drive, w0 = design.drive, lobe_height(design)
    fs, cs = profiles["flexspline"], profiles["circular_spline"]
    checks = []
    # tip of the flexspline in the root of the circular spline, then the reverse case,
    # in which the root of the flexspline has the smaller radius
    for member, tip, key, root in (
        ("flexspline", fs.addendum_radius + w0, "circular_spline", cs.dedendum_radius),
        ("circular_spline", fs.dedendum_radius + w0, "flexspline", cs.addendum_radius),
    ):
        clearance = (root - tip) / mm
        value = getattr(design, member).addendum_coefficient
        checks.append(
            Check.lower_limit(
                f"{_name(member)}: tip clearance at the major axis",
                # round-off of tip and root on the same circle does not count as overlap
                clearance if abs(clearance) > 1e-12 else 0.0,
                0.0,
                "mm",
                f"{drive.name}: {member}.addendum_coefficient = {value:g}: the tip"
                f" overlaps the root by {-clearance:.4g} mm at the major axis;"
                f" accepted: at most {value + clearance / drive.module_mm:.4g}, or a"
                f" larger {key}.dedendum_coefficient",
            )
        )
    # the flexspline keeps its length, so it moves inwards by about w0 at the minor axis
    apart = (cs.addendum_radius - (fs.addendum_radius - w0)) / mm
    value = design.flexspline.addendum_coefficient
    other = design.circular_spline.addendum_coefficient
    checks.append(
        Check.strict_lower_limit(
            "teeth: clearance of the tips at the minor axis",
            apart,
            0.0,
            "mm",
            f"{drive.name}: flexspline.addendum_coefficient = {value:g}: the teeth"
            f" still overlap by {-apart:.4g} mm at the minor axis; accepted: below"
            f" {2 * w0 / mm / drive.module_mm - other:.4g} with"
            f" circular_spline.addendum_coefficient = {other:g}",
        )
    )
    return checks


def _cup(design: Design) -> list[Check]:
    """Check that the fillet fits between cylinder and bore, or flange edge of a hat."""
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
        Check.upper_limit(
            "cup: fillet",
            cup.fillet_mm,
            room,
            "mm",
            f"{design.drive.name}: cup.fillet_mm = {cup.fillet_mm:g} mm; accepted: at"
            f" most {room:.4g} mm, the space between cylinder and bore",
        )
    ]
