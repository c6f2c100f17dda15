"""Outputs that are written whole or not at all."""

from __future__ import annotations

import os
import re
import secrets
from pathlib import Path

from swgjoint.errors import InputError

DEEPEST = 100
"""Folders inside each other in the path of an output: making them is recursive."""
LONGEST_NAME = 60
"""Characters of a foreign name within that of a file, 240 bytes in UTF-8 at most."""


def write_whole(path: str | Path, data: bytes | str) -> Path:
    """Write beside the target and rename, so that no reader sees half a file.

    Raises:
        InputError: If the folder does not exist or cannot be written.
    """
    path = Path(path)
    beside = path.with_name(f".{path.name[:80]}.{os.getpid()}-{secrets.token_hex(4)}")
    content = data.encode() if isinstance(data, str) else data
    try:
        with beside.open("xb") as file:
            file.write(content)
        os.replace(beside, path)
    except OSError as exc:
        raise InputError(f"cannot write {path}: {exc.strerror}") from None
    finally:
        beside.unlink(missing_ok=True)
    return path


def check_output_file(path: str | Path, suffix: str) -> Path:
    """Refuse an output file that cannot be written, before any long work.

    Raises:
        InputError: If the suffix is another one, the folder is missing or read-only,
            or the path is a folder.
    """
    path = Path(path)
    if path.suffix != suffix:
        raise InputError(f"output file {str(path)!r}: accepted: a name ending {suffix}")
    _check_length(path)
    if path.is_dir():
        raise InputError(f"output file {str(path)!r} is a folder")
    if not path.parent.is_dir():
        raise InputError(f"output folder {str(path.parent)!r} does not exist")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"output folder {str(path.parent)!r} is not writable")
    return path


def output_folder(path: str | Path) -> Path:
    """Refuse a folder that cannot be written, before any long work; creates nothing.

    Raises:
        InputError: If the path or one above it is a file, or is not writable.
    """
    path = Path(path)
    _check_length(path)
    existing = path
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(f"output folder {str(path)!r}: {str(existing)!r} is a file")
    if not os.access(existing, os.W_OK):
        raise InputError(f"output folder {str(path)!r} is not writable")
    return path


def _check_length(path: Path) -> None:
    """Refuse a path that no file system takes, or nobody follows."""
    try:
        path.exists()
    except OSError as exc:
        raise InputError(f"output {str(path)[:60]!r}: {exc.strerror}") from None
    if len(path.parts) > DEEPEST:
        raise InputError(
            f"output {str(path)[:60]!r}: {len(path.parts)} folders inside each other;"
            f" accepted: up to {DEEPEST}"
        )


def file_name(text: str) -> str:
    """A name from a file as part of the name of a file, in the folder it is meant for.

    Letters, digits, ``.``, ``_`` and ``-`` stay, so that names of drives do; a slash
    leads nowhere. Names that differ elsewhere, or late, become the same.
    """
    return re.sub(r"[^\w.-]", "-", text)[:LONGEST_NAME].lstrip(".") or "-"
