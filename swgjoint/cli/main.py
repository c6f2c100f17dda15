"""Entry point of the ``swgjoint`` command.

Only the module of the chosen command is imported, so that ``--help`` is fast. A
command module has ``configure(parser)``, ``run(args) -> dict`` (the JSON object),
``report(result) -> str`` (text for the terminal) and optionally
``status(result) -> int`` (the exit status). Commands report the progress of long
computations through the callback ``args.progress``.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import textwrap
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from swgjoint import __version__
from swgjoint.errors import InputError, OutputWarning, SwgError, out_of_memory
from swgjoint.memory import keep_freed_memory
from swgjoint.progress import StderrProgress, silent

COMMANDS = {
    "demo": "run the bundled example from finite elements to a recording and a plot",
    "design": "check, plot, export or rescale gear designs",
    "profile": "compute and plot the tooth profiles of both members",
    "meshing": "simulate meshing with finite elements",
    "map": "build the map of a drive and save it to a file",
    "identify": "identify drive parameters and a map from a test-bench log",
    "spec": "print a data sheet for a design, a map or a catalogue drive",
    "run": "simulate a robot arm with its drives",
    "compare": "compare drives or model levels in one scene, against limits",
    "select": "select the cheapest drives of an arm that meet limits",
    "export": "write a drive or an arm with drives for other simulators",
    "accept": "test a drive on a bench, simulated or measured, against limits",
    "lot": "estimate accuracy, ripple and yield of a production lot",
    "tune": "tune a controller in an environment, and compare the result",
    "sweep": "evaluate many designs, locally or on a cluster; resumable",
    "optimise": "search for Pareto-optimal designs",
    "study": "compare swgjoint with published values",
    "bench": "measure error against run time",
    "advise": "find the cheapest level, integrator and step within an error bound",
    "stability": "test the numerical stability of stiff and extreme joints",
    "list": "list the bundled drives, designs, arms and scenes",
    "schema": "list the keys of an input file with unit, range and default",
    "studio": "design a drive and run an arm on a local web page",
    "view": "open a recording in the viewer",
    "doctor": "check versions, the MuJoCo plugin, the cache and optional parts",
}

BAD_INPUT = 2
FAILED = 1
INTERRUPTED = 130
LONGEST, MOST = 500, 50
"""Largest number of characters per line and of lines in one message."""
BROKEN_PIPE = 141
STATUSES = (
    "Exit status: 0 success; 1 the computation failed, or its result misses a limit or"
    " is not valid; 2 bad input, or a design that cannot be built; 130 interrupted."
    " Error messages are printed on stderr and leave stdout empty, also with --json. A"
    " result is printed regardless of the exit status."
)
"""Last paragraph of every help text."""


class Parser(argparse.ArgumentParser):
    """Argument parser that reports an error in one line on stderr, exit status 2."""

    def error(self, message: str) -> NoReturn:
        """Print the error with a pointer to the help text, and exit."""
        line = _cut(f"{self.prog}: {message}")
        self.exit(BAD_INPUT, f"{line}; see '{self.prog} --help'\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: Arguments after the program name; None for those of this process.

    Returns:
        Exit status as listed in :data:`STATUSES`, or 141 if the reader of stdout has
        closed it.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if "OMP_NUM_THREADS" not in os.environ:
        # set before numpy and scipy load OpenBLAS: its threads slow each other down on
        # matrices of this size, and a 3D model would take twice as long
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # an ASCII terminal shows ? in a unit
            stream.reconfigure(errors="replace")
    try:
        if arguments and arguments[0] in COMMANDS:
            return _command(arguments[0], arguments[1:])
        return _top(arguments)
    except BrokenPipeError:
        # the reader closed the pipe: keep the final flush of Python from failing
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return BROKEN_PIPE
    except KeyboardInterrupt:
        print("swgjoint: interrupted", file=sys.stderr)
        return INTERRUPTED


def _top(arguments: list[str]) -> int:
    width = max(map(len, COMMANDS)) + 2
    listing = "\n".join(f"  {name:{width}}{text}" for name, text in COMMANDS.items())
    parser = Parser(
        prog="swgjoint",
        usage="swgjoint COMMAND ... [--json]",
        description="Simulate strain wave gears, from the tooth geometry to the"
        " behaviour of a robot arm.",
        epilog=f"commands:\n{listing}\n\n'swgjoint COMMAND --help' lists the options of"
        f" a command.\n\n{textwrap.fill(STATUSES, 88)}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=__version__)
    parser.add_argument("command", nargs="?", help=argparse.SUPPRESS)
    args, _ = parser.parse_known_args(arguments)
    if args.command is None:
        if arguments:
            parser.error(f"unknown option {arguments[0]}")
        parser.print_help(sys.stderr)
        return BAD_INPUT
    near = get_close_matches(args.command, COMMANDS, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    if args.command in COMMANDS:
        parser.error(f"options belong after the command: swgjoint {args.command} ...")
    command = args.command if len(args.command) <= 40 else f"{args.command[:37]}..."
    parser.error(f"unknown command {command!r}; {hint}accepted: {', '.join(COMMANDS)}")


def command_parser(name: str) -> Parser:
    """Parser of one command, with the options that all commands share.

    Args:
        name: One of :data:`COMMANDS`.
    """
    module = import_module(f"swgjoint.cli.{name}")
    parser = Parser(
        prog=f"swgjoint {name}", description=COMMANDS[name], allow_abbrev=False
    )
    module.configure(parser)
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object on stdout"
    )
    loudness = parser.add_mutually_exclusive_group()
    loudness.add_argument(
        "--quiet", action="store_true", help="hide progress, but not warnings"
    )
    loudness.add_argument(
        "--verbose",
        action="store_true",
        help="print every progress step on a separate line",
    )
    parser.add_argument(
        "--traceback",
        action="store_true",
        help="print the traceback after an internal error",
    )
    parser.epilog = f"{parser.epilog or ''} {STATUSES}".strip()
    return parser


def _command(name: str, arguments: list[str]) -> int:
    module = import_module(f"swgjoint.cli.{name}")
    parser = command_parser(name)
    args = parser.parse_args(arguments)
    for option in ("out", "output"):
        if getattr(args, option, None) == "":
            parser.error(f"--{option} '': expected a path, not an empty text")
    progress = StderrProgress(verbose=args.verbose)
    args.progress = silent if args.quiet else progress
    keep_freed_memory()
    incomplete: list[str] = []
    try:
        with warnings.catch_warnings(), _ended(progress), _rare_collections():
            warnings.showwarning = partial(_show_warning, set(), incomplete)
            result = _result(module, args)
    except SwgError as exc:
        bad_input = isinstance(exc, InputError)
        return _refuse(name, str(exc), BAD_INPUT if bad_input else FAILED)
    except BrokenPipeError:
        raise
    except OSError as exc:  # disk full, no permission: no bug in swgjoint
        prefix = f"{exc.filename}: " if exc.filename else ""
        return _refuse(name, f"{prefix}{exc.strerror or exc}", FAILED)
    except Exception as exc:
        if isinstance(exc.__cause__, KeyboardInterrupt):  # while a module was imported
            raise exc.__cause__ from None
        if out_of_memory(exc):
            return _refuse(name, "out of memory: use a smaller refinement", FAILED)
        # a bug in swgjoint: print one line, which tells how to report it
        if args.traceback:
            traceback.print_exc()
        return _refuse(name, _internal(exc, shown=args.traceback), FAILED)
    status = getattr(module, "status", None)
    return (int(status(result)) if status else 0) or int(bool(incomplete)) * FAILED


def _result(module: ModuleType, args: argparse.Namespace) -> dict[str, Any]:
    """Run the command and print its result."""
    if args.json:
        from swgjoint.json_text import json_text

        with _stdout_on_stderr():
            result: dict[str, Any] = module.run(args)
        print(json_text(result, ascii_only=True))
    else:
        result = module.run(args)
        print(module.report(result))
    sys.stdout.flush()
    return result


def _refuse(name: str, message: str, status: int) -> int:
    lines = message.splitlines()
    for line in lines[:MOST]:
        print(_cut(f"swgjoint {name}: {line}"), file=sys.stderr)
    if len(lines) > MOST:
        print(f"swgjoint {name}: {len(lines) - MOST} more errors", file=sys.stderr)
    return status


def _internal(exc: Exception, *, shown: bool) -> str:
    """Describe an unexpected exception in one line."""
    last = traceback.extract_tb(exc.__traceback__)[-1]
    text = " ".join(str(exc).split())[:200]
    more = "" if shown else " of the same command with --traceback"
    return (
        f"internal error: {type(exc).__name__} at {Path(last.filename).name}:"
        f"{last.lineno}{': ' if text else ''}{text}; please report it together with"
        f" the input and the output{more}"
    )


def _show_warning(
    shown: set[str],
    incomplete: list[str],
    message: Warning | str,
    category: type[Warning],
    *_: Any,
    **__: Any,
) -> None:
    """Print a warning once; also collect it if it reports a missing output file."""
    if str(message) not in shown:
        print(_cut(f"swgjoint: warning: {message}"), file=sys.stderr)
    shown.add(str(message))
    if issubclass(category, OutputWarning):
        incomplete.append(str(message))


def _cut(line: str) -> str:
    """Remove control characters from a line of a message and limit its length."""
    line = "".join(c if c.isprintable() or c == "\t" else "?" for c in line)
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 3]}..."


@contextmanager
def _rare_collections() -> Iterator[None]:
    """Search for unreachable cycles of objects after 50,000 instead of 700 new ones.

    Imports and pictures make many small objects, almost all of which stay reachable.
    """
    before = gc.get_threshold()
    gc.set_threshold(50_000, 20, 50)
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def _ended(progress: StderrProgress) -> Iterator[None]:
    """End the progress line before other text is printed, also after an exception."""
    try:
        yield
    finally:
        progress.end_line()


@contextmanager
def _stdout_on_stderr() -> Iterator[None]:
    """Redirect everything that libraries print, also from C code, to stderr."""
    kept, sys.stdout = sys.stdout, sys.stderr
    copy = os.dup(1)
    try:
        os.dup2(2, 1)
        yield
    finally:
        sys.stdout = kept
        os.dup2(copy, 1)
        os.close(copy)
