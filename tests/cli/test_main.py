"""The command line frame: status, one line per fault, JSON and nothing else."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import time
import warnings
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from messages import names

from swgjoint import __version__
from swgjoint.cli import main as frame
from swgjoint.cli.main import COMMANDS, main
from swgjoint.errors import ComputationError, DesignError, MissingExtraError
from swgjoint.files import Outputs


@pytest.fixture
def command(monkeypatch):
    """Let the command ``doctor`` do something else; its work is the argument."""

    def replaced(work, **more):
        module = SimpleNamespace(
            configure=lambda parser: parser.add_argument("--size", type=float),
            run=work,
            report=lambda result: f"report of {result}",
            **more,
        )
        monkeypatch.setattr(frame, "import_module", lambda name: module)

    return replaced


def shell(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "swgjoint", *arguments],
        capture_output=True,
        text=True,
        **options,
    )


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_there(name, capsys):
    """Each command of the table has its module, its help and --json."""
    module = import_module(f"swgjoint.cli.{name}")
    assert callable(module.run)
    assert callable(module.report)
    with pytest.raises(SystemExit) as left:
        main([name, "--help"])
    assert left.value.code == 0
    assert "--json" in capsys.readouterr().out


ALGEBRA = """
import os
from swgjoint.cli.main import main
try:
    main(["--version"])
finally:
    import scipy.linalg
    tasks = "/proc/self/task"
    threads = len(os.listdir(tasks)) if os.path.exists(tasks) else "uncounted"
    print(os.getenv("OPENBLAS_NUM_THREADS"), threads)
"""


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "1"),
        ({"OPENBLAS_NUM_THREADS": "2"}, "2"),
        ({"OMP_NUM_THREADS": "2"}, "None"),
    ],
)
def test_algebra_has_one_thread_unless_asked(given, told):
    """Numpy and scipy each bring a pool of threads, which fight for the cores."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    clean = {k: v for k, v in os.environ.items() if k not in names}
    script = [sys.executable, "-c", ALGEBRA]
    done = subprocess.run(script, capture_output=True, text=True, env=clean | given)
    setting, threads = done.stdout.split()[-2:]
    assert setting == told
    if not given:
        assert threads in ("1", "uncounted")


def test_help_lists_the_commands(capsys):
    """--help goes to stdout and names every command."""
    with pytest.raises(SystemExit) as left:
        main(["--help"])
    assert left.value.code == 0
    out = capsys.readouterr().out
    assert all(f"  {name}" in out for name in COMMANDS)


def test_help_is_quick():
    """--help takes less than three starts of Python: numpy alone would take more."""

    def taken(*arguments: str) -> float:
        start = time.perf_counter()
        subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
        return time.perf_counter() - start

    pairs = [(taken("-m", "swgjoint", "--help"), taken("-c", "")) for _ in range(7)]
    asked, bare = np.min(pairs, axis=0)
    assert asked < 3.0 * bare


def test_version(capsys):
    """--version prints the version alone."""
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    assert capsys.readouterr().out == f"{__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["meshin"], ("'meshin'", "meshing", "design", "doctor")),
        (["--jsn"], ("option", "--jsn")),
        (["--json", "doctor"], ("options", "swgjoint doctor ...")),
        (["doctor", "--bad"], ("arguments", "--bad")),
        (["doctor", "--js"], ("arguments", "--js")),
        (["map", "reference-2d"], ("required", "-o/--output")),
        (["run", "bench", "--out", ""], ("--out", "''", "path")),
        (["map", "reference-2d", "-o", ""], ("--output", "''", "path")),
        (["meshing", "reference-2d", "--steps", "x"], ("--steps", "int", "'x'")),
        (
            ["meshing", "reference-2d", "--linear", "--nonlinear"],
            ("--nonlinear", "--linear"),
        ),
    ],
)
def test_wrong_arguments(arguments, message, capsys):
    """A wrong command or option is one line on stderr with status 2."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert names(err, *message)


@pytest.mark.parametrize(
    ("error", "status", "lines"),
    [
        (DesignError("a.toml: x\na.toml: y"), 2, ["a.toml: x", "a.toml: y"]),
        (ComputationError("did not settle"), 1, ["did not settle"]),
        (MissingExtraError("needs casadi"), 1, ["needs casadi"]),
        (OSError(28, "No space left on device", "a.png"), 1, None),
        (MemoryError(), 1, None),
    ],
)
@pytest.mark.parametrize("options", [[], ["--json"]])
def test_errors_are_lines(command, capsys, error, status, lines, options):
    """Errors are lines on stderr, stdout stays empty, the status says which kind."""

    def work(args):
        raise error

    command(work)
    assert main(["doctor", *options]) == status
    out, err = capsys.readouterr()
    assert out == ""
    found = err.splitlines()
    if lines is None:
        assert len(found) == 1
    else:
        assert found == [f"swgjoint doctor: {line}" for line in lines]


@pytest.mark.parametrize("options", [[], ["--json"], ["--traceback"]])
@pytest.mark.parametrize(
    "error",
    [ZeroDivisionError(), RecursionError("x" * 5000), KeyError("a\nb"), TypeError("µ")],
)
def test_a_defect_is_one_line(command, capsys, error, options):
    """An error that is not ours is one line that asks for a report; status 1."""

    def work(args):
        raise error

    command(work)
    assert main(["doctor", *options]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert ("Traceback" in err) == ("--traceback" in options)
    last = err.splitlines()[-1]
    assert len(last) <= 500 and (err.count("\n") == 1 or "--traceback" in options)
    assert names(last, "internal error", type(error).__name__, "test_main.py", "report")


def test_a_missing_output_leaves_the_figures(command, capsys, tmp_path):
    """The result is printed, the file is named, and the status is 1."""

    def work(args):
        outputs = Outputs(tmp_path)
        outputs.write("a.png", lambda: 1 / 0)
        return {"figure": 1.5, "files": outputs.files}

    command(work)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        assert main(["doctor", "--json"]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out) == {"figure": 1.5, "files": []}
    assert err.count("\n") == 1
    assert names(err, "warning", "a.png", "not written", "ZeroDivisionError")


def test_long_messages_are_cut(command, capsys):
    """A message has 51 lines at most, each of up to 500 printable characters."""

    def work(args):
        raise DesignError("\n".join(["\x1b[2J" + "k" * 5000] * 1000))

    command(work)
    assert main(["doctor"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 51 and max(map(len, lines)) <= 500
    assert all(line.isprintable() for line in lines)
    assert names(lines[-1], "950", "more")
    for arguments in (
        ["k" * 5000],
        ["doctor", "k" * 5000],
        ["doctor", "--size", "k" * 5000],
    ):
        with pytest.raises(SystemExit):
            main(arguments)
        assert len(capsys.readouterr().err) < 600


def test_collections_are_rare_while_a_command_runs(command):
    """The thresholds of the caller are back afterwards, also after an error."""
    before, seen = gc.get_threshold(), []

    def work(args):
        seen.append(gc.get_threshold()[0])
        if len(seen) > 1:
            raise DesignError("no such drive")
        return {}

    command(work)
    for status in (0, 2):
        assert main(["doctor"]) == status
        assert gc.get_threshold() == before
    assert seen == [50_000, 50_000]


def test_json_is_alone_on_stdout(command, capfd):
    """With --json what the work prints, from Python or C, goes to stderr."""

    def work(args):
        print("from python")
        sys.stdout.flush()
        os.write(1, b"from c\n")
        return {
            "a": np.float64(1.5),
            "b": np.arange(3),
            "c": [np.nan, np.inf],
            "d": "µ",
        }

    command(work)
    assert main(["doctor", "--json"]) == 0
    out, err = capfd.readouterr()
    assert json.loads(out) == {"a": 1.5, "b": [0, 1, 2], "c": [None, None], "d": "µ"}
    assert "from python" in err
    assert "from c" in err


def test_terminal_report(command, capsys):
    """Without --json the report is printed; options and progress reach the work."""

    def work(args):
        args.progress("stage", 2, 2)
        return {"size": args.size}

    command(work)
    assert main(["doctor", "--size", "3"]) == 0
    out, err = capsys.readouterr()
    assert out == "report of {'size': 3.0}\n"
    assert "stage: 2/2" in err


def stages(args):
    """Work of three steps, two of them too soon after the first to be shown."""
    for done in (1, 2, 3):
        args.progress("stage", done, 3)
    return {}


@pytest.mark.parametrize(
    ("options", "lines"), [([], 2), (["--quiet"], 0), (["--verbose"], 3)]
)
@pytest.mark.parametrize("form", [[], ["--json"]])
def test_progress_is_as_loud_as_asked(command, capsys, options, lines, form):
    """Every step with --verbose, none with --quiet; stdout is the result alone."""
    command(stages)
    assert main(["doctor", *options, *form]) == 0
    out, err = capsys.readouterr()
    assert err.count("stage: ") == err.count("\n") == lines
    assert out.strip() == ("{}" if form else "report of {}")


def test_quiet_and_verbose_exclude_each_other(command, capsys):
    """Both at once is a wrong argument."""
    command(stages)
    with pytest.raises(SystemExit) as left:
        main(["doctor", "--quiet", "--verbose"])
    assert left.value.code == 2
    assert names(capsys.readouterr().err, "--quiet", "--verbose")


@pytest.mark.filterwarnings("default")
def test_warnings_stay_when_it_is_quiet(command, capsys):
    """What bears on the validity of a result is no progress."""

    def work(args):
        warnings.warn("bodies touch", stacklevel=1)
        return {}

    command(work)
    assert main(["doctor", "--quiet"]) == 0
    assert "bodies touch" in capsys.readouterr().err


@pytest.mark.parametrize("name", [None, "run", "sweep"])
def test_help_states_the_exit_statuses(name, capsys):
    """0, 1, 2 and 130 with their meaning, and what stdout holds after an error."""
    with pytest.raises(SystemExit):
        main([*([name] if name else []), "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert names(text, "Exit status", "0", "1", "2", "130", "stdout empty", "--json")


def test_status_of_a_result(command):
    """A command may turn its result into a status."""
    command(lambda args: {}, status=lambda result: 1)
    assert main(["doctor"]) == 1


def test_interrupt(command, capsys):
    """Ctrl-C ends with status 130 and one word."""

    def work(args):
        raise KeyboardInterrupt

    command(work)
    assert main(["doctor"]) == 130
    assert capsys.readouterr().err == "swgjoint: interrupted\n"


def test_interrupt_of_an_import(command, capsys):
    """Compiled modules turn Ctrl-C while they load into an ImportError."""

    def work(args):
        raise ImportError("initialization failed") from KeyboardInterrupt()

    command(work)
    assert main(["doctor"]) == 130
    assert capsys.readouterr().err == "swgjoint: interrupted\n"


def test_reader_that_leaves():
    """A closed pipe is no error message."""
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "swgjoint", "doctor"],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(writer)
    assert done.returncode == 141
    assert "Error" not in done.stderr


def test_no_command():
    """Without a command the help is shown on stderr, status 2."""
    done = shell()
    assert done.returncode == 2
    assert done.stdout == ""
    assert "commands:" in done.stderr


def test_ascii_terminal():
    """A terminal without Unicode gets JSON that reads the same, and no traceback."""
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "SWGJOINT_CACHE": "µ"}
    done = shell("doctor", "--json", env=environment)
    checks = {check["name"]: check for check in json.loads(done.stdout)["checks"]}
    assert checks["cache"]["detail"] == "µ"
    assert shell("doctor", env=environment).stderr == ""
