"""Whether the tests notice single wrong changes of the code.

Every change of ``mutations.toml`` is applied by itself to a copy of the installed
package, and the tests of its part run against that copy until one fails. Run it in an
environment that has the package and its test tools::

    python tests/mutations.py                    # the default tier, all changes
    python tests/mutations.py --slow --only 17   # the slow tests, for survivors
    python tests/mutations.py --check            # the table alone, a second

The exit status is 1 if the default tier notices less than 90 % of the changes, or if
the slow tests miss any; it is 2 if tests fail without a change.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parents[1]
PARTS = ("gear", "fe", "maps", "joint", "plugin", "sim", "control", "envs")
WIDER = ("tests/peer", "tests/explore", "tests/bench", "tests/validation", "tests/cli")
WIDER += ("tests/test_notebooks.py",)
"""Slow tests that reach into every part."""
ENOUGH = 0.9
"""Share of the changes that the default tier must notice."""
PYTEST = (sys.executable, "-P", "-m", "pytest")
FAILED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)
COMPILE = "-std=c++17 -O3 -DNDEBUG -fPIC -shared -fvisibility=hidden"
COMPILE += " -ffp-contract=off -fno-math-errno"
"""Options of a release build, as in swgjoint/plugin/CMakeLists.txt."""


@dataclass(frozen=True, kw_only=True)
class Mutation:
    """One change of one file, and what the tests said about it."""

    package: str
    number: int = 0
    file: str = ""
    """Empty for a run without any change."""
    kind: str = "no change"
    what: str = ""
    """Its physical consequence."""
    old: str = ""
    new: str = ""
    slow_test: str = ""
    """Slow test that notices what the default tier does not."""
    noticed_by: str = ""
    """First failing test, or how the run ended without one; empty for a survivor."""
    seconds: float = 0.0

    def __str__(self) -> str:
        verdict = f"noticed by {self.noticed_by}" if self.noticed_by else "SURVIVED"
        change = f"{self.number:3d} {self.package:7s} {self.file} ({self.kind})"
        return f"{change}: {verdict} [{self.seconds:.0f} s]"

    def text(self) -> str:
        """Content of the file after the change.

        Raises:
            ValueError: If ``old`` does not occur exactly once.
        """
        # a wheel leaves the source of the plugin out
        whole = self.package == "plugin"
        tree = ROOT if whole else installed("swgjoint").parent
        text = (tree / self.file).read_text()
        if (count := text.count(self.old)) != 1 or self.old == self.new:
            raise ValueError(
                f"mutation {self.number}: {self.old!r} occurs {count} times in"
                f" {self.file}; needed: once, with another text in its place"
            )
        return text.replace(self.old, self.new)


@cache
def installed(name: str) -> Path:
    """Folder of an installed package; the checkout is not on the path of a script."""
    spec = find_spec(name)
    if spec is None or not spec.submodule_search_locations:
        raise SystemExit(f"{name} is not installed: pip install '.[test]'")
    return Path(spec.submodule_search_locations[0])


def read_table() -> list[Mutation]:
    """All changes; each can be applied and leaves valid Python."""
    rows = tomllib.loads((ROOT / "tests/mutations.toml").read_text())["mutation"]
    table = [Mutation(number=k, **row) for k, row in enumerate(rows, 1)]
    for one in table:
        assert one.package in PARTS and one.what, one
        text = one.text()
        if one.file.endswith(".py"):
            ast.parse(text, one.file)
    return table


def build_plugin(folder: Path) -> None:
    """Compile the plugin beside its source, as a release build does."""
    mujoco = installed("mujoco")
    (engine,) = mujoco.glob("libmujoco.so.*")
    command = [os.environ.get("CXX", "g++"), *COMPILE.split(), f"-I{mujoco}/include"]
    command += [*map(str, sorted(folder.glob("*.cc"))), str(engine)]
    command += [f"-Wl,-rpath,{mujoco}", "-o", str(folder / "libswgjoint_plugin.so")]
    subprocess.run(command, check=True)


def make_copy(mutation: Mutation, folder: Path) -> None:
    """Put a copy of the package with the change into a folder."""
    plugin = folder / "swgjoint" / "plugin"
    shutil.copytree(installed("swgjoint"), folder / "swgjoint")
    if mutation.package == "plugin":
        for source in (ROOT / "swgjoint/plugin").glob("*.[ch]*"):
            shutil.copy(source, plugin)
    if mutation.file:
        (folder / mutation.file).write_text(mutation.text())
    if mutation.package == "plugin":
        build_plugin(plugin)


@cache
def sorting() -> tuple[str, ...]:
    """The option that runs quick tests first, where the tests have it."""
    command = [*PYTEST, "tests", "--help"]
    shown = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout
    return ("--quickest-first",) if "--quickest-first" in shown else ()


def selection(mutation: Mutation, *, slow: bool) -> tuple[str, ...]:
    """Arguments of pytest that select the tests."""
    own: tuple[str, ...] = (f"tests/{mutation.package}",)
    if mutation.package == "plugin":
        own = ("tests/joint", "tests/test_counts_plugin.py")
    if not slow:
        return ("-m", "not slow", *own)
    named = (mutation.slow_test,) if mutation.slow_test else (*own, *WIDER)
    return ("-m", "slow", *named)


def run_tests(selected: Sequence[str], folder: Path, limit: float) -> str:
    """First failing test, or how the run ended without one; empty if all pass.

    The folder holds the package to test. All runs share the cache of maps beside it,
    whose keys contain the code.
    """
    settings = {
        "PYTHONPATH": str(folder),
        "PYTHONSAFEPATH": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "SWGJOINT_CACHE": str(folder.parent / "cache"),
        "HYPOTHESIS_STORAGE_DIRECTORY": str(folder / "hypothesis"),
    }
    command = [*PYTEST, "-x", "-q", "-p", "no:cacheprovider", *sorting(), *selected]
    # a file, not a pipe: processes that a hung test started would hold it open
    with (folder / "log").open("w+", errors="replace") as log:
        try:
            run = subprocess.run(
                command,
                cwd=ROOT,
                env=os.environ | settings,
                stdout=log,
                stderr=subprocess.STDOUT,
                timeout=limit,
            )
        except subprocess.TimeoutExpired:
            return f"hung: no end after {limit:g} s"
        log.seek(0)
        text = log.read()
    if run.returncode == 0:
        return ""
    if run.returncode == 5:
        raise RuntimeError(f"no test was run: {' '.join(command)}")
    found = FAILED.search(text)
    if found is None:  # a crash, or a conftest.py that cannot be imported
        return f"exit status {run.returncode}: {' '.join(text.split()[-12:])}"
    return found[1] if "::" in found[1] else f"collection: {found[1]}"


def judged(mutation: Mutation, work: Path, *, slow: bool, limit: float) -> Mutation:
    """The change with what the tests say about it."""
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=work) as folder:
        make_copy(mutation, Path(folder))
        selected = selection(mutation, slow=slow)
        noticed_by = run_tests(selected, Path(folder), limit)
    seconds = round(time.perf_counter() - begin, 1)
    return replace(mutation, noticed_by=noticed_by, seconds=seconds)


def summarise(found: Sequence[Mutation]) -> float:
    """Print counts and survivors; the share of the changes that were noticed."""
    for name in (*PARTS, "all"):
        own = [bool(one.noticed_by) for one in found if name in (one.package, "all")]
        if own:
            share = sum(own) / len(own)
            print(f"{name:8s} {sum(own):3d} of {len(own):3d} noticed, {share:.1%}")
    for one in found:
        if not one.noticed_by:
            print(f"{one}\n    {one.what}")
    return share


def main() -> int:
    """Run the script."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--slow", action="store_true", help="run the slow tests")
    parser.add_argument("--package", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--only", nargs="+", type=int, help="numbers of changes")
    parser.add_argument("--jobs", type=int, default=1, help="changes at a time")
    parser.add_argument("--limit", type=float, default=3600.0, help="of a run [s]")
    parser.add_argument("--json", type=Path, help="file for the findings")
    parser.add_argument("--no-baseline", action="store_true")
    parser.add_argument("--check", action="store_true", help="check the table alone")
    given = parser.parse_args()
    chosen = [one for one in read_table() if one.package in given.package]
    chosen = [one for one in chosen if not given.only or one.number in given.only]
    print(f"{len(chosen)} changes can be applied", flush=True)
    if given.check or not chosen:
        return 0 if chosen else 2
    kinds = {(one.package, one.slow_test if given.slow else "") for one in chosen}
    unchanged = [Mutation(package=p, slow_test=test) for p, test in sorted(kinds)]
    found: list[Mutation] = []
    with (
        tempfile.TemporaryDirectory(prefix="swgjoint-mutations-") as work,
        ThreadPoolExecutor(given.jobs) as pool,
    ):

        def run(one: Mutation) -> Mutation:
            return judged(one, Path(work), slow=given.slow, limit=given.limit)

        for one in pool.map(run, [] if given.no_baseline else unchanged):
            if one.noticed_by:
                print(f"tests fail without any change: {one}")
                return 2
        for ended in as_completed([pool.submit(run, one) for one in chosen]):
            found.append(ended.result())
            print(found[-1], flush=True)
    found.sort(key=lambda one: one.number)
    if given.json:
        given.json.write_text(json.dumps([asdict(one) for one in found], indent=1))
    return int(summarise(found) < (1.0 if given.slow else ENOUGH))


if __name__ == "__main__":
    sys.exit(main())
