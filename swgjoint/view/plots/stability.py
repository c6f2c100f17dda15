"""Picture of the stability study."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from swgjoint.pictures import png

if TYPE_CHECKING:
    from swgjoint.bench.stability.rows import StabilityRow

_COLOURS = {
    "ok": "tab:green",
    "sub_stepped": "tab:blue",
    "refused": "0.6",
    "diverged": "tab:red",
    "energy_gain": "tab:orange",
}
_SCHEMES = {
    "discrete": "tab:blue",
    "discrete, never cut": "tab:purple",
    "native tendon": "tab:olive",
    "RK4": "tab:red",
}
"""Colours of the schemes, in the sequence in which their bars are drawn."""


def stability_picture(rows: Sequence[StabilityRow], *, scheme: str, free: str) -> bytes:
    """Draw the results of the stability study as PNG.

    The panels show the share of each outcome by scheme and group, the number of
    sub-steps, the numerical damping ratio, the error of the link angle, and the energy
    change of the long free runs.

    Args:
        rows: Rows of the study.
        scheme: Scheme that the joint uses, whose sub-steps are shown; the other schemes
            are drawn for comparison.
        free: Group of the long free runs.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 8.5), layout="constrained")
    axes: dict[str, Any] = figure.subplot_mosaic(
        [["outcomes", "outcomes", "parts"], ["damping", "error", "free"]]
    )
    _outcomes(axes["outcomes"], rows)
    _parts(axes["parts"], [row for row in rows if row.scheme == scheme])
    _damping(axes["damping"], rows)
    _error(axes["error"], rows)
    _free(axes["free"], [row for row in rows if row.group == free])
    return png(figure, dpi=100)


def _outcomes(axis: Any, rows: Sequence[StabilityRow]) -> None:
    """Share of every outcome, one bar per scheme and group."""
    names = list(dict.fromkeys((row.scheme, row.group) for row in rows))
    names.sort(key=lambda name: list(_SCHEMES).index(name[0]))
    left = [0.0] * len(names)
    for outcome in _COLOURS:
        share = []
        for name in names:
            outcomes = [r.outcome for r in rows if (r.scheme, r.group) == name]
            share.append(100.0 * outcomes.count(outcome) / len(outcomes))
        axis.barh(
            range(len(names)),
            share,
            left=left,
            color=_COLOURS[outcome],
            label=outcome.replace("_", " "),
        )
        left = [a + b for a, b in zip(left, share, strict=True)]
    axis.set_yticks(
        range(len(names)), [f"{scheme}: {group}" for scheme, group in names], fontsize=8
    )
    axis.invert_yaxis()
    axis.set_xlim(0.0, 100.0)
    axis.set_xlabel("share of the runs [%]")
    axis.legend(
        fontsize="small", ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0)
    )


def _parts(axis: Any, rows: Sequence[StabilityRow]) -> None:
    """Cumulative share of the runs over the number of sub-steps, by time step."""
    for step in sorted({row.step_s for row in rows}):
        parts = sorted(row.sub_steps or 100 for row in rows if row.step_s == step)
        share = [100.0 * (k + 1) / len(parts) for k in range(len(parts))]
        axis.step(parts, share, where="post", label=f"{1e3 * step:g} ms")
    axis.axvline(64, color="0.6", lw=1)
    axis.set_xscale("log")
    axis.set_xlim(0.9, 100)
    axis.set_ylim(0, 101)
    axis.set_xlabel("number of sub-steps (more than 64: refused)")
    axis.set_ylabel("share of the runs [%]")
    axis.legend(fontsize="small", title="time step")
    axis.grid(alpha=0.3)


def _damping(axis: Any, rows: Sequence[StabilityRow]) -> None:
    """Damping ratios of the schemes and drives over the phase advance per step."""
    for scheme, colour in _SCHEMES.items():
        if scheme == "discrete, never cut":
            continue
        points = {
            (row.phase_step, row.numerical_damping_ratio)
            for row in rows
            if row.scheme == scheme
            and row.phase_step is not None
            and (row.numerical_damping_ratio or 0.0) > 1e-9
        }
        if points:
            x, y = zip(*points, strict=True)
            axis.plot(x, y, ".", color=colour, label=scheme, ms=4)
    physical = {r.physical_damping_ratio for r in rows} - {None}
    for value in physical:
        axis.axhline(value, color="black", lw=1, ls="--")
        axis.text(1.2e-3, 1.15 * float(value or 0.0), "drive", fontsize=8)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlim(1e-3, None)
    axis.set_ylim(1e-7, 2.0)
    axis.set_xlabel("step times torsion frequency [rad]")
    axis.set_title("numerical damping ratio", fontsize=10)
    _legend(axis)
    axis.grid(alpha=0.3)


def _error(axis: Any, rows: Sequence[StabilityRow]) -> None:
    """Largest error of the link angle in the free runs over phase advance per step."""
    for scheme, colour in _SCHEMES.items():
        points = [
            (row.phase_step, row.error)
            for row in rows
            if row.scheme == scheme and row.group == "free" and row.error
        ]
        if points:
            x, y = zip(*points, strict=True)
            axis.plot(x, y, ".", color=colour, label=scheme, ms=4)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel("step times torsion frequency [rad]")
    axis.set_title("error of the link angle, free runs [arcmin]", fontsize=10)
    _legend(axis)
    axis.grid(alpha=0.3)


def _free(axis: Any, rows: Sequence[StabilityRow]) -> None:
    """Relative energy change after ten seconds, the mean over the last tenth."""
    known = [row for row in rows if row.energy_balance is not None]
    axis.plot(
        [row.phase_step for row in known],
        [100.0 * (row.energy_balance or 0.0) for row in known],
        ".",
        color=_SCHEMES["discrete"],
    )
    for limit in (-5.0, 5.0):
        axis.axhline(limit, color="0.6", lw=1)
    axis.set_xlabel("step times torsion frequency [rad]")
    axis.set_title("energy change [%], catalogue drives, 10 s", fontsize=10)
    axis.grid(alpha=0.3)


def _legend(axis: Any) -> None:
    """Draw a legend if any line has a label."""
    if axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize="small")
