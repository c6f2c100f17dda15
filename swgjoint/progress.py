"""Progress of long computations: a callback, and its display on the command line."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Callback with the arguments (stage, done, total)."""


def silent(stage: str, done: int, total: int) -> None:
    """Show nothing.

    Args:
        stage: Name of the stage.
        done: Number of completed items.
        total: Number of items.
    """


LONGEST = 100
"""Largest length of the name of a stage [characters], which may contain text from a
file; longer names are cut off."""


class StderrProgress:
    """Print the progress of every stage on stderr.

    In a terminal, one line per stage is rewritten at most every 0.1 s; in a log, a line
    is added at most every 5 s. The remaining time is estimated only from items that
    were completed since the first call of the stage, because items of an interrupted
    earlier run do not indicate the speed of this one.

    Args:
        verbose: Whether to print a line at every call, with the time since the stage
            began.
    """

    def __init__(self, *, verbose: bool = False) -> None:
        self._verbose = verbose
        self._stage = ""
        self._start = 0.0
        self._first = 0
        self._shown = 0.0
        self._open = False

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show the progress and the remaining time.

        Args:
            stage: Name of the stage.
            done: Number of completed items.
            total: Number of items.
        """
        stage = "".join(c if c.isprintable() else "?" for c in stage[:LONGEST])
        now = time.monotonic()
        if stage != self._stage:
            self.end_line()
            self._stage, self._start, self._first, self._shown = stage, now, done, 0.0
        last = done >= total
        if self._verbose:
            spent = now - self._start
            print(f"{stage}: {done}/{total} after {spent:.1f} s", file=sys.stderr)
            return
        live = sys.stderr.isatty()
        if not last and now - self._shown < (0.1 if live else 5.0):
            return
        self._shown = now
        spent, seen = now - self._start, done - self._first
        tail = f" {spent:.1f} s" if last else ""
        if seen > 0 and not last:
            tail = f" {spent / seen * (total - done):.0f} s left"
        end = "\n" if last or not live else ""
        start = "\r\x1b[K" if live else ""
        print(f"{start}{stage}: {done}/{total}{tail}", end=end, file=sys.stderr)
        self._open = not end

    def end_line(self) -> None:
        """End a line that is being rewritten, so that a message can follow."""
        if self._open:
            print(file=sys.stderr)
            self._open = False
