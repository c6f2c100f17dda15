"""Write rows as CSV text."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    r"""Format rows as CSV with a header line that names the columns of all rows.

    A cell without a value is empty. A mapping of counts by name fills one cell.

    Args:
        rows: Values by column; a row may lack columns that other rows have.

    Returns:
        The text; empty if there are no rows.

    >>> csv_text([{"a": 1, "b": None}, {"a": 2, "c": {"bore": 3, "flank": 4}}])
    'a,b,c\n1,,\n2,,bore:3 flank:4\n'
    """
    if not rows:
        return ""
    out = io.StringIO()
    columns = dict.fromkeys(key for row in rows for key in row)
    writer = csv.DictWriter(out, fieldnames=list(columns), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: _cell(value) for key, value in row.items()})
    return out.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, Mapping):
        return " ".join(f"{key}:{count}" for key, count in value.items())
    return value
