"""``swgjoint bench joint``: error and cost of joint levels, integrators and time steps.

There are three scenes (:mod:`swgjoint.bench.joint.scenes`). The ``error`` of a setting
is its difference from level ``full`` solved with negligible time-step error. Its
``own_error`` is the difference from its own level solved in the same way, that is the
part of the error that the time step causes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import mujoco

from swgjoint.bench.joint.modes import numerical_damping
from swgjoint.bench.joint.scenes import SCENES, BenchScene, bench_scene, exact
from swgjoint.bench.joint.splits import SPLITS, split
from swgjoint.csv_text import csv_text
from swgjoint.errors import ComputationError, InputError
from swgjoint.files import Outputs
from swgjoint.joint.attach import LEVELS
from swgjoint.json_text import json_text
from swgjoint.pool import run_all
from swgjoint.progress import Progress, silent
from swgjoint.provenance import provenance
from swgjoint.sim.accuracy import (
    QUANTITIES,
    Setting,
    SettingOutcome,
    Stepper,
    attempt,
    attempt_assembled,
    cost_at,
    errors,
    relative_speed,
    rigid_arm,
)
from swgjoint.sim.run import Run

STEPS = (1e-5, 5e-5, 1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 5e-3)
"""Time steps of level ``full`` [s]; other levels use some of them."""
REFERENCE_STEP = 2e-5
"""Time step of the RK4 reference [s]; a run at twice this step estimates its error."""
EXPLICIT = ("Euler", "implicitfast", "RK4")
"""Integrators that run without sub-steps."""
SPLIT_STEPS = (5e-4, 1e-3, 2e-3, 5e-3)
"""Time steps of the splits [s]."""
DAMPING = "damping_ratio"
"""Quantity of the rows with the numerical damping of a setting."""


def settings() -> list[Setting]:
    """All settings of a scene; level ``full`` has the largest number of time steps."""
    found = []
    for level in LEVELS:
        steps: tuple[float, ...] = STEPS[1:]
        if level in ("rigid", "kinematic"):
            steps = (1e-4, 1e-3, 5e-3)
        elif level != "full":
            steps = (1e-4, 5e-4, 1e-3, 2e-3, 5e-3)
        for integrator in (*EXPLICIT, "discrete"):
            all_steps = level == "full" and integrator == "discrete"
            found += [
                Setting(level=level, integrator=integrator, step=step)
                for step in (STEPS if all_steps else steps)
            ]
    return found + [
        Setting(level="full", integrator=name, step=step)
        for name in SPLITS
        for step in SPLIT_STEPS
    ]


def run_joint_cost(
    *,
    only: Sequence[str] = (),
    jobs: int = 2,
    folder: Path | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Run every setting of every scene.

    Args:
        only: Names of the scenes to run; empty for all.
        jobs: Number of processes, each of which runs one scene at a time.
        folder: Folder for tables and pictures; None writes nothing.
        progress: Called after every scene.

    Returns:
        ``rows``, one per setting and quantity: ``bench``, ``scene``, ``model`` (the
        level), ``setting``, ``integrator``, ``step_s``, ``quantity``, ``error``,
        ``own_error``, ``unit``, ``outcome``, ``reason``, ``sub_steps``, ``unresolved``
        (number of harmonics left out), ``steps_ratio`` (steps of the scene per second
        relative to the rigid arm), ``cost`` (CPU time per simulated time relative to
        the rigid arm at 1 ms), ``pareto``, ``wall_s``, ``reference``. ``steps_ratio``
        and ``cost`` are None for the splits. The rows of quantity ``damping_ratio``
        also have ``frequency_Hz``, ``physical_damping_ratio``, ``most`` and
        ``most_at_Hz`` (largest numerical damping ratio and its frequency). Also
        ``references`` with estimates of their own errors, ``files``, ``provenance``,
        ``wall_s``.

    Raises:
        InputError: If a scene is unknown.
        ComputationError: If a reference fails.
    """
    begin = time.perf_counter()
    check_scenes(only)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)  # fail before minutes of work
    names = [name for name in SCENES if not only or name in only]
    found = run_all(
        run_bench_scene, names, jobs=jobs, stage="bench joint", progress=progress
    )
    rows = [row for part in found for row in part["rows"]]
    result = {
        "rows": rows,
        "references": [row for part in found for row in part["references"]],
        "provenance": provenance(),
        "wall_s": time.perf_counter() - begin,
    }
    return result | {"files": [] if folder is None else write_files(result, folder)}


def check_scenes(only: Sequence[str]) -> None:
    """Check that all names are scenes of this benchmark.

    Raises:
        InputError: If a name is unknown or empty.
    """
    unknown = [name or "''" for name in only if name not in SCENES]
    if unknown:
        raise InputError(
            f"--only {','.join(unknown)}: unknown scene; accepted: {', '.join(SCENES)}"
        )


def run_bench_scene(name: str) -> dict[str, Any]:
    """Run all settings of one scene."""
    # a diverging run becomes a row, so the engine need not print a warning
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        return measure(bench_scene(name), settings())
    finally:
        mujoco.set_mju_user_warning(None)


def measure(bench: BenchScene, chosen: Sequence[Setting]) -> dict[str, Any]:
    """Run settings of a scene, and the references that they need.

    Args:
        bench: Scene with its drives.
        chosen: Settings to run.

    Returns:
        ``rows`` and ``references``.

    Raises:
        ComputationError: If a reference fails.
    """
    rigid = rigid_arm(bench.scene, bench.drives)
    own, names, shown = {}, {}, []
    for level in ("full", *LEVELS):
        if level not in own and (level == "full" or level in {s.level for s in chosen}):
            own[level], names[level], row = reference(bench, level)
            shown.append(row)
    rows: list[dict[str, Any]] = []
    for setting in chosen:
        base = {
            "bench": "joint",
            "scene": bench.name,
            "model": setting.level,
            "setting": setting.name,
            "integrator": setting.integrator,
            "step_s": setting.step,
            "reference": names["full"],
        }
        if setting.integrator in SPLITS:
            # the force of a split comes from Python, so its cost is not comparable
            with split(bench.scene, setting, bench.drives) as whole:
                got = attempt_assembled(whole)
                base |= _costs(got, None)
                rows += _rows(base, got, own["full"], own["full"])
            continue
        got = attempt(bench.scene, setting, bench.drives)
        base |= _costs(got, rigid)
        rows += _rows(base, got, own["full"], own[setting.level])
    _mark_pareto(rows)
    return {"rows": rows, "references": shown}


def reference(bench: BenchScene, level: str) -> tuple[Run, str, dict[str, Any]]:
    """Solve a level with negligible time-step error.

    The method is RK4; for scene ``bench`` at level ``full`` it is DOP853.

    Args:
        bench: Scene with its drives.
        level: Level of the joint.

    Returns:
        Run, name of the reference, and a row with estimates of its own errors.

    Raises:
        ComputationError: If the reference fails.
    """
    step = REFERENCE_STEP
    runs, assemblies = [], []
    for h in (step, 2.0 * step):
        setting = Setting(level=level, integrator="RK4", step=h)
        got = attempt(bench.scene, setting, bench.drives)
        if got.run is None or got.assembly is None:
            raise ComputationError(
                f"reference of scene {bench.name!r}, {level}, {setting.name}:"
                f" {got.reason}"
            )
        runs.append(got.run)
        assemblies.append(got.assembly)
    name = f"{level}, RK4, {1e3 * step:g} ms"
    row: dict[str, Any] = {"scene": bench.name, "model": level, "reference": name}
    row |= {f"step_doubled_{k}": v for k, v in errors(runs[1], runs[0]).items()}
    if bench.is_bench and level == "full":
        best = exact(runs[0], assemblies[0])
        row["reference"] = "full, DOP853"
        row |= {f"rk4_{k}": v for k, v in errors(runs[0], best).items()}
        return best, "full, DOP853", row
    return runs[0], name, row


def _rows(
    base: dict[str, Any], got: SettingOutcome, full: Run, level: Run
) -> list[dict[str, Any]]:
    """One row per quantity of a setting, and one for its numerical damping.

    Args:
        base: Columns that the rows share.
        got: Outcome of the setting.
        full: Reference at level ``full``.
        level: Reference at the level of the setting.
    """
    row = base | {"outcome": got.outcome, "reason": got.reason}
    off: dict[str, float] = {}
    by_steps: dict[str, float] = {}
    if got.run is not None:
        off, by_steps = errors(got.run, full), errors(got.run, level)
    rows = [
        row
        | {
            "quantity": quantity,
            "unit": unit,
            "error": off.get(quantity),
            "own_error": by_steps.get(quantity),
        }
        for quantity, unit in QUANTITIES.items()
    ]
    damped = [] if got.assembly is None else numerical_damping(got.assembly)
    if damped:
        first, worst = damped[0], max(damped, key=lambda mode: mode[2])
        rows.append(
            row
            | {
                "quantity": DAMPING,
                "unit": "-",
                "error": first[2],
                "own_error": first[2],
                "frequency_Hz": first[0],
                "physical_damping_ratio": first[1],
                "most": worst[2],
                "most_at_Hz": worst[0],
            }
        )
    return rows


def _costs(got: SettingOutcome, rigid: Stepper | None) -> dict[str, Any]:
    """Sub-steps, unresolved harmonics, wall time; relative cost if ``rigid`` is set."""
    keys = ("sub_steps", "unresolved", "wall_s", "steps_ratio", "cost")
    found: dict[str, Any] = dict.fromkeys(keys)
    if got.run is None or got.assembly is None:
        return found
    parts = got.assembly.sub_steps
    found |= {
        "sub_steps": parts,
        "unresolved": sum(
            len(t.attached.unresolved) for t in got.assembly.transmissions
        ),
        "wall_s": got.run.wall,
    }
    if rigid is not None:
        speed = relative_speed(Stepper.from_assembly(got.assembly), rigid)
        found |= {"steps_ratio": speed / parts, "cost": cost_at(got.assembly, speed)}
    return found


def _mark_pareto(rows: list[dict[str, Any]]) -> None:
    """Mark rows that are Pareto-optimal in cost and error among those of a quantity."""
    for row in rows:
        if row["quantity"] == DAMPING:
            row["pareto"] = None
            continue
        others = [
            (other["cost"], other["error"])
            for other in rows
            if other["quantity"] == row["quantity"]
            and other is not row
            and None not in (other["cost"], other["error"])
        ]
        row["pareto"] = None not in (row["cost"], row["error"]) and not any(
            cost <= row["cost"] and error <= row["error"] for cost, error in others
        )


def write_files(result: dict[str, Any], folder: Path) -> list[str]:
    """Write tables as CSV and JSON, and one picture per scene.

    Args:
        result: Result of :func:`run_joint_cost`.
        folder: Folder of the files.

    Returns:
        Paths of the written files.
    """
    from swgjoint.view.plots.bench_joint import joint_picture

    rows = result["rows"]
    outputs = Outputs(folder)
    outputs.write("bench-joint.csv", lambda: csv_text(rows))
    outputs.write("bench-joint.json", lambda: json_text(result) + "\n")
    for scene in dict.fromkeys(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == scene]
        outputs.write(f"bench-joint-{scene}.png", partial(joint_picture, scene, own))
    return outputs.files
