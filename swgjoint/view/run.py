"""Scenes simulated for users: the run, and its recording for the viewer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from swgjoint.files import attempt_output
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.controller import Controller, KnownArm
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.simulation import prepare_scene, simulate


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneRun(Run):
    """A recorded run that can be written for the rerun viewer."""

    def to_rerun(self, path: str | Path) -> Path:
        """Write the recording for the rerun viewer; see :mod:`swgjoint.view`."""
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
    """Simulate a scene from an equilibrium to its end.

    A step that lies outside the region in which a joint's integration holds is cut into
    ``run.assembly.sub_steps`` equal parts; the run records the scene's steps.

    Args:
        scene: A scene, the path of a scene file, or the name of a bundled one.
        overrides: Dotted keys of the scene with other values, as a mapping or as
            ``key=value`` texts.
        drives: Maps that replace the scene's drive references of these names.
        controller: Drives the motors in place of the scene's own law, once a control
            period on what the sensors of the scene read; limits of the motors,
            payload, disturbances and start stay the scene's. It reads the link angle
            where ``controller.feedback`` is ``link``, the output torque where
            ``sensors.torque`` is there.
        known_drives: Drive maps that the controller assumes for some joints; for the
            others it assumes the simulated drive.
        known_arm: What it takes the arm for, for instance
            :class:`swgjoint.control.pinocchio_arm.PinocchioArm`, whose torques its
            feed-forward then has; None: the scene's arm, with its payload if known.
        name: What recordings and progress call the run; default: the scene's name.
        recording: File that receives the recording for the viewer, like
            :meth:`SceneRun.to_rerun` but begun while the steps are taken; a recording
            that cannot be written is an ``OutputWarning``; the run is still returned.
        progress: Called with the steps done.

    Raises:
        InputError: If the scene, a drive or a joint cannot be used.
        ComputationError: If the start is out of balance or the motion diverges.
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
    if recording is None:
        return _for_user(simulate(assembly, name=name, loop=loop, progress=progress))
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
    return _for_user(run)


def _for_user(run: Run) -> SceneRun:
    return SceneRun(**{one.name: getattr(run, one.name) for one in fields(run)})
