"""Atomic output files: a file is either complete or absent."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import secrets
import stat
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from swgjoint.errors import InputError, OutputWarning, SwgError, out_of_memory
from swgjoint.json_text import json_text

DEEPEST = 100
"""Largest number of parts in the path of an output; folders are created recursively."""
LONGEST_NAME = 60
"""Largest number of characters that a name from an input file contributes to a file
name. They are at most 240 bytes in UTF-8."""


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Provide a temporary file that replaces the target if the block does not fail.

    The temporary file is in the folder of the target, and its name identifies host and
    process. Temporary files left by processes of this host that were killed are
    removed.
    """
    host = hashlib.sha256(platform.node().encode()).hexdigest()[:8]
    start = f".{path.name[:40]}.{host}-"
    _clear(path.parent, re.compile(re.escape(start) + r"(\d+)-[0-9a-f]{8}"))
    beside = path.with_name(f"{start}{os.getpid()}-{secrets.token_hex(4)}")
    # created exclusively for this process; its mode follows the umask
    beside.open("xb").close()
    try:
        yield beside
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def _clear(folder: Path, left: re.Pattern[str]) -> None:
    """Remove temporary files of processes of this host that have ended."""
    with suppress(OSError):  # no such folder, or another process removes them as well
        for name in os.listdir(folder):
            found = left.fullmatch(name)
            if found is not None and _is_gone(int(found[1])):
                (folder / name).unlink(missing_ok=True)


def _is_gone(process: int) -> bool:
    if os.name != "posix":  # only POSIX systems test a process with signal 0
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False


def write_whole(path: str | Path, data: bytes | str) -> Path:
    """Write a temporary file and rename it, so that no reader sees an incomplete file.

    Args:
        path: The target.
        data: Content; text is encoded as UTF-8.

    Returns:
        The target as a path.

    Raises:
        InputError: If the file cannot be written, e.g. because its folder does not
            exist.
    """
    path = Path(path)
    try:
        with whole(path) as beside:
            beside.write_bytes(data.encode() if isinstance(data, str) else data)
    except OSError as exc:
        raise InputError(f"cannot write {path}: {exc.strerror}") from None
    return path


@contextmanager
def attempt_output(
    path: str | Path, *, unless: Callable[[], bool] = lambda: False
) -> Iterator[None]:
    """Turn a failure to write a file into an ``OutputWarning``.

    A plot that cannot be drawn must not discard the results that it would show.

    Args:
        path: The file.
        unless: Function that is called after a failure. It returns True if the content
            rather than the file is at fault; the exception is then raised.
    """
    try:
        yield
    except Exception as failure:
        if unless():
            raise
        kind = "" if isinstance(failure, SwgError) else f"{type(failure).__name__}: "
        why = f"{kind}{' '.join(str(failure).split())}"
        if out_of_memory(failure):
            why = "out of memory"
        text = f"{path} is not written: {why}"
        warnings.warn(OutputWarning(text), stacklevel=3)


class Outputs:
    """The output files of one result; a failure to write one only causes a warning.

    Args:
        folder: Output folder, created when the first file is written.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.files: list[str] = []
        """Paths of the files that were written."""

    def write(self, name: str, make: Callable[[], bytes | str | None]) -> None:
        """Write the content that ``make`` returns.

        Args:
            name: File name in the folder.
            make: Function that returns the content, or None to write nothing.
        """
        path = self._folder / name
        with attempt_output(path):
            content = make()
            if content is not None:
                self._folder.mkdir(parents=True, exist_ok=True)
                write_whole(path, content)
                self.files.append(str(path))

    def write_json(self, name: str, result: dict[str, Any]) -> None:
        """Write a result as JSON and list all output files in its key ``files``.

        Call this last, so that the list is complete.

        Args:
            name: File name in the folder.
            result: The result, whose key ``files`` is set.
        """
        path = str(self._folder / name)
        content = result | {"files": [path, *self.files]}
        self.write(name, lambda: json_text(content) + "\n")
        if path in self.files:
            self.files.remove(path)
            self.files.insert(0, path)
        result["files"] = self.files

    def hand_over(self, name: str, write: Callable[[Path], object]) -> None:
        """Let ``write`` write the file.

        Args:
            name: File name in the folder.
            write: Function that writes the file at the path it receives.
        """
        path = self._folder / name
        with attempt_output(path):
            self._folder.mkdir(parents=True, exist_ok=True)
            write(path)
            self.files.append(str(path))


def read_regular(path: Path) -> bytes:
    """Content of a regular file; reading a pipe or a device might never end.

    Raises:
        OSError: If the file cannot be read or is not a regular file.
    """
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(f"{path} is not a regular file")
    return path.read_bytes()


def check_output_file(path: str | Path, suffix: str) -> Path:
    """Reject an output file that cannot be written, before a long computation starts.

    Args:
        path: The file.
        suffix: Required suffix, including the dot.

    Returns:
        The file as a path.

    Raises:
        InputError: If the suffix is wrong, if the folder is missing or read-only, or if
            the path is a folder.
    """
    path = Path(path)
    if path.suffix != suffix:
        raise InputError(
            f"output file {str(path)!r}: accepted: a name that ends in {suffix}"
        )
    _check_length(path)
    if path.is_dir():
        raise InputError(f"output file {str(path)!r} is a folder")
    if not path.parent.is_dir():
        raise InputError(f"output folder {str(path.parent)!r} does not exist")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"output folder {str(path.parent)!r} is not writable")
    return path


def output_folder(path: str | Path) -> Path:
    """Reject an output folder that cannot be written, before a long computation starts.

    The folder is not created.

    Returns:
        The folder as a path.

    Raises:
        InputError: If the path or one of its parents is a file, or if the folder cannot
            be created or written.
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
    """Reject a path that the file system does not accept or that is too deep."""
    try:
        path.exists()
    except OSError as exc:
        raise InputError(f"output {str(path)[:60]!r}: {exc.strerror}") from None
    if len(path.parts) > DEEPEST:
        raise InputError(
            f"output {str(path)[:60]!r}: {len(path.parts)} nested folders;"
            f" accepted: up to {DEEPEST}"
        )


def file_name(text: str) -> str:
    """Make a safe file name from a name in an input file.

    Letters, digits, ``.``, ``_`` and ``-`` are kept, so that the names of drives do not
    change; other characters, including slashes, become ``-``. The result is not unique:
    names that differ only in replaced characters or after the 60th character become
    equal.

    >>> file_name("../CSG 25/100")
    '-CSG-25-100'
    """
    return re.sub(r"[^\w.-]", "-", text)[:LONGEST_NAME].lstrip(".") or "-"
