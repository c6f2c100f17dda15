"""Content-addressed cache of drive maps in the user's cache folder."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Mapping
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from swgjoint import __version__
from swgjoint.code_hash import code_hash
from swgjoint.errors import InputError, MapFileError
from swgjoint.json_text import plain
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.file import SCHEMA_VERSION
from swgjoint.models_path import models_path
from swgjoint.store import cache_folder, json_content, json_file, keep, read_kept

Found = TypeVar("Found")

_log = logging.getLogger(__name__)

_CODE = ("arrays.py", "units.py", "kernels", "gear", "fe", "maps")
"""Parts of this package whose code determines the content of a map."""
_PACKAGES = ("numpy", "scipy", "scikit-fem")
"""Dependencies whose versions also determine the content of a map."""


@lru_cache
def code_version() -> str:
    """Hash of everything except the inputs that determines the content of a map.

    It covers the code, the file schema, the versions of numpy, scipy and scikit-fem and
    the catalogue tables, so that the cache never returns a map computed from others.
    Comments and docstrings do not count.
    """
    used = [f"{name} {version(name)}" for name in _PACKAGES]
    digest = hashlib.sha256(f"{__version__} {SCHEMA_VERSION} {used}".encode())
    digest.update(code_hash(*_CODE).encode())
    # the catalogue provides the ratings that a design does not state
    for file in sorted((models_path() / "catalogue").glob("*.csv")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def key_of(parts: Mapping[str, Any]) -> str:
    """Hash of the given parts and of :func:`code_version`, 64 hexadecimal digits."""
    content = {"code": code_version(), "parts": plain(parts)}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def cache_map(
    parts: Mapping[str, Any],
    build: Callable[[], DriveMap],
    *,
    name: str | None = None,
) -> DriveMap:
    """The map for the given parts, read from the cache or built and stored there.

    Concurrent writers are safe: an entry is written atomically, under a name that
    depends only on ``parts`` and the code. A damaged entry, or an entry of another
    design, is rebuilt. If the cache cannot be written, a warning is logged and the map
    is returned without being stored.

    Args:
        parts: Everything that determines the result, such as level and options, as JSON
            values. ``parts["design"]`` is the content hash of the design.
        build: Called if there is no valid entry. It returns a map that has the content
            hash of the design as ``info["design_hash"]``.
        name: Name of the returned map; it does not enter the hash. None keeps the name
            that the map has.
    """
    folder = cache_folder()
    if folder is None:
        drive = build()
        return drive if name is None else drive.with_parts(name=name)
    key = key_of(parts)
    path = folder / "maps" / key[:2] / f"{key}.swg"
    drive = _sound(path, str(parts["design"])) or _built(path, build)
    return drive if name in (None, drive.name) else drive.with_parts(name=name)


def recall(
    store: str,
    parts: Mapping[str, Any],
    kind: type[Found],
    compute: Callable[[], Found],
) -> Found:
    """The result for the given parts, read from the cache or computed and stored there.

    An entry is written atomically, under a name that depends only on ``parts`` and the
    code, so that an interrupted series of computations resumes where it stopped. A
    damaged entry is computed again.

    Args:
        store: Folder in the cache.
        parts: Everything that determines the result, as JSON values. If it depends on
            code outside of gear, fe and maps, the parts include a hash of that code.
        kind: Type of the result; its fields are JSON values.
        compute: Called if there is no valid entry.
    """
    path = entry_of(store, parts)
    result = recall_kept(path, kind)
    if result is None:
        result = compute()
        if path is not None:
            keep(path, json_file(result))
    return result


def entry_of(store: str, parts: Mapping[str, Any]) -> Path | None:
    """File of a result of :func:`recall` in the cache; None if the cache is off.

    Args:
        store: Folder in the cache.
        parts: Everything that determines the result, as JSON values.
    """
    folder = cache_folder()
    return None if folder is None else folder / store / f"{key_of(parts)}.json"


def recall_kept(path: Path | None, kind: type[Found]) -> Found | None:
    """Content of an entry; None if the entry is absent or damaged.

    Args:
        path: File of the entry; None if the cache is off.
        kind: Type that the content must have.
    """
    if path is None:
        return None
    return read_kept(path, lambda data: json_content(data, kind))


def _sound(path: Path, design: str) -> DriveMap | None:
    """The cached map of a design; None if absent, damaged or for another design."""
    if not path.exists():
        return None
    try:
        drive = DriveMap.load(path)
        if drive.info.get("design_hash") != design:
            raise MapFileError(f"map {path} belongs to another design")
    except MapFileError as exc:
        _log.warning("cache entry ignored and rebuilt: %s", exc)
        return None
    return drive


def _built(path: Path, build: Callable[[], DriveMap]) -> DriveMap:
    """A newly built map, stored in the cache if the file can be written."""
    drive = build()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        drive.save(path)
    except (OSError, InputError) as exc:
        _log.warning("map not kept in the cache: %s", exc)
    return drive
