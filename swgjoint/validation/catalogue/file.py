"""File of the catalogue study, ``models/studies/catalogue.toml``, and its designs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from swgjoint.errors import InputError
from swgjoint.faults import Section, validate
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.family import BEARING_BORE, CLEARANCE
from swgjoint.models_path import find
from swgjoint.toml_file import read_toml

Whole = Annotated[int, Field(gt=0, le=1000)]
Numbers = Annotated[tuple[Whole, ...], Field(strict=False)]
Text = Annotated[str, Field(min_length=1, max_length=300)]


class Variant(Section):
    """Changes of the family design, one of several choices that the sources leave open.

    Keys of the mappings are dotted keys of the design.
    """

    name: Text
    cup: Text
    """Name of the cup in messages."""
    flank_deg: float
    """Pressure angle of the flanks [deg], for the names of computations; it must be
    that of the changed design."""
    per_pitch_diameter: Mapping[str, float] = {}
    """Lengths divided by the pitch diameter [-]."""
    per_module: Mapping[str, float] = {}
    """Lengths divided by the module [-]."""
    changes: Mapping[str, Any] = {}
    """Values in the units of the design file."""


class Goal(Section):
    """Accuracy goals: accepted relative deviations from the catalogue [-].

    The deviation is that of the middle of the bracket.
    """

    ratios: Numbers
    sizes: Numbers
    K1: float
    K2: float
    K3: float


class NoClaim(Section):
    """Sizes that are reported without an accuracy goal, listed for the reader."""

    sizes: Numbers


class Individuals(Section):
    """Individual gears of one design, one per seed."""

    seeds: Numbers
    variant: Text
    """Name of the variant."""
    size: Whole
    ratio: Whole
    clearance: Mapping[str, Any]
    """Description of the random bearing clearance; :meth:`CatalogueFile.individual`
    does not read it."""
    changes: Mapping[str, Any]
    """Tolerances by dotted key of the design."""
    source: Text
    """Source of the tolerances."""


class ConingSection(Section):
    """Comparison of wave generators in 3D, rigid and on a bearing, at one size."""

    size: Whole
    ratios: Numbers
    variant: Text
    """Name of the variant."""
    refinement: float
    """Mesh refinement [-]."""
    straight: Mapping[str, Any]
    """Changes of the design that omit relief along the face width."""
    assumptions: Annotated[tuple[Text, ...], Field(strict=False)]


class CatalogueFile(Section):
    """Content of the study file."""

    source: Text
    sizes: Numbers
    """Sizes of the drives: the pitch diameter in tenths of an inch."""
    ratios: Numbers
    goals: Annotated[tuple[Goal, ...], Field(strict=False)]
    no_claim: Annotated[tuple[NoClaim, ...], Field(strict=False)] = ()
    middle: Literal["mean of smallest and largest"]
    """Definition of the middle of a bracket."""
    stated: Mapping[str, Mapping[str, Any]]
    """Assumed values with their sources; only ``tooth_friction`` is read."""
    variants: Annotated[tuple[Variant, ...], Field(strict=False, min_length=1)]
    """Variants; the first one is used where only one is computed."""
    individuals: Individuals
    coning: ConingSection

    @classmethod
    def load(cls, reference: str = "catalogue") -> CatalogueFile:
        """Read a study file, given as a path or as the name of a bundled one.

        Raises:
            InputError: If the file is missing or invalid, with one line per fault.
        """
        path = find(reference, "studies", ".toml", what="study")
        data = read_toml(path, what="study", error=InputError)
        return validate(cls, data, where=str(path), error=InputError)

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
        variant = next(v for v in self.variants if v.name == own.variant)
        design = variant_design(own.size, ratio, variant)
        changes = {"mesh.refinement": own.refinement}
        return design.with_changes({**changes, **(own.straight if straight else {})})

    def individual(self, seed: int) -> Design:
        """Design of an individual gear.

        The tooth errors and the bearing clearance are random; the clearance is
        uniformly distributed over its class.
        """
        own = self.individuals
        variant = next(v for v in self.variants if v.name == own.variant)
        design = variant_design(own.size, own.ratio, variant)
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
    """Member of the drive family with the changes of a variant.

    Args:
        size: Size of the drive.
        ratio: Ratio of the drive.
        variant: Changes of the family design.
    """
    design = Design.preset(f"size-{size}-{ratio}")
    changes = dict(variant.changes)
    for table, unit in (
        (variant.per_pitch_diameter, 2.54 * size),
        (variant.per_module, design.drive.module_mm),
    ):
        changes |= {key: value * unit for key, value in table.items()}
    return design.with_changes(changes)
