"""Printed numbers of the three articles, from ``models/studies/articles.toml``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section
from swgjoint.gear.design.design import Design
from swgjoint.validation.row_entry import RowEntry
from swgjoint.validation.study_tables import StudyTables

Positive = Annotated[float, Field(gt=0, le=1e6)]
Text = Annotated[str, Field(min_length=1, max_length=200)]
Rows = Annotated[tuple[RowEntry, ...], Field(strict=False, min_length=1)]
Series = Annotated[tuple[Positive, ...], Field(strict=False, min_length=1)]


class ArticleVariation(Section):
    """Alternative to an assumption where a source leaves something open."""

    name: Text
    changes: Mapping[str, Any]
    """Changes of the design by dotted key."""


class Deflection(Section):
    """Section of the file on the deflection of the 80:1 drive."""

    source: Text
    base: Text
    """Bundled design."""
    coefficient: Positive
    """Printed lobe height divided by the theoretical one, w_0* [-]."""
    varied_quantity: Text
    """Quantity that is computed for every variation."""
    variations: Annotated[tuple[ArticleVariation, ...], Field(strict=False)] = ()
    """Variations, each applied alone."""
    rows: Rows


class Springs(Section):
    """Assumed springs of an elastic wave generator; the source prints no values."""

    name: Text
    stiffness_N_mm: Annotated[float, Field(ge=0, le=1e6)]
    """Stiffness of each lobe [N/mm]."""
    preload_N: Annotated[float, Field(ge=0, le=1e6)]
    """Force of each lobe at the lobe height of the drive [N]."""


class Force(Section):
    """Section of the file on the force that deforms the flexspline XB1-100-80."""

    source: Text
    base: Text
    """Bundled design."""
    radius_mm: Positive
    """Radius of the middle of the wall in the printed formula [mm]."""
    series_sum: Positive
    """Printed sum of the series in this formula [-]."""
    rows: Rows
    variations: Annotated[tuple[ArticleVariation, ...], Field(strict=False)] = ()
    """Variations, each applied alone."""
    springs: Annotated[tuple[Springs, ...], Field(strict=False)] = ()
    """Assumed elastic wave generators."""


class StressAndFatigue(Section):
    """Section of the file on stress and fatigue of a cup, with and without torque."""

    source: Text
    base: Text
    """Bundled design."""
    rows: Rows
    """Stress without torque."""
    fatigue_rows: Rows
    """Fatigue results that do not depend on the torque."""
    torque_rows: Rows
    """Stress and fatigue at each torque."""
    crowned: Mapping[str, Any]
    """Changes of the design that crown and slope the wave generator, for comparison."""
    torques_Nm: Series
    """Output torques [N·m]."""
    nodal_force_N: Series
    """Printed nodal force at each torque [N]."""
    nodes: Annotated[int, Field(gt=0, le=1000)]
    """Number of nodes that share the torque."""
    von_mises_MPa: Series
    """Largest equivalent stress at each torque, from the printed fit [MPa]."""
    allowable: Positive
    """Safety factor that the source requires [-]."""

    @model_validator(mode="after")
    def _same_length(self) -> StressAndFatigue:
        for key in ("nodal_force_N", "von_mises_MPa"):
            count = len(getattr(self, key))
            if count != len(self.torques_Nm):
                want = len(self.torques_Nm)
                raise Fault((key, f"{count} values; accepted: one per torque, {want}"))
        return self


class ArticlesFile(StudyTables):
    """Content of the study file."""

    source: Text
    deflection: Deflection
    force: Force
    stress: StressAndFatigue


def changed_design(base: str, changes: Mapping[str, Any] | None = None) -> Design:
    """Bundled design with changed keys.

    Args:
        base: Name of the design.
        changes: Values by dotted key; None for no changes.

    Raises:
        DesignError: If the design is unknown or the changed design is invalid.
    """
    return Design.preset(base).with_changes(changes or {})
