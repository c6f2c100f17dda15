"""What a map that is being built has solved so far, in the cache folder.

An interrupted build, by a key or by the machine, goes on from there: the parts have the
key of the map itself, the hash of design, fidelity and code, so that nothing solved by
other code or for another design is ever taken up. They are removed once the map is
complete.
"""

from __future__ import annotations

import io
import logging
import shutil
import time
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import InputError
from swgjoint.files import write_whole
from swgjoint.maps.cache import cache_folder, key_of

_log = logging.getLogger(__name__)

FORGOTTEN = 14 * 24 * 3600.0
"""Parts that nobody went on with are removed after this time [s]."""
UNREADABLE = (
    OSError,
    EOFError,
    KeyError,
    TypeError,
    ValueError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What a damaged file may raise when it is read."""


@dataclass(frozen=True, kw_only=True)
class Unfinished:
    """A folder with the parts of one map that is being built."""

    folder: Path

    @classmethod
    def of(cls, parts: Mapping[str, Any]) -> Unfinished | None:
        """The parts of a map; None if there is no cache.

        Args:
            parts: Everything that decides the map, as for
                :func:`swgjoint.maps.cache.cached`.
        """
        cache = cache_folder()
        if cache is None:
            return None
        _remove_forgotten(cache / "unfinished")
        return cls(folder=cache / "unfinished" / key_of(parts))

    def read(self, name: str) -> dict[str, Any] | None:
        """Arrays of a part; None if it was not kept or is damaged."""
        path = self.folder / f"{name}.npz"
        if not path.exists():
            return None
        try:
            content = io.BytesIO(path.read_bytes())
            with np.load(content, allow_pickle=False) as arrays:
                return {key: arrays[key] for key in arrays.files}
        except UNREADABLE as error:
            self.ignored(name, error)
            return None

    def write(self, name: str, arrays: Mapping[str, Any]) -> None:
        """Keep a part, whole or not at all; a full disk is no reason to stop."""
        out = io.BytesIO()
        np.savez_compressed(out, **arrays)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(self.folder / f"{name}.npz", out.getvalue())
        except (OSError, InputError) as error:
            _log.warning("part of a map not kept in the cache: %s", error)

    def ignored(self, name: str, why: Exception) -> None:
        """Report a part that cannot be used and is computed again."""
        _log.warning(
            "%s ignored and computed again: %s", self.folder / f"{name}.npz", why
        )

    def clear(self) -> None:
        """Remove all parts: the map is complete."""
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
