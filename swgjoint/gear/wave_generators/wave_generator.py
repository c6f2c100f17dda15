"""Wave generator of a design.

Lengths are in metres and refer to the frame of the wave generator, whose +y axis is the
major axis. At wave-generator angle zero, this axis is the +y axis of the drive.
"""

from __future__ import annotations

import numpy as np

from swgjoint.errors import DesignError
from swgjoint.gear.design.check import Check, raise_faults
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.curve import ClosedCurve
from swgjoint.gear.wave_generators.ellipse import Elliptical
from swgjoint.gear.wave_generators.fit import wave_generator_checks
from swgjoint.gear.wave_generators.parabolic import OutlineFault, Side, parabolic
from swgjoint.gear.wave_generators.radial import Cosine, TableOutline
from swgjoint.gear.wave_generators.rollers import FourRoller
from swgjoint.gear.wave_generators.sections import (
    AsymmetricParabolic,
    ParabolaSide,
    Parabolic,
)
from swgjoint.gear.wave_generators.simplified import Simplified
from swgjoint.units import deg, mm

__all__ = [
    "WaveGenerator",
    "has_mirror_symmetry",
    "lobe_height",
    "wave_generator",
    "with_checks",
]

WaveGenerator = ClosedCurve
"""Outline of a wave generator, as contact and kinematics use it."""

SYMMETRIC = ("elliptical", "simplified", "parabolic", "four_roller", "cosine")
"""Kinds of wave generator with mirror symmetry."""


def has_mirror_symmetry(design: Design) -> bool:
    """Whether the drive without errors has mirror symmetry, as its teeth always have.

    Its results under negative torques are then the mirror image of those under positive
    ones.
    """
    return design.wave_generator.kind in SYMMETRIC


def lobe_height(design: Design) -> float:
    """Radial deflection at the lobe, module times (z_cs - z_fs)/2 [m]."""
    return 0.5 * design.drive.module_mm * design.tooth_difference * mm


def wave_generator(design: Design) -> WaveGenerator:
    """Wave generator of a design.

    Raises:
        DesignError: If the wave generator cannot be built or does not fit; one line per
            fault, with the key, its value and what is accepted.
    """
    outline, checks = with_checks(design)
    raise_faults(checks)
    return outline


def with_checks(design: Design) -> tuple[WaveGenerator, list[Check]]:
    """Wave generator of a design and the checks of its fit, passed or failed.

    Raises:
        DesignError: If the parameters give no outline.
    """
    r, w0 = design.flexspline_inner_radius, lobe_height(design)  # (3.1)
    if r <= w0:
        raise DesignError(
            f"{design.drive.name}: flexspline.rim_mm = {design.flexspline.rim_mm:g} mm:"
            f" the inner radius {r / mm:.4g} mm is not larger than the deflection"
            f" {w0 / mm:.4g} mm; accepted: below"
            f" {(r - w0) / mm + design.flexspline.rim_mm:.4g} mm"
        )
    try:
        outline = _outline(design, r, w0)
    except OutlineFault as fault:
        raise DesignError(f"{design.drive.name}: wave_generator.{fault}") from None
    return outline, wave_generator_checks(design, outline, w0)


def _outline(design: Design, r: float, w0: float) -> ClosedCurve:
    """Outline for the inner radius r [m] and the deflection w0 [m]."""
    spec = design.wave_generator
    major = r + w0  # semi-major axis, half of thesis eq. (3.3)
    if spec.kind == "four_roller":
        radius = spec.roller_radius_mm * mm
        if radius >= 0.5 * major:
            raise OutlineFault(
                "roller_radius_mm",
                f" = {spec.roller_radius_mm:g} mm: opposite rollers overlap; accepted:"
                f" below {0.5 * major / mm:.5g} mm",
            )
        return FourRoller(
            major=major, aperture=spec.aperture_deg * deg, roller_radius=radius
        )
    if spec.kind == "table":
        angles = np.asarray(spec.angle_deg) * deg
        return TableOutline(angles.tolist(), [radius * mm for radius in spec.radius_mm])
    minor = spec.minor_axis_coefficient * (r - w0)  # (3.2), (3.4)
    if spec.kind == "elliptical":
        return Elliptical(major=major, minor=minor)
    if spec.kind == "simplified":
        return Simplified(major=major, pin_radius=minor)
    if spec.kind == "cosine":
        return Cosine(major=major, minor=minor, lobes=design.lobes)
    if spec.kind == "parabolic":
        side = _side(spec)
        return parabolic(major=major, minor=minor, left=side, right=side)
    if spec.left is not None and spec.right is not None:
        return parabolic(
            major=major,
            minor=minor,
            left=_side(spec.left),
            right=_side(spec.right),
            prefixes=("left.", "right."),
        )
    assert spec.rotation_deg is not None
    side = _side(spec)
    plain = parabolic(major=major, minor=minor, left=side, right=side)
    if spec.rotation_deg == 0.0:
        return plain
    turn = spec.rotation_deg * deg
    try:
        return parabolic(major=major, minor=minor, left=side, right=side, turn=turn)
    except OutlineFault as fault:
        raise OutlineFault(
            "rotation_deg",
            f" = {spec.rotation_deg:g} deg: with this angle, {fault}, or an angle"
            " closer to 0 deg",
        ) from None


def _side(spec: Parabolic | AsymmetricParabolic | ParabolaSide) -> Side:
    assert spec.parabola_coefficient_per_mm is not None
    assert spec.parabola_length_coefficient is not None
    assert spec.connector_radius_mm is not None
    return Side(
        coefficient=spec.parabola_coefficient_per_mm / mm,
        length_coefficient=spec.parabola_length_coefficient,
        connector_radius=spec.connector_radius_mm * mm,
    )
