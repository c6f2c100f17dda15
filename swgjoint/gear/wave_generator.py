"""Wave generator of a design.

The major axis lies along +y at wave-generator angle zero; everything is in the frame of
the wave generator, in metres.
"""

from __future__ import annotations

from swgjoint.errors import DesignError
from swgjoint.gear.design import Design
from swgjoint.gear.wave_generators.curve import ClosedCurve
from swgjoint.gear.wave_generators.ellipse import Elliptical
from swgjoint.gear.wave_generators.simplified import Simplified
from swgjoint.units import mm

__all__ = ["Elliptical", "Simplified", "WaveGenerator", "lobe_height", "wave_generator"]

WaveGenerator = ClosedCurve
"""What contact and kinematics need to know of a wave generator."""


def lobe_height(design: Design) -> float:
    """Radial deflection at the lobe, half of m (z_cs - z_fs) [m]."""
    drive = design.drive
    difference = drive.teeth_circular_spline - drive.teeth_flexspline
    return 0.5 * drive.module_mm * difference * mm


def wave_generator(design: Design) -> WaveGenerator:
    """Wave generator of a design.

    Raises:
        DesignError: If the kind is not available or does not fit.
    """
    spec = design.wave_generator
    r, w0 = design.flexspline_inner_radius, lobe_height(design)  # (3.1)
    if spec.kind not in ("elliptical", "simplified"):
        raise DesignError(
            f"{design.drive.name}: wave_generator.kind = {spec.kind!r} cannot be built "
            "yet; available: 'elliptical', 'simplified'"
        )
    minor = spec.minor_axis_coefficient * (r - w0)
    if spec.kind == "elliptical":
        return Elliptical(major=r + w0, minor=minor)
    return Simplified(major=r + w0, pin_radius=minor)
