"""File of the catalogue study, ``models/studies/catalogue.toml``, and its designs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from swgjoint.faults import Section
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.family import BEARING_BORE, CLEARANCE
from swgjoint.gear.torsional_buckling import wall_for_buckling_torque
from swgjoint.units import mm
from swgjoint.validation.catalogue.printed import catalogue_buckling_torque
from swgjoint.validation.study_tables import StudyTables

Whole = Annotated[int, Field(gt=0, le=1000)]
Numbers = Annotated[tuple[Whole, ...], Field(strict=False)]
Text = Annotated[str, Field(min_length=1, max_length=300)]
Source = Annotated[str, Field(min_length=9, max_length=1000)]


class CupRule(Section):
    """Proportions of a cup; its wall is the thinnest that bears the buckling torque.

    Wall and diaphragm have the same thickness.
    """

    name: Text
    per_pitch_diameter: Mapping[str, float]
    """Lengths by dotted key of the design, divided by the pitch diameter [-]."""
    buckling_torque_over_cube_Nm_mm3: float | None = None
    """Buckling torque divided by the cube of the pitch diameter; by default the
    catalogue's buckling torque of the size."""
    knock_down: float
    """Buckling stress of a real cylinder over that of a perfect one [-]."""
    source: Source


class FlankChoice(Section):
    """Flank angle, with the profile that can be built with it."""

    flank_deg: float
    """Pressure angle of the flanks [deg]."""
    per_module: Mapping[str, float] = {}
    """Lengths by dotted key of the design, divided by the module [-]."""
    source: Source


class RimRule(Section):
    r"""Rule for the rim by the ratio: :math:`s / d = c + k\,i^p`."""

    name: Text
    constant: float
    """c [-]."""
    factor: float
    """k [-]."""
    exponent: float
    """p [-]."""
    source: Source

    def thickness(self, pitch_diameter: float, ratio: int) -> float:
        """Thickness s of the rim, in the unit of the pitch diameter d.

        Args:
            pitch_diameter: Pitch diameter d.
            ratio: Ratio i, half the number of flexspline teeth.
        """
        power = float(ratio**self.exponent)
        return pitch_diameter * (self.constant + self.factor * power)


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One combination of the choices that the sources leave open."""

    cup: CupRule
    flank: FlankChoice
    rim: RimRule

    @property
    def name(self) -> str:
        """Name in messages."""
        return f"{self.cup.name}, {self.section}"

    @property
    def flank_deg(self) -> float:
        """Pressure angle of the flanks [deg]."""
        return self.flank.flank_deg

    @property
    def section(self) -> str:
        """Name of what the thin rings depend on: flank angle and rim."""
        return f"{self.flank_deg:g} deg, {self.rim.name}"


class Goal(Section):
    """Accuracy goals: accepted relative deviations from the catalogue [-].

    The deviation is that of the middle of the bracket.
    """

    ratios: Numbers
    sizes: Numbers
    K1: float
    K2: float
    K3: float


class RatioEffect(Section):
    """Goal for the stiffness at one ratio divided by that at another.

    K of the middles of the brackets is divided for each size; the mean over the sizes
    is compared with that of the catalogue.
    """

    ratios: Annotated[tuple[Whole, Whole], Field(strict=False)]
    """Ratio of the dividend and of the divisor."""
    sizes: Numbers
    goal: float
    """Accepted relative deviation from the catalogue [-]."""


class NoClaim(Section):
    """Sizes that are reported without an accuracy goal, listed for the reader."""

    sizes: Numbers


class Individuals(Section):
    """Individual gears of one design, one per seed."""

    seeds: Numbers
    size: Whole
    ratio: Whole
    clearance: Mapping[str, Any]
    """Description of the random bearing clearance; :meth:`CatalogueFile.individual`
    does not read it."""
    changes: Mapping[str, Any]
    """Tolerances by dotted key of the design."""
    source: Text
    """Source of the tolerances."""


class Experiment(Section):
    """One change of the first variant, to test what causes the effect of the ratio."""

    name: Text
    ratios: Numbers | None = None
    """Ratios at which the drive is changed; by default all."""
    rim: RimRule | None = None
    """Other rule for the rim; the wall keeps its thickness."""
    flank_deg: float | None = None
    """Other flank, one of the study file [deg]."""
    per_pitch_diameter: Mapping[str, float] = {}
    """Lengths by dotted key of the design, divided by the pitch diameter [-]."""
    changes: Mapping[str, Any] = {}
    """Values by dotted key, in the units of the design file."""
    play_arcsec: Mapping[str, float] = {}
    """Play at the output by ratio, added to the torsion."""
    source: Source


class ConingSection(Section):
    """Comparison of wave generators in 3D, rigid and on a bearing, at one size.

    The drives are those of the family without changes.
    """

    size: Whole
    ratios: Numbers
    refinement: float
    """Mesh refinement [-]."""
    straight: Mapping[str, Any]
    """Changes of the design that omit relief along the face width."""
    assumptions: Annotated[tuple[Text, ...], Field(strict=False)]


class CatalogueFile(StudyTables):
    """Content of the study file."""

    source: Text
    sizes: Numbers
    """Sizes of the drives: the pitch diameter in tenths of an inch."""
    ratios: Numbers
    goals: Annotated[tuple[Goal, ...], Field(strict=False)]
    figures_within_goals: Whole
    """Number of stiffness figures that shall meet their goal."""
    ratio_effect: RatioEffect
    no_claim: Annotated[tuple[NoClaim, ...], Field(strict=False)] = ()
    middle: Literal["mean of smallest and largest"]
    """Definition of the middle of a bracket."""
    stated: Mapping[str, Mapping[str, Any]]
    """Assumed values with their sources; only ``tooth_friction`` is read."""
    cups: Annotated[tuple[CupRule, ...], Field(strict=False, min_length=1)]
    flanks: Annotated[tuple[FlankChoice, ...], Field(strict=False, min_length=1)]
    rims: Annotated[tuple[RimRule, ...], Field(strict=False, min_length=1)]
    individuals: Individuals
    experiments: Annotated[tuple[Experiment, ...], Field(strict=False)]
    coning: ConingSection

    @property
    def variants(self) -> tuple[Variant, ...]:
        """All combinations; the first one is used where only one is computed."""
        return tuple(
            Variant(cup=cup, flank=flank, rim=rim)
            for flank in self.flanks
            for rim in self.rims
            for cup in self.cups
        )

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of tooth friction [-]."""
        return tuple(float(mu) for mu in self.stated["tooth_friction"]["coefficients"])

    def goal(self, size: int, ratio: int, quantity: str) -> float | None:
        """Accepted relative deviation from the catalogue; None without a goal.

        Args:
            size: Size of the drive.
            ratio: Ratio of the drive.
            quantity: ``K1``, ``K2`` or ``K3``.
        """
        for goal in self.goals:
            if ratio in goal.ratios and size in goal.sizes:
                value = getattr(goal, quantity, None)
                return None if value is None else float(value)
        return None

    def coned_design(self, ratio: int, *, straight: bool) -> Design:
        """Design of part ``coning`` for the 3D model.

        Args:
            ratio: Ratio of the drive.
            straight: Whether relief along the face width is omitted.
        """
        own = self.coning
        design = Design.preset(f"size-{own.size}-{ratio}")
        changes = {"mesh.refinement": own.refinement}
        return design.with_changes({**changes, **(own.straight if straight else {})})

    def individual(self, seed: int) -> Design:
        """Design of an individual gear.

        The tooth errors and the bearing clearance are random; the clearance is
        uniformly distributed over its class.
        """
        own = self.individuals
        design = variant_design(own.size, own.ratio, self.variants[0])
        bore = BEARING_BORE * 2.54 * own.size
        low, high = next(band for limit, band in CLEARANCE if bore <= limit)
        drawn = float(np.random.default_rng(seed).uniform(low, high))
        return design.with_changes(
            {
                **own.changes,
                "tolerances.seed": seed,
                "wave_generator.bearing.clearance_um": drawn,
            }
        )


def variant_design(size: int, ratio: int, variant: Variant) -> Design:
    """Member of the drive family with the cup, flanks and rim of a variant.

    Args:
        size: Size of the drive.
        ratio: Ratio of the drive.
        variant: Choices of cup, flanks and rim.
    """
    design = Design.preset(f"size-{size}-{ratio}")
    diameter, module = 2.54 * size, design.drive.module_mm
    angle = variant.flank_deg
    rim_mm = variant.rim.thickness(diameter, ratio)
    cup, flank = variant.cup.per_pitch_diameter, variant.flank.per_module
    design = design.with_changes(
        {
            **{key: value * diameter for key, value in cup.items()},
            **{key: value * module for key, value in flank.items()},
            "flexspline.pressure_angle_deg": angle,
            "circular_spline.pressure_angle_deg": angle,
            "flexspline.rim_mm": rim_mm,
        }
    )
    wall = cup_wall(design, variant.cup, size)
    return design.with_changes({"cup.thickness_coefficient": wall / (rim_mm * mm)})


def cup_wall(design: Design, cup: CupRule, size: int) -> float:
    """Wall of a cup by the rule of the study [m].

    Args:
        design: Drive with the length of the cup and the rim.
        cup: Rule for the wall.
        size: Size of the drive, for the buckling torque of the catalogue.
    """
    assert design.cup is not None
    torque = catalogue_buckling_torque(size)
    if cup.buckling_torque_over_cube_Nm_mm3 is not None:
        torque = cup.buckling_torque_over_cube_Nm_mm3 * (2.54 * size) ** 3
    return wall_for_buckling_torque(
        torque,
        inner_radius=design.flexspline_inner_radius,
        length=design.cup.length_mm * mm,
        material=design.material_of("flexspline"),
        knock_down=cup.knock_down,
    )
