"""Simulation of the tasks of a duty cycle."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.assembly import Assembly, assemble
from swgjoint.sim.life.loads import TaskLoads
from swgjoint.sim.life.motion_loads import motion_loads, rest_loads
from swgjoint.sim.scene.scene import Scene

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

Simulate = Callable[[Assembly, str], "Run"]
"""Function that runs a compiled scene under a name."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PreparedTask:
    """A task that is ready to run."""

    name: str
    """Name of the task."""
    duration: float
    """Duration of one occurrence [s]."""
    times: int
    """Number of occurrences in a cycle."""
    rest: bool
    """Whether the joints stand still."""
    assembly: Assembly | None
    """The compiled task; None for a rest and for the motion of the scene itself."""


def prepare_cycle(
    scene: Scene,
    *,
    drives: Mapping[str, DriveMap] | None = None,
    controlled_by: str | None = None,
    progress: Progress = silent,
) -> tuple[PreparedTask, ...]:
    """Compile the tasks of a scene, so that faults appear before the first run.

    Args:
        scene: The scene; without a duty cycle, there are no tasks.
        drives: Maps by drive reference, used instead of loading or building them.
        controlled_by: Name of an external controller; None for that of the scene.
        progress: Called while maps are built.

    Raises:
        InputError: If a task does not fit the arm or the time step.
        ComputationError: If a joint needs more sub-steps than the scene accepts.
    """
    tasks = []
    for k, task in enumerate(scene.cycle):
        own = scene.simulation.duration_s
        same = not task.changes and task.duration_s in (None, own)
        assembly = None
        if not (task.rest or same):
            assembly = assemble(
                scene.task_scene(k),
                drives=drives,
                controlled_by=controlled_by,
                progress=progress,
            )
        tasks.append(
            PreparedTask(
                name=task.name or ("rest" if task.rest else f"task {k + 1}"),
                duration=task.duration_s or own,
                times=task.times,
                rest=task.rest,
                assembly=assembly,
            )
        )
    return tuple(tasks)


def run_cycle(
    run: Run, tasks: tuple[PreparedTask, ...], simulate: Simulate
) -> tuple[TaskLoads, ...]:
    """Loads of the joints during all tasks.

    Args:
        run: Run of the scene itself, which tasks without changes use.
        tasks: The tasks, see :func:`prepare_cycle`.
        simulate: Function that runs a compiled task.

    Raises:
        ComputationError: If a motion diverges or has no initial equilibrium.
    """
    loads = []
    for task in tasks:
        if task.rest:
            loads.append(
                rest_loads(task.name, task.duration, task.times, len(run.joints))
            )
            continue
        done, reasons = run, []
        if task.assembly is not None:
            done = simulate(task.assembly, f"{run.name}, {task.name}")
            reasons = done.metrics()["reasons"]
        loads.append(
            replace(
                motion_loads(done),
                name=task.name,
                duration=task.duration,
                times=task.times,
                reasons=tuple(f"{task.name}: {reason}" for reason in reasons),
            )
        )
    return tuple(loads)
