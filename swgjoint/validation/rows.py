"""Rows of all studies: our values compared with those of a source."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swgjoint.errors import InputError
from swgjoint.progress import Progress, silent

Page = Callable[[], bytes | str | None]
"""Function that returns the content of a file, called when the file is written. If it
returns None, no file is written."""


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """Options of ``swgjoint study``; options that a study does not use are rejected."""

    only: tuple[str, ...] = ()
    """Parts to run, or drives for ``response`` and ``control``; empty for the default
    of the study."""
    model: str | None = None
    """Model, ``2d`` or ``3d``; None for the default of the study."""
    jobs: int = 1
    """Number of processes."""
    seeds: int | None = None
    """Number of specimens to draw; None for the default of the study."""
    folder: Path | None = None
    """Folder for tables, report and plots; None if nothing is to be written."""
    load_inertia: float | None = None
    """Load inertia about the output [kg·m²]; None for the default of the study."""
    rotor_inertia: float | None = None
    """Inertia of rotor and wave generator about the input [kg·m²]; None for the
    default of the study."""
    closed_form: bool = False
    """Whether only closed forms are evaluated, without simulation."""
    progress: Progress = silent
    """Called with the stage, the number of finished computations and the total."""

    def chosen(self, parts: Sequence[str]) -> list[str]:
        """Parts of a study to run, in the order of the study.

        Raises:
            InputError: If an unknown part is chosen.
        """
        unknown = [part for part in self.only if part not in parts]
        if unknown:
            raise InputError(
                f"--only {','.join(unknown)}: unknown part; accepted:"
                f" {', '.join(parts)}"
            )
        return [part for part in parts if not self.only or part in self.only]


@dataclass(frozen=True, kw_only=True)
class Row:
    """One quantity of one case: the source's value and ours."""

    case: str
    """Drive, design or part of the source to which the quantity belongs."""
    quantity: str
    unit: str
    """Unit of all values of the row."""
    source_value: float | None
    """Printed value; None if the source withholds it or prints none."""
    ours: float | None
    """Our value; None if the computation failed, see ``reason``."""
    converged: float | None = None
    """Value on a finer mesh, or at half the time step for ``response``; None if it was
    not computed."""
    reason: str | None = None
    """Why our value differs or is missing."""
    more: dict[str, Any] = field(default_factory=dict)
    """Further columns of this study, by name."""

    def to_json(self) -> dict[str, Any]:
        """All columns of the row, by name."""
        named = {k: getattr(self, k) for k in self.__dataclass_fields__ if k != "more"}
        return named | self.more


@dataclass(frozen=True, kw_only=True)
class StudyResult:
    """Rows of a study, with summary, pages and the paths of its files."""

    rows: tuple[Row, ...]
    summary: tuple[str, ...] = ()
    """Lines for the terminal."""
    more: dict[str, Any] = field(default_factory=dict)
    """Further keys of the JSON object that ``--json`` prints."""
    content: Mapping[str, Any] | None = None
    """Keys of the JSON file besides ``rows``; if None, the file is a list of rows."""
    pages: Mapping[str, Page] = field(default_factory=dict)
    """Functions that return pictures and texts, by file name."""
    files: tuple[str, ...] = ()
    """Paths of the written files; empty until they are written."""
