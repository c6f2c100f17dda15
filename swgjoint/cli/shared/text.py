"""Tables for terminal output."""

from __future__ import annotations

from collections.abc import Sequence


def table(rows: Sequence[Sequence[object]], *, header: Sequence[str] = ()) -> str:
    """Format a table with the first column left-aligned and the others right-aligned.

    Args:
        rows: Rows of equal length; None is shown as ``-``, a float with four digits.
        header: Column headings; empty for none.

    Returns:
        Lines of text, without a line break at the end.
    """
    cells = [[_cell(value) for value in row] for row in ([header] if header else [])]
    cells += [[_cell(value) for value in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    )


def short_headers(names: Sequence[str]) -> list[str]:
    """Shorten dotted keys to their last part, where that part is unique.

    Args:
        names: Dotted keys, such as ``flexspline.rim_mm``.
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
