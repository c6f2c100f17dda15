"""Picture of one scene of ``swgjoint bench joint``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from swgjoint.pictures import png
from swgjoint.sim.accuracy import QUANTITIES

_COLOURS = {
    "rigid": "0.5",
    "kinematic": "tab:olive",
    "linear": "tab:orange",
    "native": "tab:green",
    "full": "tab:blue",
}
_MARKERS = {
    "discrete": "o",
    "RK4": "s",
    "Euler": "^",
    "implicitfast": "v",
    "plain split": "x",
    "corrected split": "+",
}
_TITLES = {
    "link_angle": "link angle, rms of the worst joint",
    "tool_position": "tool position, rms",
    "torsion": "torsion, rms of the worst joint",
    "ripple_spectrum": "torque ripple, spectral lines",
}


def joint_picture(scene: str, rows: Sequence[dict[str, Any]]) -> bytes:
    """Draw the error of every quantity over cost, and the effect of the step, as PNG.

    The last two panels show the numerical damping ratio, and the error of the link
    angle that the step alone causes, over the step.

    Args:
        scene: Name of the scene.
        rows: Rows of the benchmark of this scene.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 8.5), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    for axis, (quantity, unit) in zip(axes, QUANTITIES.items(), strict=False):
        known = [
            row
            for row in rows
            if row["quantity"] == quantity and row["error"] and row["cost"]
        ]
        _points(axis, known)
        front = sorted((r["cost"], r["error"]) for r in known if r["pareto"])
        axis.plot(*zip(*front, strict=True), color="black", lw=1, label="Pareto front")
        axis.set(title=_TITLES[quantity], ylabel=f"error [{unit}]")
        axis.set_xlabel("CPU time / CPU time of the rigid arm at 1 ms")
    axes[0].legend(fontsize="x-small", ncols=2)
    _damping(axes[4], rows)
    _own_error(axes[5], rows)
    for name in dict.fromkeys(row["integrator"] for row in rows):
        axes[5].plot([], [], _MARKERS[name], color="black", mfc="none", label=name)
    axes[5].legend(fontsize="x-small")
    against = next(row["reference"] for row in rows)
    figure.suptitle(f"scene {scene}; reference: {against}")
    return png(figure, dpi=90)


def _points(axis: Any, rows: Sequence[dict[str, Any]]) -> None:
    """Draw error over cost, one point per setting."""
    for row in rows:
        marker, colour = _MARKERS[row["integrator"]], _COLOURS[row["model"]]
        axis.loglog(row["cost"], row["error"], marker, color=colour, ms=5)
        if row["model"] == "full" and row["integrator"] == "discrete":
            text = f" {1e3 * row['step_s']:g} ms"
            axis.annotate(text, (row["cost"], row["error"]), fontsize=6)
    for name in dict.fromkeys(row["model"] for row in rows):
        axis.plot([], [], "o", color=_COLOURS[name], label=name)
    for name in dict.fromkeys(row["integrator"] for row in rows):
        axis.plot([], [], _MARKERS[name], color="black", mfc="none", label=name)
    axis.grid(alpha=0.3, which="both")


def _damping(axis: Any, rows: Sequence[dict[str, Any]]) -> None:
    """Draw the numerical damping ratio of the first mode over the step."""
    damped = [row for row in rows if row["quantity"] == "damping_ratio"]
    _over_step(axis, damped, "error")
    first = damped[0] if damped else None
    name = "first mode" if first is None else f"mode at {first['frequency_Hz']:.0f} Hz"
    axis.set_xscale("log")
    axis.set_yscale("symlog", linthresh=1e-3)
    axis.set(title=f"numerical damping ratio, {name}", xlabel="step [ms]")
    for level in (0.005, -0.005):
        axis.axhline(level, color="0.6", lw=1, ls="--")
    axis.grid(alpha=0.3)


def _own_error(axis: Any, rows: Sequence[dict[str, Any]]) -> None:
    """Draw the error of the link angle that the step alone causes, over the step."""
    known = [r for r in rows if r["quantity"] == "link_angle" and r["own_error"]]
    _over_step(axis, known, "own_error")
    axis.set(
        xscale="log",
        yscale="log",
        title="link angle, rms of the worst joint, error due to the step",
        xlabel="step [ms]",
        ylabel="error [arcmin]",
    )
    axis.grid(alpha=0.3, which="both")


def _over_step(axis: Any, rows: Sequence[dict[str, Any]], value: str) -> None:
    """Draw one line per level and integrator.

    Args:
        axis: Axes to draw on.
        rows: Rows of one quantity.
        value: Key of the values to draw.
    """
    for key in dict.fromkeys((row["model"], row["integrator"]) for row in rows):
        points = sorted(
            (1e3 * row["step_s"], row[value])
            for row in rows
            if (row["model"], row["integrator"]) == key
        )
        axis.plot(
            *zip(*points, strict=True),
            marker=_MARKERS[key[1]],
            color=_COLOURS[key[0]],
            ms=4,
            lw=1,
        )
