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
from typing import Any

from golden import load

from swgjoint.units import arcsec

PAGES = Path(__file__).parents[2] / "notebooks" / "guide" / "validation"
Row = dict[str, Any]


def span(low: float, high: float) -> str:
    """Both ends of a bracket, with two digits."""
    return f"{digits(low)} to {digits(high)}"


def digits(value: float) -> str:
    """Two significant digits, but no fewer than the whole number."""
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:#.2g}"


def losses(rows: list[Row]) -> list[list[str]]:
    """Running torque, efficiency and starting torque of the catalogue, by size."""
    sizes = [row for row in rows if row["quantity"] == "no-load running torque"]
    starts = [row for row in rows if row["quantity"] == "starting torque"]
    shares = [row for row in rows if row["unit"] == "%"]
    wide = "model, run in to flooded, 30 to 300 mm²/s"
    near = "model, flooded, greases of the maker"
    table = [["size", *(str(row["size"]) for row in sizes)]]
    for name, found in (
        ("no-load running torque, catalogue [mN·m]", sizes),
        ("efficiency at rated torque, catalogue [%]", shares),
    ):
        table += [
            [name, *(f"{row['source_value']:.0f}" for row in found)],
            [wide, *(span(row["low"], row["high"]) for row in found)],
            [near, *(span(*row["maker_greases"]) for row in found)],
        ]
    stated = [f"{row['source_value']:.0f}" for row in starts]
    table.append(["starting torque, catalogue [mN·m]", *stated])
    table.append(["model", *(span(row["low"], row["high"]) for row in starts)])
    return table


def wave_generators(rows: list[Row]) -> list[list[str]]:
    """Stresses [MPa] of four wave generators, Table 5.6 of the thesis."""
    keys = "source_value", "ours_tenth", "ours", "converged_tenth", "converged"
    head = ["wave generator, stress [MPa]", "thesis", "ours, T/10", "ours, T"]
    table = [[*head, "ours, T/10, fine", "ours, T, fine"]]
    for row in rows:
        name = f"{row['case'].removeprefix('table-5.6 ')}, {row['quantity']}"
        table.append(
            [name.removesuffix(" stress"), *(f"{row[key]:.1f}" for key in keys)]
        )
    return table


def resonance(rows: list[Row]) -> list[list[str]]:
    """Frequencies of the linear level and of its closed form."""
    table = [["CSG-25-100 at level `linear`", "closed form [Hz]", "chirp [Hz]"]]
    table[0].append("difference [%]")
    for row in rows:
        if row["case"] == "CSG-25-100, linear":
            found, exact = row["ours"], row["source_value"]
            cells = f"{exact:.2f}", f"{found:.2f}", f"{100 * (found / exact - 1):.2f}"
            table.append([row["quantity"], *cells])
    return table


def back_driving(results: Sequence[Row]) -> list[list[str]]:
    """Back-driving torque of catalogue drives of ratio 100, by size."""
    key = "back_driving_torque_Nm"
    sizes = [one["design"].split("-")[1] for one in results]
    return [
        ["CSG, ratio 100, size", *sizes],
        [
            "back-driving torque, predicted [N·m]",
            *(f"{one[key]:.2f}" for one in results),
        ],
        [
            "back-driving torque, stated [N·m]",
            *(f"{one['stated'][key]:.2f}" for one in results),
        ],
    ]


def efficiencies(results: Sequence[Row]) -> list[list[str]]:
    """Efficiency [%] at 2000 rpm by torque up to the rated one, and temperature."""
    flooded, run_in = results
    loads = [f"{load:.4g}" for load in flooded["efficiency"]["load_Nm"]]
    table = [["output torque [N·m]", *loads[:-1], f"{loads[-1]} (rated)"]]
    for result, grease, temperature in (
        (flooded, "flooded", 0.0),
        (flooded, "flooded", 20.0),
        (flooded, "flooded", 40.0),
        (run_in, "run in", 20.0),
    ):
        found = result["efficiency"]
        k = found["temperature_C"].index(temperature)
        row = found["efficiency_percent"][k][found["speed_rpm"].index(2000.0)]
        table.append([f"{grease}, {temperature:.0f} °C", *map(digits, row)])
    share = flooded["losses"]["bending_share"][1:]
    name = "share of bending in the losses, flooded, 20 °C [%]"
    return [*table, [name, *(f"{100.0 * one:.2f}" for one in share)]]


def radial_stiffness(results: Sequence[Row]) -> list[list[str]]:
    """Radial stiffness [N/mm] of a cup by mesh and load."""
    (result,) = results
    found = result["radial_stiffness"]
    large = found["large_rotations"]
    values = {
        "loads at mid-face, half of the elements per direction": "half_the_elements",
        "loads at the open edge": "open_edge",
        "loads spread over the face width": "spread_over_face_width",
        "smooth cup in closed form": "smooth_shell",
    }
    rows = {name: found[f"{key}_N_mm"] for name, key in values.items()}
    rows = {
        "loads at mid-face, mesh of the thesis": result["radial_stiffness_N_mm"],
        **rows,
        "pulled apart by 0.4 mm with large rotations": large["outward_N_mm"],
        "pressed together by 0.4 mm with large rotations": large["inward_N_mm"],
    }
    return [
        ["case", "radial stiffness [N/mm]"],
        *([name, f"{value:.1f}"] for name, value in rows.items()),
    ]


def kinematic_errors(results: Sequence[Row]) -> list[list[str]]:
    """Peak to peak of the kinematic error [µrad] by wave generator and torque."""

    def cell(result: Row) -> str:
        error = result["per_step"]["output_error_arcsec"]
        return f"{1e6 * arcsec * (max(error) - min(error)):.2f}"

    cells = [cell(one) for one in results]
    return [
        ["wave generator", "unloaded", "20 N·m"],
        ["elliptical", *cells[:2]],
        ["simplified", *cells[2:]],
    ]


def of_rows(
    table: Callable[[list[Row]], list[list[str]]],
) -> Callable[[Sequence[Row]], list[list[str]]]:
    """A table of the rows of a single study."""
    return lambda results: table(results[0]["rows"])


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of a page."""

    page: str
    """Name of the page without its ending."""
    title: str
    """What the table shows."""
    cells: Callable[[Sequence[Row]], list[list[str]]]
    """Head and rows from the results, in the order of ``frozen``."""
    frozen: tuple[str, ...]
    """Names of the frozen results."""


TABLES: dict[str, Table] = {
    "study-catalogue": Table(
        page="catalogue",
        title="Losses at ratio 100",
        cells=of_rows(losses),
        frozen=("study-catalogue",),
    ),
    "study-thesis": Table(
        page="thesis",
        title="Table 5.6 of the thesis",
        cells=of_rows(wave_generators),
        frozen=("study-thesis",),
    ),
    "study-response": Table(
        page="joint",
        title="Resonance with a free motor",
        cells=of_rows(resonance),
        frozen=("study-response",),
    ),
    "back-driving": Table(
        page="joint",
        title="Back-driving torque",
        cells=back_driving,
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
        cells=efficiencies,
        frozen=("spec-flooded", "spec-run-in"),
    ),
    "radial-stiffness": Table(
        page="articles",
        title="Radial stiffness",
        cells=radial_stiffness,
        frozen=("spec-radial",),
    ),
    "kinematic-error": Table(
        page="gear",
        title="Kinematic error, peak to peak over one pitch [µrad]",
        cells=kinematic_errors,
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


def table_text(name: str) -> str:
    """Caption and rows of a table."""
    table = TABLES[name]
    stored = [load(one) for one in table.frozen]
    head, *rows = table.cells([one["result"] for one in stored])
    commands: dict[str, list[str]] = {}
    for one in stored:
        when = f"on {one['frozen']['date']} at commit {one['frozen']['commit']}"
        command = shlex.join(["swgjoint", *one["command"]])
        commands.setdefault(when, []).append(f"`{command}`")
    made = "; ".join(f"{', '.join(run)} {when}" for when, run in commands.items())
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
