"""Text of a selection of drives."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table


def selection_lines(result: dict[str, Any]) -> list[str]:
    """Format the selected drives, what they use of their limits, and the result.

    Args:
        result: JSON object of the command ``select``.
    """
    from swgjoint.view.selection import limit_lines, selection_tables

    tried = result["motor_feedback_failure"]
    count = len(result["simulated"])
    sets = "1 set" if count == 1 else f"{count} sets"
    lines = []
    if tried is not None:
        lines.append(f"with feedback of the motor angles, no set of drives: {tried}")
        lines.append(
            "with feedback of the link angles (controller.feedback = link), which needs"
            " an encoder at every link:"
        )
    lines += [f"scene {result['scene']}: {sets} simulated in {result['wall_s']:.0f} s"]
    for one in selection_tables(result)[: 1 + bool(count)]:
        cells = [[cell.text for cell in row] for row in one.rows]
        names = [f"{name} [{unit}]" if unit else name for name, unit in one.header]
        lines += [table(cells, header=names), *one.notes]
    lines += limit_lines(result)
    if not result["careful"]:
        lines.append(
            "many sets are close to a limit of the tool error: a cheaper set whose"
            " error is within 0.5 % of it may have been dropped"
        )
    if result["passed"]:
        lines.append(f"cheapest set by {result['by']}: {result['cost']:g}")
    else:
        lines.append(f"no set of drives: {result['failure']}")
    return lines
