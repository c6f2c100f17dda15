"""Printed numbers of the three articles, from ``models/studies/articles.toml``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from swgjoint.errors import InputError
from swgjoint.faults import Fault, Section, validate
from swgjoint.gear.design.design import Design
from swgjoint.models_path import find
from swgjoint.toml_file import read_toml
from swgjoint.validation.row_entry import RowEntry

Positive = Annotated[float, Field(gt=0, le=1e6)]
Text = Annotated[str, Field(min_length=1, max_length=200)]
Rows = Annotated[tuple[RowEntry, ...], Field(strict=False, min_length=1)]
Series = Annotated[tuple[Positive, ...], Field(strict=False, min_length=1)]


class ArticleVariation(Section):
    """Another choice for something that a source leaves open."""

    name: Text
    changes: Mapping[str, Any]


class Deflection(Section):
    """Deflection of the 80:1 drive."""

    source: Text
    base: Text
    coefficient: Positive
    """Printed lobe height divided by the theoretical one, w_0* [-]."""
    varied_quantity: Text
    """Quantity that the rows of the variations compare."""
    variations: Annotated[tuple[ArticleVariation, ...], Field(strict=False)] = ()
    rows: Rows


class Springs(Section):
    """An assumed elastic wave generator; the source prints none."""

    name: Text
    stiffness_N_mm: Annotated[float, Field(ge=0, le=1e6)]
    """Stiffness of each lobe."""
    preload_N: Annotated[float, Field(ge=0, le=1e6)]
    """Force of each lobe at the lobe height of the drive."""


class Force(Section):
    """Deformation force of XB1-100-80."""

    source: Text
    base: Text
    radius_mm: Positive
    series_sum: Positive
    rows: Rows
    variations: Annotated[tuple[ArticleVariation, ...], Field(strict=False)] = ()
    springs: Annotated[tuple[Springs, ...], Field(strict=False)] = ()


class StressAndFatigue(Section):
    """Stress and fatigue of a cup without and with torque."""

    source: Text
    base: Text
    rows: Rows
    """Stress without torque."""
    fatigue_rows: Rows
    """Fatigue results that do not depend on the torque."""
    torque_rows: Rows
    """Stress and fatigue at each torque."""
    crowned: Mapping[str, Any]
    """Micro-geometry of the wave generator for comparison."""
    torques_Nm: Series
    nodal_force_N: Series
    nodes: Annotated[int, Field(gt=0, le=1000)]
    von_mises_MPa: Series
    allowable: Positive

    @model_validator(mode="after")
    def _same_length(self) -> StressAndFatigue:
        for key in ("nodal_force_N", "von_mises_MPa"):
            count = len(getattr(self, key))
            if count != len(self.torques_Nm):
                want = len(self.torques_Nm)
                raise Fault((key, f"{count} values; accepted: one per torque, {want}"))
        return self


class ArticlesFile(Section):
    """File of the study."""

    source: Text
    deflection: Deflection
    force: Force
    stress: StressAndFatigue

    @classmethod
    def load(cls, reference: str = "articles") -> ArticlesFile:
        """Read a study file, given as a path or as the name of a bundled one.

        Raises:
            InputError: With one line per fault of the file.
        """
        path = find(reference, "studies", ".toml", what="study")
        data = read_toml(path, what="study", error=InputError)
        return validate(cls, data, where=str(path), error=InputError)


def changed_design(base: str, changes: Mapping[str, Any] | None = None) -> Design:
    """Bundled design with changed keys.

    Args:
        base: Name of the design.
        changes: Values by dotted key; None for no changes.

    Raises:
        DesignError: If the design is unknown or the changed design is invalid.
    """
    return Design.preset(base).with_changes(changes or {})
