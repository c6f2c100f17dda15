"""Picture of ``swgjoint study articles``, which recomputes articles on flexsplines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.pictures import png

if TYPE_CHECKING:
    from swgjoint.validation.articles.runs import Found


def articles_picture(
    parts: Sequence[str], results: Mapping[str, Found]
) -> bytes | None:
    """Draw radial stiffness, lobe force, stress amplitude and safety factor as PNG.

    Args:
        parts: Names of the computed parts.
        results: Results by name of the task.

    Returns:
        The PNG file; None if no computed part has a panel.
    """
    panels: list[Callable[[Any, Mapping[str, Found]], None]] = []
    if "force" in parts:
        panels += [_force, _lobes]
    if "fatigue" in parts:
        panels += [_amplitude, _safety]
    if not panels:
        return None
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1 + 4.6 * len(panels), 4.6), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for ax, draw in zip(axes, panels, strict=True):
        draw(ax, results)
    return png(figure, dpi=110)


def _force(ax: Any, results: Mapping[str, Found]) -> None:
    """Draw the radial stiffness of every variant for three places of the loads."""
    named = {
        name.removeprefix("force, ").replace("force", "as bundled"): result
        for name, result in results.items()
        if name.startswith("force") and "mid_face" in result
    }
    order = sorted(named, key=lambda name: named[name]["mid_face"])
    height = range(len(order))
    for place, mark in (("mid_face", "o"), ("open_edge", "<"), ("face_width", "|")):
        values = [named[name][place] for name in order]
        ax.plot(values, height, mark, label=place.replace("_", " "))
    ax.set_yticks(height, order, fontsize="small")
    ax.set_xlim(left=0.0)
    ax.set_xlabel("radial stiffness [N/mm]")
    ax.set_title("XB1-100-80, boss clamped", fontsize="medium")
    ax.legend(fontsize="small")
    ax.grid(alpha=0.3)


def _lobes(ax: Any, results: Mapping[str, Found]) -> None:
    """Draw the force on a lobe and the play of the output over the lobe deflection."""
    result = results.get("force, lobes", {})
    ax.set_title("cup between two lobes, large rotations", fontsize="medium")
    ax.set_xlabel("deflection of a lobe [mm]")
    ax.set_ylabel("force on a lobe [N]")
    ax.grid(alpha=0.3)
    if "force_N" not in result:
        return
    deflection = result["deflection_mm"]
    ax.plot(deflection, result["force_N"], "tab:blue", marker=".", label="cup")
    pressed = np.array(result["pressed_mm"])
    cup = np.interp(pressed, deflection, result["force_N"])
    both = cup + np.array(result["on_teeth_N"])
    ax.plot(pressed, both, "tab:green", marker=".", label="cup and teeth")
    ax.set_ylim(0.0, 2.0 * max(result["force_N"]))
    ax.legend(fontsize="small")
    ax.axvline(result["height_mm"], color="0.6", lw=0.8)
    right = ax.twinx()
    right.plot(deflection, result["play_mrad"], "tab:red", marker=".", ls="--")
    right.axhline(0.0, color="tab:red", lw=0.5)
    right.set_ylabel("play of the output [mrad] (vertical line: w_0)", color="tab:red")


_LINES = (
    ("four", "mid_face", "four forces, mid-face", "tab:green", "-"),
    ("fatigue", "mid_face", "ellipse, mid-face", "tab:blue", "-"),
    ("fatigue", "worst_section", "ellipse, worst section", "tab:blue", "--"),
    ("fatigue, crowned", "mid_face", "crowned, mid-face", "tab:red", "-"),
    ("fatigue, crowned", "worst_section", "crowned, worst section", "tab:red", "--"),
)
"""Name of the task, section, label, colour and line style of each line."""


def _amplitude(ax: Any, results: Mapping[str, Found]) -> None:
    """Draw the amplitude of the circumferential normal stress at the tooth roots."""
    _over_torque(ax, results, "normal_amplitude_MPa")
    ax.set_ylabel("normal stress amplitude at the tooth roots [MPa]")


def _safety(ax: Any, results: Mapping[str, Found]) -> None:
    """Draw the fatigue safety factors, compared with those of shell theory."""
    _over_torque(ax, results, "S")
    known = [f["by_torque"] for f in results.values() if "by_torque" in f]
    rows = known[0] if known else []
    torque = [row["torque_Nm"] for row in rows]
    theory = [row["shell_theory"]["S"] for row in rows]
    ax.plot(torque, theory, "k:", label="shell theory")
    ax.axhline(1.5, color="0.6", lw=0.8)
    ax.set_ylim(0.0, 1.05 * max([1.5, *theory]))
    ax.set_ylabel("fatigue safety factor")
    ax.legend(fontsize="small")


def _over_torque(ax: Any, results: Mapping[str, Found], key: str) -> None:
    """Draw one figure over the output torque for every line of ``_LINES``."""
    for name, section, label, colour, style in _LINES:
        rows = results.get(name, {}).get("by_torque", [])
        torque = [row["torque_Nm"] for row in rows]
        values = [row[section][key] for row in rows]
        ax.plot(torque, values, color=colour, ls=style, marker=".", label=label)
    ax.set_xlabel("output torque [N·m]")
    ax.set_ylim(bottom=0.0)
    ax.grid(alpha=0.3)
