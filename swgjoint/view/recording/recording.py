"""Runs as a recording for the rerun viewer, made of the entities beside this module."""

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
"""Samples that are sent at a time: a long run needs no more memory for its recording
than a short one."""

FLUSH = 120.0
"""Longest wait until a part is in its file [s]."""


def write_recording(
    runs: Mapping[str, Run], path: str | Path, *, rigid: Run | None = None
) -> Path:
    """Write runs of one motion into one ``.rrd`` file, whole or not at all.

    Args:
        runs: Runs by the name that the viewer shows; a lone run may be called ``""``.
        path: File to write; its folder is made.
        rigid: The run that tool errors refer to; None for the commanded path.

    Returns:
        The path.
    """
    with recording_file(Path(path)) as beside:
        scenes = {label: run.assembly for label, run in runs.items()}
        stream, drives = _begin(beside, scenes)
        _end(stream, path, runs, drives, rigid=rigid)
    return Path(path)


class Recorder:
    """A recording of one run that begins while the run goes on.

    Layout and shapes are known before: they are sent beside the steps, which the engine
    takes without Python. Used as a context, the file is there whole after it, or not at
    all.
    """

    def __init__(self, assembly: Assembly, path: str | Path) -> None:
        """Nothing is written yet.

        Args:
            assembly: The scene that is going to be run.
            path: File to write; its folder is made.
        """
        self._scenes = {"": assembly}
        self._stack = contextlib.ExitStack()
        self._path = Path(path)

    def __enter__(self) -> Recorder:
        """Make the file."""
        self._beside = self._stack.enter_context(recording_file(self._path))
        self._begun: Future[tuple[Any, dict[str, str]]] | None = None
        self._thread = self._stack.enter_context(ThreadPoolExecutor(1))
        return self

    def begin(self) -> None:
        """Start to send what is known; once, however often it is called."""
        if self._begun is None:
            self._begun = self._thread.submit(_begin, self._beside, self._scenes)

    def finish(self, run: Run) -> None:
        """Send the rest when the run is done."""
        self.begin()
        assert self._begun is not None
        stream, drives = self._begun.result()
        _end(stream, self._path, {"": run}, drives)

    def __exit__(self, *failure: Any) -> bool | None:
        """Put the file in its place, or remove it after a failure."""
        return self._stack.__exit__(*failure)


@contextlib.contextmanager
def recording_file(path: Path) -> Iterator[Path]:
    """A file beside the path that takes its place at the end if nothing fails."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as beside:
        yield beside


def end_stream(stream: Any, path: str | Path) -> None:
    """Wait until all of a recording is in its file, and close it.

    Raises:
        ComputationError: If it cannot be written.
    """
    _flush(stream, path)
    stream.disconnect()


def _flush(stream: Any, path: str | Path) -> None:
    """Wait until what was sent so far is in the file of a recording."""
    try:
        stream.flush(timeout_sec=FLUSH)  # a writer that died need not answer
    except RuntimeError as error:  # the thread that writes has given up
        raise ComputationError(
            f"cannot write the recording {path}: {error}; the disk may be full"
        ) from None


def _begin(path: Path, scenes: Mapping[str, Assembly]) -> tuple[Any, dict[str, str]]:
    """The recording with what is known before the runs, and the drives it shows."""
    import rerun as rr

    stream = rr.RecordingStream(stream_name(scenes))
    joints = joints_shown(scenes)
    stream.save(path, default_blueprint=blueprint_of(scenes, joints))
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
    """What follows from the runs, and the end of the file."""
    scales = phase_scales(runs)
    samples = next(iter(runs.values())).time.size
    for first in range(0, samples, PART):
        if first:  # what was sent is in the file before more is put together
            _flush(stream, path)
        part = slice(first, min(first + PART, samples))
        log_moving(stream, runs, scales, drives=drives, rigid=rigid, part=part)
    log_measured(stream, runs, scales)
    end_stream(stream, path)


def stream_name(scenes: Mapping[str, Assembly]) -> str:
    """What the viewer calls a recording of these scenes."""
    return f"swgjoint {next(iter(scenes.values())).scene.name}"
