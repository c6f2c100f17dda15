"""Report and plots of the thesis study."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any

from swgjoint.validation.rows import Page, Row
from swgjoint.validation.thesis.cases import StudyFile
from swgjoint.validation.thesis.checks import TrendCheck
from swgjoint.view.plots.thesis import group_picture

if TYPE_CHECKING:
    from swgjoint.validation.thesis.rows import CaseRecords

_COLUMNS = {
    "case": "case",
    "quantity": "quantity",
    "source_value": "thesis",
    "ours": "T",
    "ours_tenth": "T/10",
    "deviation_percent": "T [%]",
    "deviation_tenth_percent": "T/10 [%]",
    "converged": "T, fine",
    "converged_tenth": "T/10, fine",
    "run_s": "run [s]",
}

_HEAD = """\
# {source}: recomputation of the {space} studies

The tables list the largest nodal stress of the flexspline in MPa, averaged over
{positions} positions of the wave generator in half a turn (refinement 1, the mesh of
the thesis). T is the stated torque. {tenth}
Deviations of our values are relative to the thesis. "fine" is the finest mesh
(refinement {finest:g}, mean over {fine_positions} positions in one pitch).

{summary}
"""
_TENTH = {
    "2d": """T/10 is the torque that the thesis probably applied:
in the thesis, the stress increase with torque is only about a tenth of what static
equilibrium of a ring of the stated face width requires.""",
    "3d": """T/10 is listed because the 2D stresses of the thesis
suggest this torque. Rows in 3D are judged at T, and
finer meshes are computed at T only.""",
}


def report_pages(
    study: StudyFile,
    results: Sequence[CaseRecords],
    rows: Sequence[Row],
    trends: Sequence[TrendCheck],
    summary: Sequence[str],
) -> dict[str, Page]:
    """Functions that return ``thesis.md`` and one plot per part, by file name.

    Args:
        study: Study file.
        results: Runs of all cases.
        rows: Rows of the study.
        trends: Checks of the stated trends.
        summary: Lines for the head of the report.
    """
    pages: dict[str, Page] = {
        "thesis.md": lambda: _markdown(study, results, rows, trends, summary)
    }
    for part, found in groupby(results, key=lambda result: result.case.group.id):
        pages[f"{part}.png"] = partial(group_picture, list(found))
    return pages


def _markdown(
    study: StudyFile,
    results: Sequence[CaseRecords],
    rows: Sequence[Row],
    trends: Sequence[TrendCheck],
    summary: Sequence[str],
) -> str:
    head = _HEAD.format(
        source=study.source[:1].upper() + study.source[1:],
        space="2D" if study.model == "2d" else "3D",
        positions=study.positions,
        tenth=_TENTH[study.model],
        finest=study.refinements[-1],
        fine_positions=study.fine_positions,
        summary="\n".join(f"- {line}" for line in summary),
    )
    groups = {result.case.group.id: result.case.group for result in results}
    parts = [head]
    for part, found in groupby(rows, key=lambda row: row.more["part"]):
        group = groups[part]
        lines = [f"## {part}: {group.title}", "", group.source]
        if group.statement:
            lines[-1] += f": {group.statement}"
        stated = [f"- {check.text}" for check in trends if check.part == part]
        stated += [""] if stated else []
        parts.append("\n".join([*lines, "", *stated, *_table(list(found))]))
    return "\n\n".join(parts) + "\n"


def _table(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of the Markdown table of one part, followed by the reasons of its rows."""
    plain_rows = [row.to_json() for row in rows]
    # omit empty columns
    keys = [k for k in _COLUMNS if any(row[k] is not None for row in plain_rows)]
    yield "| " + " | ".join(_COLUMNS[key] for key in keys) + " |"
    yield "|" + "---|" * len(keys)
    for columns in plain_rows:
        yield "| " + " | ".join(_cell(key, columns[key]) for key in keys) + " |"
    reasons: dict[str, list[str]] = {}
    for row in rows:
        if row.reason:
            reasons.setdefault(row.reason, []).append(f"{row.case} {row.quantity}")
    if reasons:
        yield ""
    for reason, names in reasons.items():
        yield f"- {', '.join(names)}: {reason}"


def _cell(key: str, value: Any) -> str:
    if value is None:
        return ""
    if not isinstance(value, float):
        return str(value)
    return f"{value:+.1f}" if key.startswith("deviation") else f"{value:.1f}"
