"""Commands that are killed and given again: same result, little work twice, no litter.

Linux, whose ``/proc`` tells the processes of a command.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import begun

CACHE = "cache"
"""Folder of the cache inside that of a case."""
COSTS = {
    *("wall_s", "work_s", "cpu_s", "workers", "efficiency", "reused", "computed"),
    *("sampling_wall_s", "steps_per_s", "evaluation_s", "seconds", "files"),
}
"""Entries of results that say how they came about."""
PATIENCE_S = 20.0
"""For which the processes of a killed command may still be there."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """One command in a folder of its own."""

    name: str
    arguments: tuple[str, ...]
    unit: str
    """What one process computes at a time."""
    begins: str
    """The function that begins a unit, see :data:`begun.UNIT`."""
    settings: str = ""
    """Statements before the command, for what it has no option for."""
    inputs: Mapping[str, str] = field(default_factory=dict)
    """Files of the folder by name."""
    kept: Callable[[Path], Mapping[str, Any]]
    """What is in the folder by name, each with what changes if it is done again."""
    result: Callable[[Path, dict[str, Any]], Any] = lambda folder, printed: printed
    """What has to be the same, of the folder and the JSON that the command prints."""
    sound: Callable[[Path], bool] = lambda folder: True
    """Whether what was there before is whole after the kill."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one interruption."""

    kept: int
    """Units in the folder when the command was killed."""
    again: int
    """Of these, those that the second run did once more."""
    begun: int
    """Units that were begun when the command was killed."""
    twice: int
    """Of these, those that the second run began once more."""
    sound: bool
    same: bool
    litter: tuple[str, ...]
    """Files that an uninterrupted run does not leave, or the other way round."""
    left: tuple[int, ...]
    """Processes that outlived the command."""


def prepared(case: Case, folder: Path) -> Path:
    """The folder with the inputs of a case."""
    folder.mkdir(parents=True)
    for name, text in case.inputs.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def started(case: Case, folder: Path) -> subprocess.Popen[str]:
    """The command, its progress in a file."""
    code = (
        f"import sys, begun; begun.watch(); {case.settings}\n"
        "from swgjoint.cli.main import main; sys.exit(main())"
    )
    note = {begun.UNIT: case.begins, begun.FILE: str(note_of(folder))}
    path = [str(Path(begun.__file__).parent), os.environ.get("PYTHONPATH", "")]
    note["PYTHONPATH"] = os.pathsep.join(filter(None, path))
    note_of(folder).write_text("")
    with log_of(folder).open("w") as log:
        return subprocess.Popen(
            [sys.executable, "-P", "-c", code, *case.arguments, "--json"],
            cwd=folder,
            env={**os.environ, "SWGJOINT_CACHE": str(folder / CACHE), **note},
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
        )


def finished(case: Case, folder: Path) -> dict[str, Any]:
    """What the command prints when nothing stops it."""
    process = started(case, folder)
    printed, _ = process.communicate()
    assert process.returncode == 0, log_of(folder).read_text()
    found: dict[str, Any] = json.loads(printed)
    return found


def note_of(folder: Path) -> Path:
    """Where the units are noted that the command of a folder begins."""
    return folder.parent / f"{folder.name}.begun"


def units(folder: Path) -> int:
    """Units that the last command of a folder has begun."""
    return len(note_of(folder).read_text().splitlines())


def log_of(folder: Path) -> Path:
    """Where the command that runs in a folder says what it does."""
    return folder.parent / f"{folder.name}.log"


def interrupted(
    case: Case,
    folder: Path,
    stop: Callable[[], bool],
    whole: tuple[Path, dict[str, Any]],
) -> Outcome | None:
    """Kill the command when ``stop`` says so, then give it again.

    Args:
        case: The command.
        folder: Prepared for it.
        stop: Asked again and again while it runs.
        whole: Folder and output of a run that nothing stopped.

    Returns:
        None if it ended before.
    """
    process = started(case, folder)
    while process.poll() is None and not stop():
        time.sleep(0.01)
    if process.poll() is not None:
        process.communicate()
        return None
    processes = children(process.pid)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    end = time.monotonic() + PATIENCE_S
    while (left := tuple(filter(running, processes))) and time.monotonic() < end:
        time.sleep(0.05)
    kept, first = case.kept(folder), units(folder)
    sound = case.sound(folder)
    printed = finished(case, folder)
    after = case.kept(folder)
    unlike = files(folder) ^ files(whole[0])
    return Outcome(
        kept=len(kept),
        again=sum(after.get(name, token) != token for name, token in kept.items()),
        begun=first,
        twice=first + units(folder) - units(whole[0]),
        sound=sound,
        same=plain(case, folder, printed) == plain(case, *whole),
        litter=tuple(sorted(unlike)),
        left=left,
    )


def plain(case: Case, folder: Path, printed: dict[str, Any]) -> str:
    """A result as text, without what it cost and where it is."""
    return json.dumps(_free(case.result(folder, printed))).replace(str(folder), "")


def _free(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _free(v) for k, v in value.items() if k not in COSTS}
    return [_free(v) for v in value] if isinstance(value, list | tuple) else value


def stored(pattern: str) -> Callable[[Path], dict[str, int]]:
    """Files of a folder and when they were written, for :attr:`Case.kept`."""

    def found(folder: Path) -> dict[str, int]:
        return {
            str(path.relative_to(folder)): path.stat().st_mtime_ns
            for path in folder.glob(pattern)
            if not path.name.startswith(".")
        }

    return found


def files(folder: Path) -> set[str]:
    """Names of all files below a folder, and of its empty folders."""
    return {
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if path.is_file() or not any(path.iterdir())
    }


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    text = "".join(p.read_text() for p in Path(f"/proc/{pid}/task").glob("*/children"))
    return [int(child) for child in text.split()]


def running(pid: int) -> bool:
    """Whether there is such a process that has not ended."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2]
    except FileNotFoundError:
        return False
    return state.split()[0] != "Z"
