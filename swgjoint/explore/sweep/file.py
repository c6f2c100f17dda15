"""Sweep files: the designs of a sweep, and the tasks computed for each design."""

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
    """Parameters and how their values are combined, by kind."""

    @model_validator(mode="after")
    def _fits(self) -> SweepFile:
        faults = [*task_faults(self), *plan_faults(self.plan, self.kinds)]
        if faults:
            raise Fault(*faults)
        return self

    @classmethod
    def load(cls, reference: str | Path) -> SweepFile:
        """Read a sweep file, given as a path or as the name of a bundled file.

        Relative paths in the file start from its folder.

        Raises:
            InputError: If the file is not found or has faults; one line per fault.
        """
        path = find(reference, "sweeps", ".toml", what="sweep")
        data = read_toml(path, what="sweep")
        return anchor_files(validate(cls, data, where=str(path)), path.parent)


class _Planned(Protocol):
    """A file with base design, base scene and a plan."""

    design: str | None
    scene: str | None

    @property
    def plan(self) -> AnyPlan:
        """Plan of the file, with its parameters."""

    def model_copy(self, *, update: dict[str, Any]) -> Self:
        """Copy with some fields replaced."""


Planned = TypeVar("Planned", bound=_Planned)


def anchor_files(file: Planned, folder: Path) -> Planned:
    """Resolve the paths in a file relative to a folder.

    Args:
        file: File with a plan and bases.
        folder: Folder that relative paths start from.

    Returns:
        Copy of the file with absolute paths.
    """
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
    """Absolute path if the value names a file in the folder, else the value unchanged.

    Args:
        folder: Folder that a relative path starts from.
        value: Any value of a key.
    """
    if isinstance(value, str) and os.path.isfile(folder / value):
        return str((folder / value).resolve())
    return value
