"""The cache of maps: built once, never damaged, never in the way."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import pytest

from swgjoint.maps import cache
from swgjoint.maps.cache import cache_map
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.file import map_bytes
from swgjoint.store import cache_folder


class Builder:
    """Builds a linear map of the design ``a`` and counts."""

    def __init__(self, stiffness: float = 1e4) -> None:
        self.count, self.stiffness = 0, stiffness

    def __call__(self) -> DriveMap:
        """Build one more."""
        self.count += 1
        return replace(DriveMap.linear(self.stiffness), info={"design_hash": "a"})


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_built_once(folder):
    """The second request of the same parts is answered from the folder, bitwise."""
    build = Builder()
    first = cache_map({"design": "a", "level": "2d"}, build)
    second = cache_map({"level": "2d", "design": "a"}, build)
    assert build.count == 1
    assert map_bytes(first) == map_bytes(second)


def test_other_parts_other_entry(folder):
    """Any other part gives another entry."""
    build = Builder()
    cache_map({"design": "a", "level": "2d"}, build)
    cache_map({"design": "a", "level": "3d"}, build)
    assert build.count == 2


def test_other_code_other_entry(folder, monkeypatch):
    """A map that other code computed is not used."""
    build = Builder()
    cache_map({"design": "a"}, build)
    monkeypatch.setattr(cache, "code_version", lambda: "other")
    cache_map({"design": "a"}, build)
    assert build.count == 2


@pytest.mark.parametrize("package", ["numpy", "scipy", "scikit-fem"])
def test_other_packages_other_entry(folder, monkeypatch, package):
    """A map that another version of a package computed is not used."""
    build, asked = Builder(), cache.version
    cache_map({"design": "a"}, build)
    monkeypatch.setattr(
        cache, "version", lambda name: "0" if name == package else asked(name)
    )
    cache.code_version.cache_clear()
    try:
        cache_map({"design": "a"}, build)
    finally:
        cache.code_version.cache_clear()
    assert build.count == 2


def test_a_map_of_another_design_is_not_taken(folder, caplog):
    """However sound it is: whoever put it there, the design asked for is built."""
    build = Builder()
    cache_map({"design": "a"}, build)
    (entry,) = folder.rglob("*.swg")
    for info in ({}, {"design_hash": "b"}):
        replace(DriveMap.linear(5e3), info=info).save(entry)
        assert cache_map({"design": "a"}, build).mean_stiffness == pytest.approx(1e4)
        assert "another design" in caplog.text
        caplog.clear()
    assert build.count == 3


def test_damaged_entry_is_built_again(folder, caplog):
    """A damaged entry is reported, ignored and replaced."""
    build = Builder()
    cache_map({"design": "a"}, build)
    (entry,) = folder.rglob("*.swg")
    entry.write_bytes(entry.read_bytes()[:-30])
    cache_map({"design": "a"}, build)
    assert build.count == 2
    assert "ignored" in caplog.text
    cache_map({"design": "a"}, build)
    assert build.count == 2


def test_empty_variable_switches_off(monkeypatch):
    """With an empty SWGJOINT_CACHE every request builds."""
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    build = Builder()
    cache_map({"design": "a"}, build)
    cache_map({"design": "a"}, build)
    assert build.count == 2
    assert cache_folder() is None


def test_unwritable_folder_is_no_obstacle(tmp_path, monkeypatch, caplog):
    """Where the folder cannot be made the map is built and the log says so."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path / "file"))
    build = Builder()
    cache_map({"design": "a"}, build)
    assert build.count == 1
    assert "not kept" in caplog.text


def test_name_is_not_content(folder):
    """Two designs that differ in their name share an entry and keep their names."""
    build = Builder()
    assert cache_map({"design": "a"}, build, name="one").name == "one"
    assert cache_map({"design": "a"}, build, name="two").name == "two"
    assert build.count == 1


WRITER = """
import sys
from dataclasses import replace
from pathlib import Path
from swgjoint.maps.cache import _built, _sound
from swgjoint.maps.drive_map import DriveMap

entry, stiffness = Path(sys.argv[1]), float(sys.argv[2])
info = {"design_hash": "a"}
for _ in range(40):
    _built(entry, lambda: replace(DriveMap.linear(stiffness), info=info))
    assert _sound(entry, "a") is not None
"""


def test_concurrent_writers(tmp_path):
    """Writers of the same entry at the same time never leave a damaged one."""
    entry = tmp_path / "maps" / "ab" / "abc.swg"
    writers = [
        subprocess.Popen(
            [sys.executable, "-c", WRITER, str(entry), str(stiffness)],
            stderr=subprocess.PIPE,
        )
        for stiffness in (1e4, 2e4, 3e4)
    ]
    for writer in writers:
        _, errors = writer.communicate()
        assert (writer.returncode, errors) == (0, b"")
    assert [p for p in tmp_path.rglob("*") if p.is_file()] == [entry]
    drive = DriveMap.load(entry)
    assert round(drive.mean_stiffness) in (10000, 20000, 30000)
    assert map_bytes(drive) == entry.read_bytes()
