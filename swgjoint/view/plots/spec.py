"""Picture of a spec sheet: torque loop, transmission error, orders, efficiency."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.sheet.friction_running import RUNNING_SPEED
from swgjoint.pictures import png
from swgjoint.units import ZERO_CELSIUS, arcmin, rpm

if TYPE_CHECKING:
    from swgjoint.maps.sheet.efficiency import EfficiencyTable
    from swgjoint.maps.sheet.spec_sheet import SpecSheet

_AT_MOST = 20_000
"""Largest number of drawn samples of an output turn."""
_MANY = 200
"""Number of periods per output turn above which only two periods are drawn."""
_WAVES = 60
"""Number of waves per output turn above which a line would be a solid area; its
envelope is drawn instead, and below it the first input turns."""
_INPUT_TURNS = 3
_PIECES = 240
"""Largest number of pieces of an envelope."""
_LINES = 40
"""Largest number of orders that are drawn for each signal."""
_FLOOR = 1e-3
"""Smallest drawn amplitude relative to the largest [-]."""
_APART = 0.11
"""Smallest distance of the labels of two orders, as a part of the axis [-]."""
_ERRORS = {"no_load": ("without load", "tab:blue"), "rated": ("rated load", "tab:red")}


def spec_picture(
    name: str, sheet: SpecSheet, efficiency: EfficiencyTable | None = None
) -> bytes:
    """Draw the curves from which the figures of a spec sheet were read as PNG.

    A panel without a curve shows the reason; without friction there are no panels of
    the efficiency.

    Args:
        name: Name of the drive.
        sheet: Figures and curves.
        efficiency: Efficiency over load, speed and temperature.
    """
    from matplotlib.figure import Figure

    panels = [_loop, _turn, _orders]
    if sheet.losses and efficiency is None:
        panels.append(_losses)
    count = len(panels) + 2 * (efficiency is not None)
    figure = Figure(figsize=(1 + 4 * count, 4.2), layout="constrained")
    axes = figure.subplots(1, count)
    for ax, draw in zip(axes, panels, strict=False):
        draw(ax, sheet)
    if efficiency is not None:
        _efficiency_by_load(axes[-2], efficiency)
        _efficiency_by_speed(axes[-1], efficiency)
    for ax in figure.axes:
        ax.set_title(ax.get_title(), y=1.0)  # not placed by measuring, five times
    figure.suptitle(f"{name}: spec sheet")
    return png(figure, dpi=130)


def _loop(ax: Any, sheet: SpecSheet) -> None:
    ax.set_title("torque loop, input locked")
    ax.set_xlabel("torque [N·m]")
    ax.set_ylabel("torsion [arcmin]")
    if sheet.loop is None:
        _absent(ax, "not computed")
        return
    loop, figures = sheet.loop, sheet.figures
    ax.plot(loop.torque, loop.torsion / arcmin, color="0.6", lw=2.5, label="loop")
    limits = [0.0, figures.get("T1_Nm"), figures.get("T2_Nm"), loop.torque.max()]
    colours = ("tab:blue", "tab:orange", "tab:green")
    for k, colour in enumerate(colours, 1):
        low, high = limits[k - 1], limits[k]
        K = figures.get(f"K{k}_Nm_rad")
        if K is None or low is None or high is None:
            continue
        for sign in (1.0, -1.0):
            at = sign * np.array([low, high])
            label = f"K{k} {K:.3g} N·m/rad" if sign > 0 else None
            x = loop.mid_line(at) / arcmin
            ax.plot(at, x, color=colour, lw=1.2, marker=".", label=label)
    ax.legend(fontsize="small")
    ax.grid(alpha=0.3)


def _turn(ax: Any, sheet: SpecSheet) -> None:
    title = "transmission error over one output turn"
    ax.set_title(title)
    ax.set_xlabel("output angle [deg]")
    ax.set_ylabel("deviation from the mean [arcmin]")
    shown = [key for key in _ERRORS if key in sheet.turns]
    if not shown:
        _absent(ax, sheet.missing.get("transmission_accuracy_arcmin", "not computed"))
        return
    lines, waves = {}, 0
    for key in shown:
        turn = sheet.turns[key]
        periods = turn.turns / float(turn.period_turns)
        angle, error = turn.output_turn()
        error = (error - turn.signal.mean()) / arcmin
        if periods > _MANY:  # a whole turn would be drawn as a solid area
            part = slice(0, 2 * turn.signal.size + 1)
            angle, error = angle[part], error[part]
            ax.set_title(f"transmission error, 2 of {periods:.0f} periods per turn")
        else:
            crossings = int(np.count_nonzero(np.diff(np.sign(error))))
            waves = max(waves, crossings // 2)
        lines[key] = angle, error, turn.turns
    whole = None
    if waves > _WAVES:
        # the envelope of the output turn above, its waves below
        whole, ax = _split(ax)
        whole.set_title(title)
        whole.set_ylabel("envelope [arcmin]")
        ax.set_ylabel("[arcmin]")
        ax.set_xlabel(f"output angle [deg]   (the first {_INPUT_TURNS} input turns)")
    for key in reversed(shown):
        label, colour = _ERRORS[key]
        angle, error, turns = lines[key]
        output = 360.0 * angle / (2.0 * np.pi * turns)
        if whole is not None:
            pieces = min(_PIECES, waves // 3)  # each contains whole waves
            _envelope(whole, output, error, pieces, color=colour, label=label)
            first = angle <= 2.0 * np.pi * _INPUT_TURNS
            output, error = output[first], error[first]
        stride = -(-error.size // _AT_MOST)
        ax.plot(output[::stride], error[::stride], color=colour, lw=0.9, label=label)
    for axis in [ax] if whole is None else [ax, whole]:
        axis.grid(alpha=0.3)
        axis.margins(x=0)
    top = whole or ax
    low, high = top.get_ylim()
    top.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    top.legend(fontsize="small", loc="upper right", ncols=2)


def _split(ax: Any) -> tuple[Any, Any]:
    """Replace axes by two axes, one above the other."""
    figure, place = ax.figure, ax.get_subplotspec()
    ax.remove()
    grid = place.subgridspec(2, 1)
    return figure.add_subplot(grid[0]), figure.add_subplot(grid[1])


def _envelope(
    ax: Any,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    pieces: int,
    **style: Any,
) -> None:
    """Draw the lower and upper bound of a dense line as a band."""
    edges = np.linspace(0, x.size, pieces + 1).astype(np.intp)
    low, high = (f.reduceat(y, edges[:-1]) for f in (np.minimum, np.maximum))
    middle = 0.5 * (x[edges[:-1]] + x[edges[1:] - 1])
    ax.fill_between(middle, low, high, alpha=0.25, lw=0.0, **style)
    for bound in (low, high):
        ax.plot(middle, bound, color=style["color"], lw=0.9)


def _orders(ax: Any, sheet: SpecSheet) -> None:
    ax.set_title("order spectrum of the transmission error")
    ax.set_xlabel("order [cycles per input turn]")
    ax.set_ylabel("amplitude [arcmin]")
    shown = [key for key in _ERRORS if key in sheet.turns]
    if not shown:
        _absent(ax, sheet.missing.get("orders", "not computed"))
        return
    from matplotlib.ticker import NullFormatter, NullLocator

    largest, strongest, cut = 0.0, dict[float, float](), False
    for k, key in enumerate(shown):
        label, colour = _ERRORS[key]
        order, amplitude = sheet.turns[key].lines()
        amplitude = amplitude / arcmin
        largest = max(largest, float(amplitude.max(initial=0.0)))
        keep = np.argsort(amplitude)[::-1]
        keep = keep[amplitude[keep] > _FLOOR * amplitude.max(initial=1e-300)]
        cut |= keep.size > _LINES
        keep = keep[:_LINES]
        for at, size in zip(order[keep], amplitude[keep], strict=True):
            strongest[float(at)] = max(size, strongest.get(float(at), 0.0))
        shift = 1.0 + 0.02 * k  # draws the lines side by side on a logarithmic axis
        x, y = order[keep] * shift, amplitude[keep]
        ax.vlines(x, 0.0, y, color=colour, lw=1.0)
        ax.plot(x, y, "o^"[k], color=colour, ms=3.5, label=label)
    ax.set_xscale("log")
    ax.xaxis.set_minor_formatter(NullFormatter())
    if cut:
        ax.set_title(f"transmission error: the {_LINES} strongest orders")
    if ticks := _ticks(strongest):
        ax.set_xticks(ticks, [f"{order:.4g}" for order in ticks])
        ax.xaxis.set_minor_locator(NullLocator())
    if largest > 0.0:
        ax.set_yscale("log")
        ax.set_ylim(_FLOOR * largest, 3.0 * largest)
    ax.legend(fontsize="small", loc="upper right", ncols=2)
    ax.grid(alpha=0.3)


def _ticks(strongest: Mapping[float, float]) -> list[float]:
    """The strongest orders whose labels do not overlap on the logarithmic axis.

    Args:
        strongest: Amplitudes by order.
    """
    if not strongest:
        return []
    low, high = min(strongest), max(strongest)
    apart = max((high / low) ** _APART, 1.0 + 1e-9)
    ticks: list[float] = []
    for order in sorted(strongest, key=lambda order: -strongest[order]):
        if all(max(order / one, one / order) >= apart for one in ticks):
            ticks.append(order)
    return sorted(ticks)


def _losses(ax: Any, sheet: SpecSheet) -> None:
    ax.set_title("efficiency over the output torque")
    ax.set_xlabel("output torque [N·m]")
    ax.set_ylabel("efficiency [%]")
    assert sheet.losses is not None
    for speed, values in sheet.losses.efficiency.items():
        label = f"input at {speed / rpm:.0f} rpm"
        ax.plot(sheet.losses.load, 100.0 * values, label=label)
    rated = sheet.figures.get("rated_torque_Nm")
    if rated:
        ax.axvline(rated, color="0.6", lw=1.0, ls="--", label="rated torque")
    _end_efficiency(ax)


def _efficiency_by_load(ax: Any, found: EfficiencyTable) -> None:
    """Efficiency over the load at the speed of catalogues, by temperature."""
    at = int(np.argmin(np.abs(found.speed - RUNNING_SPEED)))
    ax.set_title(f"efficiency, input at {found.speed[at] / rpm:.0f} rpm")
    ax.set_xlabel("output torque [N·m]")
    ax.set_ylabel("efficiency [%]")
    for colour, T, block in _by_temperature(found):
        label = f"{T - ZERO_CELSIUS:.0f} °C"
        x = np.concatenate([[0.0], found.load])
        y = np.concatenate([[0.0], block[at]])
        ax.plot(x, 100.0 * y, color=colour, marker=".", label=label)
    _end_efficiency(ax)


def _efficiency_by_speed(ax: Any, found: EfficiencyTable) -> None:
    """Efficiency over the speed at the largest load, by temperature."""
    ax.set_title(f"efficiency at {found.load[-1]:.4g} N·m")
    ax.set_xlabel("input speed [rpm]")
    ax.set_ylabel("efficiency [%]")
    for colour, T, block in _by_temperature(found):
        label = f"{T - ZERO_CELSIUS:.0f} °C"
        y = 100.0 * block[:, -1]
        ax.plot(found.speed / rpm, y, color=colour, marker=".", label=label)
    _end_efficiency(ax)


def _by_temperature(found: EfficiencyTable) -> list[tuple[Any, float, Any]]:
    """Colour from cold to hot, temperature [K] and efficiencies, by temperature."""
    from matplotlib import colormaps

    colours = colormaps["coolwarm"](np.linspace(0.0, 1.0, found.temperature.size))
    return list(zip(colours, found.temperature.tolist(), found.efficiency, strict=True))


def _end_efficiency(ax: Any) -> None:
    """Limits, legend and grid of a panel of the efficiency."""
    ax.set_xlim(left=0.0)
    ax.set_ylim(0.0, 100.0)
    ax.legend(fontsize="small", loc="lower right")
    ax.grid(alpha=0.3)


def _absent(ax: Any, reason: str) -> None:
    """Show the reason why a panel has no curve."""
    ax.set_xlabel("")
    ax.set_ylabel("")
    ax.set_xticks([])
    ax.set_yticks([])
    text = fill(reason, 40)
    ax.text(0.5, 0.5, text, ha="center", va="center", transform=ax.transAxes)
