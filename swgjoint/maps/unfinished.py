"""Intermediate results of a map that is being built, in the cache folder.

An interrupted build resumes from them. Their folder is named by the cache key of the
map, a hash of design, fidelity and code, so results of other code or of another design
are never used. They are removed once the map is complete.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from swgjoint.maps.cache import key_of
from swgjoint.store import (
    arrays_content,
    arrays_file,
    cache_folder,
    join_arrays,
    keep,
    read_kept,
    split_arrays,
    warn_ignored,
)

FORGOTTEN = 14 * 24 * 3600.0
"""Age after which the parts of an interrupted map are removed [s]."""

SHARED = 1.0
"""Results of this time share a file [s]. With one file for each result of some
milliseconds, writing took a tenth of the time of a map."""

Part = TypeVar("Part")


@dataclass(frozen=True, kw_only=True)
class Unfinished:
    """A folder with the parts of one map that is being built."""

    folder: Path
    """Folder of the parts; it may not exist yet."""

    @classmethod
    def from_parts(cls, parts: Mapping[str, Any]) -> Unfinished | None:
        """The folder for the parts of a map; None if the cache is off.

        Args:
            parts: Everything that determines the map, as for
                :func:`swgjoint.maps.cache.cache_map`.
        """
        cache = cache_folder()
        if cache is None:
            return None
        _remove_forgotten(cache / "unfinished")
        return cls(folder=cache / "unfinished" / key_of(parts))

    def read(self, name: str, take: Callable[[dict[str, Any]], Part]) -> Part | None:
        """A stored part; None if it is absent or damaged.

        Args:
            name: Name of the part.
            take: Builds the part from its arrays and raises an exception if they are
                damaged.
        """

        def read(data: bytes) -> Part:
            return take(split_arrays(arrays_content(data)))

        return read_kept(self._path(name), read)

    def write(self, name: str, arrays: Mapping[str, Any]) -> None:
        """Write a part atomically; a failure such as a full disk is only logged.

        Args:
            name: Name of the part.
            arrays: Arrays of the part by name.
        """
        keep(self._path(name), arrays_file(join_arrays(arrays), level=0))

    def _path(self, name: str) -> Path:
        """File of a part."""
        return self.folder / f"{name}.npz"

    def clear(self) -> None:
        """Remove all parts, once the map is complete."""
        shutil.rmtree(self.folder, ignore_errors=True)


@dataclass(kw_only=True)
class UnfinishedSeries:
    """Results in the order in which they are computed, many to a part.

    The same results are computed in the same order by the build that resumes, which
    reads them by their numbers. A part is named by its first number.
    """

    keep: Unfinished
    """Folder of the parts."""
    name: str
    """Format of the names of the parts, with a field for the number."""
    number: int = 0
    """Number of the next result."""
    _stored: dict[int, dict[str, Any]] = field(default_factory=dict)
    _pending: dict[int, dict[str, Any]] = field(default_factory=dict)
    _written: float = field(default_factory=time.monotonic)

    def read(self, take: Callable[[dict[str, Any]], Part]) -> Part | None:
        """The next result, if it is stored; else None, and it must be written.

        Args:
            take: Builds the result from its arrays and raises an exception if they are
                damaged.
        """
        name = self.name.format(self.number)
        if self.number not in self._stored:
            self._stored = self.keep.read(name, _by_number) or {}
        if self.number not in self._stored:
            return None
        try:
            part = take(self._stored.pop(self.number))
        except Exception as error:
            warn_ignored(name, error)
            return None
        self.number += 1
        return part

    def write(self, arrays: Mapping[str, Any]) -> None:
        """Add the next result, with all others of the last second to one part.

        Args:
            arrays: Arrays of the result by name.
        """
        self._pending[self.number] = dict(arrays)
        self.number += 1
        if time.monotonic() - self._written >= SHARED:
            self.flush()

    def flush(self) -> None:
        """Write the results that are not yet in a part."""
        if self._pending:
            first = min(self._pending)
            arrays = {
                f"{number} {key}": value
                for number, one in self._pending.items()
                for key, value in one.items()
            }
            self.keep.write(self.name.format(first), arrays)
            self._pending.clear()
        self._written = time.monotonic()


def _by_number(arrays: Mapping[str, Any]) -> dict[int, dict[str, Any]]:
    """Arrays of a part of a series, by the number of the result."""
    found: dict[int, dict[str, Any]] = {}
    for key, value in arrays.items():
        number, _, own = key.partition(" ")
        found.setdefault(int(number), {})[own] = value
    return found


def _remove_forgotten(folder: Path) -> None:
    """Remove parts of maps that were interrupted long ago."""
    oldest = time.time() - FORGOTTEN
    try:
        for each in folder.iterdir():
            if each.stat().st_mtime < oldest:
                shutil.rmtree(each, ignore_errors=True)
    except OSError:  # no such folder yet, or another process removes it
        return
