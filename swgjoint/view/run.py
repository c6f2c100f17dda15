"""Simulate a scene and, on request, record it for the viewer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from swgjoint.files import attempt_output
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.controller import Controller, KnownArm
from swgjoint.sim.life.cycle import prepare_cycle, run_cycle
from swgjoint.sim.run import Run
from swgjoint.sim.sampled_loop import GivenLoop
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.task import task_of
from swgjoint.sim.simulation import prepare_scene, simulate


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneRun(Run):
    """A recorded run that can be exported to the rerun viewer."""

    def to_rerun(self, path: str | Path) -> Path:
        """Write a recording for the rerun viewer and return its path.

        See :mod:`swgjoint.view.recording.recording`.

        Raises:
            ComputationError: If the file cannot be written.
        """
        from swgjoint.view.recording.recording import write_recording

        return write_recording({"": self}, path)


def run_scene(
    scene: Scene | str | Path,
    *,
    overrides: Mapping[str, Any] | Iterable[str] | None = None,
    drives: Mapping[str, DriveMap] | None = None,
    controller: Controller | None = None,
    known_drives: Mapping[str, DriveMap] | None = None,
    known_arm: KnownArm | None = None,
    name: str | None = None,
    recording: str | Path | None = None,
    progress: Progress = silent,
) -> SceneRun:
    """Simulate a scene from its initial equilibrium to its end.

    If the step of the scene is outside the stability region of a joint, every step is
    divided into ``run.assembly.sub_steps`` equal sub-steps. The run records only the
    states at the steps of the scene.

    If the scene has a duty cycle, each of its tasks is simulated after the scene itself
    and contributes to the life of the drives; the recording contains only the motion of
    the scene.

    Args:
        scene: A scene, the path of a scene file, or the name of a bundled scene.
        overrides: New values for dotted keys of the scene, as a mapping or as
            ``key=value`` strings.
        drives: Maps to use for drive references of the scene, by reference.
        controller: Controller that replaces the control law of the scene. It acts once
            per control period on the sensor readings of the scene. Motor limits,
            payload, disturbances and initial state remain those of the scene. It reads
            the link angle if ``controller.feedback`` is ``link``, and the output torque
            if the scene has ``sensors.torque``.
        known_drives: Drive maps that the controller assumes, by joint; for all other
            joints it assumes the simulated drive.
        known_arm: Arm model that the controller assumes, for instance
            :class:`swgjoint.control.pinocchio_arm.PinocchioArm`; its torques enter the
            feed-forward. None for the arm of the scene, with the payload that the
            controller knows.
        name: Name of the run in recordings and progress; None for the scene's name.
        recording: File for a viewer recording, which is written together with the run;
            :meth:`SceneRun.to_rerun` writes the same recording later. If it cannot be
            written, an ``OutputWarning`` is issued and the run is still returned.
        progress: Called with the stage, the number of completed steps and their total.

    Returns:
        The recorded run.

    Raises:
        InputError: If the scene, a drive or a joint cannot be used, or if
            ``known_drives`` or ``known_arm`` is given without a controller.
        ComputationError: If the initial state is not an equilibrium or the motion
            diverges.
    """
    assembly, loop = prepare_scene(
        scene,
        overrides=overrides,
        drives=drives,
        controller=controller,
        known_drives=known_drives,
        known_arm=known_arm,
        progress=progress,
    )
    name = name or assembly.scene.name
    tasks = prepare_cycle(
        assembly.scene,
        drives=drives,
        controlled_by=assembly.controlled_by,
        progress=progress,
    )

    def task_run(task: Assembly, label: str) -> Run:
        own: GivenLoop | None = None
        if controller is not None:
            own = GivenLoop(task, controller, task_of(task, known_drives, known_arm))
        return simulate(task, name=label, loop=own, progress=progress)

    def with_cycle(run: Run) -> Run:
        return replace(run, cycle=run_cycle(run, tasks, task_run))

    if recording is None:
        return _for_user(
            with_cycle(simulate(assembly, name=name, loop=loop, progress=progress))
        )
    from swgjoint.view.recording.recording import Recorder

    run: Run | None = None
    with attempt_output(recording, unless=lambda: run is None):
        with Recorder(assembly, recording) as recorder:

            def going(label: str, done: int, total: int) -> None:
                recorder.begin()
                progress(label, done, total)

            run = simulate(assembly, name=name, loop=loop, progress=going)
            recorder.finish(run)
        run = replace(run, recording=Path(recording))
    assert run is not None
    return _for_user(with_cycle(run))


def _for_user(run: Run) -> SceneRun:
    return SceneRun(**{one.name: getattr(run, one.name) for one in fields(run)})
