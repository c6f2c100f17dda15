"""The compiled loops under the sanitizers for addresses and undefined behaviour."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path

import pytest
from sanitized import CXX, SANITIZERS, compiled, run_compiler

KERNELS = Path(__file__).parents[2] / "swgjoint/kernels"
TESTS = Path(__file__).parents[1]
SHARED = ("lanes", "local_sums")
"""Sources that the loops have in common with the plugin."""
HEADERS = Path(sysconfig.get_path("include"))
PROGRAM = """
import importlib.util, sys
name = "swgjoint.kernels.compiled"
spec = importlib.util.spec_from_file_location(name, sys.argv[1])
sys.modules[name] = module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
import swgjoint.kernels
assert swgjoint.kernels.kernels() is module
import pytest
sys.exit(pytest.main(["-q", "-x", "-s", "-p", "no:cacheprovider", *sys.argv[2:]]))
"""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="preloads a library of gcc"),
    pytest.mark.skipif(find_spec("nanobind") is None, reason="needs nanobind"),
    pytest.mark.skipif(shutil.which(CXX) is None, reason="needs a C++ compiler"),
    pytest.mark.skipif(
        not (HEADERS / "Python.h").exists(), reason="needs the headers of Python"
    ),
]


SLOW_TO_COMPILE = ("module.cc", "combined.cpp", "local_sums.cc", "cholesky.cc")
"""Sources whose templates take longer to optimise than their loops to run."""
OPTIONS = "-std=c++17 -g1 -fPIC -fvisibility=hidden".split()
OPTIONS += [*SANITIZERS, "-fno-sanitize=vptr"]


def build(folder: Path, change: tuple[str, str, str] | None = None) -> Path:
    """The module with both sanitizers; ``change`` is a file, a text and another one."""
    shared = [KERNELS.parent / "plugin" / f"{name}.cc" for name in SHARED]
    for path in [*KERNELS.glob("*.cc"), *KERNELS.glob("*.h"), *shared]:
        text = path.read_text(encoding="utf-8")
        if change and path.name == change[0]:
            assert text.count(change[1]) == 1
            text = text.replace(change[1], change[2])
        (folder / path.parent.name).mkdir(exist_ok=True)
        (folder / path.parent.name / path.name).write_text(text, encoding="utf-8")
    for path in shared:
        header = path.with_suffix(".h")
        shutil.copy(header, folder / "plugin" / header.name)
    spec = find_spec("nanobind")
    assert spec is not None and spec.submodule_search_locations
    nanobind = Path(spec.submodule_search_locations[0])
    library = folder / "nb_combined.cpp"
    shutil.copy(nanobind / "src" / library.name, library)
    include = [nanobind / "include", nanobind / "ext/robin_map/include", HEADERS]
    include += [nanobind / "src"]
    headers = "".join(path.read_text() for path in sorted(folder.glob("*/*.h")))
    objects = []
    for source in [library, *sorted(folder.glob("*/*.cc"))]:
        options = [*OPTIONS, *(f"-I{path}" for path in include)]
        options += ["-O0" if source.name.endswith(SLOW_TO_COMPILE) else "-O1"]
        objects.append(compiled(source, options, headers))
    out = folder / "compiled.so"
    run_compiler(*OPTIONS, "-shared", *objects, "-o", out)
    return out


def run_twins(module: Path, *files: Path) -> subprocess.CompletedProcess[str]:
    """Tests against numpy with a module, the sanitizer loaded first."""
    first = [
        run_compiler(f"-print-file-name={name}")
        for name in ("libasan.so", "libstdc++.so.6")
    ]
    environment = os.environ | {
        "LD_PRELOAD": " ".join(first),
        "ASAN_OPTIONS": "detect_leaks=0",
    }
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, str(module), *map(str, files)],
        env=environment,
        cwd=TESTS.parent,
        capture_output=True,
        text=True,
    )


def test_the_loops_are_clean(tmp_path):
    """No access beyond an array and nothing undefined in the tests against numpy."""
    folders = ("fe", "gear", "envs", "maps")
    files = [f for name in folders for f in (TESTS / name).glob("test_compiled_*.py")]
    assert len(files) == 11
    ended = run_twins(build(tmp_path), *sorted(files))
    assert ended.returncode == 0, ended.stdout[-2000:] + ended.stderr[-2000:]
    assert "passed" in ended.stdout and "skipped" not in ended.stdout


def test_an_access_beyond_an_array_is_found(tmp_path):
    """One point too many in a loop of the module ends the tests."""
    wrong = ("outline.cc", "i < n; ++i) seen", "i <= n; ++i) seen")
    tests = TESTS / "gear/test_compiled_outlines.py"
    ended = run_twins(build(tmp_path, wrong), tests)
    assert ended.returncode != 0
    assert "AddressSanitizer" in ended.stderr
