"""Files that a run keeps and a later run reads: written whole, read through one door.

Each file carries the SHA-256 of its content. It is checked before anything of the
content is parsed, and what was parsed has the type that the caller names; whatever else
a file may be is damaged, and a store computes it again.
"""

from __future__ import annotations

import hashlib
import io
import logging
import os
import re
import sys
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from pydantic import TypeAdapter, ValidationError

from swgjoint.errors import InputError
from swgjoint.files import read_regular, write_whole
from swgjoint.json_text import json_text

T = TypeVar("T")

_log = logging.getLogger(__name__)

_HEAD = b'{\n  "sha256": "%s",'
_HEAD_READ = re.compile(rb'\{\n  "sha256": "([0-9a-f]{64})",')
# a zip archive ends with the length of its comment and the comment
_NO_COMMENT, _COMMENT = b"\0\0", (64).to_bytes(2, "little")
_TAIL_READ = re.compile(re.escape(_COMMENT) + rb"([0-9a-f]{64})\Z")
_TAIL = len(_COMMENT) + 64


class DamagedError(InputError):
    """A kept file that is not what a run has written."""


def cache_folder() -> Path | None:
    """Folder of the cache: ``SWGJOINT_CACHE``, else the platform's; None if off.

    An empty ``SWGJOINT_CACHE`` switches the cache off.
    """
    named = os.environ.get("SWGJOINT_CACHE")
    if named is not None:
        return Path(named) if named.strip() else None
    try:
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "swgjoint"
        if sys.platform == "win32":
            local = os.environ.get("LOCALAPPDATA")
            base = Path(local) if local else Path.home() / "AppData" / "Local"
            return base / "swgjoint" / "Cache"
        # XDG base directories: a relative path is to be ignored
        xdg = os.environ.get("XDG_CACHE_HOME", "")
        base = Path(xdg) if os.path.isabs(xdg) else Path.home() / ".cache"
        return base / "swgjoint"
    except RuntimeError:  # no home folder
        return None


def json_file(content: Any) -> bytes:
    """A JSON object whose first entry ``sha256`` is the hash of the rest.

    Args:
        content: A dataclass or mapping with at least one entry.
    """
    body = (json_text(content, ascii_only=True) + "\n").encode()
    assert body.startswith(b"{\n"), "no entry: the hash has no place"
    return _HEAD % _hash(body) + body.removeprefix(b"{")


def json_content(data: bytes, kind: type[T]) -> T:
    """The content of a JSON file, with the types of ``kind``.

    Args:
        data: The file.
        kind: A dataclass or a type such as ``dict[str, Any]``.

    Raises:
        DamagedError: If the checksum or a type is wrong.
    """
    head = _HEAD_READ.match(data)
    body = b"{" + data[head.end() :] if head else data
    _check(body, head)
    try:
        content: T = _reader(cast(Any, kind)).validate_json(body, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise DamagedError(f"{where}: {first['msg']}".lstrip(": ")) from None
    return content


@lru_cache
def _reader(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def arrays_file(arrays: Mapping[str, Any]) -> bytes:
    """A file of ``numpy.load`` with the hash as the comment of the archive."""
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)
    body = out.getvalue()
    return body.removesuffix(_NO_COMMENT) + _COMMENT + _hash(body)


def arrays_content(data: bytes) -> dict[str, Any]:
    """Arrays of a file by name.

    Raises:
        DamagedError: If the checksum is wrong.
    """
    tail = _TAIL_READ.search(data, max(0, len(data) - _TAIL))
    _check(data[:-_TAIL] + _NO_COMMENT if tail else data, tail)
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        return {key: arrays[key] for key in arrays.files}


def _hash(body: bytes) -> bytes:
    return hashlib.sha256(body).hexdigest().encode()


def _check(body: bytes, stated: re.Match[bytes] | None) -> None:
    if stated is None:
        raise DamagedError("no checksum: damaged, or written by an older version")
    if stated[1] != _hash(body):
        raise DamagedError("damaged: its checksum is that of another content")


def read_kept(path: Path, take: Callable[[bytes], T]) -> T | None:
    """What a file holds that can be computed again; None if it cannot be used.

    Args:
        path: The file.
        take: Makes the result of its bytes; whatever it raises means damage.
    """
    try:
        return take(read_regular(path))
    except FileNotFoundError:
        return None
    except Exception as error:
        warn_ignored(path, error)
        return None


def warn_ignored(where: Path | str, why: Exception) -> None:
    """Warn of something kept that cannot be used."""
    _log.warning("%s ignored and computed again: %s", where, one_line(why))


def one_line(error: Exception) -> str:
    """One line about an error."""
    lines = str(error).splitlines() or [type(error).__name__]
    return lines[0]


def keep(path: Path, data: bytes) -> None:
    """Write what can be computed again; a full disk is no reason to stop."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)
    except (OSError, InputError) as error:
        _log.warning("not kept: %s", one_line(error))
