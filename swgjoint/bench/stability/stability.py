"""``swgjoint stability``: stability of the joint in stiff and extreme cases.

The runs belong to these groups:

- ``free``, ``loaded``, ``released``, ``step``, ``drop``: a grid of stiffness, inertias
  and time steps (:mod:`swgjoint.bench.stability.grid`), with a kinematic error of
  1 arcmin at orders 2 and 4 per input turn;
- ``free 10 s``, ``ratchet``: every CSG drive of the catalogue
  (:mod:`swgjoint.bench.stability.catalogue`);
- ``fall``, ``sweep``: four arms with catalogue drives
  (:mod:`swgjoint.bench.stability.arms`);
- ``contact``: chains of two links that rest on a floor or against joint limits
  (:mod:`swgjoint.bench.stability.contact`).

No run has physical damping, except for the ``sweep`` runs, two thirds of the
``contact`` runs, and the contact damping of lossless drives. Any energy gain therefore
comes from the integrator or from the contacts; a run with a much smaller step shows the
gain of the contacts alone. A gain is the mean of energy minus work over a tenth of the
run, minus the initial value. It is divided by the sum of the initial kinetic and
torsion energy and the energy that the load stores in the drive. Groups ``fall`` and
``contact`` divide by the largest kinetic and torsion energy of the fall instead, and
``contact`` subtracts the lowest earlier mean instead of the initial value.
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
"""Groups of runs of a whole arm."""
REFERENCE = (
    "free, loaded: two-mass equations by DOP853 (rtol 1e-10) over 100 rad of torsional"
    " vibration, at most 0.1 s; sweep: the same arm by RK4 at 0.1 ms"
)
SCHEME = (
    "discrete gradient of the potential, predicted per joint and solved with the arm by"
    " MuJoCo's discrete integrator; steps outside its stability region are divided into"
    f" up to {MAX_SUB_STEPS} sub-steps, or refused"
)


def run_stability(
    *,
    full: bool = False,
    jobs: int = 2,
    folder: Path | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Run the stability study.

    Args:
        full: Whether the whole grid and all chains are run, instead of a subset of the
            grid at four time steps and a subset of the chains.
        jobs: Number of processes.
        folder: Folder for table and picture; None writes nothing.
        progress: Called after every joint, drive, arm or chain.

    Returns:
        ``rows`` (see :class:`swgjoint.bench.stability.rows.StabilityRow`),
        ``default_scheme`` (its name), ``scheme`` (its description), ``unexplained``
        (rows in which it fails inside its stability region), ``counts`` of the outcomes
        by group and scheme, ``shares`` of the outcomes of the default scheme,
        ``refused_share``, ``arms_refused``, ``free_running`` (energy balance of group
        ``free 10 s``), ``error_unit``, ``reference``, ``files``, ``wall_s``.
    """
    begin = time.perf_counter()
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)  # fail before minutes of work
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
    """Run one joint, drive, arm or chain."""
    # a diverging run becomes a row, so the engine need not print a warning
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
    """Write table and picture.

    Args:
        rows: Rows of the study.
        folder: Folder of the files.

    Returns:
        Paths of the written files.
    """
    from swgjoint.view.plots.stability import stability_picture

    table = [row.to_json() for row in rows]
    outputs = Outputs(folder)
    outputs.write("stability.csv", lambda: csv_text(table))
    outputs.write(
        "stability.png", lambda: stability_picture(rows, scheme=DEFAULT, free=FREE)
    )
    return outputs.files


def summary(result: dict[str, Any]) -> list[str]:
    """Summary of the study as lines for the terminal."""
    share, free = result["shares"], result["free_running"]
    own = [row for row in result["rows"] if row["scheme"] == DEFAULT]
    parts = ", ".join(f"{name} {100.0 * share[name]:.1f} %" for name in OUTCOMES)
    lines = [
        f"default scheme: {result['scheme']}",
        f"{len(own)} runs with the default scheme: {parts}",
        f"arms with catalogue drives at 0.5 to 2 ms: {result['arms_refused']} refused",
        f"{free['runs']} free joints over 10 s at 1 ms: energy loss at most"
        f" {100.0 * free['largest_loss']:.2f} %, gain at most"
        f" {100.0 * max(0.0, free['largest_gain']):.2g} %",
        f"reference of the errors in arcmin: {result['reference']}",
    ]
    if not result["unexplained"]:
        return [*lines, "no run of the default scheme gained energy or diverged"]
    return [
        *lines,
        f"unexplained: {len(result['unexplained'])}",
        *(
            f"  {row['group']}: {row['case']} at {1e3 * row['step_s']:g} ms:"
            f" {row['outcome']}"
            for row in result["unexplained"][:20]
        ),
    ]
