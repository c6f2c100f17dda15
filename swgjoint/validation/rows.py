"""Rows that every study returns: our values compared with those of a source."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swgjoint.errors import InputError
from swgjoint.progress import Progress, silent

Page = Callable[[], bytes | str | None]
"""Makes the content of a file when it is written; None writes no file."""


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """Options of ``swgjoint study``; a study refuses those that it has no use for."""

    only: tuple[str, ...] = ()
    """Parts to run; all without."""
    model: str | None = None
    """Fidelity, ``2d`` or ``3d``; None for the study's own."""
    jobs: int = 1
    """Processes."""
    seeds: int | None = None
    """Specimens to draw; None for the study's own number."""
    folder: Path | None = None
    """Where tables, report and plots go; None writes nothing."""
    load_inertia: float | None = None
    """Inertia of the load about the output [kg·m²]; None for the study's own."""
    rotor_inertia: float | None = None
    """Of rotor and wave generator about the input [kg·m²]; None for the study's own."""
    closed_form: bool = False
    """Whether closed forms are enough, without simulation."""
    progress: Progress = silent

    def chosen(self, parts: Sequence[str]) -> list[str]:
        """Those of a study's parts that are to be run, in its order.

        Raises:
            InputError: If one is wanted that the study does not have.
        """
        unknown = [part for part in self.only if part not in parts]
        if unknown:
            raise InputError(
                f"--only {','.join(unknown)}: no such part; accepted:"
                f" {', '.join(parts)}"
            )
        return [part for part in parts if not self.only or part in self.only]


@dataclass(frozen=True, kw_only=True)
class Row:
    """One quantity of one case: the source's value and ours."""

    case: str
    quantity: str
    unit: str
    source_value: float | None
    """None where the source holds it back or prints no number."""
    ours: float | None
    """None where the computation failed; ``reason`` then says why."""
    converged: float | None = None
    """Mesh-converged value; None where it was not computed."""
    reason: str | None = None
    """Why ours differs or is missing."""
    more: dict[str, Any] = field(default_factory=dict)
    """Further columns of this study."""

    def to_json(self) -> dict[str, Any]:
        """All columns side by side."""
        named = {k: getattr(self, k) for k in self.__dataclass_fields__ if k != "more"}
        return named | self.more


@dataclass(frozen=True, kw_only=True)
class StudyResult:
    """Rows of a study, what they add up to, and the files written."""

    rows: tuple[Row, ...]
    summary: tuple[str, ...] = ()
    """Lines for the terminal."""
    more: dict[str, Any] = field(default_factory=dict)
    """Further keys of the JSON object."""
    content: Mapping[str, Any] | None = None
    """Keys of the JSON file besides ``rows``; None: the file is the list of rows."""
    pages: Mapping[str, Page] = field(default_factory=dict)
    """Pictures and texts by file name."""
    files: tuple[str, ...] = ()
    """Paths of the files that were written."""
