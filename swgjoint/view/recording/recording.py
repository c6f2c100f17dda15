"""Write runs to a recording file for the rerun viewer.

The module :mod:`swgjoint.view.recording.entities` lists the entities of a recording.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint.errors import ComputationError
from swgjoint.files import whole
from swgjoint.view.recording.blueprint import blueprint_of, joints_shown
from swgjoint.view.recording.drive_view import drives_shown
from swgjoint.view.recording.entities import log_known, log_measured, log_moving
from swgjoint.view.recording.joint_pictures import phase_scales

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.run import Run


PART = 100_000
"""Number of samples that are sent at a time; it bounds the memory that the recording of
a long run needs."""

FLUSH = 120.0
"""Longest time to wait until a part is written to the file [s]."""


def write_recording(
    runs: Mapping[str, Run], path: str | Path, *, rigid: Run | None = None
) -> Path:
    """Write runs of one motion to a ``.rrd`` file, which is complete or absent.

    Args:
        runs: Runs by the name that the viewer shows; a single run may be called ``""``.
        path: File to write; its folder is created if necessary.
        rigid: Run of the rigid arm to which tool errors refer; None for the commanded
            path.

    Returns:
        Path of the file.

    Raises:
        ComputationError: If the file cannot be written.
    """
    with recording_file(Path(path)) as beside:
        scenes = {label: run.assembly for label, run in runs.items()}
        stream, drives = _begin(beside, scenes)
        _end(stream, path, runs, drives, rigid=rigid)
    return Path(path)


class Recorder:
    """Recording of one run that starts while the simulation is still running.

    Layout and shapes are known in advance. A thread sends them during the simulation,
    while the engine leaves the Python interpreter free. The recorder is a context
    manager; at its exit the file is complete, or absent after a failure.
    """

    def __init__(self, assembly: Assembly, path: str | Path) -> None:
        """Store the arguments; nothing is written yet.

        Args:
            assembly: The scene that is going to be simulated.
            path: File to write; its folder is created if necessary.
        """
        self._scenes = {"": assembly}
        self._stack = contextlib.ExitStack()
        self._path = Path(path)

    def __enter__(self) -> Recorder:
        """Create the temporary file and the thread."""
        self._beside = self._stack.enter_context(recording_file(self._path))
        self._begun: Future[tuple[Any, dict[str, str]]] | None = None
        self._thread = self._stack.enter_context(ThreadPoolExecutor(1))
        return self

    def begin(self) -> None:
        """Start to send layout and shapes; further calls have no effect."""
        if self._begun is None:
            self._begun = self._thread.submit(_begin, self._beside, self._scenes)

    def finish(self, run: Run) -> None:
        """Send the results of the finished run and complete the file.

        Raises:
            ComputationError: If the file cannot be written.
        """
        self.begin()
        assert self._begun is not None
        stream, drives = self._begun.result()
        _end(stream, self._path, {"": run}, drives)

    def __exit__(self, *failure: Any) -> bool | None:
        """Move the file to its final path, or remove it after a failure."""
        return self._stack.__exit__(*failure)


@contextlib.contextmanager
def recording_file(path: Path) -> Iterator[Path]:
    """Yield a temporary file that replaces ``path`` at the end if nothing fails."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as beside:
        yield beside


def begin_stream(stream: Any, path: Path, blueprint: Any) -> None:
    """Write a stream to a file, with its default blueprint.

    Args:
        stream: The stream of the recording.
        path: File to write.
        blueprint: Layout of the viewer.
    """
    import rerun as rr

    # with a blueprint, save waits forever for a writer that a full disk has ended
    stream.save(path)
    rr.send_blueprint(blueprint, make_active=False, recording=stream)


def end_stream(stream: Any, path: str | Path) -> None:
    """Wait until a recording is written completely, and close it.

    Args:
        stream: Rerun recording stream.
        path: File named in the error message.

    Raises:
        ComputationError: If the file cannot be written.
    """
    _flush(stream, path)
    stream.disconnect()


def _flush(stream: Any, path: str | Path) -> None:
    """Wait until everything sent so far is written to the file."""
    try:
        stream.flush(timeout_sec=FLUSH)  # a writer thread that died may never answer
    except RuntimeError as error:  # the writer thread has given up
        raise ComputationError(
            f"cannot write the recording {path}: {error}; the disk may be full"
        ) from None


def _begin(path: Path, scenes: Mapping[str, Assembly]) -> tuple[Any, dict[str, str]]:
    """Start a recording; return its stream and the joint whose drive each run shows."""
    import rerun as rr

    stream = rr.RecordingStream(stream_name(scenes))
    joints = joints_shown(scenes)
    begin_stream(stream, path, blueprint_of(scenes, joints))
    drives = drives_shown(scenes, joints)
    log_known(stream, scenes, drives=drives)
    return stream, drives


def _end(
    stream: Any,
    path: str | Path,
    runs: Mapping[str, Run],
    drives: Mapping[str, str],
    rigid: Run | None = None,
) -> None:
    """Send the results of the runs and complete the file."""
    scales = phase_scales(runs)
    samples = next(iter(runs.values())).time.size
    for first in range(0, samples, PART):
        if first:  # write the previous part before the next one is assembled
            _flush(stream, path)
        part = slice(first, min(first + PART, samples))
        log_moving(stream, runs, scales, drives=drives, rigid=rigid, part=part)
    log_measured(stream, runs, scales)
    end_stream(stream, path)


def stream_name(scenes: Mapping[str, Assembly]) -> str:
    """Name of the recording of these scenes in the viewer."""
    return f"swgjoint {next(iter(scenes.values())).scene.name}"
