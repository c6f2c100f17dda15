"""Cache files: results that one run writes and a later run reads.

Each file contains the SHA-256 hash of its content, which is checked before the content
is parsed. The parsed content must have the type that the caller states. A file that
fails a check is treated as damaged, and its content is computed again.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import math
import os
import re
import sys
import zipfile
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
    """A cache file whose checksum or types are wrong."""


def cache_folder() -> Path | None:
    """Folder of the cache; None if the cache is off.

    The environment variable ``SWGJOINT_CACHE`` names the folder; if it is empty, the
    cache is off. Without the variable, the folder is in the user's cache folder of the
    platform, and the cache is off if there is no home folder.
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
        # XDG Base Directory Specification: relative paths must be ignored
        xdg = os.environ.get("XDG_CACHE_HOME", "")
        base = Path(xdg) if os.path.isabs(xdg) else Path.home() / ".cache"
        return base / "swgjoint"
    except RuntimeError:  # no home folder
        return None


def json_file(content: Any) -> bytes:
    """Encode a JSON object whose first entry ``sha256`` is the hash of the rest.

    Args:
        content: A dataclass or mapping with at least one entry.
    """
    body = (json_text(content, ascii_only=True) + "\n").encode()
    assert body.startswith(b"{\n"), "no entry: the hash has no place"
    return _HEAD % _hash(body) + body.removeprefix(b"{")


def json_content(data: bytes, kind: type[T]) -> T:
    """Decode a JSON file of :func:`json_file`, with the types of ``kind``.

    Args:
        data: Content of the file.
        kind: A dataclass or a type such as ``dict[str, Any]``.

    Raises:
        DamagedError: If the checksum is missing or wrong, or if a type is wrong.
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


def arrays_file(arrays: Mapping[str, Any], *, level: int = 6) -> bytes:
    """Encode arrays as an ``.npz`` archive whose comment is the hash.

    Args:
        arrays: Arrays by name.
        level: Level of compression, from 0 (none) and 1 (fastest) to 9 (smallest).
    """
    out = io.BytesIO()
    kind = zipfile.ZIP_DEFLATED
    with zipfile.ZipFile(out, "w", kind, compresslevel=level) as archive:
        for key, value in arrays.items():
            with archive.open(f"{key}.npy", "w", force_zip64=True) as file:
                values = np.asanyarray(value)
                np.lib.format.write_array(file, values, allow_pickle=False)
    body = out.getvalue()
    return body.removesuffix(_NO_COMMENT) + _COMMENT + _hash(body)


def arrays_content(data: bytes) -> dict[str, Any]:
    """Decode the arrays of :func:`arrays_file`.

    Returns:
        The arrays by name.

    Raises:
        DamagedError: If the checksum is missing or wrong.
    """
    tail = _TAIL_READ.search(data, max(0, len(data) - _TAIL))
    _check(data[:-_TAIL] + _NO_COMMENT if tail else data, tail)
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        return {key: arrays[key] for key in arrays.files}


def join_arrays(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Join arrays to one array of bytes, for a file that only this package reads.

    Storing many small arrays one by one takes three times as long. Words of eight zero
    bytes, which are most of the equilibria of a map, are left out: compression would
    take six times as long and save 15 % more.

    Args:
        arrays: Arrays by name.

    Returns:
        ``data``, the words that are not zero of the bytes of all arrays one after the
        other; ``used``, one bit per word, set if ``data`` contains it; and ``layout``,
        a JSON table of their names, types and shapes.
    """
    values = {key: np.asanyarray(value) for key, value in arrays.items()}
    layout = {key: [one.dtype.str, one.shape] for key, one in values.items()}
    data = b"".join(one.tobytes() for one in values.values())
    words = np.frombuffer(data + bytes(-len(data) % 8), np.uint64)
    used = words != 0
    return {
        "layout": json.dumps(layout),
        "used": np.packbits(used),
        "data": words[used],
    }


def split_arrays(joined: Mapping[str, Any]) -> dict[str, Any]:
    """The arrays that :func:`join_arrays` joined, by name."""
    used = np.unpackbits(joined["used"]).astype(bool)
    words = np.zeros(used.size, np.uint64)
    words[used] = joined["data"]
    data, start, arrays = words.tobytes(), 0, {}
    for key, (kind, shape) in json.loads(str(joined["layout"])).items():
        size = math.prod(shape) * np.dtype(kind).itemsize
        values = np.frombuffer(data[start : start + size], kind)
        arrays[key] = values.reshape(shape).copy()
        start += size
    return arrays


def _hash(body: bytes) -> bytes:
    return hashlib.sha256(body).hexdigest().encode()


def _check(body: bytes, stated: re.Match[bytes] | None) -> None:
    if stated is None:
        raise DamagedError("no checksum: damaged, or written by an older version")
    if stated[1] != _hash(body):
        raise DamagedError("damaged: the checksum does not match the content")


def read_kept(path: Path, take: Callable[[bytes], T]) -> T | None:
    """Read a cache file; None if it is missing or damaged.

    Args:
        path: The file.
        take: Function that converts the bytes to the result; any exception means that
            the file is damaged.
    """
    try:
        return take(read_regular(path))
    except FileNotFoundError:
        return None
    except Exception as error:
        warn_ignored(path, error)
        return None


def warn_ignored(where: Path | str, why: Exception) -> None:
    """Log that a cached result is ignored.

    Args:
        where: The cache file or the name of the result.
        why: The reason.
    """
    _log.warning("%s is ignored and computed again: %s", where, one_line(why))


def one_line(error: BaseException) -> str:
    """First line of an error message, or the class name if there is no message."""
    lines = str(error).splitlines() or [type(error).__name__]
    return lines[0]


def keep(path: Path, data: bytes) -> None:
    """Write a cache file; a failure, for instance a full disk, is only logged.

    Args:
        path: The file; its folder is created if necessary.
        data: Content of the file.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)
    except (OSError, InputError) as error:
        _log.warning("cache file not kept: %s", one_line(error))
