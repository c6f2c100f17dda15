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
    """Something that a source leaves open, chosen otherwise."""

    name: Text
    changes: Mapping[str, Any]


class Deflection(Section):
    """Deflection of the 80:1 drive."""

    source: Text
    base: Text
    coefficient: Positive
    """Printed lobe height over the theoretical one, w_0*."""
    varied_quantity: Text
    """Quantity that the rows of the variations compare."""
    variations: Annotated[tuple[ArticleVariation, ...], Field(strict=False)] = ()
    rows: Rows


class Springs(Section):
    """An elastic wave generator, chosen: the source prints none."""

    name: Text
    stiffness_N_mm: Annotated[float, Field(ge=0, le=1e6)]
    """Of each lobe."""
    preload_N: Annotated[float, Field(ge=0, le=1e6)]
    """Force of each lobe at the lobe height of the drive."""


class Force(Section):
    """Force that deforms XB1-100-80."""

    source: Text
    base: Text
    radius_mm: Positive
    series_sum: Positive
    rows: Rows
    variations: Annotated[tuple[ArticleVariation, ...], Field(strict=False)] = ()
    springs: Annotated[tuple[Springs, ...], Field(strict=False)] = ()


class StressAndFatigue(Section):
    """Stress of a cup without and with torque."""

    source: Text
    base: Text
    rows: Rows
    """Stress without torque."""
    fatigue_rows: Rows
    """Fatigue, whatever the torque."""
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
    """The study file."""

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
    """A bundled design with some keys changed.

    Raises:
        DesignError: If there is no such design.
    """
    return Design.preset(base).with_changes(changes or {})
