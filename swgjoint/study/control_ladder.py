"""``swgjoint study control``: the ladder of baselines for the control of one joint.

Specimens of a drive on the bench joint, ten by default: phases of the errors, friction,
load and sensor noise are drawn. Every controller adds one thing to the one before it
and is made for one figure, named in :data:`RUNGS` before any run. Three motions tell
the figures: a fast move (tracking), one slow turn of the output in one direction
(positioning), a turn at constant speed after learning (ripple).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.kinematic_error import (
    JointRecord,
    KinematicErrorTable,
    Recorder,
    compensated,
    identify_kinematic_error,
)
from swgjoint.control.learning import LearningCompensation
from swgjoint.control.motor_side import MotorPID, ideal_plan, rigid_plan
from swgjoint.control.mpc import PredictiveController
from swgjoint.files import write_whole
from swgjoint.json_text import json_text
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.controller import Controller
from swgjoint.sim.drives import load_drive
from swgjoint.sim.run import Run, run_scene
from swgjoint.sim.scene import Scene
from swgjoint.study.control_specimens import nominal, specimen
from swgjoint.study.pool import run_all
from swgjoint.study.rows import Row, StudyOptions, StudyResult
from swgjoint.units import arcmin

Array = NDArray[np.float64]

DRIVE = "CSG-25-100"
SEEDS = 10
FREQUENCY = 20.0
"""Natural frequency of every rung's loop on the motor [Hz]; damping ratio 1."""
LOAD, RECORD_LOAD = 0.3, 0.6
"""Known load of the motions and of the record, over the rated torque."""
UNKNOWN = 0.1
"""Largest part of the load that the controllers do not know."""
MOTOR_COUNTS, LINK_NOISE = 2**17, 2.0
"""Counts of the motor's encoder; noise of the link's [arcsec]."""
LEARNED = ((1, 1), *((p, 0) for p in range(1, 9)), *((0, q) for q in range(1, 9)))
TWO_PER_TURN = ((2, 0), (0, 2), (1, 1))

UNITS = {
    "tracking_rms": "arcmin",
    "tracking_peak": "arcmin",
    "positioning_pp": "arcmin",
    "ripple_rms": "% of rated torque",
    "two_per_turn": "N·m",
    "effort_rms": "N·m",
}
"""Figures of a rung: error of the link on the move, its peak to peak on the slow turn,
ripple of the output torque at constant speed and its part of 2 per turn, torque of the
motor on the move."""

MOVE: dict[str, Any] = {
    "trajectory": {
        "kind": "sweep",
        "hold_s": 0.3,
        "ramp_s": 0.25,
        "end_deg": {"joint": 20.0},
    },
    "simulation": {"duration_s": 1.3},
}
SLOW: dict[str, Any] = {
    "trajectory": {
        "kind": "constant_speed",
        "speed_deg_s": {"joint": 8.0},
        "settle_s": 1.0,
    },
    "simulation": {"duration_s": 46.0},
}
EVEN: dict[str, Any] = {
    "trajectory": {
        "kind": "constant_speed",
        "speed_deg_s": {"joint": 30.0},
        "settle_s": 15.0,
    },
    "simulation": {"duration_s": 27.0},
}
MOTIONS = {"move": MOVE, "slow": SLOW, "even": EVEN}

Build = Callable[[KinematicErrorTable], Controller]


@dataclass(frozen=True, kw_only=True)
class Rung:
    """One controller of the ladder."""

    name: str
    build: Build
    """From the table of the specimen."""
    made_for: str | None = None
    """Figure of :data:`UNITS` that it shall improve."""
    over: str | None = None
    """Rung that it adds to; None for the first."""


def _plan(planner: Any) -> Build:
    return lambda table: MotorPID(planner, frequency=FREQUENCY)


def _compensated(table: KinematicErrorTable) -> Controller:
    return MotorPID(compensated([table]), frequency=FREQUENCY)


def _predictive(table: KinematicErrorTable) -> Controller:
    return PredictiveController(compensated([table]))


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
    """What the rungs came to on one drive."""

    drive: DriveMap
    figures: dict[str, dict[str, Array]]
    """By rung and figure, one value a seed."""
    shown: dict[str, dict[str, Array]]
    """Of the first seed, by rung: signals for the picture."""

    def improvement(self, rung: Rung) -> tuple[float, int]:
        """Figure of a rung over that of the one below, mean; seeds that got better."""
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
        drive: Of which specimens are drawn; the controllers know its mean curve.
        seeds: Specimens.
        jobs: Processes.
        rungs: Names of those that are run.
        progress: Called with the stage, the specimens done and their number.
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
    """Figures and shown signals of all rungs on one specimen."""
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
        figures[rung.name] = _figures(runs)
        shown[rung.name] = _shown(runs) if seed == 0 else {}
    return figures, shown


def record_turn(drive: DriveMap, seed: int) -> JointRecord:
    """A noisy slow turn at another load, of a drive with another random part."""
    recorder = Recorder(MotorPID(rigid_plan, frequency=FREQUENCY))
    plant = specimen(drive, seed, random_seed=1)
    run_motion(drive, plant, recorder, "slow", seed + 1000, load=RECORD_LOAD)
    return recorder.record(skip=500)


def run_motion(
    drive: DriveMap,
    plant: DriveMap,
    controller: Controller,
    motion: str,
    seed: int,
    load: float = LOAD,
) -> Run:
    """One motion of a specimen under an unknown share of the load and noise."""
    torque = load * drive.ratings.rated_torque
    more = UNKNOWN * torque * np.random.default_rng([seed, 2]).uniform(-1.0, 1.0)
    scene = Scene.from_data(
        {
            "name": f"control, {motion}",
            "arm": "bench",
            "defaults": {
                "drive": "specimen",
                "level": "full",
                "rotor_inertia_kgm2": 1e-4,
                "friction": drive.friction is not None,
            },
            "load": {"joint": {"torque_Nm": torque}},
            "disturbance": [
                {
                    "kind": "joint_pulse",
                    "joint": "joint",
                    "torque_Nm": -more,
                    "start_s": 0.0,
                    "duration_s": 1000.0,
                }
            ],
            "controller": {"feedback": "link"},
            "sensors": {
                "motor": {"counts_per_turn": MOTOR_COUNTS},
                "link": {"noise_arcsec": LINK_NOISE},
                "seed": seed,
            },
            **MOTIONS[motion],
        }
    )
    return run_scene(
        scene,
        drives={"specimen": plant},
        known_drives={"joint": nominal(drive)},
        controller=controller,
    )


def _figures(runs: dict[str, Run]) -> dict[str, float]:
    move, slow, even = (runs[motion] for motion in MOTIONS)
    moving = move.time >= MOVE["trajectory"]["hold_s"]
    off = (move.position - move.reference)[moving, 0] / arcmin
    turned = (slow.position - slow.reference)[slow.steady, 0] / arcmin
    ripple = even.metrics()["joints"]["joint"]["ripple_rms_percent"]
    return {
        "tracking_rms": float(np.sqrt(np.mean(off**2))),
        "tracking_peak": float(np.abs(off).max()),
        "positioning_pp": float(np.ptp(turned)),
        "ripple_rms": float(ripple),
        "two_per_turn": two_per_turn(even),
        "effort_rms": float(np.sqrt(np.mean(move.motor_torque[moving] ** 2))),
    }


def two_per_turn(run: Run) -> float:
    """Amplitude of the ripple of 2 per turn, root of the squares of its lines [N·m]."""
    theta, psi, torque = (
        x[run.steady, 0] for x in (run.motor_position, run.position, run.output_torque)
    )
    law = run.assembly.transmissions[0].law
    assert law is not None
    angles = KinematicErrorTable(
        orders=np.array(TWO_PER_TURN), amplitudes=np.zeros((len(TWO_PER_TURN), 2))
    )
    phases = angles.on(law.with_harmonics(np.zeros(len(law.orders), bool)))
    waves = phases.phases(theta, psi)[:, 1:]
    line = np.linspace(-1.0, 1.0, theta.size)[:, None]
    basis = np.hstack([np.ones_like(line), line, np.cos(waves), np.sin(waves)])
    weights = np.linalg.lstsq(basis, torque, rcond=None)[0][2:]
    return float(np.sqrt(weights @ weights))


def _shown(runs: dict[str, Run]) -> dict[str, Array]:
    move, slow, even = (runs[motion] for motion in MOTIONS)
    turn = slice(slow.steady.start, slow.steady.stop, 10)
    last = slice(even.time.size - 1000, even.time.size)
    torque = even.output_torque[last, 0]
    return {
        "time": move.time,
        "tracking": (move.position - move.reference)[:, 0] / arcmin,
        "output": np.degrees(slow.reference[turn, 0]),
        "positioning": (slow.position - slow.reference)[turn, 0] / arcmin,
        "even_time": even.time[last],
        "ripple": torque - torque.mean(),
    }


def run_control(options: StudyOptions) -> StudyResult:
    """The ladder; ``only`` names other drives, maps or designs.

    Raises:
        InputError: If a drive is unknown or a fidelity does not fit it.
    """
    from swgjoint.study.control_ladder_shown import ladder_picture, ladder_table

    if options.folder is not None:
        options.folder.mkdir(parents=True, exist_ok=True)
    references = options.only or (DRIVE,)
    drives = {name: load_drive(name, model=options.model) for name in references}
    rows: list[Row] = []
    summary, files, more = [], [], {}
    for name, drive in drives.items():
        found = climb(drive, jobs=options.jobs, progress=options.progress)
        rows += ladder_rows(name, found)
        summary += [f"{name}, {SEEDS} specimens, mean ± standard deviation:"]
        summary += [*ladder_table(found), *ladder_claims(found)]
        more[name] = {
            rung: {key: values.tolist() for key, values in figures.items()}
            for rung, figures in found.figures.items()
        }
        if options.folder is not None:
            picture = ladder_picture(name, found)
            target = options.folder / f"control-{drive.name}.png"
            files.append(write_whole(target, picture))
    if options.folder is not None:
        text = json_text({"rows": [row.to_json() for row in rows], "values": more})
        files.append(write_whole(options.folder / "control.json", text + "\n"))
    return StudyResult(
        rows=tuple(rows),
        summary=tuple(summary),
        more={"values": more},
        files=tuple(str(path) for path in files),
    )


def ladder_rows(name: str, found: Ladder) -> list[Row]:
    """One row for every rung and figure."""
    made_for = {rung.name: rung.made_for for rung in RUNGS}
    return [
        Row(
            case=f"{name}, {rung}",
            quantity=key,
            unit=UNITS[key],
            source_value=None,
            ours=float(values.mean()),
            reason="what it is made for" if made_for[rung] == key else None,
            more={"spread": float(values.std(ddof=min(1, values.size - 1)))},
        )
        for rung, figures in found.figures.items()
        for key, values in figures.items()
    ]


def ladder_claims(found: Ladder) -> list[str]:
    """What each rung did to the figure that it is made for, a line each."""
    lines = []
    for rung in RUNGS:
        if rung.made_for is None or not {rung.name, rung.over} <= set(found.figures):
            continue
        share, better = found.improvement(rung)
        count = len(found.figures[rung.name][rung.made_for])
        lines.append(
            f"{rung.name}: {rung.made_for} {share:.3g} of that of {rung.over!r},"
            f" better on {better} of {count}"
        )
    return lines
