"""Tables of the validation pages that frozen results determine.

    python tests/golden/guide_tables.py

Writes every table between its two comments, with a caption that names the commands, the
date and the commit of the results. A test compares the pages with what this would
write.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import guide_cells
import map_accuracy
from golden import load

COMPARED = (*map_accuracy.DESIGNS, *map_accuracy.OTHERS)
PAGES = Path(__file__).parents[2] / "notebooks" / "guide" / "validation"


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of a page."""

    page: str
    """Name of the page without its ending."""
    title: str
    """What the table shows."""
    cells: Callable[[Sequence[guide_cells.Row]], list[list[str]]]
    """Head and rows from the results, in the order of ``frozen``."""
    frozen: tuple[str, ...]
    """Names of the frozen results."""


TABLES: dict[str, Table] = {
    "study-catalogue": Table(
        page="catalogue",
        title="Losses at ratio 100",
        cells=guide_cells.of_rows(guide_cells.losses),
        frozen=("study-catalogue",),
    ),
    "study-thesis": Table(
        page="thesis",
        title="Table 5.6 of the thesis",
        cells=guide_cells.of_rows(guide_cells.wave_generators),
        frozen=("study-thesis",),
    ),
    "study-thesis-profiles": Table(
        page="thesis",
        title="Von Mises stress with other tooth profiles [MPa]",
        cells=guide_cells.of_rows(guide_cells.tooth_profiles),
        frozen=("study-thesis-profiles",),
    ),
    "study-articles-fatigue": Table(
        page="articles",
        title="Fatigue safety factor",
        cells=guide_cells.of_rows(guide_cells.fatigue),
        frozen=("study-articles-fatigue",),
    ),
    "study-control": Table(
        page="controllers",
        title="Ten specimens of CSG-25-100",
        cells=guide_cells.of_rows(guide_cells.controllers),
        frozen=("study-control-ten",),
    ),
    "study-experiments": Table(
        page="catalogue",
        title="One change at a time",
        cells=guide_cells.experiments,
        frozen=("study-experiments",),
    ),
    "bearing-2d": Table(
        page="catalogue",
        title="Size 25, ratio 100",
        cells=guide_cells.bearing_in_plane,
        frozen=("spec-plane-100", "spec-ring-100"),
    ),
    "coning": Table(
        page="solid",
        title="Radial motion of the bore at the major axis",
        cells=guide_cells.coning,
        frozen=("meshing-straight", "meshing-crowned"),
    ),
    "map-accuracy": Table(
        page="gear",
        title="Differences of 2D maps from unseen solves in % of the peak to peak",
        cells=guide_cells.map_accuracy,
        frozen=tuple(f"map-accuracy-{name}" for name in COMPARED),
    ),
    "study-response": Table(
        page="joint",
        title="Resonance with a free motor",
        cells=guide_cells.of_rows(guide_cells.resonance),
        frozen=("study-response",),
    ),
    "back-driving": Table(
        page="joint",
        title="Back-driving torque",
        cells=guide_cells.back_driving,
        frozen=(
            "spec-back-driving-14",
            "spec-back-driving-17",
            "spec-back-driving-20",
            "spec-back-driving",
        ),
    ),
    "efficiency": Table(
        page="joint",
        title="Efficiency in percent at 2000 rpm",
        cells=guide_cells.efficiencies,
        frozen=("spec-flooded", "spec-run-in"),
    ),
    "radial-stiffness": Table(
        page="articles",
        title="Radial stiffness",
        cells=guide_cells.radial_stiffness,
        frozen=("spec-radial",),
    ),
    "kinematic-error": Table(
        page="gear",
        title="Kinematic error, peak to peak over one pitch [µrad]",
        cells=guide_cells.kinematic_errors,
        frozen=(
            "error-elliptical-0",
            "error-elliptical-20",
            "error-simplified-0",
            "error-simplified-20",
        ),
    ),
}
"""Tables by the name that their place in the page has."""


def between(name: str) -> re.Pattern[str]:
    """The place of a table in its page."""
    mark = re.escape(f"<!-- table {name}: tests/golden/guide_tables.py -->\n")
    return re.compile(f"({mark}).*?(<!-- end -->)", re.DOTALL)


def commands(stored: Sequence[guide_cells.Row]) -> dict[str, list[str]]:
    """Command lines by the date and commit of their results.

    Scripts that were run once for each of several names are one line.
    """
    lines: dict[str, list[str]] = {}
    for one in stored:
        when = f"on {one['frozen']['date']} at commit {one['frozen']['commit']}"
        found = lines.setdefault(when, [])
        words = one["command"]
        if words[0] != "python":
            found.append(shlex.join(["swgjoint", *words]))
        elif found and found[-1].startswith(shlex.join(words[:2])):
            found[-1] += f" {shlex.join(words[2:])}"
        else:
            found.append(shlex.join(words))
    return lines


def table_text(name: str) -> str:
    """Caption and rows of a table."""
    table = TABLES[name]
    stored = [load(one) for one in table.frozen]
    head, *rows = table.cells([one["result"] for one in stored])
    made = "; ".join(
        f"{', '.join(f'`{line}`' for line in lines)} {when}"
        for when, lines in commands(stored).items()
    )
    lines = [head, ["---"] * len(head), *rows]
    text = [f"| {' | '.join(row)} |" for row in lines]
    return "\n".join([f"*{table.title}; {made}:*", "", *text, ""])


def page_text(name: str) -> tuple[Path, str]:
    """A page, and its content with a table."""
    path = PAGES / f"{TABLES[name].page}.md"
    before = path.read_text(encoding="utf-8")
    text = table_text(name)
    after, count = between(name).subn(lambda m: f"{m[1]}{text}{m[2]}", before)
    if count != 1:
        raise ValueError(f"{path}: {count} places for the table {name}")
    return path, after


if __name__ == "__main__":
    for place in TABLES:
        page, content = page_text(place)
        page.write_text(content, encoding="utf-8")
