"""Plots of a joint in a recording: ripple spectrum, torque against torsion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.sim.figures.metrics import highest_resolved_order, torque_ripple
from swgjoint.typing import Array
from swgjoint.units import arcmin
from swgjoint.view.recording.columns import Column, Numbers
from swgjoint.view.recording.paths import phase_plot

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


BARS = 400
"""Largest number of bars of a spectrum; a bar is the largest amplitude in its range."""
WIDTH = 1.6
"""Ratio of width to height of the plot of torque against torsion [-]."""
Scales = dict[str, tuple[float, float] | None]
"""Largest magnitudes of torsion [arcmin] and torque [N·m] by joint; None if either is
zero."""
_POINTS = 2000
"""Approximate number of points of a curve of torque against torsion."""
_FRAME = 0x787878FF
"""Colour of axes and their labels, 0xRRGGBBAA."""


def ripple_bars(run: Run, j: int) -> tuple[Array, Array] | None:
    """Spectrum of the torque ripple of one joint.

    Args:
        run: The run.
        j: Index of the joint.

    Returns:
        Mean order of every bar [cycles per input turn] and its largest amplitude, zero
        to peak [% of rated torque], both of shape (n,). None if the joint does not move
        at constant speed, if its input turns less than half a turn or has fewer than 16
        samples, or if the step resolves no order.
    """
    from scipy.fft import next_fast_len

    highest = highest_resolved_order(run, j)
    if highest is None:
        return None
    angle = run.motor_position[run.steady, j]
    travel = np.maximum.accumulate((angle - angle[0]) * np.sign(angle[-1] - angle[0]))
    if travel.size < 16 or travel[-1] < np.pi:
        return None
    rated = run.assembly.transmissions[j].drive.ratings.rated_torque
    # linear interpolation reduces the amplitude of the highest orders by 2 %, which is
    # acceptable in a plot; the splines of the metrics would take half of the time that
    # a recording takes
    grid = np.linspace(0.0, travel[-1], travel.size)
    ripple = np.interp(grid, travel, torque_ripple(run, j)) * np.hanning(grid.size)
    size = next_fast_len(2 * grid.size, real=True)
    amplitude = np.abs(np.fft.rfft(ripple, size)) * (400.0 / rated / (grid.size - 1))
    order = 2.0 * np.pi * np.fft.rfftfreq(size, grid[1])
    inside = slice(1, int(np.searchsorted(order, highest, side="right")))
    order, amplitude = order[inside], amplitude[inside]
    if not order.size:
        return None
    per = -(-order.size // BARS)
    starts = np.arange(0, order.size, per)
    middle = np.add.reduceat(order, starts) / np.diff(np.append(starts, order.size))
    return middle, np.maximum.reduceat(amplitude, starts)


def log_ripple(stream: Any, path: str, bars: tuple[Array, Array], color: int) -> None:
    """Log the ripple spectrum of a joint as a bar chart.

    Args:
        stream: Rerun recording stream.
        path: Entity path of the joint.
        bars: Orders and amplitudes from :func:`ripple_bars`.
        color: Colour of the run, 0xRRGGBBAA.
    """
    import rerun as rr

    # the components of rr.BarChart, whose constructor takes longer than the spectrum
    chart = (
        (Numbers(bars[1]), rr.BarChart.descriptor_values()),
        (Numbers(bars[0]), rr.BarChart.descriptor_abscissa()),
        (rr.components.ColorBatch([color]), rr.BarChart.descriptor_color()),
    )
    parts = [rr.DescribedComponentBatch(*part) for part in chart]
    stream.log(f"{path}/ripple_orders", parts, static=True)


def phase_scales(runs: Mapping[str, Run]) -> Scales:
    """Largest magnitudes of torsion and torque over all runs, see ``Scales``."""
    first = next(iter(runs.values()))
    torsion, torque = (
        np.max([np.abs(one).max(axis=0) for one in signals], axis=0)
        for signals in (
            [run.torsion for run in runs.values()],
            [run.output_torque for run in runs.values()],
        )
    )
    return {
        joint: (float(x) / arcmin, float(y)) if x > 0.0 and y > 0.0 else None
        for joint, x, y in zip(first.joints, torsion, torque, strict=True)
    }


def phase_points(
    run: Run,
    j: int,
    scales: tuple[float, float],
    rows: slice | NDArray[np.intp] = slice(None),
) -> Array:
    """Points of torque against torsion in plot coordinates.

    Torsion increases to the right and torque upwards; the vertical coordinate of the
    plot increases downwards.

    Args:
        run: The run.
        j: Index of the joint.
        scales: Largest torsion [arcmin] and torque [N·m] from :func:`phase_scales`.
        rows: Samples to return; all by default.

    Returns:
        Points of shape (n, 2).
    """
    x = WIDTH * run.torsion[rows, j] / (scales[0] * arcmin)
    return np.column_stack([x, -run.output_torque[rows, j] / scales[1]])


def log_phase_axes(stream: Any, joint: str) -> None:
    """Log the axes of the plot of torque against torsion.

    Args:
        stream: Rerun recording stream.
        joint: Name of the joint.
    """
    import rerun as rr

    axes = [[[-WIDTH, 0.0], [WIDTH, 0.0]], [[0.0, 1.0], [0.0, -1.0]]]
    strips = rr.LineStrips2D(axes, colors=[_FRAME], radii=[0.004])
    stream.log(f"{phase_plot(joint)}/axes", strips, static=True)


def log_phase_ends(stream: Any, joint: str, scales: tuple[float, float]) -> None:
    """Log the values at the ends of the axes of the plot of torque against torsion.

    Args:
        stream: Rerun recording stream.
        joint: Name of the joint.
        scales: Largest torsion [arcmin] and torque [N·m] from :func:`phase_scales`.
    """
    import rerun as rr

    torsion, torque = scales
    stream.log(
        f"{phase_plot(joint)}/ends",
        rr.Points2D(
            [[WIDTH, 0.0], [0.0, -1.0]],
            labels=[f"{torsion:.3g} arcmin", f"{torque:.3g} N·m"],
            colors=[_FRAME],
            radii=[0.01],
            show_labels=True,
        ),
        static=True,
    )


def log_phase_path(
    stream: Any,
    path: str,
    run: Run,
    j: int,
    scales: tuple[float, float],
    color: int,
) -> None:
    """Log the curve of torque against torsion of one run, thinned for display.

    Args:
        stream: Rerun recording stream.
        path: Entity path from :func:`swgjoint.view.recording.paths.phase_path`.
        run: The run.
        j: Index of the joint.
        scales: Largest torsion [arcmin] and torque [N·m] from :func:`phase_scales`.
        color: Colour of the run, 0xRRGGBBAA.
    """
    import rerun as rr

    thinned = slice(None, None, -(-run.time.size // _POINTS))
    points = phase_points(run, j, scales, thinned)
    line = rr.LineStrips2D([points], colors=[color], radii=[0.004])
    stream.log(f"{path}/path", line, static=True)


def log_phase_point(stream: Any, path: str, color: int) -> None:
    """Log the style of the point that shows the current torque and torsion.

    Args:
        stream: Rerun recording stream.
        path: Entity path from :func:`swgjoint.view.recording.paths.phase_path`.
        color: Colour of the run, 0xRRGGBBAA.
    """
    import rerun as rr

    point = rr.Points2D.from_fields(radii=[0.03], colors=[color])
    stream.log(f"{path}/now", point, static=True)


def send_phase(stream: Any, path: str, points: Array, time: Any) -> None:
    """Send the positions of the point that shows the current torque and torsion.

    Args:
        stream: Rerun recording stream.
        path: Entity path from :func:`swgjoint.view.recording.paths.phase_path`.
        points: Points from :func:`phase_points`, shape (n, 2).
        time: Time column of the samples.
    """
    import rerun as rr

    column = Column(rr.Points2D.descriptor_positions(), points, np.float32)
    stream.send_columns(f"{path}/now", indexes=[time], columns=[column])
