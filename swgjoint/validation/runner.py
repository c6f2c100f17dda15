"""List of all studies, and functions that run them and write their files.

A study is a function that takes :class:`StudyOptions` and returns a
:class:`StudyResult`. It does not write to disk; :func:`run_study` writes its files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Protocol, TypeVar

from swgjoint.csv_text import csv_text
from swgjoint.errors import InputError
from swgjoint.files import Outputs
from swgjoint.json_text import json_text
from swgjoint.pool import run_all
from swgjoint.validation.rows import StudyOptions, StudyResult


@dataclass(frozen=True, kw_only=True)
class StudyEntry:
    """One study: its function, title and models."""

    function: str
    """Function as ``module:function``; the module is imported when the study runs."""
    title: str
    """Description of the comparison in one line."""
    models: tuple[str, ...] = ()
    """Accepted values of ``--model``; empty if the option is not accepted."""
    model_reason: str = ""
    """Why no other model is accepted."""

    def load(self) -> Callable[[StudyOptions], StudyResult]:
        """Import and return the function of the study."""
        module, _, function = self.function.partition(":")
        loaded: Callable[[StudyOptions], StudyResult] = getattr(
            import_module(f"swgjoint.validation.{module}"), function
        )
        return loaded


STUDIES = {
    "thesis": StudyEntry(
        function="thesis.thesis:run_thesis",
        title="stresses of the thesis, chapters 4 to 6 in 2D or chapter 7 in 3D",
        models=("2d", "3d"),
    ),
    "ring": StudyEntry(
        function="ring:run_ring",
        title="deflection of a plain ring pulled apart by two rollers, thesis"
        " appendix A",
        models=("2d",),
        model_reason="the plain ring is two-dimensional",
    ),
    "articles": StudyEntry(
        function="articles.articles:run_articles",
        title="force, deflection, stress and fatigue results of three articles, in 3D",
        models=("3d",),
        model_reason="the articles need the 3D model",
    ),
    "catalogue": StudyEntry(
        function="catalogue.catalogue:run_catalogue",
        title="stiffness, accuracy, losses and ratcheting of a family of drives,"
        " compared with a catalogue",
        model_reason="the study fixes the model of each quantity",
    ),
    "response": StudyEntry(
        function="response:run_response",
        title="two-mass frequency response of a joint, compared with its closed form",
        models=("2d", "3d"),
    ),
    "control": StudyEntry(
        function="control.ladder:run_control",
        title="controllers of one joint, from PD to learning and MPC, on specimens of a"
        " drive",
        models=("2d", "3d"),
    ),
}
"""All studies by name."""


def run_study(name: str, options: StudyOptions) -> StudyResult:
    """Run a study and write its files.

    The folder receives ``<name>.json`` and ``<name>.csv`` with all rows, and the
    study's own pictures and texts. If a file cannot be written, a warning is issued and
    the other files are still written.

    Args:
        name: Key of :data:`STUDIES`.
        options: Parts, model, number of processes and folder.

    Returns:
        Rows and summary, with the paths of the files.

    Raises:
        InputError: If the study is unknown or does not accept the model or a part.
    """
    entry = STUDIES.get(name)
    if entry is None:
        raise InputError(f"study {name!r}; accepted: {', '.join(STUDIES)}")
    if options.model not in (None, *entry.models):
        accepted = ", ".join(entry.models) or "none"
        raise InputError(
            f"--model {options.model}: {entry.model_reason}; accepted: {accepted}"
        )
    result = entry.load()(options)
    return (
        result if options.folder is None else write_study(name, result, options.folder)
    )


def write_study(name: str, result: StudyResult, folder: Path) -> StudyResult:
    """Write the files of a study.

    Args:
        name: Name of the study and of its tables.
        result: Rows and pages.
        folder: Folder of the files, created if it does not exist.

    Returns:
        The result with the paths of the files.
    """
    outputs = Outputs(folder)
    rows = [row.to_json() for row in result.rows]
    content = rows if result.content is None else {"rows": rows, **result.content}
    outputs.write(f"{name}.json", lambda: json_text(content) + "\n")
    outputs.write(f"{name}.csv", lambda: csv_text(rows) or None)
    for file, make in result.pages.items():
        outputs.write(file, make)
    return replace(result, files=tuple(outputs.files))


class Computation(Protocol):
    """One computation of a study, picklable."""

    @property
    def name(self) -> str:
        """Name that identifies the computation and its result."""

    @property
    def work(self) -> float:
        """Estimated relative work, so that long computations start first."""


Task = TypeVar("Task", bound=Computation)
Found = TypeVar("Found")


def compute_all(
    compute: Callable[[Task], Found],
    tasks: Iterable[Task],
    options: StudyOptions,
    *,
    stage: str = "computations",
) -> dict[str, Found]:
    """Run computations and return their results by name.

    Computations with equal names are run only once.

    Args:
        compute: Picklable function of one task, called in other processes.
        tasks: Computations of all parts.
        options: Options, of which the number of processes and the progress are used.
        stage: Name of the stage in progress reports.
    """
    by_name = {task.name: task for task in tasks}
    ordered = sorted(by_name.values(), key=lambda task: -task.work)
    results = run_all(
        compute, ordered, jobs=options.jobs, stage=stage, progress=options.progress
    )
    return dict(zip((task.name for task in ordered), results, strict=True))
