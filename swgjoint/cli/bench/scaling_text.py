"""Terminal output of ``swgjoint bench scaling``."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table


def report(result: dict[str, Any]) -> str:
    """Format the CPU times by problem size, then the fitted exponents."""
    body = [
        (
            row["setting"],
            row["size"],
            row["seconds"],
            row["per"],
            row.get("steps_per_s"),
            row["outcome"],
        )
        for row in result["rows"]
    ]
    header = ("", "size", "CPU seconds", "per", "steps/s", "outcome")
    fits = [
        f"{fit['sweep']}: time per {fit['per']} ~ size^{fit['exponent']:.2f} for sizes"
        f" from {fit['from_size']:g} (fit within a factor of {fit['spread']:.2f})"
        for fit in result["fits"]
    ]
    wrote = [f"wrote {name}" for name in result["files"]]
    text = [table(body, header=header), *fits, *wrote, f"{result['wall_s']:.0f} s"]
    return "\n".join(text)
