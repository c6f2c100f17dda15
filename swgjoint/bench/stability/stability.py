"""Stability of the joint on stiff and extreme cases: everything that can go wrong.

- ``free``, ``loaded``, ``released``, ``step``, ``drop``: a grid of stiffness, inertias
  and steps (:mod:`stability_grid`), kinematic error of 1 arcmin at 2 and 4 per turn;
- ``free 10 s``, ``ratchet``: every CSG row of the catalogue
  (:mod:`stability_catalogue`);
- ``fall``, ``sweep``: four arms with catalogue drives (:mod:`stability_arms`);
- ``contact``: chains of two links that lie on a floor or press against joint limits
  (:mod:`stability_contact`).

But for two thirds of the last, no run has physical damping, so whatever energy appears
is the integrator's, or the contacts', which a much finer run tells. A gain is
sustained: the mean of energy less work over a tenth of the run, above that at the
start, over the kinetic and torsion energy at the start and what the load winds up.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco

from swgjoint.bench.stability.arms import SCENES, ArmTask, run_arm
from swgjoint.bench.stability.catalogue import (
    CatalogueDrive,
    catalogue_drives,
    run_drive,
)
from swgjoint.bench.stability.contact import ContactTask, contact_tasks, run_contact
from swgjoint.bench.stability.grid import GridJoint, grid, run_joint
from swgjoint.bench.stability.joint import GAIN
from swgjoint.bench.stability.rows import (
    DEFAULT,
    FREE,
    OUTCOMES,
    StabilityRow,
    counts,
    shares,
)
from swgjoint.csv_text import csv_text
from swgjoint.files import Outputs
from swgjoint.joint.region import MAX_SUB_STEPS
from swgjoint.pool import run_all
from swgjoint.progress import Progress, silent

Task = ArmTask | CatalogueDrive | ContactTask | GridJoint

ARM_GROUPS = ("fall", "sweep")
REFERENCE = (
    "free, loaded: two-mass equations by DOP853 (rtol 1e-10) over 100 rad of torsional"
    " vibration, at most 0.1 s; sweep: the same arm by RK4 at 0.1 ms"
)
SCHEME = (
    "discrete gradient of the potential, predicted per joint and solved with the arm by"
    " MuJoCo's discrete integrator; steps outside its region in up to"
    f" {MAX_SUB_STEPS} sub-steps, else refused"
)


def run_stability(
    *,
    full: bool = False,
    jobs: int = 2,
    folder: Path | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Run the study.

    Args:
        full: The whole grid instead of a third of its joints at four steps.
        jobs: Processes.
        folder: Where table and picture go; None writes nothing.
        progress: Called after every joint, drive or arm.

    Returns:
        ``rows``, ``default_scheme``, ``unexplained``, ``counts`` by group and scheme,
        ``shares`` of the outcomes of the default scheme, ``refused_share``,
        ``arms_refused``, ``free_running``, what the columns mean, ``files``,
        ``wall_s``.
    """
    begin = time.perf_counter()
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)  # before minutes of work
    tasks: list[Task] = [ArmTask(scene=scene) for scene in SCENES]
    tasks += [*grid(full=full), *contact_tasks(full=full), *catalogue_drives()]
    found = run_all(run_task, tasks, jobs=jobs, stage="stability", progress=progress)
    rows = [row for part in found for row in part]
    files = [] if folder is None else write_files(rows, folder)
    share = shares(rows)
    free = [row.energy_balance or 0.0 for row in rows if row.group == FREE]
    return {
        "rows": [row.to_json() for row in rows],
        "default_scheme": DEFAULT,
        "scheme": SCHEME,
        "unexplained": [row.to_json() for row in rows if row.unexplained],
        "counts": counts(rows),
        "shares": share,
        "refused_share": share["refused"],
        "arms_refused": sum(
            row.outcome == "refused" for row in rows if row.group in ARM_GROUPS
        ),
        "free_running": {
            "runs": len(free),
            "largest_loss": -min(free),
            "largest_gain": max(free),
            "limit": GAIN,
        },
        "error_unit": "arcmin",
        "reference": REFERENCE,
        "files": files,
        "wall_s": time.perf_counter() - begin,
    }


def run_task(task: Task) -> list[StabilityRow]:
    """All rows of one joint, drive or arm."""
    # schemes that diverge are counted, the engine need not print them too
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        if isinstance(task, GridJoint):
            return run_joint(task)
        if isinstance(task, CatalogueDrive):
            return run_drive(task)
        if isinstance(task, ContactTask):
            return run_contact(task)
        return run_arm(task)
    finally:
        mujoco.set_mju_user_warning(None)


def write_files(rows: Sequence[StabilityRow], folder: Path) -> list[str]:
    """Table and picture in a folder; their paths."""
    from swgjoint.view.plots.stability import stability_picture

    table = [row.to_json() for row in rows]
    outputs = Outputs(folder)
    outputs.write("stability.csv", lambda: csv_text(table))
    outputs.write(
        "stability.png", lambda: stability_picture(rows, scheme=DEFAULT, free=FREE)
    )
    return outputs.files


def summary(result: dict[str, Any]) -> list[str]:
    """Lines for the terminal: what the study adds up to."""
    share, free = result["shares"], result["free_running"]
    own = [row for row in result["rows"] if row["scheme"] == DEFAULT]
    parts = ", ".join(f"{name} {100.0 * share[name]:.1f} %" for name in OUTCOMES)
    lines = [
        f"default scheme: {result['scheme']}",
        f"{len(own)} runs of it: {parts}",
        f"arms with catalogue drives at 0.5 to 2 ms: {result['arms_refused']} refused",
        f"{free['runs']} free joints over 10 s at 1 ms: lost"
        f" {100.0 * free['largest_loss']:.2f} % at most, gained"
        f" {100.0 * max(0.0, free['largest_gain']):.2g} %",
        f"error in arcmin: {result['reference']}",
    ]
    if not result["unexplained"]:
        return [*lines, "no run of it gained energy or diverged without saying so"]
    return [
        *lines,
        f"unexplained: {len(result['unexplained'])}",
        *(
            f"  {row['group']}: {row['case']} at {1e3 * row['step_s']:g} ms:"
            f" {row['outcome']}"
            for row in result["unexplained"][:20]
        ),
    ]
