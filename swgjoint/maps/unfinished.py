"""Intermediate results of a map that is being built, in the cache folder.

An interrupted build resumes from them. Their folder is named by the cache key of the
map, a hash of design, fidelity and code, so results of other code or of another design
are never used. They are removed once the map is complete.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
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
)

FORGOTTEN = 14 * 24 * 3600.0
"""Age after which the parts of an interrupted map are removed [s]."""

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
        keep(self._path(name), arrays_file(join_arrays(arrays), level=1))

    def _path(self, name: str) -> Path:
        """File of a part."""
        return self.folder / f"{name}.npz"

    def clear(self) -> None:
        """Remove all parts, once the map is complete."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _remove_forgotten(folder: Path) -> None:
    """Remove parts of maps that were interrupted long ago."""
    oldest = time.time() - FORGOTTEN
    try:
        for each in folder.iterdir():
            if each.stat().st_mtime < oldest:
                shutil.rmtree(each, ignore_errors=True)
    except OSError:  # no such folder yet, or another process removes it
        return
