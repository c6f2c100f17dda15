"""The tooth profile of a member, of the kind that the design specifies."""

from __future__ import annotations

from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.arc_profiles import arc_profile
from swgjoint.gear.teeth.conjugate import conjugate_profile
from swgjoint.gear.teeth.involute import involute_profile
from swgjoint.gear.teeth.profile import ToothProfile


def tooth_profile(design: Design, member: str, *, bounds: bool = True) -> ToothProfile:
    """Tooth profile of a member, of the kind in its profile table.

    Args:
        design: The drive.
        member: ``flexspline`` or ``circular_spline``.
        bounds: Whether an error for an arc profile states which values would be
            accepted. The search for them takes as long as building a thousand arc
            profiles.

    Raises:
        DesignError: If the tooth cannot be built, in one line that names the key.
    """
    spec = design.flexspline if member == "flexspline" else design.circular_spline
    if spec.profile.kind == "involute":
        return involute_profile(design, member)
    if spec.profile.kind == "conjugate":
        other = "circular_spline" if member == "flexspline" else "flexspline"
        mate = tooth_profile(design, other)
        return conjugate_profile(design, member, mate)
    return arc_profile(design, member, bounds=bounds)
