"""Tables of the validation pages that frozen results determine.

    python tests/golden/guide_tables.py

Writes every table between its two comments, with a caption that names the command, the
date and the commit of the result. A test compares the pages with what this would write.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

from golden import load

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


TABLES: dict[str, tuple[str, Callable[[list[Row]], list[list[str]]], str]] = {
    "study-catalogue": ("catalogue", losses, "Losses at ratio 100"),
    "study-thesis": ("thesis", wave_generators, "Table 5.6 of the thesis"),
    "study-response": ("joint", resonance, "Resonance with a free motor"),
}
"""Page, table and title by the name of the frozen result."""


def between(name: str) -> re.Pattern[str]:
    """The place of a table in its page."""
    mark = re.escape(f"<!-- table {name}: tests/golden/guide_tables.py -->\n")
    return re.compile(f"({mark}).*?(<!-- end -->)", re.DOTALL)


def table_text(name: str) -> str:
    """Caption and rows of a table."""
    frozen = load(name)
    _, rows_of, title = TABLES[name]
    head, *rows = rows_of(frozen["result"]["rows"])
    date, commit = frozen["frozen"]["date"], frozen["frozen"]["commit"]
    command = shlex.join(["swgjoint", *frozen["command"]])
    lines = [head, ["---"] * len(head), *rows]
    caption = f"*{title}; `{command}` on {date} at commit {commit}:*"
    return "\n".join([caption, "", *(f"| {' | '.join(row)} |" for row in lines), ""])


def page_text(name: str) -> tuple[Path, str]:
    """A page, and its content with the table of a frozen result."""
    path = PAGES / f"{TABLES[name][0]}.md"
    before = path.read_text(encoding="utf-8")
    text = table_text(name)
    after, count = between(name).subn(lambda m: f"{m[1]}{text}{m[2]}", before)
    if count != 1:
        raise ValueError(f"{path}: {count} places for the table {name}")
    return path, after


if __name__ == "__main__":
    for table in TABLES:
        page, content = page_text(table)
        page.write_text(content, encoding="utf-8")
