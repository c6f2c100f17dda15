"""Backlash of the unloaded teeth and the rotation that takes it up."""

from __future__ import annotations

from math import pi

from swgjoint.gear.design.design import Design
from swgjoint.units import mm


def circumferential_backlash(design: Design) -> float:
    """Backlash B on the pitch circles, the missing thickness of both members [m].

    Source:
        Thesis eqs (6.1) to (6.3), B = t_P (1 - c_P) with t_P = pi m/2 per member.
    """
    tight = 0.5 * pi * design.drive.module_mm * mm
    members = (design.flexspline, design.circular_spline)
    return sum(tight * (1.0 - member.thickness_coefficient) for member in members)


def initial_rotation(design: Design) -> float:
    r"""Rotation gamma of the flexspline that brings its teeth into contact [rad].

    .. math:: \gamma = \frac{\pi}{2 N_{fs}} (1 - c_P)

    with the lower thickness coefficient of the two members; for involute teeth the
    difference of the angular tooth thicknesses :math:`\pi c_P/N` on the pitch circles.
    A starting value for a solver, not a result: it may overshoot. Zero for teeth
    without backlash, or with more thickness than room.

    Source:
        Thesis eq. (6.4) and the paragraph after it, section 6.2.2.
    """
    fs, cs = design.flexspline, design.circular_spline
    teeth = design.drive.teeth_flexspline
    if fs.profile.kind == "involute" and cs.profile.kind == "involute":
        angular = [
            pi * member.thickness_coefficient / count
            for member, count in ((fs, teeth), (cs, design.drive.teeth_circular_spline))
        ]
        return abs(angular[0] - angular[1])
    lower = min(fs.thickness_coefficient, cs.thickness_coefficient)
    return max(0.0, pi / (2.0 * teeth) * (1.0 - lower))
