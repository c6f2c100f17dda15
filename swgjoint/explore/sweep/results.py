"""Storage for the records of a sweep: a folder, or any address that fsspec supports."""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from swgjoint.errors import InputError, MissingExtraError
from swgjoint.explore.sweep.figures import Record
from swgjoint.files import attempt_output, output_folder, read_regular, write_whole
from swgjoint.json_text import json_text
from swgjoint.store import DamagedError, json_content, json_file, warn_ignored


class ResultStore(Protocol):
    """A folder in which results are stored."""

    def path_of(self, name: str) -> str:
        """Path of a file."""

    def read(self, name: str) -> bytes | None:
        """Content of a file; None if there is none."""

    def write(self, name: str, data: bytes) -> str:
        """Write a file atomically.

        Args:
            name: Path relative to the folder.
            data: Content.

        Returns:
            Path of the file.
        """

    def remove(self, name: str) -> None:
        """Remove an existing file."""


class Folder:
    """A folder of this machine."""

    def __init__(self, path: str | Path) -> None:
        self.path = output_folder(path)

    def path_of(self, name: str) -> str:
        """See :class:`ResultStore`."""
        return str(self.path / name)

    def read(self, name: str) -> bytes | None:
        """See :class:`ResultStore`."""
        try:
            return read_regular(self.path / name)
        except FileNotFoundError:
            return None
        except OSError as error:  # such as a missing permission, or a file as folder
            why = error.strerror or error
            raise InputError(f"cannot read {self.path_of(name)}: {why}") from None

    def write(self, name: str, data: bytes) -> str:
        """See :class:`ResultStore`.

        Args:
            name: Path relative to the folder.
            data: Content.

        Raises:
            InputError: If the file cannot be written.
        """
        target = self.path / name
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot write {target}: {error.strerror}") from None
        return str(write_whole(target, data))

    def remove(self, name: str) -> None:
        """See :class:`ResultStore`."""
        target = self.path / name
        try:
            target.unlink()
        except OSError as error:
            raise InputError(f"cannot remove {target}: {error.strerror}") from None


class Remote:
    """A folder of any file system of fsspec, such as ``s3://bucket/sweep``."""

    def __init__(self, address: str) -> None:
        try:
            from fsspec.core import url_to_fs
        except ImportError:
            raise MissingExtraError(
                f"results at {address!r} need fsspec: pip install 'swgjoint[cluster]'"
            ) from None
        try:
            self._files, self._root = url_to_fs(address)
        except (ValueError, ImportError) as error:  # unknown protocol, missing package
            raise InputError(f"results at {address!r}: {error}") from None
        self._scheme = address.partition("://")[0]

    def path_of(self, name: str) -> str:
        """See :class:`ResultStore`."""
        return f"{self._scheme}://{f'{self._root}/{name}'.lstrip('/')}"

    def read(self, name: str) -> bytes | None:
        """See :class:`ResultStore`."""
        try:
            data: bytes = self._files.cat_file(f"{self._root}/{name}")
        except FileNotFoundError:
            return None
        return data

    def write(self, name: str, data: bytes) -> str:
        """See :class:`ResultStore`.

        The data are written to a temporary name and moved into place, because not all
        file systems write atomically.

        Args:
            name: Path relative to the folder.
            data: Content.
        """
        target = f"{self._root}/{name}"
        folder, _, last = target.rpartition("/")
        temporary = f"{folder}/.{last}.{secrets.token_hex(4)}"
        self._files.makedirs(folder, exist_ok=True)
        self._files.pipe_file(temporary, data)
        self._files.mv(temporary, target)
        return self.path_of(name)

    def remove(self, name: str) -> None:
        """See :class:`ResultStore`."""
        self._files.rm_file(f"{self._root}/{name}")


def place_of(where: str | Path) -> ResultStore:
    """Store for a local path, or for an address that contains ``://``."""
    return Remote(where) if isinstance(where, str) and "://" in where else Folder(where)


def read_record(place: ResultStore, key: str) -> Record | None:
    """Read a stored record; None if there is none or it is damaged.

    Args:
        place: Store of the records.
        key: Key of the record.
    """
    data = place.read(_name(key))
    if data is None:
        return None
    try:
        return json_content(data, Record)
    except DamagedError as error:
        warn_ignored(place.path_of(_name(key)), error)
        return None


def write_record(
    place: ResultStore, key: str, record: Record, values: Mapping[str, Any]
) -> None:
    """Store a record, together with its parameter values for the human reader.

    Args:
        place: Store of the records.
        key: Key of the record.
        record: Outcome and figures.
        values: Values of the parameters by column.
    """
    place.write(_name(key), json_file({**asdict(record), "values": dict(values)}))


def _name(key: str) -> str:
    return f"results/{key[:2]}/{key}.json"


def write_to(
    place: ResultStore, outputs: Mapping[str, Callable[[], bytes | None]]
) -> list[str]:
    """Write the output files of a result; if one fails, the others are still written.

    Args:
        place: Folder of the outputs.
        outputs: Functions that return the content, by file name. A file whose content
            is None is skipped.

    Returns:
        Paths of the written files.
    """
    files: list[str] = []
    for name, make in outputs.items():
        with attempt_output(place.path_of(name)):
            data = make()
            if data is not None:
                files.append(place.write(name, data))
    return files


def parquet_bytes(rows: Sequence[Mapping[str, Any]]) -> bytes | None:
    """Rows with the same keys in Parquet format; None if pyarrow is not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        return None
    columns = {key: _column([row[key] for row in rows]) for key in rows[0]}
    out = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(pyarrow.table(columns), out)
    data: bytes = out.getvalue().to_pybytes()
    return data


def _column(values: list[Any]) -> list[Any]:
    """Values of one type: integers and floats become floats, other mixtures text."""
    kinds = {type(value) for value in values} - {type(None)}
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    if len(kinds) <= 1:
        return values
    return [None if value is None else str(value) for value in values]


def flat(value: Any) -> Any:
    """Value of a table cell: tables and lists as JSON text, infinity or NaN as None."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping | list | tuple):
        return json_text(value, indent=None)
    return value
