"""Tables for terminal output."""

from __future__ import annotations

import re
from collections.abc import Sequence

_NUMBER = re.compile(r"[~!> ]*[-+]?([0-9.,]+(e[-+]?[0-9]+)?|nan|inf)[%*]?")
"""A number as the tables show it, with the marks that may surround it."""
_ABSENT = ("", "-")
"""Cells without a value."""


def table(rows: Sequence[Sequence[object]], *, header: Sequence[str] = ()) -> str:
    """Format a table: text is left-aligned, numbers are right-aligned.

    A column is right-aligned if a cell is a number, or if all cells are empty; the
    first column is always left-aligned.

    Args:
        rows: Rows of equal length; None is shown as ``-``, a float with four digits.
        header: Column headings; empty for none.

    Returns:
        Lines of text, without a line break at the end.
    """
    cells = [[_cell(value) for value in row] for row in ([header] if header else [])]
    cells += [[_cell(value) for value in row] for row in rows]
    columns = list(zip(*cells, strict=True))
    widths = [max(map(len, column)) for column in columns]
    first = 1 if header else 0
    right = [k > 0 and _is_numeric(column[first:]) for k, column in enumerate(columns)]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(row, widths, right, strict=True)
        ).rstrip()
        for row in cells
    )


def _is_numeric(cells: Sequence[str]) -> bool:
    """Whether a column contains a number, or nothing at all."""
    return any(map(_NUMBER.fullmatch, cells)) or all(cell in _ABSENT for cell in cells)


def short_headers(names: Sequence[str]) -> list[str]:
    """Shorten dotted keys to their last part where that part is unique.

    Args:
        names: Dotted keys, such as ``flexspline.rim_mm``.

    Returns:
        Last part of each key, or the whole key if two keys have the same last part.
    """
    lasts = [name.rpartition(".")[2] for name in names]
    return [
        last if lasts.count(last) == 1 else name
        for name, last in zip(names, lasts, strict=True)
    ]


def _cell(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
