"""The table of the wave generator in a design file, one class per kind."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section
from swgjoint.gear.design.sections import Micrometre, Millimetre, Positive, Reduction


class Bearing(Section):
    """Thin-race ball bearing between wave generator and flexspline.

    :meth:`swgjoint.gear.bearing.ball_bearing.BallBearing.from_design` describes the
    defaults of absent keys.
    """

    balls: Annotated[int, Field(ge=3, le=200)]
    """Number of balls."""
    ball_diameter_mm: Millimetre
    """Diameter of a ball."""
    race_thickness_mm: Millimetre
    """Radial thickness of the outer race, from its outer surface to the raceway."""
    clearance_um: Micrometre = 0.0
    """Radial internal clearance as in catalogues, a difference of diameters."""
    race_width_mm: Millimetre | None = None
    """Width of the outer race along the axis; by default the face width."""
    groove_inertia_factor: Reduction | None = None
    """Second moment of area of the race section, divided by that of a rectangle of the
    same width and thickness; by default 1."""
    groove_conformity: Annotated[float, Field(gt=0.5, le=1)] | None = None
    """Radius of the groove, divided by the diameter of the ball; by default 0.52."""
    fit_clearance_um: Micrometre | None = None
    """Clearance between race and flexspline, a difference of diameters; by default
    0."""
    youngs_modulus_GPa: Annotated[float, Field(gt=0, le=2_000)] | None = None
    """Young's modulus of balls and races; by default that of the flexspline."""
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5)] | None = None
    """Poisson's ratio of balls and races; by default that of the flexspline."""


class WaveGeneratorBase(Section):
    """Keys that every kind of wave generator has."""

    bearing: Bearing | None = None
    """Ball bearing between cam and flexspline; without a bearing, the flexspline slides
    on the cam."""


class EllipticalSection(WaveGeneratorBase):
    """Ellipse, thesis 3.2.2."""

    kind: Literal["elliptical"] = "elliptical"
    minor_axis_coefficient: Reduction = 1.0
    """C: semi-minor axis divided by (bore radius minus deflection)."""


class SimplifiedSection(WaveGeneratorBase):
    """Two semicircles joined by straight lines, thesis 3.2.1."""

    kind: Literal["simplified"] = "simplified"
    minor_axis_coefficient: Reduction
    """C: semi-minor axis divided by (bore radius minus deflection)."""


class Parabolic(WaveGeneratorBase):
    """Two parabolas joined by circular arcs, thesis 3.2.3."""

    kind: Literal["parabolic"] = "parabolic"
    minor_axis_coefficient: Reduction = 1.0
    """C: semi-minor axis divided by (bore radius minus deflection)."""
    parabola_coefficient_per_mm: Positive
    """Coefficient c of the parabola y = a - c x² at the lobe."""
    parabola_length_coefficient: Reduction
    """Half width of the parabola, divided by the semi-minor axis."""
    connector_radius_mm: Millimetre
    """Radius of the arc that joins the parabola to the lateral arc."""


class ParabolaSide(Section):
    """One side of a bilateral asymmetric parabolic wave generator."""

    parabola_coefficient_per_mm: Positive
    """Coefficient c of the parabola y = a - c x² at the lobe."""
    parabola_length_coefficient: Reduction
    """Half width of the parabola, divided by the semi-minor axis."""
    connector_radius_mm: Millimetre
    """Radius of the arc that joins the parabola to the lateral arc."""


class AsymmetricParabolic(WaveGeneratorBase):
    """Parabolic outline with rotated lobes (``rotation_deg``) or with unequal sides."""

    kind: Literal["asymmetric_parabolic"] = "asymmetric_parabolic"
    minor_axis_coefficient: Reduction = 1.0
    """C: semi-minor axis divided by (bore radius minus deflection)."""
    rotation_deg: Annotated[float, Field(gt=-45, lt=45)] | None = None
    """Rotation of the parabola of each lobe about its apex, counter-clockwise."""
    parabola_coefficient_per_mm: Positive | None = None
    """Coefficient c of the parabola y = a - c x² at the lobe; required with
    rotation_deg."""
    parabola_length_coefficient: Reduction | None = None
    """Half width of the parabola, divided by the semi-minor axis; required with
    rotation_deg."""
    connector_radius_mm: Millimetre | None = None
    """Radius of the arc that joins the parabola to the lateral arc; required with
    rotation_deg."""
    left: ParabolaSide | None = None
    """Side at x < 0 of the upper lobe; given together with right, instead of
    rotation_deg."""
    right: ParabolaSide | None = None
    """Side at x > 0 of the upper lobe; given together with left."""

    @model_validator(mode="after")
    def _one_of_two_forms(self) -> AsymmetricParabolic:
        keys = (
            "parabola_coefficient_per_mm",
            "parabola_length_coefficient",
            "connector_radius_mm",
        )
        turned = ("rotation_deg", *keys)
        sides = ("left", "right")
        present = {key for key in (*turned, *sides) if getattr(self, key) is not None}
        if present not in (set(turned), set(sides)):
            raise Fault(
                (
                    "kind",
                    "'asymmetric_parabolic' needs either rotation_deg with"
                    f" {', '.join(keys)}, or both tables left and right",
                )
            )
        return self


class FourRollerSection(WaveGeneratorBase):
    """Four rollers, thesis 3.2.4."""

    kind: Literal["four_roller"] = "four_roller"
    aperture_deg: Annotated[float, Field(gt=0, lt=45)]
    """Angle of a roller's centre from the major axis."""
    roller_radius_mm: Millimetre
    """Radius of the rollers."""


class CosineSection(WaveGeneratorBase):
    """Outline whose radius varies as cos(n phi), with the number of lobes n."""

    kind: Literal["cosine"] = "cosine"
    minor_axis_coefficient: Reduction = 1.0
    """C: smallest radius divided by (bore radius minus deflection)."""


class TableSection(WaveGeneratorBase):
    """Outline given by a table of radius against angle from the major axis."""

    kind: Literal["table"] = "table"
    angle_deg: Annotated[tuple[float, ...], Field(strict=False)]
    """Angles from the major axis, counter-clockwise, at least 8 increasing values
    within one turn."""
    radius_mm: Annotated[tuple[Millimetre, ...], Field(strict=False)]
    """Radius of the outline at each angle."""

    @model_validator(mode="after")
    def _same_length(self) -> TableSection:
        if len(self.angle_deg) < 8:
            raise Fault(
                ("angle_deg", f"{len(self.angle_deg)} values; accepted: 8 or more")
            )
        if len(self.angle_deg) != len(self.radius_mm):
            raise Fault(
                (
                    "radius_mm",
                    f"{len(self.radius_mm)} values; accepted: as many as in angle_deg,"
                    f" {len(self.angle_deg)}",
                )
            )
        steps = [b - a for a, b in pairwise(self.angle_deg)]
        if min(steps) <= 0 or self.angle_deg[-1] - self.angle_deg[0] >= 360:
            raise Fault(
                ("angle_deg", "expected increasing angles within one turn of 360 deg")
            )
        return self


WaveGenerator = Annotated[
    EllipticalSection
    | SimplifiedSection
    | Parabolic
    | AsymmetricParabolic
    | FourRollerSection
    | CosineSection
    | TableSection,
    Field(discriminator="kind"),
]
