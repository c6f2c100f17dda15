"""Table and picture of the torque that strain gauges read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.pictures import png
from swgjoint.sim.gauges import COMPARED, with_bridges
from swgjoint.view.report.tables import Table, cells_of
from swgjoint.view.words import format_figure, short

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

GAUGE_COLUMNS = (
    ("strain gauges", ""),
    ("bridges", ""),
    ("gain", "µV/V per N·m"),
    ("order: ripple", "% of rated torque"),
    ("reading minus torque", "rms, % of rated"),
    *((f"{n} exact", "rms, % of rated") for n in COMPARED),
)
"""Name and unit of every column of the table of strain gauges."""
SHOWN = 3
"""Number of orders in the table."""
CONVERGED = {
    "3d": "; converged to 5 % for reference-3d, the order of six lobes to a fifth"
}
"""How far the finite elements of the contact are converged, by the kind of strain."""
DRAWN = 10
"""Largest number of orders in the picture."""
SMALLEST = 1e-2
"""Smallest amplitude in the picture [% of the rated torque]."""


def gauge_grid(joints: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """Rows of the table of strain gauges; empty without any.

    Args:
        joints: Figures of the joints.
    """
    rows = []
    for name, joint in joints.items():
        if (one := joint.get("gauges")) is None:
            continue
        lines = sorted(one["ripple"], key=lambda line: -line["amplitude_Nm"])
        told = [
            f"{line['order']:.4g}: {format_figure(line['amplitude_percent'])}"
            for line in lines[:SHOWN]
        ]
        rows.append(
            [
                short(name),
                str(one["bridges"]),
                format_figure(one["gain_uV_V_Nm"]),
                "  ".join(told),
                format_figure(one["error_rms_percent"]),
                *(
                    format_figure(left["ripple_rms_percent"])
                    for left in one["compensation"]
                ),
            ]
        )
    return rows


def gauge_notes(joints: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Where the strain under the gauges comes from, and how far it is converged.

    Args:
        joints: Figures of the joints.
    """
    lines = []
    for name, joint in joints.items():
        if "gauges" in joint:
            found = joint["gauges"]
            lines.append(
                f"gauges of {short(name)}: flexspline of design {found['flexspline']},"
                f" strain: {found['strain']}{CONVERGED.get(found['strain'], '')}"
            )
    return lines


def gauge_tables(runs: Mapping[str, Run]) -> list[Table]:
    """One table for every run with strain gauges.

    Args:
        runs: Runs by displayed name.
    """
    return [
        Table(
            title=f"Strain gauges of {label}",
            header=GAUGE_COLUMNS,
            rows=cells_of(gauge_grid(run.figures["joints"])),
            notes=gauge_notes(run.figures["joints"]),
        )
        for label, run in runs.items()
        if run.assembly.gauges
    ]


def gauge_picture(run: Run) -> bytes:
    """Draw what the gauges of the first joint with gauges read, and their ripple.

    On the left the reading is next to the torque over the first turn of the input, and
    the errors that exact bridges at equal distances would leave. On the right are the
    orders.

    Args:
        run: A run with strain gauges.

    Returns:
        The PNG file.
    """
    from matplotlib.figure import Figure

    joint, gauges = next(iter(run.assembly.gauges.items()))
    j = run.joints.index(joint)
    rated = run.assembly.transmissions[j].drive.ratings.rated_torque
    reading = run.gauge_torque(j)
    assert reading is not None
    angle = run.motor_position[run.steady, j]
    beyond = np.flatnonzero(np.abs(angle - angle[0]) > 2.0 * np.pi)
    turn = slice(0, int(beyond[0]) if beyond.size else len(angle))
    theta, psi, torque, read = (
        values[run.steady][turn]
        for values in (
            run.motor_position[:, j],
            run.position[:, j],
            run.output_torque[:, j],
            reading,
        )
    )
    turns = np.abs(theta - theta[0]) / (2.0 * np.pi)
    alone = 100.0 * with_bridges(gauges, 1).ripple / rated
    visible = np.flatnonzero(alone[:DRAWN] > SMALLEST)
    drawn = slice(0, int(visible[-1]) + 1 if visible.size else 1)
    figure = Figure(figsize=(13.0, 7.0), layout="constrained")
    axes = figure.subplots(2, 2)
    axes[0, 0].plot(turns, read / rated, "k", lw=1.1, label="reading")
    axes[0, 0].plot(turns, torque / rated, "0.6", lw=1.1, label="torque")
    axes[0, 0].set_title(f"{short(joint)}, bridges of the scene: {gauges.ring.bridges}")
    width = 0.8 / len(COMPARED)
    places = np.arange(len(gauges.orders[drawn]))
    for k, count in enumerate(COMPARED):
        exact = with_bridges(gauges, count)
        style: dict[str, Any] = {"color": f"C{k}", "label": f"{count}"}
        error = (exact.read_torque(torque, theta, psi) - torque) / rated
        # one and two bridges read the same and are drawn on top of each other
        line = {"lw": 2.2, "alpha": 0.5} if count == 1 else {"lw": 0.9}
        axes[1, 0].plot(turns, np.abs(error), **style, **line)
        place = (
            np.arange(len(gauges.orders[drawn]))
            + (k - 0.5 * len(COMPARED) + 0.5) * width
        )
        ripple = 100.0 * exact.ripple[drawn] / rated
        axes[0, 1].bar(place, ripple, width, **style)
    ripple = 100.0 * gauges.ripple[drawn] / rated
    axes[1, 1].bar(places, ripple, 0.8)
    axes[1, 0].set_yscale("log")
    axes[1, 0].set_ylim(0.01 * SMALLEST, max(0.3 * alone.sum(), 1e-2))
    axes[1, 0].set_title("1, 2, 3 or 5 exact bridges: reading minus torque, magnitude")
    axes[0, 1].set_title("1, 2, 3 or 5 exact bridges: ripple by order")
    axes[1, 1].set_title("bridges of the scene: ripple by order")
    low, high = axes[0, 0].get_ylim()
    axes[0, 0].set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    for axis in axes[:, 0]:
        axis.set_xlabel("input turns")
        axis.set_ylabel("torque / rated torque")
        axis.margins(x=0)
    for axis in axes[:, 1]:
        names = [f"{order:.4g}" for order in gauges.orders[drawn]]
        axis.set_xticks(places, names)
        axis.set_yscale("log")
        axis.set_ylim(bottom=SMALLEST)
        axis.set_xlabel("order [cycles per input turn]")
        axis.set_ylabel("amplitude [% of rated torque]")
    for axis in (axes[0, 0], axes[1, 0], axes[0, 1]):
        axis.legend(fontsize=8, ncols=2, loc="upper right")
    return png(figure, dpi=110)
