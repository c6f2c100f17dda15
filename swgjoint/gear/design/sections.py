"""The tables of a design file, with the same key names as in the file.

Keys of quantities with a unit end with that unit. The addendum and dedendum
coefficients are multiples of the module, as in the thesis. The tables check single
values; whether a tooth can be built is checked when it is built. The tables of wave
generators are in :mod:`swgjoint.gear.wave_generators.sections`.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section
from swgjoint.gear.kinematics import Layout

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Millimetre = Annotated[float, Field(gt=0, le=10_000)]
Micrometre = Annotated[float, Field(ge=0, le=2_000)]
Coefficient = Annotated[float, Field(gt=0, le=5)]
Reduction = Annotated[float, Field(gt=0, le=1)]

SMALLEST_MODULE = 0.005
"""Smallest accepted module [mm]. For comparison, micro strain wave gears with a pitch
diameter of 6 mm have a module of 0.03 mm."""


class DriveSection(Section):
    """Identity, layout, teeth and module."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    """Name in results and files."""
    source: str = ""
    """Source of the numbers."""
    layout: Layout = "circular_spline_fixed"
    """Which member is fixed."""
    teeth_flexspline: Annotated[int, Field(ge=40, le=400)]
    """Number of teeth of the flexspline."""
    teeth_circular_spline: Annotated[int, Field(ge=42, le=412)]
    """Number of teeth of the circular spline. It exceeds that of the flexspline by a
    multiple of the number of lobes (2 or 3), at most 12."""
    module_mm: Annotated[float, Field(gt=0, le=50)]
    """Module: pitch diameter divided by the number of teeth."""
    face_width_mm: Millimetre
    """Face width: length of the teeth along the axis."""

    @model_validator(mode="after")
    def _module_in_millimetres(self) -> DriveSection:
        if self.module_mm < SMALLEST_MODULE:
            raise Fault(
                (
                    "module_mm",
                    f"{self.module_mm:g} mm: is this value in metres? accepted:"
                    f" {SMALLEST_MODULE:g} to 50 mm ({self.module_mm:g} m are"
                    f" {1e3 * self.module_mm:g} mm)",
                )
            )
        return self

    @model_validator(mode="after")
    def _tooth_difference(self) -> DriveSection:
        difference = self.teeth_circular_spline - self.teeth_flexspline
        if difference <= 0:
            raise Fault(
                (
                    "teeth_circular_spline",
                    f"{self.teeth_circular_spline} teeth; accepted: more than the"
                    f" {self.teeth_flexspline} of the flexspline",
                )
            )
        if difference > 12 or (difference % 2 and difference % 3):
            raise Fault(
                (
                    "teeth_circular_spline",
                    f"exceeds teeth_flexspline by {difference}; accepted: by a multiple"
                    " of the number of lobes of the wave generator (2 or 3), at most"
                    " 12",
                )
            )
        return self


class MaterialOverride(Section):
    """Material keys of one member; absent keys come from ``[material]``."""

    youngs_modulus_GPa: Annotated[float, Field(gt=0, le=2_000)] | None = None
    """Young's modulus of this member."""
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5)] | None = None
    """Poisson's ratio of this member."""
    density_kg_m3: Annotated[float, Field(gt=0, le=30_000)] | None = None
    """Mass density of this member."""
    fatigue_limit_bending_MPa: Positive | None = None
    """Endurance limit in reversed bending."""
    fatigue_limit_torsion_MPa: Positive | None = None
    """Endurance limit in reversed torsion."""


class MaterialSection(Section):
    """Material of both toothed members; the default is steel as in thesis Table 4.1."""

    youngs_modulus_GPa: Annotated[float, Field(gt=0, le=2_000)] = 210.0
    """Young's modulus; the default is that of steel."""
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5)] = 0.29
    """Poisson's ratio; the default is that of steel."""
    # density of steels used in such drives, e.g. 34CrNiMo6 (EN 10083-3)
    density_kg_m3: Annotated[float, Field(gt=0, le=30_000)] = 7850.0
    """Mass density; the default is that of steel."""
    fatigue_limit_bending_MPa: Positive | None = None
    """Endurance limit in reversed bending."""
    fatigue_limit_torsion_MPa: Positive | None = None
    """Endurance limit in reversed torsion."""
    flexspline: MaterialOverride = MaterialOverride()
    """Values that apply only to the flexspline."""
    circular_spline: MaterialOverride = MaterialOverride()
    """Values that apply only to the circular spline."""


class QuadrupleCircularArc(Section):
    """Quadruple circular arc: four arcs and a straight segment, thesis 3.3.3."""

    kind: Literal["qca"] = "qca"
    tip_radius_mm: Millimetre
    """Radius of the tip rounding; smaller than the addendum radius."""
    addendum_radius_mm: Millimetre
    """Radius of the convex arc above the pitch point."""
    straight_mm: Annotated[float, Field(ge=0, le=1_000)]
    """Length of the straight segment through the pitch point."""
    dedendum_radius_mm: Millimetre
    """Radius of the concave arc below the pitch point."""
    root_radius_mm: Millimetre
    """Radius of the root fillet; smaller than the dedendum radius."""
    straight_split: Annotated[float, Field(ge=0, le=1)] = 0.5
    """Fraction of the straight segment above the pitch point."""

    @model_validator(mode="after")
    def _straight_is_none_or_real(self) -> QuadrupleCircularArc:
        # the direction of a shorter segment is lost in double precision
        if 0.0 < self.straight_mm < 1e-6:
            raise Fault(
                (
                    "straight_mm",
                    f"{self.straight_mm:g} mm; accepted: 0, or at least 1e-06 mm",
                )
            )
        return self


class DoubleCircularArc(Section):
    """Double circular arc: two arcs and a resulting straight segment, thesis 3.3.2."""

    kind: Literal["dca"] = "dca"
    addendum_radius_mm: Millimetre
    """Radius of the convex arc, which ends in an edge at the tip."""
    dedendum_radius_mm: Millimetre
    """Radius of the concave arc, which is tangent to the root circle."""
    straight_split: Annotated[float, Field(ge=0, le=1)] = 0.5
    """Fraction of the straight segment above the pitch point."""


class Involute(Section):
    """Involute generated by a rack cutter (external) or a shaper cutter (internal)."""

    kind: Literal["involute"] = "involute"
    cutter_tip_radius_mm: Millimetre | None = None
    """Tip radius of the cutter; by default a quarter of the module, or the largest
    radius that fits if this is smaller."""
    cutter_teeth: Annotated[int, Field(ge=10, le=400)] | None = None
    """Number of teeth of the shaper cutter for the circular spline; by default half the
    number of teeth of the circular spline, but at least 10."""


class TwoArc(Section):
    """Convex and concave arc with a common tangent, as in the article on an 80:1 drive.

    The centre of each arc is given by its ``offset`` from the tooth axis and by its
    ``shift`` from the pitch circle along the radius. By default, the dimensions have
    the proportions of the article. The article states no root radius; the default is
    0.6 modules. The design ``dca-80-to-1`` describes the drive of the article.
    """

    kind: Literal["two_arc"] = "two_arc"
    addendum_radius_mm: Millimetre | None = None
    """Radius of the convex arc."""
    addendum_offset_mm: Millimetre | None = None
    """Distance of the centre of the convex arc from the tooth axis, on the side that is
    opposite to the flank."""
    addendum_shift_mm: Millimetre | None = None
    """Distance of the centre of the convex arc from the pitch circle, towards the
    root."""
    dedendum_radius_mm: Millimetre | None = None
    """Radius of the concave arc."""
    dedendum_offset_mm: Millimetre | None = None
    """Distance of the centre of the concave arc from the tooth axis, on the side of the
    flank."""
    dedendum_shift_mm: Millimetre | None = None
    """Distance of the centre of the concave arc from the pitch circle, towards the
    tip."""
    root_radius_mm: Millimetre | None = None
    """Radius of the root fillet."""


class Conjugate(Section):
    """Envelope of the profile of the other member as the wave generator moves it."""

    kind: Literal["conjugate"] = "conjugate"
    root_radius_mm: Millimetre | None = None
    """Radius of the root fillet; by default the largest that fits below the flank."""


Profile = Annotated[
    QuadrupleCircularArc | DoubleCircularArc | Involute | TwoArc | Conjugate,
    Field(discriminator="kind"),
]


class Member(Section):
    """Teeth and rim of a toothed member, flexspline or circular spline."""

    rim_mm: Millimetre
    """Thickness of the rim below the teeth."""
    addendum_coefficient: Coefficient = 0.6
    """Height of the tip above the pitch circle, divided by the module."""
    dedendum_coefficient: Coefficient = 0.8
    """Depth of the root below the pitch circle, divided by the module."""
    pressure_angle_deg: Annotated[float, Field(gt=0, lt=60)] = 20.0
    """Angle between flank and radius at the pitch circle."""
    thickness_coefficient: Annotated[float, Field(gt=0, le=1.5)] = 1.0
    """Tooth thickness at the pitch circle, divided by half the pitch; values below 1
    give backlash."""
    profile: Profile
    """Shape of the flank, by kind."""


class CircularSplineMember(Member):
    """Teeth and rim of the circular spline."""

    outer_rim: Literal["fixed", "free"] = "fixed"
    """Support of the outer surface: fixed by a rigid housing, or free to deform."""


class Cup(Section):
    """Cup or hat behind the teeth of the flexspline."""

    kind: Literal["cup", "hat"] = "cup"
    """Shape: a diaphragm directed inwards (cup) or a flange directed outwards (hat)."""
    length_mm: Millimetre
    """Length of the cylindrical wall behind the teeth."""
    thickness_coefficient: Coefficient = 0.8
    """Thickness of the wall, divided by that of the rim."""
    fillet_mm: Annotated[float, Field(ge=0, le=1_000)]
    """Radius of the fillet between wall and diaphragm or flange."""
    bore_radius_mm: Millimetre
    """Radius of the bore in the diaphragm; for a hat, outer radius of the flange."""


class Boss(Section):
    """Spring between the flexspline and its shaft or frame."""

    torsional_stiffness_Nm_rad: Annotated[float, Field(gt=0, le=1e12)]
    """Torsional stiffness about the axis."""


class Housing(Section):
    """Spring between the circular spline and its frame or shaft."""

    torsional_stiffness_Nm_rad: Annotated[float, Field(gt=0, le=1e12)]
    """Torsional stiffness about the axis."""


class Coupling(Section):
    """Spring between the wave generator and its shaft: Oldham coupling, hub, cam."""

    torsional_stiffness_Nm_rad: Annotated[float, Field(gt=0, le=1e12)]
    """Torsional stiffness about the axis, at the wave generator."""


class MicroGeometry(Section):
    """Crowning and slope of the contact surfaces; all zero by default."""

    wave_generator_crowning_um: Micrometre = 0.0
    """Drop of the wave-generator surface at both edges of the face."""
    wave_generator_slope_um: Annotated[float, Field(ge=-2_000, le=2_000)] = 0.0
    """Rise of the wave-generator surface at the open edge, at the major axis; at the
    minor axis the surface drops by this amount. Positive values follow the coning of
    the flexspline."""
    flexspline_crowning_um: Micrometre = 0.0
    """Relief of the flexspline flanks at both edges of the face."""
    crowning_kind: Literal["parabolic", "circular"] = "parabolic"
    """Shape of both crownings along the face width."""


class TolerancesSection(Section):
    """Manufacturing errors; all zero by default."""

    flexspline_cumulative_pitch_um: Micrometre = 0.0
    """Peak-to-peak cumulative pitch error of the flexspline, harmonics 1 to 4."""
    circular_spline_cumulative_pitch_um: Micrometre = 0.0
    """Peak-to-peak cumulative pitch error of the circular spline, harmonics 1 to 4."""
    random_pitch_um: Micrometre = 0.0
    """Standard deviation of the random position error of single teeth along the pitch
    circle, for both members."""
    wave_generator_ovality_um: Micrometre = 0.0
    """Largest minus smallest deviation of the wave-generator outline, along its
    normals."""
    wave_generator_eccentricity_um: Micrometre = 0.0
    """Offset of the wave-generator outline from the axis of rotation."""
    circular_spline_eccentricity_um: Micrometre = 0.0
    """Offset of the pitch circle of the circular spline from the axis."""
    circular_spline_ovality_um: Micrometre = 0.0
    """Largest minus smallest radial position of the teeth of the circular spline."""
    misalignment_arcmin: Annotated[float, Field(ge=0, le=600)] = 0.0
    """Angle between the axes of circular spline and flexspline; used in 3D models
    only."""
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = 1
    """Seed of all random errors."""


class FrictionSection(Section):
    """Coulomb friction of the teeth."""

    tooth_coefficient: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Coefficient of friction of the flanks."""


class RatingsSection(Section):
    """Catalogue torques at the output.

    :func:`swgjoint.gear.catalogue.ratings_of` describes the defaults of absent keys.
    """

    rated_torque_Nm: Positive | None = None
    """Rated torque at the output."""
    repeated_peak_Nm: Positive | None = None
    """Limit for repeated peak torque."""
    momentary_peak_Nm: Positive | None = None
    """Limit for momentary peak torque."""
    T1_Nm: Positive | None = None
    """Torque at the end of the first line of the torsion curve, whose slope is K1."""
    T2_Nm: Positive | None = None
    """Torque at the end of the second line of the torsion curve, whose slope is K2."""

    @model_validator(mode="after")
    def _increasing(self) -> RatingsSection:
        faults = []
        for keys in (
            ("rated_torque_Nm", "repeated_peak_Nm", "momentary_peak_Nm"),
            ("T1_Nm", "T2_Nm"),
        ):
            present = [(k, v) for k in keys if (v := getattr(self, k)) is not None]
            for (low_key, low), (key, value) in pairwise(present):
                if value < low or (key == "T2_Nm" and value == low):
                    faults.append(
                        (key, f"{value:g} N·m; accepted: above {low_key} = {low:g} N·m")
                    )
        if faults:
            raise Fault(*faults)
        return self


class JointDampingSection(Section):
    """Damping of the drive in a robot joint."""

    damping_ratio: Annotated[float, Field(ge=0, le=2)] = 0.02
    """Damping ratio of the torsional vibration between rotor and link."""


class MeshSection(Section):
    """Mesh and stress state of the finite element models."""

    refinement: Annotated[float, Field(ge=0.5, le=16)] = 1.0
    """Factor on the number of elements in every direction; 1 gives the mesh of the
    thesis and 0.5 a coarse mesh."""
    stress_state: Literal["auto", "plane_stress", "plane_strain"] = "auto"
    """Stress state across the face width in the 2D and thin-ring models; ``auto``
    interpolates between plane stress and plane strain according to the face width."""
