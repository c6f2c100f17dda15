"""How a run of the tests is set up, shared out over processes, and timed.

A pytest plugin. ``tests/durations.json`` holds the duration of each test as it was last
measured; ``pytest -m "" -n 2 --record-durations`` measures them again. A duration is
the CPU time, which depends less on what else the machine does, or half the time that
passed if that is more: of tests that wait for browsers and other processes.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

DURATIONS = Path(__file__).parents[1] / "durations.json"
LEAST = 0.2
"""Shorter tests are not listed [s]."""
LONG = 60.0
"""A longer test is a share of work by itself [s]."""
WHOLE_FILE = 60.0
"""The other tests of a file, up to this long, go to one process [s]: they then compute
the fixtures of the file once."""
STARTED = pytest.StashKey[tuple[float, float]]()
FOLDER = pytest.StashKey[str]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of a run."""
    group = parser.getgroup("swgjoint")
    group.addoption(
        "--record-durations", action="store_true", help=f"write {DURATIONS.name}"
    )
    group.addoption(
        "--quickest-first", action="store_true", help="order tests by their duration"
    )


def pytest_configure(config: pytest.Config) -> None:
    """One folder for what the processes of a run share.

    The run neither reads nor leaves anything in the user's cache. Processes that
    pytest-xdist starts inherit the variables.
    """
    if hasattr(config, "workerinput"):
        return
    config.pluginmanager.register(Durations(config.getoption("record_durations")))
    if not os.environ.get("SWGJOINT_TEST_CACHE"):  # which two runs in a row may share
        folder = config.stash[FOLDER] = tempfile.mkdtemp(prefix="swgjoint-tests-")
        os.environ["SWGJOINT_TEST_CACHE"] = folder
    os.environ["SWGJOINT_CACHE"] = os.environ["SWGJOINT_TEST_CACHE"]


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the folder of the run."""
    if folder := config.stash.get(FOLDER, None):
        shutil.rmtree(folder, ignore_errors=True)
        del os.environ["SWGJOINT_TEST_CACHE"]


# -- order and shares ------------------------------------------------------------------


def measured() -> dict[str, float]:
    """Durations of the listed tests by node id [s]; empty if never measured."""
    return json.loads(DURATIONS.read_text()) if DURATIONS.exists() else {}


def units(nodeids: list[str], seconds: dict[str, float]) -> dict[str, str]:
    """Share of work of each test: its file if that is short, else itself."""
    of_file: dict[str, float] = defaultdict(float)
    files = {n: n.partition("::")[0] for n in nodeids if seconds.get(n, 0.0) <= LONG}
    for nodeid, file in files.items():
        of_file[file] += seconds.get(nodeid, 0.0)
    short = {n: file for n, file in files.items() if of_file[file] <= WHOLE_FILE}
    return {nodeid: short.get(nodeid, nodeid) for nodeid in nodeids}


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Longest share of work first, so that no process waits for another at the end."""
    quickest = config.getoption("quickest_first")
    if not quickest and not hasattr(config, "workerinput"):
        return
    seconds = measured()
    unit = units([item.nodeid for item in items], seconds)
    total: dict[str, float] = defaultdict(float)
    for item in items:
        total[unit[item.nodeid]] += seconds.get(item.nodeid, 0.0)
    if quickest:
        items.sort(key=lambda item: seconds.get(item.nodeid, 0.0))
    else:
        items.sort(key=lambda item: -total[unit[item.nodeid]])


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Processes take the shares of work in their order, one by one."""
    from xdist.scheduler import LoadScopeScheduling

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            if not hasattr(self, "unit"):
                (collected, *_) = self.registered_collections.values()
                self.unit = units(collected, measured())
            return self.unit[nodeid]

    config.option.loadscopereorder = False
    return Scheduling(config, log)


# -- durations -------------------------------------------------------------------------


def _clocks() -> tuple[float, float]:
    """CPU time of this process and of those that it has waited for, and time [s]."""
    times = os.times()
    cpu = times.user + times.system + times.children_user + times.children_system
    return cpu, time.monotonic()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Note when a test starts, fixtures included."""
    item.stash[STARTED] = _clocks()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[Any]:
    """Hand CPU time and duration so far to the process that collects them."""
    report = yield
    cpu, passed = (
        now - then for now, then in zip(_clocks(), item.stash[STARTED], strict=True)
    )
    report.user_properties += [("cpu_s", cpu), ("duration_s", max(cpu, 0.5 * passed))]
    return report


class Durations:
    """Collects what the tests of all processes took."""

    def __init__(self, write: bool) -> None:
        self.write = write
        self.taken: dict[str, float] = {}
        self.cpu = 0.0

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """The last report of a test has all of it."""
        if report.when == "teardown":
            found = dict(report.user_properties)
            self.taken[report.nodeid] = found["duration_s"]
            self.cpu += found["cpu_s"]

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Print the sum; write the list if asked."""
        if self.taken:
            terminalreporter.write_line(
                f"{self.cpu:.0f} CPU seconds in {len(self.taken)} tests"
            )
        if self.write:
            known = {**measured(), **self.taken}
            listed = {n: round(known[n], 1) for n in sorted(known) if known[n] >= LEAST}
            DURATIONS.write_text(json.dumps(listed, indent=0) + "\n")
