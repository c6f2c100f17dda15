"""Laws that the command keeps, whatever it is given; one case at a time."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import sys
import traceback
import warnings
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from hostile.case import Case
from swgjoint.cli.main import main
from swgjoint.explore.sweep.figures import Record
from swgjoint.fe.tolerances.lot import Lot
from swgjoint.maps.cache import code_version
from swgjoint.maps.drive_map import DriveMap

TASKS = ("meshing", "spec", "size", "run")
"""Tables of a sweep that ask for figures."""
LONGEST_LINE = 500
"""Letters of a line on stderr: some lines of a terminal."""
ENGINE_LOG = "MUJOCO_LOG.TXT"
"""The engine leaves it in the current folder; no file of ours."""


_INTERNAL = re.compile(r"internal error|is not written: \w*(Error|Exception): ")
"""A fault of ours, reported by the outermost guard or where a file is written."""


class OutOfTime(BaseException):
    """Raised by an alarm; nothing in the package may catch it."""


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What a command did."""

    status: int | None
    """None where an exception left it."""
    out: str
    err: str
    raised: str
    left: tuple[str, ...]
    """Files of the folder that were not there."""

    @property
    def internal(self) -> bool:
        """Whether a fault of ours ended it, told or not."""
        return bool(self.raised) or _INTERNAL.search(self.err) is not None

    @property
    def outcome(self) -> str:
        """Column of the table: accepted, line, status 1 or traceback."""
        if self.internal:
            return "traceback"
        return {0: "accepted", 2: "line"}.get(self.status or 0, "status 1")


def answer(case: Case, folder: Path) -> Answer:
    """Run the command in a folder of its own, without cache.

    Args:
        case: Files and arguments.
        folder: Empty; the current folder meanwhile.
    """
    for name, data in case.files.items():
        (folder / name).write_bytes(data)
    before = set(os.listdir(folder))
    out, err = (
        io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
        for _ in range(2)
    )
    status, raised = None, ""
    with (
        contextlib.chdir(folder),
        mock.patch.dict(os.environ, {"SWGJOINT_CACHE": ""}),
        warnings.catch_warnings(),
        _no_finite_elements(),
        mock.patch.object(sys, "stdin", io.StringIO()),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        warnings.simplefilter("default")
        try:
            status = main(list(case.argv))
        except SystemExit as exc:  # of argparse
            status = exc.code if isinstance(exc.code, int) else 2
        except BaseException as exc:
            if isinstance(exc, KeyboardInterrupt | OutOfTime):
                raise
            raised = "".join(traceback.format_exception(exc, limit=-4))
    texts = [
        stream.buffer.getvalue().decode("utf-8", "replace")  # type: ignore[attr-defined]
        for stream in (out, err)
    ]
    left = {
        str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()
    }
    return Answer(
        status=status,
        out=texts[0],
        err=texts[1],
        raised=raised,
        left=tuple(sorted(left - before - {ENGINE_LOG})),
    )


def broken_laws(case: Case, found: Answer) -> list[str]:
    """What the answer to a case breaks, one line a law; empty if nothing."""
    broken = []
    if found.raised:
        broken.append(f"an exception left main: {found.raised.splitlines()[-1][:200]}")
    elif found.status not in (0, 1, 2):
        broken.append(f"exit status {found.status}")
    elif found.internal:
        broken.append("an internal error was told")
    if "Traceback" in found.err:
        broken.append("a traceback on stderr")
    lines = [line.partition("; see 'swgjoint")[0] for line in found.err.splitlines()]
    longest = max(map(len, lines), default=0)
    if longest > LONGEST_LINE:
        broken.append(f"a line of {longest} letters on stderr")
    if found.status == 1 and "File name too long" in found.err:
        broken.append("a name that no file has is no bad input")
    if found.status == 2 and not found.err.strip():
        broken.append("refused without a line")
    # a design that cannot be built is a result, with its checks
    if found.status == 2 and found.out and case.argv[:2] != ("design", "check"):
        broken.append("refused with something on stdout")
    broken += _wrong_json(case, found)
    broken += _litter(case, found)
    return broken


def _wrong_json(case: Case, found: Answer) -> list[str]:
    """JSON is one document with numbers that JSON has, in files, too."""
    if "--json" not in case.argv or not found.out or {"-h", "--help"} & {*case.argv}:
        return []
    try:
        json.loads(found.out, parse_constant=_no_number)
    except ValueError as exc:
        return [f"stdout is not JSON: {str(exc)[:100]}"]
    return []


def _no_number(name: str) -> None:
    raise ValueError(f"{name} in JSON")


def _litter(case: Case, found: Answer) -> list[str]:
    """Files that were not asked for, half ones, or any after a refusal."""
    asked = {
        case.argv[k + 1]
        for k, part in enumerate(case.argv[:-1])
        if part in ("--out", "-o", "--output")
    }
    wrong = [
        name
        for name in found.left
        if found.status == 2
        or Path(name).name.startswith((".", "tmp"))
        or name.endswith((".part", ".tmp"))
        or not any(_within(name, place) for place in asked)
    ]
    return [f"left behind: {', '.join(wrong)[:200]}"] if wrong else []


def _within(name: str, place: str) -> bool:
    if os.path.normpath(place) == ".":
        return True
    return name == os.path.normpath(place) or os.path.normpath(name).startswith(
        os.path.normpath(place) + os.sep
    )


@contextlib.contextmanager
def _no_finite_elements() -> Iterator[None]:
    """Drawn figures in place of those that would be computed for minutes.

    What is read, planned, collected, drawn and written is ours; the map of a design is
    that of a catalogue drive.
    """
    lot = "swgjoint.explore.lot"
    with (
        mock.patch("swgjoint.explore.sweep.sweep.compute_all", _drawn_records),
        mock.patch(f"{lot}.perfect_positions", lambda *_: ()),
        mock.patch(f"{lot}.superposition_error", lambda *_: 0.01),
        mock.patch(f"{lot}.sample_lot", _drawn_lot),
        mock.patch("swgjoint.drives.build_map.build_map", _known_map),
    ):
        yield


def _drawn_records(points: Sequence[Any]) -> tuple[str, list[Record]]:
    records = []
    for point in points:
        rng = np.random.default_rng(zlib.crc32(point.key.encode()))
        tasks = [getattr(point.asked, name) for name in TASKS]
        names = [name for task in tasks if task is not None for name in task.figures]
        figures = {name: float(rng.uniform(0.2, 1.5)) for name in names}
        records.append(Record(outcome="ok", figures=figures))
    return code_version(), records


def _drawn_lot(drives: Sequence[Any], *_: Any) -> Lot:
    rng = np.random.default_rng(len(drives))
    shape = (len(drives), 16)
    return Lot(
        input_angle=np.linspace(0.0, np.pi, 16),
        unloaded=1e-5 * rng.standard_normal(shape),
        loaded=1e-5 * rng.standard_normal(shape),
        compliance=np.full(shape, 1e-4),
        whole=np.ones(len(drives), dtype=bool),
    )


def _known_map(*_: Any, **__: Any) -> DriveMap:
    return DriveMap.from_catalogue("CSG-25-100")
