"""Computations in processes of their own, which report progress and can be stopped."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
import traceback
from collections.abc import Callable
from functools import cache
from multiprocessing.connection import Connection
from typing import Any

from swgjoint.errors import SwgError, out_of_memory

PRELOADED = "swgjoint.studio.work"
"""Module with the computations; it is loaded once, and every process is forked from
there, so that it starts within milliseconds where the system can fork."""
INTERVAL = 0.2
"""Shortest time between two progress messages [s]."""


class Job:
    """One computation; :meth:`poll` tells how far it is.

    Args:
        function: Picklable function that takes ``args`` and the keyword ``progress``.
        args: Arguments of the function.
    """

    def __init__(self, function: Callable[..., Any], *args: Any) -> None:
        self.stage = ""
        """Current stage and its share, as text."""
        self.share = 0.0
        """Finished share of the current stage, 0 to 1."""
        self.running = True
        """Whether the computation still runs."""
        self.result: Any = None
        """Result of the function; None until it has succeeded."""
        self.fault = ""
        """Message of a failure; empty if there was none."""
        context = _context()
        self._pipe, far = context.Pipe()
        self._process = context.Process(
            target=_work, args=(far, function, args), daemon=True
        )
        self._process.start()
        far.close()

    @property
    def pid(self) -> int:
        """Identifier of the process."""
        return int(self._process.pid)

    def poll(self) -> bool:
        """Take in what the process has sent; return whether anything has changed."""
        changed = False
        try:
            while self.running and self._pipe.poll():
                kind, content = self._pipe.recv()
                changed = True
                if kind == "progress":
                    self.stage, self.share = content
                    continue
                self.running = False
                setattr(self, kind, content)
        except (EOFError, OSError):
            self.running, changed = False, True
            self.fault = "the process ended without a result: out of memory, or killed"
        if changed and not self.running:
            self.cancel()
        return changed

    def cancel(self) -> None:
        """End the process and wait for its end; harmless if it has ended."""
        self.running = False
        self._pipe.close()
        self._process.kill()
        self._process.join()


def start_server() -> None:
    """Load the computations once, so that the first one need not wait for it.

    The first start of a process waits for that, in which time a page gets no answer.
    """
    process = _context().Process(target=_do_nothing)
    process.start()
    process.join()


def _do_nothing() -> None:
    pass


def _work(
    pipe: Connection, function: Callable[..., Any], args: tuple[Any, ...]
) -> None:
    """Run the function in the process and send its result or its failure."""
    threading.Thread(target=_end_with, args=(pipe,), daemon=True).start()
    shown = 0.0

    def progress(stage: str, done: int, total: int) -> None:
        nonlocal shown
        if time.monotonic() - shown >= INTERVAL or done == 0:
            shown = time.monotonic()
            share = done / total if total > 0 else 0.0
            pipe.send(("progress", (f"{stage}: {done}/{total}", min(share, 1.0))))

    try:
        message = ("result", function(*args, progress=progress))
    except SwgError as error:
        message = ("fault", str(error))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{os.path.basename(last.filename)}:{last.lineno}"
        text = f"internal error: {type(error).__name__} at {where}: {error}"
        memory = "out of memory: use a smaller refinement"
        message = ("fault", memory if out_of_memory(error) else text)
    pipe.send(message)


def _end_with(pipe: Connection) -> None:
    """End this process once the page that waits for its result has gone."""
    try:
        pipe.recv()
    except (EOFError, OSError):
        os._exit(1)


@cache
def _context() -> Any:
    if "forkserver" in multiprocessing.get_all_start_methods():
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([PRELOADED])
        return context
    return multiprocessing.get_context("spawn")
