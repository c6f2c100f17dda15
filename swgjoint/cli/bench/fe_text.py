"""Terminal output of ``swgjoint bench fe``."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table

SHORT = {
    "torsional_stiffness_Nm_rad": "stiffness",
    "kinematic_error_pp_arcsec": "kinematic error",
    "tensile_MPa": "tensile stress",
    "rim_shape_mm": "rim shape",
}
"""Short names of the quantities in the tables."""


def report(result: dict[str, Any]) -> str:
    """Format the errors of every setting and the cheapest setting within each bound."""
    rows = result["rows"]
    solved = [row for row in rows if row["value"] is not None]
    text = [
        f"{result['design']} compared with {rows[0]['reference']}; * Pareto-optimal"
    ]
    positions = (
        f" at {result['kinematic_error_positions']} positions of a pitch, first"
        " harmonic"
    )
    for quantity, name in SHORT.items():
        here = [row for row in solved if row["quantity"] == quantity]
        if not here:
            continue
        unit = here[0]["unit"]
        body = [
            (
                f"{row['model']}, {row['setting']}{' *' if row['pareto'] else ''}",
                row["value"],
                row["error"],
                row["error_of_kind"],
                row["error_next_level"],
                row["cpu_s"],
                row["wall_s"],
                None if row["peak_MB"] is None else round(row["peak_MB"]),
            )
            for row in here
        ]
        header = (
            name + positions * quantity.startswith("kinematic_error"),
            quantity.rpartition("pp_")[2] if "pp_" in quantity else quantity,
            f"error [{unit}]",
            "same kind",
            "next level",
            "CPU [s]",
            "wall [s]",
            "memory [MB]",
        )
        text += ["", table(body, header=header)]
    for row in rows:
        if row["value"] is None:
            text.append(f"{row['model']}, {row['setting']}: {row['outcome']}")
    text += ["", _cheapest(result["cheapest"], "cheapest within")]
    text += ["", _cheapest(result["cheapest_in_the_plane"], "2D models only")]
    text += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*text, f"{result['wall_s']:.0f} s"])


def _cheapest(picks: list[dict[str, Any]], title: str) -> str:
    """Table of the cheapest settings: one row per quantity, one column per bound."""
    bounds = list(dict.fromkeys(one["bound_percent"] for one in picks))
    body = []
    for quantity, name in SHORT.items():
        cells = [name]
        for one in picks:
            if one["quantity"] == quantity:
                none = "only the reference"
                cells.append(
                    none
                    if one["setting"] is None
                    else f"{one['model']}, {one['setting']} ({one['cpu_s']:.0f} CPU s)"
                )
        body.append(cells)
    header = (title, *(f"{bound:g} %" for bound in bounds))
    return table(body, header=header)
