"""Named columns of numbers from a CSV file, every fault one clear line."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from difflib import get_close_matches
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError

MAX_BYTES = 200_000_000
"""Some million samples; a longer file is not a record of one turn or one loop."""


def read_columns(
    path: str | Path, quantities: Mapping[str, Mapping[str, float]]
) -> dict[str, NDArray[np.float64]]:
    """Columns in SI units; lines that begin with ``#`` are comments.

    Args:
        path: File with one header line.
        quantities: Per quantity the accepted column names with their factor to SI.

    Returns:
        One array per quantity, all of one length.

    Raises:
        InputError: If the file cannot be read, a column is missing or doubled, or a
            cell is no finite number; names file and line.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise InputError(f"{path}: {size} bytes; accepted: at most {MAX_BYTES}")
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as exc:
        raise InputError(f"{path}: cannot be read: {exc.strerror}") from None
    except UnicodeDecodeError as exc:
        raise InputError(f"{path}: not UTF-8 text at byte {exc.start}") from None
    except ValueError:  # a null byte in the name
        raise InputError(f"{str(path)[:60]!r} is not a path") from None
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise InputError(f"{path}: empty; {_wanted(quantities)}")
    try:
        rows = [
            (number, row)
            for (number, _), row in zip(
                lines, csv.reader((line for _, line in lines), strict=True), strict=True
            )
        ]
    except (csv.Error, ValueError) as exc:
        raise InputError(f"{path}: not a CSV file: {exc}") from None
    header = [cell.strip() for cell in rows[0][1]]
    found = {name: _column(path, header, name, quantities) for name in quantities}
    values: dict[str, list[float]] = {name: [] for name in quantities}
    for number, row in rows[1:]:
        if len(row) != len(header):
            raise InputError(
                f"{path}, line {number}: {len(row)} cells; the header has {len(header)}"
            )
        for name, (index, factor) in found.items():
            try:
                value = float(row[index])
            except ValueError:
                value = float("nan")
            if not isfinite(value):
                raise InputError(
                    f"{path}, line {number}: {header[index]} ="
                    f" {row[index].strip()[:40]!r}; accepted: a finite number"
                )
            values[name].append(value * factor)
    return {name: np.array(column) for name, column in values.items()}


def _column(
    path: Path,
    header: list[str],
    name: str,
    quantities: Mapping[str, Mapping[str, float]],
) -> tuple[int, float]:
    units = quantities[name]
    indices = [k for k, cell in enumerate(header) if cell in units]
    if len(indices) == 1:
        return indices[0], units[header[indices[0]]]
    if indices:
        raise InputError(f"{path}: {name} stands in {len(indices)} columns; needed one")
    near = [m for key in units for m in get_close_matches(key, header, n=1)]
    hint = f" (has {near[0][:40]!r})" if near else ""
    raise InputError(f"{path}: no column {' or '.join(units)}{hint}")


def _wanted(quantities: Mapping[str, Mapping[str, float]]) -> str:
    return "needed: columns " + ", ".join(" or ".join(q) for q in quantities.values())
