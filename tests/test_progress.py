"""Progress on stderr: an estimate only where there is something to estimate from."""

from __future__ import annotations

import io
from contextlib import redirect_stderr

import pytest

from swgjoint import progress
from swgjoint.cli import main as command
from swgjoint.cli.main import INTERRUPTED, main
from swgjoint.progress import StderrProgress

NEW = "\r\x1b[K"
"""Goes back to the start of the line and clears it."""


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        """Whether lines are rewritten."""
        return True

    def shown(self) -> str:
        """What it has got since the last call."""
        text = self.getvalue()
        self.seek(0)
        self.truncate()
        return text


@pytest.fixture
def clock(monkeypatch):
    """The time, which the test moves [s]."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


@pytest.mark.parametrize("first", [1, 40])
def test_one_item_says_nothing_about_the_time_left(clock, first):
    """The first call, also of a run that goes on, shows none; the second a true one."""
    tell = StderrProgress()
    with redirect_stderr(Terminal()) as stream:
        tell("map", first, 60)
        assert "left" not in stream.shown()
        clock[0] += 3.0
        tell("map", first + 1, 60)
    assert stream.shown() == f"{NEW}map: {first + 1}/60 {3 * (59 - first)} s left"


def test_a_log_gets_whole_lines_and_few_of_them(clock, capfd):
    """Redirected: the first call, one line in 5 s and the last call, each at once."""
    tell = StderrProgress()
    seen = []
    for done in range(11):
        tell("map", done, 10)
        seen.append(capfd.readouterr().err)
        clock[0] += 2.0
    assert seen[0] == "map: 0/10\n" and seen[10] == "map: 10/10 20.0 s\n"
    assert [k for k, text in enumerate(seen) if text] == [0, 3, 6, 9, 10]
    assert all(c.isprintable() for text in seen for c in text.strip("\n"))


def test_an_open_line_ends_once(clock):
    """A line that is being rewritten ends before a message, a finished one does not."""
    tell = StderrProgress()
    with redirect_stderr(Terminal()) as stream:
        tell("map", 1, 2)
        for _ in range(2):
            tell.end_line()
        assert stream.shown() == f"{NEW}map: 1/2\n"
        tell("map", 2, 2)
        tell.end_line()
    assert stream.shown() == f"{NEW}map: 2/2 0.0 s\n"


@pytest.mark.parametrize("key", [KeyboardInterrupt, OSError(28, "No space left")])
def test_what_stops_a_command_stands_on_its_own_line(monkeypatch, key):
    """An interruption and an error both leave the progress whole above them."""

    def stopped(module, args):
        args.progress("samples", 3, 10)
        raise key

    monkeypatch.setattr(command, "_result", stopped)
    with redirect_stderr(Terminal()) as stream:
        status = main(["map", "reference-2d", "-o", "a.swg"])
    assert status == (INTERRUPTED if key is KeyboardInterrupt else 1)
    head, message = stream.shown().split("\n")[-3:-1]
    assert head.endswith("samples: 3/10")
    assert message.startswith("swgjoint")


def test_a_stage_of_a_foreign_name_is_one_short_line(capsys):
    """A name of thousands of characters, or with controls, does not fill a terminal."""
    progress = StderrProgress()
    progress("run \x1b[31m" + "n" * 5000, 3, 3)
    (line,) = capsys.readouterr().err.splitlines()
    assert len(line) < 150 and line.isprintable()
