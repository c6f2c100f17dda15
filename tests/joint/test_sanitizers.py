"""The plugin under AddressSanitizer, UndefinedBehaviorSanitizer and a checking library.

The standard library then checks indices and iterators, as some packagers have it. Its
own tests run in a process that loads a library built for that. Leaks are not looked
for: the interpreter leaves memory to the system. A planted overflow must be found.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from sanitized import CXX, SANITIZERS, compiled, run_compiler

ROOT = Path(__file__).parents[2]
SOURCES = ("drive.cc", "drive.h", "drive_map.cc", "drive_map.h", "friction.cc")
SOURCES += ("drive_map_parse.cc", "friction.h", "hysteresis.cc", "hysteresis.h")
SOURCES += ("lanes.cc", "lanes.h", "law.h", "local_sums.cc", "local_sums.h")
SOURCES += ("register.cc",)
RUN = """
import sys
from pathlib import Path
from swgjoint import engine
engine.library = lambda: Path(sys.argv[1])  # before mujoco is imported and takes it
"""
TESTS = """
import pytest
sys.exit(pytest.main(["-q", "-x", "-s", "-p", "no:cacheprovider", *sys.argv[2:]]))
"""
HOSTILE = """
import json
sys.path.insert(0, "tests/shared")
import hostile_drives
print(json.dumps(hostile_drives.run(*map(int, sys.argv[2:]))))
"""
LONG = "rk4 native coasting stiction spec_sheet loses swing one_step pushes".split()
LONG += ["wave_generator_fixed", "flexspline_fixed"]
LONG += ["0.0"]  # of the damping: a trajectory of every kind of loss is left

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="preloads a library of gcc"),
]


# without optimisation, names in place of line numbers: half the time of a compiler
OPTIONS = "-std=c++17 -O0 -g1 -fPIC -fvisibility=hidden -ffp-contract=off".split()
OPTIONS += [*SANITIZERS, "-fsanitize=float-cast-overflow"]


def build(folder: Path, change: tuple[str, str, str] | None = None) -> Path:
    """The plugin with both sanitizers; ``change`` is a file, a text and another one."""
    texts = {n: (ROOT / "swgjoint/plugin" / n).read_text() for n in SOURCES}
    if change:
        name, old, new = change
        assert texts[name].count(old) == 1
        texts[name] = texts[name].replace(old, new)
    for name, text in texts.items():
        (folder / name).write_text(text)
    spec = find_spec("mujoco")
    assert spec is not None and spec.submodule_search_locations
    mujoco = Path(spec.submodule_search_locations[0])
    (library,) = mujoco.glob("libmujoco.so.*")
    headers = "".join(text for name, text in texts.items() if name.endswith(".h"))
    options = [*OPTIONS, f"-I{mujoco / 'include'}"]
    objects = [
        compiled(folder / name, options, headers)
        for name in texts
        if name.endswith(".cc")
    ]
    out = folder / "libswgjoint_plugin.so"
    link = [*OPTIONS, "-shared", *objects, library, f"-Wl,-rpath,{mujoco}"]
    run_compiler(*link, "-o", out)
    return out


def run_tests(
    library: Path, *tests: str, program: str = TESTS
) -> subprocess.CompletedProcess[str]:
    """Run tests of this folder against a library, the sanitizer loaded first.

    Or another program, with other arguments.
    """
    environment = os.environ | {
        "LD_PRELOAD": run_compiler("-print-file-name=libasan.so"),
        "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }
    return subprocess.run(
        [sys.executable, "-P", "-c", RUN + program, str(library), *tests],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=500,
    )


@pytest.fixture(autouse=True)
def compiler() -> None:
    # who installs the package has one
    assert shutil.which(CXX), f"{CXX} is needed"


def test_the_plugin_is_clean(tmp_path):
    """Twin, copies, rollout, bad attributes, hysteresis and friction: no finding.

    Left out are long runs of the same steps, and two of three layouts.
    """
    done = run_tests(
        build(tmp_path),
        *(
            f"tests/joint/test_{name}.py"
            for name in ("twin", "copies", "hysteresis", "friction", "batch")
        ),
        "-k",
        f"not ({' or '.join(LONG)})",
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    assert "Sanitizer" not in done.stderr
    assert " passed" in done.stdout


def test_hostile_models_are_refused_or_step(tmp_path):
    """200 models of bad attributes and wild states: no finding, and no crash."""
    done = run_tests(build(tmp_path), "0", "200", program=HOSTILE)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    assert "Sanitizer" not in done.stderr
    found = json.loads(done.stdout)
    assert sum(found.values()) == 200
    assert min(found["by the plugin"], found["stepped"]) > 50


def test_a_planted_overflow_is_found(tmp_path):
    """A lane too few in the weights, which pointers alone reach, stops the run."""
    line = "weight_.assign(static_cast<size_t>(blocks_) * size_.weights(), 0.0);"
    short = line.replace("weights()", "weights() - kLanes")
    library = build(tmp_path, ("drive_map_parse.cc", line, short))
    done = run_tests(library, "tests/joint/test_twin.py", "-k", "trajectory")
    assert done.returncode != 0
    assert "heap-buffer-overflow" in done.stderr
    assert "Sweep" in done.stderr


def test_a_planted_index_past_an_empty_table_is_found(tmp_path):
    """A map without harmonics has no table, of which nothing may be indexed."""
    line = "table_->data() + static_cast<size_t>(segment) * blocks_ * size.block()"
    planted = "&(*table_)[static_cast<size_t>(segment) * blocks_ * size.block()]"
    library = build(tmp_path, ("drive_map.cc", line, planted))
    done = run_tests(library, "tests/joint/test_twin.py", "-k", "without_harmonics")
    assert done.returncode != 0
    assert "__n < this->size()" in done.stderr
