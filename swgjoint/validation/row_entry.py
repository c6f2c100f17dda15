"""Rows of a study file: printed value, path of our value, and reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from string import Template
from typing import Annotated, Any

from pydantic import Field

from swgjoint.faults import Section
from swgjoint.validation.rows import Row

Text = Annotated[str, Field(min_length=1, max_length=300)]
Path = Annotated[tuple[Text, ...], Field(strict=False, min_length=2)]
"""Name of a computation, followed by the keys of its result."""

Values = Mapping[str, Mapping[str, Any]]
"""Results by name of the computation; a failed one has the message under ``fault`` and
no results."""


class RowEntry(Section):
    """One row; ``$name`` in ``quantity`` and ``reason`` is replaced by the study."""

    quantity: Text
    unit: Text
    source_value: float | None = None
    """Printed value; None if the source withholds it or prints none."""
    source: Path | None = None
    """Path of the printed value in a series; None if ``source_value`` is used."""
    ours: Path
    """Path of our value."""
    converged: Path | None = None
    """Path of the value on a finer mesh; None if there is none."""
    reason: Text
    """Why our value differs, or what the source leaves open."""
    columns: Mapping[str, Path] = {}
    """Paths of the values of further columns, by name of the column."""


def value_at(values: Values, path: Sequence[str] | None) -> Any:
    """Value at a path; None without a path, or if the path leads to no value.

    A path leads to no value if its computation failed.

    Args:
        values: Results by computation.
        path: Name of the computation, then keys of its result.
    """
    if path is None:
        return None
    value: Any = values.get(path[0], {})
    for key in path[1:]:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value


def fill_rows(
    entries: Sequence[RowEntry],
    values: Values,
    texts: Mapping[str, str],
    *,
    case: str,
    **more: Any,
) -> list[Row]:
    """Fill the rows of a study file with values.

    Args:
        entries: Rows as described in the file.
        values: Results by computation; if the computation of ``ours`` failed, its
            message replaces the reason of the row.
        texts: Replacements for ``$name`` in quantities and reasons, by name.
        case: Case of all rows.
        **more: Further columns, equal in all rows.
    """
    rows = []
    for entry in entries:
        fault = values[entry.ours[0]].get("fault")
        reason = Template(entry.reason).substitute(texts) if fault is None else fault
        printed = value_at(values, entry.source)
        rows.append(
            Row(
                case=case,
                quantity=Template(entry.quantity).substitute(texts),
                unit=entry.unit,
                source_value=entry.source_value if printed is None else printed,
                ours=value_at(values, entry.ours),
                converged=value_at(values, entry.converged),
                reason=str(reason),
                more=more
                | {key: value_at(values, path) for key, path in entry.columns.items()},
            )
        )
    return rows
