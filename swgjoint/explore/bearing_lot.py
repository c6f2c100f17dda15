"""Accuracy, lost motion and stiffness of a lot of drives on their bearing.

Each drive has its ball bearing, its cup and its own errors of teeth and wave generator;
the bearing clearance may be random as well. The thin rings of each drive are linearised
under load, and the errors of its teeth are superposed over an output turn.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.code_hash import code_hash
from swgjoint.errors import ComputationError, DesignError
from swgjoint.explore.lot import draw, summarise_lot
from swgjoint.fe.plane.drive2d import in_plane, unmodelled_parts
from swgjoint.fe.rings.lot import (
    PerfectRings,
    perfect_rings,
    sample_turn,
    turn_superposition_error,
)
from swgjoint.fe.rings.model import thin_ring
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors
from swgjoint.maps.cache import entry_of, recall_kept
from swgjoint.maps.sheet.loop import LOST_MOTION_TORQUE
from swgjoint.maps.sheet.sampled_accuracy import accuracy_bracket
from swgjoint.pool import run_all
from swgjoint.progress import Progress, silent
from swgjoint.store import json_file, keep
from swgjoint.units import arcmin

FIGURES = ("transmission_accuracy_arcmin", "lost_motion_arcmin", "K1_Nm_rad")
_CLEARANCE_STREAM = 101
"""Stream of the random clearance of a drive; its errors have other streams."""


@dataclass(frozen=True, kw_only=True)
class DriveOnBearing:
    """One drive of the lot; its figures are None if it has no equilibrium."""

    seed: int
    clearance_um: float
    """Radial internal clearance of the bearing, a difference of diameters [um]."""
    transmission_accuracy_arcmin: float | None
    """Peak-to-peak kinematic error over one output turn [arcmin]."""
    lost_motion_arcmin: float | None
    """Torsion between +4 % and -4 % of the rated torque, mean over an output turn
    [arcmin]."""
    K1_Nm_rad: float | None
    """Slope of the centre line between zero and T1, mean over an output turn
    [N·m/rad]."""
    superposition_error: float | None = None
    """Deviation of the kinematic error from full solves, divided by its peak-to-peak
    value [-]; None if it was not compared."""

    @property
    def failed(self) -> bool:
        """Whether a position has no equilibrium."""
        return self.transmission_accuracy_arcmin is None


@dataclass(frozen=True, kw_only=True)
class _Task:
    design: Design
    perfect: PerfectRings
    path: Path | None
    """File in which the drive is stored."""
    seed: int
    sizes: str
    clearance_um: tuple[float, float] | None
    compare: bool
    """Whether the drive is also solved without linearisation."""


def draw_on_bearing(
    design: Design, seed: int, sizes: str, clearance_um: tuple[float, float] | None
) -> Design:
    """Draw one drive of a design with a bearing.

    Args:
        design: Design with tolerances and a bearing.
        seed: Seed of all errors of the drive.
        sizes: Meaning of the tolerances, see :data:`swgjoint.explore.lot.SIZES`.
        clearance_um: Limits between which the clearance is uniformly distributed [um];
            None keeps the clearance of the design.
    """
    drive = draw(design, seed, sizes)
    if clearance_um is None:
        return drive
    rng = np.random.default_rng([seed, _CLEARANCE_STREAM])
    value = float(rng.uniform(*clearance_um))
    return drive.with_changes({"wave_generator.bearing.clearance_um": value})


def run_bearing_lot(
    design: Design,
    *,
    count: int = 200,
    seed: int = 1,
    sizes: str = "limit",
    clearance_um: tuple[float, float] | None = None,
    spec: Mapping[str, float] | None = None,
    jobs: int = 1,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Draw and solve a lot of drives on their bearing, and its yield against a spec.

    Drives are stored in the user's cache as soon as they are solved.

    Args:
        design: Design with nonzero tolerances and a wave-generator bearing.
        count: Number of drives.
        seed: Seed of the first drive; the others follow consecutively.
        sizes: Meaning of the tolerances, see :data:`swgjoint.explore.lot.SIZES`.
        clearance_um: Limits of the bearing clearance, see :func:`draw_on_bearing`.
        spec: Limits by figure of :data:`FIGURES`; K1 has a lower limit.
        jobs: Number of processes.
        progress: Called with the stage, the number of finished drives and their total.

    Returns:
        As :func:`swgjoint.explore.lot.run_lot`, with the fields of
        :class:`DriveOnBearing` in ``rows`` and the limits ``clearance_um``.

    Raises:
        DesignError: If the rings lack a feature of the design, or it has no errors.
    """
    begin = time.perf_counter()
    modelled = in_plane(design)
    if not has_errors(modelled):
        raise DesignError(
            f"{design.drive.name}: all tolerances that thin rings have are zero;"
            " accepted: a positive value of at least one key of [tolerances] besides"
            " misalignment_arcmin"
        )
    thin_ring(modelled)
    name = design.drive.name
    parts = {
        "bearing lot": _own_version(),
        "design": modelled.content_hash(),
        "sizes": sizes,
        "clearance_um": clearance_um,
    }
    paths = {
        one: entry_of("lots", {**parts, "seed": one, "compare": one == seed})
        for one in range(seed, seed + count)
    }
    found = {
        one: row
        for one, path in paths.items()
        if (row := recall_kept(path, DriveOnBearing))
    }
    left = [one for one in paths if one not in found]
    tasks = []
    if left:
        progress(f"{name}: drive without errors", 0, 1)
        perfect = perfect_rings(modelled, _torques(modelled))
        progress(f"{name}: drive without errors", 1, 1)
        tasks = [
            _Task(
                design=modelled,
                perfect=perfect,
                path=paths[one],
                seed=one,
                sizes=sizes,
                clearance_um=clearance_um,
                compare=one == seed,
            )
            for one in left
        ]

    def report(stage: str, done: int, total: int) -> None:
        progress(stage, len(found) + done, count)

    solved = run_all(
        _stored, tasks, jobs=jobs, stage=f"{name}: drives", progress=report
    )
    rows = sorted([*found.values(), *solved], key=lambda row: row.seed)
    return summarise_lot(rows, FIGURES, spec) | {
        "design": name,
        "sizes": sizes,
        "clearance_um": clearance_um,
        "validity": {
            "level": "ring, errors superposed",
            "torque_Nm": ratings_of(design).T1,
            "left_out": unmodelled_parts(design, "ring"),
            "friction": "left out",
            "cup": None if design.cup is None else "closed-form torsion in series",
            "superposition_error": rows[0].superposition_error,
        },
        "wall_s": time.perf_counter() - begin,
    }


def _stored(task: _Task) -> DriveOnBearing:
    """Solve one drive and store it."""
    found = _solved(task)
    if task.path is not None:
        keep(task.path, json_file(found))
    return found


@lru_cache
def _own_version() -> str:
    return code_hash("explore/bearing_lot.py", "explore/lot.py")


def _torques(design: Design) -> tuple[float, float]:
    """Torques of lost motion and of K1 [N·m]."""
    ratings = ratings_of(design)
    return LOST_MOTION_TORQUE * ratings.rated_torque, ratings.T1


def _solved(task: _Task) -> DriveOnBearing:
    """Draw one drive and compute its figures."""
    drive = draw_on_bearing(task.design, task.seed, task.sizes, task.clearance_um)
    bearing = drive.wave_generator.bearing
    assert bearing is not None
    lost, first = _torques(drive)
    try:
        turn = sample_turn(drive, (lost, first), task.perfect)
    except ComputationError:
        turn = None
    if turn is None or not np.isfinite(turn.output_error).all():
        return DriveOnBearing(
            seed=task.seed,
            clearance_um=bearing.clearance_um,
            transmission_accuracy_arcmin=None,
            lost_motion_arcmin=None,
            K1_Nm_rad=None,
        )
    samples = {
        "input_angles_rad": turn.input_angle,
        "error_rad": turn.kinematic_error,
    }
    return DriveOnBearing(
        seed=task.seed,
        clearance_um=bearing.clearance_um,
        transmission_accuracy_arcmin=0.5 * sum(accuracy_bracket(samples, drive)),
        lost_motion_arcmin=2.0 * float(turn.torsion(lost).mean()) / arcmin,
        K1_Nm_rad=first / float(turn.torsion(first).mean()),
        superposition_error=(
            turn_superposition_error(drive, turn) if task.compare else None
        ),
    )
