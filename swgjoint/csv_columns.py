"""Read named columns of numbers from a CSV file; each fault is reported in one line."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError

MAX_BYTES = 200_000_000
"""Largest accepted file size [B], sufficient for several million samples, far more than
a record of one turn or one hysteresis loop has."""


LARGEST = 1e12
"""Largest accepted magnitude in SI units. No quantity measured on a test bench is
larger, not even a time stamp, and low powers of this value do not overflow."""
HEAD_LINES = 10_000
"""Number of leading lines, including comments, that are searched for the header."""
SEPARATORS = {",": "','", ";": "';'", "\t": "a tab"}
"""Accepted cell separators, with their names in messages. The header line determines
which one a file uses."""
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """Header and cells of a file, as text."""

    header: list[str]
    """Column names."""
    rows: list[tuple[int, list[str]]]
    """Line number in the file and cells of each row."""
    separator: str
    """Separator of the cells, a key of :data:`SEPARATORS`."""


def read_columns(
    path: str | Path, quantities: Mapping[str, Mapping[str, float]]
) -> dict[str, NDArray[np.float64]]:
    """Read columns of numbers and convert them to SI units.

    Commas, semicolons or tabs separate the cells. Lines that begin with ``#`` are
    comments; the last comment before the numbers may be the header, as written by
    ``numpy.savetxt``.

    Args:
        path: File with one header line.
        quantities: For each quantity its accepted column names, with the factors that
            convert these columns to SI units.

    Returns:
        One array per quantity, all of the same length, in SI units.

    Raises:
        InputError: If the file cannot be read, if a column is missing or occurs twice,
            or if a cell is not a finite number of magnitude up to :data:`LARGEST`. The
            message names the file and, for a cell, the line.
    """
    path = Path(path)
    sheet = _sheet(path, _wanted(quantities))
    header = sheet.header
    found = {name: _column(path, sheet, name, quantities) for name in quantities}
    if not sheet.rows:
        raise InputError(f"{path}: no line of numbers below the header")
    values: dict[str, list[float]] = {name: [] for name in quantities}
    for number, row in sheet.rows:
        if len(row) != len(header):
            raise InputError(
                f"{path}, line {number}: {len(row)} cells; the header has"
                f" {len(header)}, separated by {SEPARATORS[sheet.separator]}"
            )
        for name, (index, factor) in found.items():
            try:
                value = _number(row[index])
            except ValueError:
                value = float("nan")
            if not abs(value * factor) <= LARGEST:  # rejects NaN as well
                cell = row[index].strip()
                comma = _DECIMAL_COMMA.fullmatch(cell)
                raise InputError(
                    f"{path}, line {number}: {header[index]} = {cell[:40]!r};"
                    f" accepted: a finite number{' with a decimal point' * bool(comma)}"
                    f"{f', at most {LARGEST:g} in SI units' * isfinite(value)}"
                )
            values[name].append(value * factor)
    return {name: np.array(column) for name, column in values.items()}


def read_table(path: str | Path, text: str) -> list[dict[str, str | float | None]]:
    """Read a table with one column of text; its other columns contain numbers or text.

    Args:
        path: File with one header line, see :func:`read_columns`.
        text: Name of the required column of text, which is never empty.

    Returns:
        The rows by column name; numbers are floats, empty cells are None.

    Raises:
        InputError: If the file cannot be read, if the column is missing, if a column
            occurs twice, or if a row has another number of cells than the header.
    """
    path = Path(path)
    sheet = _sheet(path, f"accepted: a table with a column {text}")
    header = sheet.header
    if text not in header or len(set(header)) < len(header):
        raise InputError(
            f"{path}: columns {', '.join(map(repr, header))[:200]}; accepted: a column"
            f" {text}, every name once"
        )
    rows = []
    for number, cells in sheet.rows:
        row = dict(zip(header, map(_text_or_number, cells), strict=False))
        row[text] = cells[header.index(text)].strip() if len(cells) == len(row) else ""
        if len(cells) != len(header) or not row[text]:
            raise InputError(
                f"{path}, line {number}: {len(cells)} cells; accepted:"
                f" {len(header)}, with a text under {text}"
            )
        rows.append(row)
    return rows


def _text_or_number(cell: str) -> str | float | None:
    try:
        return _number(cell)
    except ValueError:
        return cell.strip() or None


def _number(cell: str) -> float:
    """Convert a cell; ``float`` alone would read ``1_5`` as 15."""
    if "_" in cell:
        raise ValueError(f"{cell!r} is not a number")
    return float(cell)


def header_of(path: str | Path) -> list[str]:
    """Column names; an empty list if :func:`read_columns` would reject the file."""
    try:
        return _sheet(Path(path), "", limit=HEAD_LINES).header
    except InputError:
        return []


def _sheet(path: Path, wanted: str, limit: int | None = None) -> Sheet:
    """Header and cells of a file, or of its first ``limit`` lines."""
    lines = _text(path).splitlines()[:limit]
    body = [
        (number, line)
        for number, line in enumerate(lines, 1)
        if line.strip() and not _is_comment(line)
    ]
    if not body:
        raise InputError(f"{path}: empty; {wanted}")
    first, head = body[0]
    if _is_numeric(head):
        above = [line for line in lines[: first - 1] if _is_comment(line)]
        named = above[-1].strip().strip('"').lstrip("# ") if above else ""
        separator = _separator(head)
        if named and named.count(separator) == head.count(separator):
            body.insert(0, (0, named))
            head = named
    separator = _separator(head)
    table = _cells(path, [line for _, line in body], separator)
    numbers = [number for number, _ in body]
    return Sheet(
        header=[cell.strip() for cell in table[0]],
        rows=list(zip(numbers[1:], table[1:], strict=True)),
        separator=separator,
    )


def _text(path: Path) -> str:
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise InputError(f"{path}: {size} bytes; accepted: at most {MAX_BYTES}")
        return path.read_bytes().decode("utf-8-sig")
    except OSError as exc:
        raise InputError(f"{path}: cannot be read: {exc.strerror}") from None
    except UnicodeDecodeError as exc:
        raise InputError(f"{path}: not UTF-8 text at byte {exc.start}") from None
    except InputError:
        raise
    except ValueError:  # a null byte in the name
        raise InputError(f"{str(path)[:60]!r} is not a path") from None


def _cells(path: Path, lines: list[str], separator: str) -> list[list[str]]:
    try:
        rows = list(csv.reader(lines, delimiter=separator, strict=True))
    except (csv.Error, ValueError) as exc:
        raise InputError(f"{path}: not a CSV file: {exc}") from None
    if len(rows) != len(lines):
        raise InputError(f"{path}: not a CSV file: a quoted cell over several lines")
    return rows


def _separator(line: str) -> str:
    """Most frequent separator in a line; a comma if there is none."""
    return max(SEPARATORS, key=line.count)


def _is_comment(line: str) -> bool:
    return line.lstrip().lstrip('"').startswith("#")


def _is_numeric(line: str) -> bool:
    """Whether all cells of a line are finite numbers."""
    try:
        return all(
            isfinite(_number(cell.strip(' "'))) for cell in line.split(_separator(line))
        )
    except ValueError:
        return False


def _column(
    path: Path,
    sheet: Sheet,
    name: str,
    quantities: Mapping[str, Mapping[str, float]],
) -> tuple[int, float]:
    """Index of the column of a quantity, and its factor to SI units."""
    units, header = quantities[name], sheet.header
    indices = [k for k, cell in enumerate(header) if cell in units]
    if len(indices) == 1:
        return indices[0], units[header[indices[0]]]
    if indices:
        raise InputError(
            f"{path}: {name} occurs in {len(indices)} columns; accepted: one"
        )
    near = [m for key in units for m in get_close_matches(key, header, n=1)]
    hint = f" (the file has {near[0][:40]!r})" if near else ""
    read = ", ".join(repr(cell[:24]) for cell in header[:6])
    more = f" and {len(header) - 6} more" if len(header) > 6 else ""
    raise InputError(
        f"{path}: no column {' or '.join(units)}{hint}; columns found, separated by"
        f" {SEPARATORS[sheet.separator]}: {read}{more}"
    )


def _wanted(quantities: Mapping[str, Mapping[str, float]]) -> str:
    return "accepted: columns " + ", ".join(" or ".join(q) for q in quantities.values())
