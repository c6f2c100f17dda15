"""Content-addressed cache of drive maps in the user's cache folder."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
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

_CODE = ("arrays.py", "units.py", "gear", "fe", "maps")
"""Parts of the package whose code decides the content of a map."""
_PACKAGES = ("numpy", "scipy", "scikit-fem")
"""Others that compute it."""


@lru_cache
def code_version() -> str:
    """Hash of the code that decides the content of a map, and of its file schema.

    With it no map computed by other code is ever taken from the cache, also while the
    package is being changed or after another version of numpy, scipy or scikit-fem was
    installed. Comments and docstrings do not count.
    """
    used = [f"{name} {version(name)}" for name in _PACKAGES]
    digest = hashlib.sha256(f"{__version__} {SCHEMA_VERSION} {used}".encode())
    digest.update(code_hash(*_CODE).encode())
    # the catalogue gives a design the ratings that it does not state
    for file in sorted((models_path() / "catalogue").glob("*.csv")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def key_of(parts: Mapping[str, Any]) -> str:
    """Hash of the given parts and of the code, 64 hexadecimal digits."""
    content = {"code": code_version(), "parts": plain(parts)}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def cache_map(
    parts: Mapping[str, Any],
    build: Callable[[], DriveMap],
    *,
    name: str | None = None,
) -> DriveMap:
    """The map of the given parts, from the cache or built and then kept.

    Safe under concurrent writers: an entry appears whole, under a name that only its
    content decides. A damaged entry, or one of another design, is built again; a cache
    that cannot be written is reported to the log and not used.

    Args:
        parts: Everything that decides the result: content hash of the ``design``,
            level, options. JSON values.
        build: Called when there is no sound entry; its map has the hash of the design
            as ``info["design_hash"]``.
        name: Name that the map shall carry; it is no part of the content.
    """
    folder = cache_folder()
    if folder is None:
        drive = build()
        return drive if name is None else replace(drive, name=name)
    key = key_of(parts)
    path = folder / "maps" / key[:2] / f"{key}.swg"
    drive = _sound(path, str(parts["design"])) or _built(path, build)
    return drive if name in (None, drive.name) else replace(drive, name=name)


def recall(
    store: str,
    parts: Mapping[str, Any],
    kind: type[Found],
    compute: Callable[[], Found],
) -> Found:
    """What was computed of the given parts, from the cache or computed and then kept.

    An entry appears whole, under a name that only its content decides, so that work
    that was interrupted goes on where it stopped; a damaged entry is computed again.

    Args:
        store: Folder in the cache.
        parts: Everything that decides the result, code outside of gear, fe and maps
            included. JSON values.
        kind: Type of the result, with fields of JSON values.
        compute: Called when there is no sound entry.
    """
    path = entry_of(store, parts)
    found = recall_kept(path, kind)
    if found is None:
        found = compute()
        if path is not None:
            keep(path, json_file(found))
    return found


def entry_of(store: str, parts: Mapping[str, Any]) -> Path | None:
    """File of a result in the cache, see :func:`recall`; None if that is off.

    Args:
        store: Name of the part of the cache.
        parts: Everything that the result depends on.
    """
    folder = cache_folder()
    return None if folder is None else folder / store / f"{key_of(parts)}.json"


def recall_kept(path: Path | None, kind: type[Found]) -> Found | None:
    """What an entry holds; None if there is none or it is damaged.

    Args:
        path: The file; None if there is no cache.
        kind: Type that the content must have.
    """
    if path is None:
        return None
    return read_kept(path, lambda data: json_content(data, kind))


def _sound(path: Path, design: str) -> DriveMap | None:
    """The map of a design; None if there is none or it is that of another one."""
    if not path.exists():
        return None
    try:
        drive = DriveMap.load(path)
        if drive.info.get("design_hash") != design:
            raise MapFileError(f"map {path} is that of another design")
    except MapFileError as exc:
        _log.warning("cache entry ignored and built again: %s", exc)
        return None
    return drive


def _built(path: Path, build: Callable[[], DriveMap]) -> DriveMap:
    drive = build()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        drive.save(path)
    except (OSError, InputError) as exc:
        _log.warning("map not kept in the cache: %s", exc)
    return drive
