"""Sweep files: which designs, and what is computed of each."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar

from pydantic import model_validator

from swgjoint.explore.sweep.keys import is_path
from swgjoint.explore.sweep.plan import AnyPlan, Plan, plan_faults
from swgjoint.explore.sweep.tasks import AskedFile, task_faults
from swgjoint.faults import Fault, validate
from swgjoint.models_path import find
from swgjoint.toml_file import read_toml


class SweepFile(AskedFile):
    """A file of ``models/sweeps``."""

    plan: Plan

    @model_validator(mode="after")
    def _fits(self) -> SweepFile:
        faults = [*task_faults(self), *plan_faults(self.plan, self.kinds)]
        if faults:
            raise Fault(*faults)
        return self

    @classmethod
    def load(cls, reference: str | Path) -> SweepFile:
        """Read a sweep file, given as a path or as the name of a bundled one.

        Files that it names by a path, as bases or as values, lie relative to it.

        Raises:
            InputError: With one line per fault of the file.
        """
        path = find(reference, "sweeps", ".toml", what="sweep")
        data = read_toml(path, what="sweep")
        return anchor_files(validate(cls, data, where=str(path)), path.parent)


class _Planned(Protocol):
    """A file with a plan."""

    design: str | None
    scene: str | None

    @property
    def plan(self) -> AnyPlan:
        """Its parameters."""

    def model_copy(self, *, update: dict[str, Any]) -> Self:
        """The file with other fields."""


Planned = TypeVar("Planned", bound=_Planned)


def anchor_files(file: Planned, folder: Path) -> Planned:
    """The file with those that it names relative to a folder."""
    parameters = tuple(
        p.model_copy(
            update={"values": tuple(path_in_folder(folder, v) for v in p.values)}
        )
        if p.values is not None and any(map(is_path, p.keys))
        else p
        for p in file.plan.parameters
    )
    plan = file.plan.model_copy(update={"parameters": parameters})
    bases = {
        key: path_in_folder(folder, getattr(file, key)) for key in ("design", "scene")
    }
    return file.model_copy(update={**bases, "plan": plan})


def path_in_folder(folder: Path, value: Any) -> Any:
    """The path of a file in the folder; whatever names none as it is."""
    if isinstance(value, str) and os.path.isfile(folder / value):
        return str((folder / value).resolve())
    return value
