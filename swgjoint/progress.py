"""Progress of long work: a callback that libraries call and the command line shows."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called with (stage, done, total)."""


def silent(stage: str, done: int, total: int) -> None:
    """Show nothing."""


LONGEST = 100
"""Characters of a stage, which may have a name from a file in it."""


class StderrProgress:
    """One line per stage on stderr, rewritten in a terminal, sparse in a log.

    The time left follows from the items that were done while this object watched: what
    an interrupted run had already done says nothing about the speed of this one, and a
    single item says nothing at all.

    Args:
        verbose: Whether every step has a line of its own, with the time since the
            stage began.
    """

    def __init__(self, *, verbose: bool = False) -> None:
        self._verbose = verbose
        self._stage = ""
        self._start = 0.0
        self._first = 0
        self._shown = 0.0
        self._open = False

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show the stage, the share done and the time left."""
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
        """End a line that is still being rewritten, so that a message can follow."""
        if self._open:
            print(file=sys.stderr)
            self._open = False
