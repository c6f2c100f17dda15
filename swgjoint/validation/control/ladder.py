"""``swgjoint study control``: a ladder of baseline controllers for one joint.

The controllers run on the bench joint with specimens of a drive, ten by default. Phases
of the errors, friction, load and sensor noise of a specimen are random. Every
controller except the first one extends another controller by one feature and targets
one figure. These targets were chosen before any run, except that of predictive control,
which was chosen after a trial on two specimens. The figures come from three motions: a
fast move (tracking), one slow output turn in one direction (positioning), and a turn at
constant speed after learning (ripple).

All controllers read the motor encoder. Learning and predictive control also read the
link encoder, and so does the recorder of the turn from which the error table is
identified. Readings are one control period of 1 ms old, as in the environments. The
controllers know this age and compare a reading with the plan at the time of the
reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.kinematic_error import (
    KinematicErrorTable,
    compensate,
    identify_kinematic_error,
)
from swgjoint.control.learning import LearningCompensation
from swgjoint.control.motor_side import MotorPID, ideal_plan, rigid_plan
from swgjoint.control.mpc import PredictiveController
from swgjoint.drives.references import load_drive
from swgjoint.files import file_name
from swgjoint.maps.drive_map import DriveMap
from swgjoint.pool import run_all
from swgjoint.progress import Progress, silent
from swgjoint.sim.controller import Controller
from swgjoint.typing import Array
from swgjoint.validation.control.bench import (
    DELAY,
    FREQUENCY,
    MOTIONS,
    UNITS,
    figures_of,
    record_turn,
    run_motion,
    signals_of,
)
from swgjoint.validation.control.specimens import nominal, specimen
from swgjoint.validation.rows import Page, Row, StudyOptions, StudyResult

DRIVE = "CSG-25-100"
SEEDS = 10
"""Default number of specimens."""
LEARNED = ((1, 1), *((p, 0) for p in range(1, 9)), *((0, q) for q in range(1, 9)))
"""Learned orders (p, q): 1 to 8 of either member, and their combination (1, 1)."""

Build = Callable[[KinematicErrorTable], Controller]


@dataclass(frozen=True, kw_only=True)
class Rung:
    """One controller of the ladder."""

    name: str
    build: Build
    """Function that builds the controller from the error table of the specimen."""
    made_for: str | None = None
    """Figure of :data:`UNITS` that the controller targets; None for the first rung."""
    over: str | None = None
    """Name of the rung that this one extends; None for the first rung."""


def _plan(planner: Any) -> Build:
    return lambda table: MotorPID(planner, frequency=FREQUENCY)


def _compensated(table: KinematicErrorTable) -> Controller:
    return MotorPID(compensate([table]), frequency=FREQUENCY)


def _predictive(table: KinematicErrorTable) -> Controller:
    return PredictiveController(compensate([table]))


def _learning(inner: Build, table: KinematicErrorTable) -> Controller:
    return LearningCompensation(inner(table), orders=LEARNED, rate=0.7)


RUNGS = (
    Rung(name="PD", build=_plan(ideal_plan)),
    Rung(
        name="+ feed-forward",
        build=_plan(rigid_plan),
        made_for="tracking_rms",
        over="PD",
    ),
    Rung(
        name="+ flexible joint",
        build=_plan(flexible_plan),
        made_for="tracking_rms",
        over="+ feed-forward",
    ),
    Rung(
        name="+ kinematic error",
        build=_compensated,
        made_for="positioning_pp",
        over="+ flexible joint",
    ),
    Rung(
        name="+ learning",
        build=partial(_learning, _compensated),
        made_for="ripple_rms",
        over="+ kinematic error",
    ),
    Rung(
        name="MPC",
        build=_predictive,
        made_for="tracking_peak",
        over="+ kinematic error",
    ),
    Rung(
        name="flexible joint, learning",
        build=partial(_learning, _plan(flexible_plan)),
        made_for="two_per_turn",
        over="+ flexible joint",
    ),
)
NAMES = tuple(rung.name for rung in RUNGS)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ladder:
    """Results of the rungs on one drive."""

    drive: DriveMap
    figures: dict[str, dict[str, Array]]
    """Values by rung and figure, in the units of :data:`UNITS`, shape (n_seeds,) each.
    """
    shown: dict[str, dict[str, Array]]
    """Signals to plot by rung, for the first specimen."""

    @property
    def units(self) -> Mapping[str, str]:
        """Units of the figures."""
        return UNITS

    @property
    def made_for(self) -> dict[str, str | None]:
        """Target figure by rung."""
        return {rung.name: rung.made_for for rung in RUNGS}

    def improvement(self, rung: Rung) -> tuple[float, int]:
        """Compare the target figure of a rung with that of the rung it extends.

        Returns:
            Ratio of the means, smaller than one for an improvement [-], and the number
            of specimens on which the figure improved.
        """
        assert rung.made_for is not None and rung.over is not None
        after, before = (
            self.figures[name][rung.made_for] for name in (rung.name, rung.over)
        )
        return float(after.mean() / before.mean()), int((after < before).sum())


def climb(
    drive: DriveMap,
    *,
    seeds: int = SEEDS,
    jobs: int = 1,
    rungs: tuple[str, ...] = NAMES,
    progress: Progress = silent,
) -> Ladder:
    """Run the rungs on specimens of a drive.

    Args:
        drive: Nominal drive of the specimens; the controllers know its mean curve.
        seeds: Number of specimens.
        jobs: Number of processes.
        rungs: Names of the rungs to run.
        progress: Called with the stage, the number of finished specimens and the total.

    Returns:
        Figures of all specimens, and signals of the first one.
    """
    tasks = [(drive, seed, rungs) for seed in range(seeds)]
    found = run_all(_one_seed, tasks, jobs=jobs, stage="specimens", progress=progress)
    return Ladder(
        drive=drive,
        figures={
            name: {key: np.array([one[0][name][key] for one in found]) for key in UNITS}
            for name in rungs
        },
        shown=found[0][1],
    )


def _one_seed(
    task: tuple[DriveMap, int, tuple[str, ...]],
) -> tuple[dict[str, dict[str, float]], dict[str, dict[str, Array]]]:
    """Figures and plotted signals of all rungs on one specimen."""
    drive, seed, names = task
    table = identify_kinematic_error(record_turn(drive, seed), nominal(drive))
    plant = specimen(drive, seed)
    figures, shown = {}, {}
    for rung in RUNGS:
        if rung.name not in names:
            continue
        runs = {
            motion: run_motion(drive, plant, rung.build(table), motion, seed)
            for motion in MOTIONS
        }
        figures[rung.name] = figures_of(runs)
        shown[rung.name] = signals_of(runs) if seed == 0 else {}
    return figures, shown


def run_control(options: StudyOptions) -> StudyResult:
    """Run all controllers on specimens of every drive.

    ``only`` names drives, maps or designs to use instead of the default drive.

    Raises:
        InputError: If a drive is unknown, or if a model is given for a drive that is
            not a design.
    """
    from swgjoint.view.plots.control import ladder_picture, ladder_table

    pages: dict[str, Page] = {}
    references, seeds = options.only or (DRIVE,), options.seeds or SEEDS
    drives = {
        # the specimens get their own kinematic errors, which have more orders
        name: load_drive(name, model=options.model, kinematic_error_arcmin=0.0)
        for name in references
    }
    rows: list[Row] = []
    summary, more = [], {}
    for name, drive in drives.items():
        found = climb(drive, seeds=seeds, jobs=options.jobs, progress=options.progress)
        rows += ladder_rows(name, found)
        summary += [
            f"{name}, {seeds} specimens, readings {1e3 * DELAY:g} ms old,"
            " mean ± standard deviation:"
        ]
        summary += [*ladder_table(found), *ladder_claims(found)]
        more[name] = {
            rung: {key: values.tolist() for key, values in figures.items()}
            for rung, figures in found.figures.items()
        }
        picture = partial(ladder_picture, name, found)
        pages[f"control-{file_name(drive.name)}.png"] = picture
    return StudyResult(
        rows=tuple(rows),
        summary=tuple(summary),
        more={"values": more},
        content={"values": more},
        pages=pages,
    )


def ladder_rows(name: str, found: Ladder) -> list[Row]:
    """Rows of the mean figures, one per rung and figure.

    Args:
        name: Name of the drive.
        found: Results of the rungs.
    """
    made_for = {rung.name: rung.made_for for rung in RUNGS}
    return [
        Row(
            case=f"{name}, {rung}",
            quantity=key,
            unit=UNITS[key],
            source_value=None,
            ours=float(values.mean()),
            reason="target of this controller" if made_for[rung] == key else None,
            more={"spread": float(values.std(ddof=min(1, values.size - 1)))},
        )
        for rung, figures in found.figures.items()
        for key, values in figures.items()
    ]


def ladder_claims(found: Ladder) -> list[str]:
    """Lines on the target figures: one per rung that extends another one."""
    lines = []
    for rung in RUNGS:
        if rung.made_for is None or not {rung.name, rung.over} <= set(found.figures):
            continue
        share, better = found.improvement(rung)
        count = len(found.figures[rung.name][rung.made_for])
        lines.append(
            f"{rung.name}: {rung.made_for} is {share:.3g} times that of {rung.over!r},"
            f" better on {better} of {count} specimens"
        )
    return lines
