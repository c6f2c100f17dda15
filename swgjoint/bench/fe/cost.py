"""``swgjoint bench fe``: error and run time of finite element models of the drive.

Every setting is compared with three references: the finest 3D model, the finest mesh of
its own kind, and the finest mesh of the next more accurate kind (ring, 2D, 3D; linear,
nonlinear).
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import (
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from swgjoint.bench.fe.rows import BOUNDS, QUANTITIES, cheapest, rows_of, seconds
from swgjoint.bench.fe.setting import POSITIONS, FeSetting, Found
from swgjoint.bench.fe.solve import SettingTask, solve_in_process
from swgjoint.csv_text import csv_text
from swgjoint.errors import ComputationError, DesignError
from swgjoint.fe.solid.drive3d import check_modelled
from swgjoint.files import Outputs
from swgjoint.gear.design.design import Design
from swgjoint.json_text import json_text
from swgjoint.progress import Progress, silent
from swgjoint.provenance import provenance
from swgjoint.view.plots.bench_fe import cost_picture

SETTINGS = (
    FeSetting(model="ring", refinement=0),
    FeSetting(model="ring", refinement=0.5),
    FeSetting(model="ring", refinement=1),
    FeSetting(model="2d", refinement=0.5, nonlinear=False),
    FeSetting(model="2d", refinement=1.0, nonlinear=False),
    FeSetting(model="2d", refinement=2.0, nonlinear=False),
    FeSetting(model="2d", refinement=0.5),
    FeSetting(model="2d", refinement=1.0),
    FeSetting(model="2d", refinement=1.0, full=True),
    FeSetting(model="2d", refinement=2.0),
    FeSetting(model="2d", refinement=4.0),
    FeSetting(model="3d", refinement=0.5, nonlinear=False),
    FeSetting(model="3d", refinement=1.0, nonlinear=False),
    FeSetting(model="3d", refinement=0.5),
    FeSetting(model="3d", refinement=0.5, full=True),
    FeSetting(model="3d", refinement=0.7),
    FeSetting(model="3d", refinement=1.0),
    FeSetting(model="3d", refinement=1.4),
)
"""Settings, from coarse to fine within each kind; the last one is the reference."""

LOST = "process died: out of memory or killed"
"""Outcome of a setting whose process died."""


def run_fe_cost(
    *,
    design: Design,
    settings: Sequence[FeSetting] = SETTINGS,
    folder: Path | None = None,
    progress: Progress = silent,
    jobs: int = 2,
) -> dict[str, Any]:
    """Solve every setting and compare the results.

    The reference is the last setting.

    Args:
        design: Design with a cup.
        settings: Settings, from coarse to fine within each kind.
        folder: Folder for table, JSON and picture; None writes nothing.
        progress: Called after every setting.
        jobs: Number of settings solved at the same time, each in a fresh process.

    Returns:
        ``rows``, see :func:`swgjoint.bench.fe.rows.rows_of`; ``cheapest``: cheapest
        setting by quantity and bound; ``cheapest_in_the_plane``: the same among the
        nonlinear 2D settings, compared with their finest mesh; ``design``;
        ``kinematic_error_positions``: number of positions per pitch at which the
        kinematic error is evaluated, enough for its first harmonic; ``provenance``,
        ``files``, ``wall_s``.

    Raises:
        DesignError: If the design has no cup, or a feature that the 3D model lacks.
        ComputationError: If the reference fails.
    """
    begin = time.perf_counter()
    if design.cup is None:
        raise DesignError(
            f"{design.drive.name}: bench fe compares with the 3D model, which needs a"
            " [cup]; accepted: a design with a cup, such as reference-3d-modified"
        )
    check_modelled(design)
    stage, best = f"{design.drive.name}: settings", settings[-1]
    found = _solve_all(design, settings, jobs=jobs, stage=stage, progress=progress)
    last = found[best.key]
    if isinstance(last, str):
        raise ComputationError(f"reference {best.key!r}: {last}")
    rows = rows_of(settings, found, best=best)
    result = {
        "design": design.drive.name,
        "rows": rows,
        "cheapest": cheapest(rows),
        "cheapest_in_the_plane": cheapest(rows, "2d"),
        "kinematic_error_positions": POSITIONS,
        "provenance": provenance(),
    }
    files: list[str] = []
    if folder is not None:
        outputs = Outputs(folder)
        outputs.write("bench-fe.json", lambda: json_text(result) + "\n")
        outputs.write("bench-fe.csv", lambda: csv_text(rows))
        outputs.write("bench-fe.png", lambda: _picture(result))
        files = outputs.files
    return result | {"files": files, "wall_s": time.perf_counter() - begin}


def _picture(result: Mapping[str, Any]) -> bytes:
    return cost_picture(result, quantities=QUANTITIES, bounds=BOUNDS, seconds=seconds)


def _solve_all(
    design: Design,
    settings: Sequence[FeSetting],
    *,
    jobs: int,
    stage: str,
    progress: Progress,
) -> dict[str, Found | str]:
    """Solve every setting in a process of its own, the longest first.

    Returns:
        Results by key of the setting, or the reason for missing results.
    """
    order = sorted(settings, key=_work, reverse=True)
    found: dict[str, Found | str] = {}
    progress(stage, 0, len(order))
    # each thread waits for one process, so a process that dies does not end the others
    threads = ThreadPoolExecutor(max_workers=jobs)
    with _one_thread():
        try:
            tasks = {
                threads.submit(_solved_apart, SettingTask(design=design, setting=s)): s
                for s in order
            }
            for future in as_completed(tasks):
                found[tasks[future].key] = future.result()
                progress(stage, len(found), len(order))
        finally:
            threads.shutdown(cancel_futures=True)
    return found


def _solved_apart(task: SettingTask) -> Found | str:
    """Solve a setting in its own process; return the reason if there is no solution."""
    context = get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=context) as process:
        try:
            return process.submit(solve_in_process, task).result()
        except BrokenProcessPool:
            return LOST
        except MemoryError:
            return "out of memory"


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes started in this context use one thread for linear algebra.

    Additional threads would increase the CPU time. The limit must be in the environment
    of a new process, because the process loads its algebra library before it runs any
    code of this package.
    """
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _work(setting: FeSetting) -> float:
    """Estimated run time [s]."""
    base = {"ring": 6.0, "2d": 5.0, "3d": 150.0}[setting.model]
    active_sets = 3.0 if setting.kind == "3d linear" else 1.0
    return (2 if setting.full else 1) * active_sets * base * setting.refinement**2
