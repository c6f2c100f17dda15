"""``swgjoint bench joint`` on the terminal."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table


def report(result: dict[str, Any]) -> str:
    """One line a setting: cost, errors, damping; then what the references are worth."""
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
    header += [f"{name} {unit}" for name, unit in units.items()]
    body = []
    for names, line in lines.items():
        row = line["link_angle"]
        found = [line[name]["error"] if name in line else None for name in units]
        damping = line.get("damping_ratio", {}).get("error")
        front = "*" if row["pareto"] else ""
        own = [row["outcome"], row["cost"], *found, row["own_error"], damping, front]
        body.append([*names, *own])
    text = [
        "cost: CPU time over that of the rigid arm at 1 ms; errors against level full"
        " without an error of its steps; steps: error of the link angle by the steps"
        " alone [arcmin]; damping: ratio that the steps add to the first mode;"
        " *: on the front of cost and error of the link angle",
        table(body, header=(*header, "steps", "damping", "")),
        *(
            f"reference of {row['scene']}, {row['model']}: {row['reference']}; at twice"
            f" the step of RK4 the link is {row['step_doubled_link_angle']:.1e} arcmin"
            " away" + _independent(row)
            for row in result["references"]
        ),
    ]
    text += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*text, f"{result['wall_s']:.0f} s"])


def _independent(row: dict[str, Any]) -> str:
    if "rk4_link_angle" not in row:
        return ""
    return f", RK4 {row['rk4_link_angle']:.1e} arcmin"
