"""Terminal output of ``swgjoint bench joint``."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table


def report(result: dict[str, Any]) -> str:
    """Format cost, errors and damping of each setting, then the references."""
    units = {
        row["quantity"]: row["unit"]
        for row in result["rows"]
        if row["quantity"] != "damping_ratio"
    }
    lines: dict[tuple[str, ...], dict[str, Any]] = {}
    for row in result["rows"]:
        key = (row["scene"], row["model"], row["setting"])
        lines.setdefault(key, {})[row["quantity"]] = row
    header = ["scene", "level", "setting", "outcome", "cost"]
    header += [f"{name} [{unit}]" for name, unit in units.items()]
    body = []
    for names, line in lines.items():
        row = line["link_angle"]
        errors = [line[name]["error"] if name in line else None for name in units]
        damping = line.get("damping_ratio", {}).get("error")
        front = "*" if row["pareto"] else ""
        values = [row["outcome"], row["cost"], *errors, row["own_error"], damping]
        body.append([*names, *values, front])
    text = [
        "cost: CPU time relative to that of the rigid arm at 1 ms; errors: compared"
        " with level full without time-step error; steps: error of the link angle due"
        " to the time step alone [arcmin]; damping: numerical damping ratio that the"
        " time step adds to the first mode; *: Pareto-optimal in cost and error of the"
        " link angle",
        table(body, header=(*header, "steps", "damping", "")),
        *(
            f"reference of {row['scene']}, {row['model']}: {row['reference']}; doubling"
            " the step of RK4 changes the link angle by"
            f" {row['step_doubled_link_angle']:.1e} arcmin" + _independent(row)
            for row in result["references"]
        ),
    ]
    text += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*text, f"{result['wall_s']:.0f} s"])


def _independent(row: dict[str, Any]) -> str:
    if "rk4_link_angle" not in row:
        return ""
    return f", RK4 differs by {row['rk4_link_angle']:.1e} arcmin"
