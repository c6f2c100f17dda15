"""Picture of a spec sheet: torque loop, transmission error, orders, efficiency."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

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
_FEW = 5
"""Largest number of orders that get one tick each."""
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
    ax.set_title("transmission error over one output turn")
    ax.set_xlabel("output angle [deg]")
    ax.set_ylabel("deviation from the mean [arcmin]")
    shown = [key for key in _ERRORS if key in sheet.turns]
    if not shown:
        _absent(ax, sheet.missing.get("transmission_accuracy_arcmin", "not computed"))
        return
    for key in reversed(shown):
        label, colour = _ERRORS[key]
        turn = sheet.turns[key]
        periods = turn.turns / float(turn.period_turns)
        angle, error = turn.output_turn()
        if periods > _MANY:  # a whole turn would be drawn as a solid area
            part = slice(0, 2 * turn.signal.size + 1)
            angle, error = angle[part], error[part]
            ax.set_title(f"transmission error, 2 of {periods:.0f} periods per turn")
        else:
            stride = -(-angle.size // _AT_MOST)
            angle, error = angle[::stride], error[::stride]
        error = (error - turn.signal.mean()) / arcmin
        output = 360.0 * angle / (2.0 * np.pi * turn.turns)
        ax.plot(output, error, color=colour, lw=0.9, alpha=0.8, label=label)
    ax.legend(fontsize="small", loc="upper right")
    ax.grid(alpha=0.3)


def _orders(ax: Any, sheet: SpecSheet) -> None:
    ax.set_title("order spectrum of the transmission error")
    ax.set_xlabel("order [cycles per input turn]")
    ax.set_ylabel("amplitude [arcmin]")
    shown = [key for key in _ERRORS if key in sheet.turns]
    if not shown:
        _absent(ax, sheet.missing.get("orders", "not computed"))
        return
    from matplotlib.ticker import NullFormatter

    largest, drawn = 0.0, set()
    for k, key in enumerate(shown):
        label, colour = _ERRORS[key]
        order, amplitude = sheet.turns[key].lines()
        amplitude = amplitude / arcmin
        largest = max(largest, float(amplitude.max(initial=0.0)))
        keep = amplitude > 1e-4 * amplitude.max(initial=1e-300)
        drawn |= set(order[keep].tolist())
        shift = 1.0 + 0.02 * k  # draws the lines side by side on a logarithmic axis
        ax.vlines(order[keep] * shift, 0.0, amplitude[keep], color=colour, label=label)
    ax.set_xscale("log")
    ax.xaxis.set_minor_formatter(NullFormatter())
    if len(drawn) <= _FEW:  # all of them may be between two labelled powers of ten
        ax.set_xticks(sorted(drawn), [f"{order:.4g}" for order in sorted(drawn)])
    if largest > 0.0:
        ax.set_yscale("log")
        ax.set_ylim(1e-4 * largest, 2.0 * largest)
    ax.legend(fontsize="small")
    ax.grid(alpha=0.3)


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
