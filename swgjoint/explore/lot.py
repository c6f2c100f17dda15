"""Accuracy and yield of a lot of drives of one design.

The errors of each drive are drawn with a seed of its own. The tolerances of the design
have one of two meanings. With ``limit``, they are the sizes of the errors, which gives
the worst lot that may be delivered. With ``uniform``, they are upper limits, and each
size is drawn between zero and its limit.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from swgjoint.code_hash import code_hash
from swgjoint.errors import DesignError
from swgjoint.fe.plane.drive2d import in_plane, unmodelled_parts
from swgjoint.fe.tolerances.lot import (
    Lot,
    perfect_positions,
    sample_lot,
    superposition_error,
)
from swgjoint.fe.tolerances.rest import Rest
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors
from swgjoint.maps.cache import entry_of, recall, recall_kept
from swgjoint.maps.sheet.sampled_accuracy import REST, peaks
from swgjoint.pool import run_all
from swgjoint.progress import Progress, silent
from swgjoint.store import json_file, keep
from swgjoint.units import arcmin

FIGURES = (
    "transmission_accuracy_arcmin",
    "ripple_rms_percent",
    "torsional_stiffness_Nm_rad",
)
"""Figures of a lot in 2D."""
LOWER = ("torsional_stiffness_Nm_rad", "K1_Nm_rad")
"""Figures with a lower limit; the others have an upper one."""
SIZES = ("limit", "uniform")
"""Meanings of the tolerances: sizes of the errors, or upper limits of these sizes."""

CHUNK = 10
"""Number of drives per task. A task takes a few seconds and contains tens of megabytes
of error-free positions. Each drive is stored as soon as it is solved."""
_SIZE_STREAM = 100
"""Stream of the random sizes of a drive; the streams of its errors have lower
numbers."""


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """One drive of the lot; its figures are None if it has no equilibrium."""

    seed: int
    transmission_accuracy_arcmin: float | None
    """Peak-to-peak kinematic error over one output turn [arcmin]: midpoint of a lower
    estimate from the low orders and the samples, and an upper estimate that adds the
    largest contribution of the remaining orders. With the wave generator fixed, the
    error differs from turn to turn; the value refers to the first turn."""
    ripple_rms_percent: float | None
    """Rms torque ripple at rated torque, with the output constrained to its ideal
    motion [% of rated torque]."""
    torsional_stiffness_Nm_rad: float | None
    """Mean tangent stiffness at rated torque [N·m/rad]."""

    @property
    def failed(self) -> bool:
        """Whether a position has no equilibrium."""
        return self.transmission_accuracy_arcmin is None


@dataclass(frozen=True, kw_only=True)
class _Judged:
    """Stored :func:`superposition_error` of the first drive."""

    error: float | None
    """Relative deviation from full solves [-]; None if none of them succeeded."""


@dataclass(frozen=True, kw_only=True)
class _Task:
    rests: Sequence[Rest]
    drives: tuple[Design, ...]
    paths: tuple[Path | None, ...]
    """Files in which the drives are stored."""


def draw(design: Design, seed: int, sizes: str = "limit") -> Design:
    """Draw one drive of a design.

    Args:
        design: Design whose ``tolerances`` are the sizes of the errors or their limits.
        seed: Seed of all errors of the drive.
        sizes: Meaning of the tolerances, one of :data:`SIZES`.
    """
    changes: dict[str, Any] = {"tolerances.seed": seed}
    if sizes == "uniform":
        rng = np.random.default_rng([seed, _SIZE_STREAM])
        limits = design.tolerances.model_dump(exclude={"seed"})
        changes |= {
            f"tolerances.{key}": limit * float(part)
            for (key, limit), part in zip(
                limits.items(), rng.uniform(size=len(limits)), strict=True
            )
        }
    return design.with_changes(changes)


def run_lot(
    design: Design,
    *,
    count: int = 500,
    seed: int = 1,
    sizes: str = "limit",
    spec: Mapping[str, float] | None = None,
    jobs: int = 1,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Draw and solve a lot of drives and compute its yield against a spec.

    Drives are stored in the user's cache as soon as they are solved: an interrupted lot
    resumes, and a longer lot solves only the additional drives.

    Args:
        design: Design with nonzero tolerances.
        count: Number of drives.
        seed: Seed of the first drive; the others follow consecutively.
        sizes: Meaning of the tolerances of the design, see :data:`SIZES`.
        spec: Limits by figure, see :data:`FIGURES` and :data:`LOWER`.
        jobs: Number of processes.
        progress: Called with the stage, the number of finished drives and their total.

    Returns:
        ``rows`` (fields of :class:`Drawn` and, with a spec, ``passed``), ``figures``
        (:func:`distribution` of each figure), ``yield`` (None without a spec; fraction
        ``part`` of drives that pass, its 95 % interval ``low`` to ``high``, and in
        ``by_limit`` the same for each limit alone), ``validity`` (level, torque,
        effects left out, and ``superposition_error``, see
        :func:`~swgjoint.fe.tolerances.lot.superposition_error`, of the first drive),
        ``failed`` (number of drives without solution), ``wall_s``, ``sizes``, ``spec``,
        ``design``.

    Raises:
        DesignError: If the design cannot be built, or has no errors to draw.
        ComputationError: If the drive without errors cannot be solved.
    """
    begin = time.perf_counter()
    modelled = in_plane(design)
    if not has_errors(modelled):
        raise DesignError(
            f"{design.drive.name}: all tolerances that a 2D model has are zero;"
            " accepted: a positive value of at least one key of [tolerances] besides"
            " misalignment_arcmin"
        )
    name = design.drive.name
    parts = {
        "lot": _own_version(),
        "design": design.content_hash(),
        "sizes": sizes,
    }

    @cache
    def rests() -> Sequence[Rest]:
        progress(f"{name}: drive without errors", 0, 1)
        found = perfect_positions(modelled)
        progress(f"{name}: drive without errors", 1, 1)
        return found

    def judged() -> _Judged:
        perfect = rests()
        progress(f"{name}: full solves", 0, 1)
        error = superposition_error(draw(modelled, seed, sizes), perfect)
        progress(f"{name}: full solves", 1, 1)
        return _Judged(error=error)

    off = recall("lots", {**parts, "full solves": seed}, _Judged, judged).error
    paths = {
        one: entry_of("lots", {**parts, "seed": one})
        for one in range(seed, seed + count)
    }
    found = {
        one: row for one, path in paths.items() if (row := recall_kept(path, Drawn))
    }
    left = [one for one in paths if one not in found]
    tasks = [
        _Task(
            rests=rests(),
            drives=tuple(draw(modelled, one, sizes) for one in seeds),
            paths=tuple(paths[one] for one in seeds),
        )
        for seeds in (left[k : k + CHUNK] for k in range(0, len(left), CHUNK))
    ]

    def report(stage: str, done: int, total: int) -> None:
        progress(stage, len(found) + min(CHUNK * done, len(left)), count)

    solved_now = run_all(
        _solved, tasks, jobs=jobs, stage=f"{name}: drives", progress=report
    )
    rows = [*found.values(), *(row for part in solved_now for row in part)]
    rows.sort(key=lambda row: row.seed)
    return summarise_lot(rows, FIGURES, spec) | {
        "design": design.drive.name,
        "sizes": sizes,
        "validity": {
            "level": "2d, errors superposed",
            "torque_Nm": ratings_of(design).rated_torque,
            "left_out": unmodelled_parts(design, bearing=False),
            "friction": "none",
            "cup": None if design.cup is None else "closed-form torsion in series",
            "superposition_error": off,
        },
        "wall_s": time.perf_counter() - begin,
    }


def summarise_lot(
    rows: Sequence[Any], figures: Sequence[str], spec: Mapping[str, float] | None
) -> dict[str, Any]:
    """Distributions and yield of the drives of a lot.

    Args:
        rows: Data of the drives, with ``figures`` and ``failed`` as attributes.
        figures: Names of the figures, which are None for drives without a solution.
        spec: Limits by figure; those in :data:`LOWER` are lower limits.

    Returns:
        ``rows``, ``figures``, ``yield``, ``failed`` and ``spec`` of :func:`run_lot`.
    """
    solved = [row for row in rows if not row.failed]

    def meets(row: Any, limits: Mapping[str, float]) -> bool:
        return not row.failed and all(
            getattr(row, key) >= limit if key in LOWER else getattr(row, key) <= limit
            for key, limit in limits.items()
        )

    def part(limits: Mapping[str, float]) -> dict[str, float]:
        return wilson(sum(meets(row, limits) for row in rows), len(rows))

    yields = None
    if spec is not None:
        by_limit = {key: part({key: spec[key]}) for key in spec}
        yields = {**part(spec), "by_limit": by_limit}
    return {
        "spec": None if spec is None else dict(spec),
        "rows": [
            vars(row) | ({} if spec is None else {"passed": meets(row, spec)})
            for row in rows
        ],
        "figures": {
            key: distribution([getattr(row, key) for row in solved]) for key in figures
        },
        "yield": yields,
        "failed": len(rows) - len(solved),
    }


def distribution(values: Sequence[float]) -> dict[str, float] | None:
    """Mean, standard deviation and percentiles; None without values."""
    if not values:
        return None
    found = {"mean": float(np.mean(values)), "std": float(np.std(values))}
    for percent in (1, 5, 50, 95, 99):
        found[f"p{percent}"] = float(np.percentile(values, percent))
    return found


def wilson(passed: int, count: int) -> dict[str, float]:
    """Fraction that passed and its 95 % score interval (Wilson 1927).

    Args:
        passed: Number of drives that passed.
        count: Number of drives, at least one.

    >>> {key: round(value, 3) for key, value in wilson(9, 10).items()}
    {'part': 0.9, 'low': 0.596, 'high': 0.982}
    """
    interval = binomtest(passed, count).proportion_ci(0.95, method="wilson")
    return {
        "part": passed / count,
        "low": float(interval.low),
        "high": float(interval.high),
    }


@lru_cache
def _own_version() -> str:
    """Hash of the code that turns the output errors of a drive into its figures."""
    return code_hash("explore/lot.py", "maps/sheet/sampled_accuracy.py")


def _solved(task: _Task) -> list[Drawn]:
    pairs = zip(task.drives, task.paths, strict=True)
    return [_one(task.rests, drive, path) for drive, path in pairs]


def _one(rests: Sequence[Rest], drive: Design, path: Path | None) -> Drawn:
    """Solve one drive alone, because a batch would change its round-off; store it."""
    found = _figures(sample_lot([drive], rests), 0, drive)
    if path is not None:
        keep(path, json_file(found))
    return found


def _figures(lot: Lot, n: int, drive: Design) -> Drawn:
    unloaded, loaded, compliance = lot.unloaded[n], lot.loaded[n], lot.compliance[n]
    seed = drive.tolerances.seed
    if not np.isfinite([unloaded, loaded, compliance]).all():
        return Drawn(
            seed=seed,
            transmission_accuracy_arcmin=None,
            ripple_rms_percent=None,
            torsional_stiffness_Nm_rad=None,
        )
    low, rest = peaks(lot.input_angle, unloaded, drive)
    sure = max(low, float(np.ptp(unloaded)))
    most = max(sure, low + 2.0 * REST * rest)
    if lot.whole[n]:
        sure = most = float(np.ptp(unloaded))
    # torque change that keeps the output on its ideal motion in spite of the error
    torque = (loaded - loaded.mean()) / compliance
    rated = ratings_of(drive).rated_torque
    return Drawn(
        seed=seed,
        transmission_accuracy_arcmin=0.5 * (sure + most) / arcmin,
        ripple_rms_percent=100.0 * float(torque.std()) / rated,
        torsional_stiffness_Nm_rad=float(np.mean(1.0 / compliance)),
    )
