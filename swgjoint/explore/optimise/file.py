"""Files of ``models/optimisations``: objectives, limits and parameters of a search."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from swgjoint.explore.sweep.file import SweepFile, anchor_files, path_in_folder
from swgjoint.explore.sweep.keys import BASE
from swgjoint.explore.sweep.plan import List, Parameter, SearchPlan, plan_faults
from swgjoint.explore.sweep.tasks import (
    AskedFile,
    MeshingTask,
    Reference,
    Text,
    task_faults,
)
from swgjoint.faults import Fault, Section, unit_of, validate
from swgjoint.models_path import find
from swgjoint.toml_file import read_toml

REFINEMENT = "mesh.refinement"
"""Design key that a confirmation may change."""


class Objective(Section):
    """A figure to minimise or maximise."""

    figure: Text
    """Name of the figure, one of those that the tasks of the file compute."""
    goal: Literal["minimise", "maximise"] = "minimise"
    """Whether smaller or larger values are better."""

    @property
    def sign(self) -> float:
        """Factor that turns the figure into a quantity to minimise: 1 or -1."""
        return 1.0 if self.goal == "minimise" else -1.0


class Limit(Section):
    """Bounds of a figure that every design of the front must meet."""

    figure: Text
    """Name of the figure, one of those that the tasks of the file compute."""
    least: float | None = None
    """Smallest accepted value, in the unit of the figure."""
    most: float | None = None
    """Largest accepted value, in the unit of the figure."""

    @model_validator(mode="after")
    def _bounded(self) -> Limit:
        if self.least is None and self.most is None:
            raise Fault(("most", "missing; accepted: least, most or both"))
        if self.least is not None and self.most is not None and self.least >= self.most:
            unit = f" {unit_of(self.figure)}".rstrip()
            told = f"{self.most:g}{unit}; accepted: above {self.least:g}{unit}"
            raise Fault(("most", told))
        return self

    def violation(self, value: float) -> float:
        """Excess beyond the violated bound, divided by the magnitude of this bound [-].

        It is zero within the bounds. The excess is not divided if the bound is zero.
        """
        beyond = 0.0
        if self.most is not None:
            beyond = max(beyond, (value - self.most) / (abs(self.most) or 1.0))
        if self.least is not None:
            beyond = max(beyond, (self.least - value) / (abs(self.least) or 1.0))
        return beyond


class Confirmation(Section):
    """More accurate computation of designs of the Pareto front."""

    designs: Annotated[int, Field(ge=1, le=1_000)] = 5
    """Number of designs of the front to confirm: first the best one in each objective,
    then those farthest from the designs already selected."""
    positions: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Number of positions of the wave generator in the simulation of meshing."""
    refinement: Annotated[float, Field(gt=0, le=100)] | None = None
    """Refinement of the mesh [-]."""
    model: Literal["2d", "3d"] | None = None
    """Fidelity of the meshing and of the map."""


class OptimisationFile(AskedFile):
    """Figures to compute, objectives, limits, and parameters that may change."""

    objectives: Annotated[tuple[Objective, ...], Field(strict=False, min_length=1)]
    """Figures to minimise or maximise."""
    limits: Annotated[tuple[Limit, ...], Field(strict=False)] = ()
    """Bounds of figures that an accepted design must meet."""
    plan: SearchPlan
    """Parameters and budget of the genetic search."""
    confirm: Confirmation | None = None
    beside: Annotated[tuple[Reference, ...], Field(strict=False)] = ()
    """Designs to compare with the front; the search does not use them."""

    @model_validator(mode="after")
    def _fits(self) -> OptimisationFile:
        faults = [*task_faults(self), *plan_faults(self.plan, self.kinds)]
        if self.design is None:
            fault = "missing; accepted: a design from which the search starts"
            faults.append(("design", fault))
        told = ", ".join(self.figures)
        for table, items in (("objectives", self.objectives), ("limits", self.limits)):
            names = [item.figure for item in items]
            for k, name in enumerate(names):
                where = f"{table}[{k}].figure"
                if name not in self.figures:
                    faults.append((where, f"{name!r}; accepted: {told}"))
                elif name in names[:k]:
                    faults.append((where, f"{name!r} is listed more than once"))
        confirm = self.confirm
        if confirm is not None and self.meshing is None:
            if confirm.positions is not None:
                faults.append(("confirm.positions", "unused without meshing"))
            if confirm.model is not None and self.spec is None and self.run is None:
                faults.append(("confirm.model", "used only by meshing and maps"))
        if confirm is not None and self.meshing is not None:
            if fault := self.meshing.range_fault(confirm.positions):
                faults.append(("confirm.positions", fault))
        varied = {key for p in self.plan.parameters for key in p.keys}
        if confirm is not None and confirm.refinement and REFINEMENT in varied:
            told = f"{REFINEMENT} is also a parameter; accepted: one of the two"
            faults.append(("confirm.refinement", told))
        if BASE in varied:
            fault = f"key {BASE!r}: only a sweep can vary the base design"
            faults.append(("plan.parameters", fault))
        if faults:
            raise Fault(*faults)
        return self

    @classmethod
    def load(cls, reference: str | Path) -> OptimisationFile:
        """Read a file, given as a path or as the name of a bundled file.

        Relative paths in the file start from its folder.

        Args:
            reference: Path or name.

        Raises:
            InputError: If the file is not found or has faults; one line per fault.
        """
        path = find(reference, "optimisations", ".toml", what="optimisation")
        data = read_toml(path, what="optimisation")
        file = anchor_files(validate(cls, data, where=str(path)), path.parent)
        beside = tuple(path_in_folder(path.parent, name) for name in file.beside)
        return file.model_copy(update={"beside": beside})

    def violations(self, figures: Mapping[str, float | None]) -> dict[str, float]:
        """Violations by limited figure [-], see :meth:`Limit.violation`.

        The violation of an unknown figure is one.
        """
        found = {}
        for limit in self.limits:
            value = figures.get(limit.figure)
            found[limit.figure] = 1.0 if value is None else limit.violation(value)
        return found

    def sweep(self, columns: Mapping[str, list[Any]], *, confirm: bool) -> SweepFile:
        """The sweep that computes some designs.

        Args:
            columns: Values of all designs by column; a column that is not a parameter
                of this file is a key of the design.
            confirm: Whether they are computed with the accuracy of the confirmation.
        """
        keys = {p.column: p.keys for p in self.plan.parameters}
        tasks = {name: getattr(self, name) for name in ("meshing", "spec", "run")}
        if confirm and (care := self.confirm) is not None:
            if care.refinement is not None:
                count = len(next(iter(columns.values())))
                columns = {**columns, REFINEMENT: [care.refinement] * count}
            for name, task in tasks.items():
                if task is None:
                    continue
                changes: dict[str, Any] = {}
                if care.model is not None:
                    changes["model"] = care.model
                if isinstance(task, MeshingTask) and care.positions is not None:
                    changes["positions"] = care.positions
                tasks[name] = task.model_copy(update=changes)
        plan = List(
            parameters=tuple(
                Parameter(keys=keys.get(column, (column,)), values=tuple(values))
                for column, values in columns.items()
            )
        )
        return SweepFile(
            description=self.description,
            design=self.design,
            scene=self.scene,
            size=self.size,
            plan=plan,
            **tasks,
        )
