"""Acceptance tests of one drive: simulated, or measured logs beside the simulation.

Each bundled scene with a table ``[acceptance]`` is one test. Simulation and measurement
give logs of the same columns, from which
:mod:`swgjoint.explore.accept.figures` reads the same figures.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from math import inf, isfinite
from pathlib import Path
from typing import Any

from swgjoint.csv_text import csv_text
from swgjoint.drives.references import given_drives, load_drive
from swgjoint.drives.rotors import rotor_inertia_of
from swgjoint.errors import InputError
from swgjoint.explore.accept.figures import FIGURES, LOWER, TESTS, Bench, Figures
from swgjoint.identify.checks import check_angles, check_ratio, check_torsion
from swgjoint.identify.log import BenchLog, read_log
from swgjoint.maps.drive_map import DriveMap
from swgjoint.models_path import bundled_names
from swgjoint.progress import Progress, silent
from swgjoint.sim.figures.verdict import VALID
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.trajectory_sections import SpeedSteps
from swgjoint.units import arcmin, deg
from swgjoint.view.run import run_scene

PREFIX = "acceptance-"
"""Beginning of the names of the scenes."""
SAMPLES = 20_000
"""Largest number of samples of a simulated log."""
AT_INPUT_SPEED = ("no_load", "starting", "efficiency")
"""Tests whose scene has the speeds of ratio :data:`RATIO`, for the same input speed at
other ratios."""
RATIO = 100.0
"""Magnitude of the ratio for which the scenes state speeds of the output [-]."""
ACCURACY = "transmission_accuracy_arcmin"
EFFICIENCY = ("efficiency_percent", 100.0)
"""Figure that has a largest possible value, and this value [%]."""
BACKWARDS = 0.1
"""Part of the lost motion by which noise may make a hysteresis loss negative [-]."""
WITH_FRICTION = ("no_load", "starting", "efficiency", "back_driving")
"""Tests of the friction of a drive."""


@dataclass(frozen=True, kw_only=True)
class AcceptanceRow:
    """One figure of one test under one condition."""

    test: str
    """Name of the test."""
    figure: str
    """Key of the figure, which ends with its unit."""
    condition: str
    """Condition of the figure, such as an input speed; empty if there is one only."""
    simulated: float | None
    """Simulated value; None without one."""
    measured: float | None
    """Measured value; None without one."""
    limit: float | None
    """Limit of the figure; None without one."""
    passed: bool | None
    """Whether the measured value, or without measurements the simulated one, meets the
    limit; None if there is no limit, or no value under a limit of the scene."""
    reason: str = ""
    """Reason why a value is missing."""

    def share_of_limit(self, value: float) -> float:
        """Part of the limit that a value uses [-], above 1 if it misses the limit."""
        assert self.limit is not None
        return self.limit / value if self.figure in LOWER else value / self.limit


@dataclass(frozen=True, kw_only=True, eq=False)
class Acceptance:
    """Results of all tests."""

    rows: tuple[AcceptanceRow, ...]
    """Figures in the order of the tests."""
    ratio: float
    """Signed ratio i of the drive, output = input / i."""
    logs: dict[str, dict[str, BenchLog]] = field(repr=False)
    """Logs by ``simulated`` or ``measured``, and by test."""
    scenes: dict[str, Scene] = field(repr=False)
    """Scenes as they were run, by test."""
    invalid: dict[str, tuple[str, ...]]
    """Reasons why a simulated run is not valid, by test."""

    @property
    def passed(self) -> bool:
        """Whether no limit is missed and all runs are valid."""
        return not self.invalid and all(row.passed is not False for row in self.rows)

    def to_json(self) -> dict[str, Any]:
        """Rows, missed rows, reasons of runs that are not valid, and the verdict."""
        return {
            "rows": [asdict(row) for row in self.rows],
            "missed": [asdict(row) for row in self.rows if row.passed is False],
            "invalid": self.invalid,
            "passed": self.passed,
        }


def accept(
    reference: str | DriveMap,
    *,
    model: str | None = None,
    spec: Mapping[str, float] | None = None,
    measured: str | Path | None = None,
    only: Collection[str] = (),
    progress: Progress = silent,
) -> Acceptance:
    """Test one drive on the bench of the acceptance scenes.

    Args:
        reference: Design, map or catalogue drive.
        model: Fidelity of a design; None for its default.
        spec: Limits by figure, which replace those of the scenes; a figure of these
            that has no value misses its limit.
        measured: Folder with measured logs ``TEST.csv``; they are judged instead of the
            simulation.
        only: Names of the tests; all if empty.
        progress: Called during the simulations.

    Raises:
        InputError: If the drive, a test, the folder or a log cannot be used.
    """
    scenes = acceptance_scenes(only)
    files = {} if measured is None else _measured_files(Path(measured), scenes)
    drive = load_drive(reference, model=model, progress=progress)
    used = reference if isinstance(reference, str) else drive.name
    known = given_drives({used: drive})
    rows: list[AcceptanceRow] = []
    logs: dict[str, dict[str, BenchLog]] = {"simulated": {}, "measured": {}}
    invalid: dict[str, tuple[str, ...]] = {}
    for name, file_scene in scenes.items():
        scene = scenes[name] = _scene_of(file_scene, used, drive)
        bench, found, reason = _bench(scene, drive), {}, _missing(scene, drive)
        if not reason:
            run = run_scene(scene, drives=known, name=name, progress=progress)
            figures = run.metrics()
            if figures["verdict"] != VALID:
                invalid[name] = tuple(figures["reasons"])
            (joint,) = figures["joints"].values()
            shown = joint["transmission_error_arcmin"]["pp"]
            reason = _unresolved(scene, run, shown, spec or {})
            if not reason:
                logs["simulated"][name] = log = _log_of(run)
                found["simulated"] = _evaluate(scene, log, bench)
        if name in files:
            logs["measured"][name] = log = read_log(files[name])
            found["measured"] = _evaluate_measured(scene, log, bench, drive)
        elif measured is not None:
            reason = f"no file {name}.csv"
        judged = "simulated" if measured is None else "measured"
        rows += _rows(name, scene, found, spec or {}, judged, reason)
    return Acceptance(
        rows=tuple(rows),
        ratio=drive.ratio,
        logs=logs,
        scenes=scenes,
        invalid=invalid,
    )


def acceptance_scenes(only: Collection[str] = ()) -> dict[str, Scene]:
    """Bundled scenes with a table ``[acceptance]``, by the name of their test.

    Args:
        only: Names of the tests; all if empty.

    Raises:
        InputError: If a test is unknown.
    """
    bundled = (n for n in bundled_names("scenes", ".toml") if n.startswith(PREFIX))
    names = [name.removeprefix(PREFIX) for name in bundled]
    for name in only:
        if name not in names:
            raise InputError(f"test {name!r}; accepted: {', '.join(names)}")
    return {
        name: Scene.load_file(PREFIX + name)
        for name in names
        if name in only or not only
    }


def log_csv(log: BenchLog) -> str:
    """A log as the CSV text that :func:`~swgjoint.identify.log.read_log` reads."""
    columns = {
        "time_s": log.time,
        "motor_angle_rad": log.motor_angle,
        "link_angle_rad": log.link_angle,
        "output_torque_Nm": log.output_torque,
        "motor_torque_Nm": log.motor_torque,
    }
    known = {
        key: values.tolist() for key, values in columns.items() if values is not None
    }
    return csv_text(
        [
            dict(zip(known, row, strict=True))
            for row in zip(*known.values(), strict=True)
        ]
    )


def _measured_files(folder: Path, tests: Mapping[str, Scene]) -> dict[str, Path]:
    """Files of measured logs by test."""
    files = {name: folder / f"{name}.csv" for name in tests}
    found = {name: path for name, path in files.items() if path.is_file()}
    if not found:
        names = ", ".join(path.name for path in files.values())
        raise InputError(f"{folder}: no measured log; accepted: a folder with {names}")
    return found


def _scene_of(scene: Scene, reference: str, drive: DriveMap) -> Scene:
    """The scene with the drive, at the input speeds of its test."""
    changes: dict[str, Any] = {}
    assert scene.acceptance is not None
    if scene.acceptance.test in AT_INPUT_SPEED:
        assert isinstance(scene.trajectory, SpeedSteps)
        share = RATIO / abs(drive.ratio)
        speeds = [share * speed for speed in scene.trajectory.speeds_deg_s]
        changes["trajectory.speeds_deg_s"] = speeds
    if (inertia := rotor_inertia_of(reference)) is not None:
        changes["defaults.rotor_inertia_kgm2"] = inertia
    return scene.with_changes(changes).with_drive(reference)


def _bench(scene: Scene, drive: DriveMap) -> Bench:
    motion = scene.trajectory
    speeds = motion.speeds_deg_s if isinstance(motion, SpeedSteps) else ()
    return Bench(
        ratio=drive.ratio,
        ratings=drive.ratings,
        speeds=tuple(speed * deg for speed in speeds),
    )


def _missing(scene: Scene, drive: DriveMap) -> str:
    """Reason why the drive cannot be simulated in a test; empty if it can."""
    assert scene.acceptance is not None
    test = scene.acceptance.test
    if test in WITH_FRICTION and drive.friction is None:
        return "the map has no friction of bearing, seals and teeth at speed"
    if test == "kinematic_error" and len(drive.orders) == 1:
        return "the map has no harmonics of the gear angles"
    return ""


def _unresolved(scene: Scene, run: Run, shown: float, spec: Mapping[str, float]) -> str:
    """Reason why a run does not show the kinematic error; empty if it does.

    It does not if the orders that the step leaves out may decide on the limit, or if
    they are more than the run shows.

    Args:
        scene: The test.
        run: Its run.
        shown: Transmission error of the run, peak to peak [arcmin].
        spec: Limits by figure, which replace those of the scene.
    """
    assert scene.acceptance is not None
    left = run.assembly.transmissions[0].attached.unresolved
    lost = 2.0 * sum(one.error for one in left) / arcmin
    limit = {**scene.acceptance.limits, **spec}.get(ACCURACY, inf)
    enough = lost < shown and not shown <= limit < shown + lost
    if scene.acceptance.test != "kinematic_error" or enough or not left:
        return ""
    strongest = max(left, key=lambda one: one.error)
    return (
        f"the step of {1e3 * scene.simulation.step_s:g} ms leaves out order"
        f" {strongest.order:.4g} of the drive, with {strongest.error / arcmin:.2g}"
        " arcmin; swgjoint spec computes the accuracy without a bench"
    )


def _log_of(run: Run) -> BenchLog:
    """The log that a bench would write of a run."""
    every = slice(None, None, -(-run.time.size // SAMPLES))
    return BenchLog(
        time=run.time[every],
        motor_angle=run.motor_position[every, 0],
        link_angle=run.position[every, 0],
        output_torque=run.output_torque[every, 0],
        motor_torque=run.motor_torque[every, 0],
        where=run.name,
    )


def _evaluate(scene: Scene, log: BenchLog, bench: Bench) -> Figures:
    assert scene.acceptance is not None
    return TESTS[scene.acceptance.test](log, bench)


def _evaluate_measured(
    scene: Scene, log: BenchLog, bench: Bench, drive: DriveMap
) -> Figures:
    """Figures of a measured log whose signs and units are those of the drive.

    Raises:
        InputError: If they are not, or if the log cannot be evaluated. A negative lost
            motion or hysteresis loss would meet any limit, and so would an efficiency
            above 100 %.
    """
    check_angles(log)
    check_ratio(
        log, drive.layout, (drive.teeth_flexspline, drive.teeth_circular_spline)
    )
    check_torsion(log, drive.ratio)
    found = _evaluate(scene, log, bench)
    for figure, most in (*((f"K{k}_Nm_rad", inf) for k in (1, 2, 3)), EFFICIENCY):
        for at, value in found.get(figure, {}).items():
            if value is not None and not 0.0 < value <= most:
                where = f" at {at}" if at else ""
                raise InputError(
                    f"{log.where}: {figure}{where} = {value:.4g}; accepted: more than 0"
                    + (f", at most {most:g}" if isfinite(most) else "")
                    + ", from torques and angles with the signs, units and zeros of"
                    " the bench"
                )
    loss = found.get("hysteresis_loss_arcmin", {}).get("") or 0.0
    lost_motion = found.get("lost_motion_arcmin", {}).get("") or 0.0
    if loss < -BACKWARDS * abs(lost_motion):
        raise InputError(
            f"{log.where}: hysteresis_loss_arcmin = {loss:.4g}; accepted: a loop in"
            " which the torsion lags behind the torque, from torques and angles at the"
            " same instants"
        )
    return found


def _rows(
    name: str,
    scene: Scene,
    found: Mapping[str, Figures],
    spec: Mapping[str, float],
    judged: str,
    reason: str,
) -> list[AcceptanceRow]:
    """Rows of one test; ``found`` are the figures by ``simulated`` or ``measured``."""
    assert scene.acceptance is not None
    limits, rows = {**scene.acceptance.limits, **spec}, []
    why = reason if judged not in found else "the input does not turn"
    for figure in FIGURES[scene.acceptance.test]:
        tables = {which: figures[figure] for which, figures in found.items()}
        conditions = dict.fromkeys(c for table in tables.values() for c in table)
        for condition in conditions or [""]:
            values = {k: table.get(condition) for k, table in tables.items()}
            value, limit = values.get(judged), limits.get(figure)
            passed = None
            if limit is not None and value is not None:
                passed = value >= limit if figure in LOWER else value <= limit
            elif figure in spec or (limit is not None and judged in found):
                passed = False
            rows.append(
                AcceptanceRow(
                    test=name,
                    figure=figure,
                    condition=condition,
                    simulated=values.get("simulated"),
                    measured=values.get("measured"),
                    limit=limit,
                    passed=passed,
                    reason=why if value is None else "",
                )
            )
    return rows
