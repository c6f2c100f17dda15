"""Pictures of simulations of meshing: results over the wave-generator angle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.pictures import png
from swgjoint.units import arcmin, deg

if TYPE_CHECKING:
    from swgjoint.fe.quick_look import QuickLook

_KINDS = {"tensile": "tab:red", "compressive": "tab:blue", "von_mises": "0.3"}

_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:purple")
_LOADS = {"no_load": ("without load", "--"), "rated": ("rated load", "-")}


def meshing_picture(result: Mapping[str, Any]) -> bytes:
    """Draw stress, output error, wave-generator torque and contacts as PNG.

    Args:
        result: JSON object of ``swgjoint meshing``.
    """
    from matplotlib.figure import Figure

    steps = result["per_step"]
    angle = steps["angle_deg"]
    figure = Figure(figsize=(9, 8), layout="constrained")
    stress, error, torque, pairs = figure.subplots(4, 1, sharex=True)
    for kind, colour in _KINDS.items():
        label = kind.replace("_", " ")
        stress.plot(angle, _gaps(steps[f"{kind}_MPa"]), ".-", color=colour, label=label)
    stress.set_ylabel("largest stress in\nthe flexspline [MPa]")
    stress.legend(ncols=3, fontsize="small")
    values = np.array(_gaps(steps["output_error_arcsec"]), dtype=float)
    solved = values[np.isfinite(values)]
    mean = float(solved.mean()) if solved.size else 0.0
    error.plot(angle, values - mean, ".-", color="tab:green")
    error.set_ylabel(f"output error [arcsec],\nmean {mean:.4g} subtracted")
    for ax, key, label in (
        (torque, "wave_generator_torque_Nm", "wave-generator\ntorque [N·m]"),
        (pairs, "pairs_in_contact", "tooth pairs\nin contact"),
    ):
        ax.plot(angle, _gaps(steps[key]), ".-", color="tab:green")
        ax.set_ylabel(label)
    pairs.set_xlabel("wave-generator angle [deg]")
    for ax in (stress, error, torque, pairs):
        ax.grid(alpha=0.3)
        ax.ticklabel_format(axis="y", useOffset=False)
    name = result.get("design", "drive")
    torque_Nm = result.get("torque_Nm")
    load = f", {torque_Nm:g} N·m at the output" if torque_Nm is not None else ""
    figure.suptitle(f"Meshing of {name}{load}: {result['outcome']}", fontsize="medium")
    return png(figure, dpi=120)


def _gaps(values: list[float | None]) -> list[float]:
    """Values with NaN for failed steps, so that the line has gaps there."""
    return [float("nan") if value is None else value for value in values]


def quick_look_picture(looks: Mapping[str, QuickLook]) -> bytes:
    """Draw torsion curve, errors, orders and stress of one or several drives as PNG.

    Args:
        looks: Quick looks by label; the label may be empty if there is only one.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 6.4))
    figure.set_layout_engine("constrained", hspace=0.06)
    (torsion, error), (orders, stress) = figure.subplots(2, 2)
    for (label, look), colour in zip(looks.items(), _COLOURS, strict=False):
        prefix = f"{label}, " if label else ""
        torsion.plot(
            look.torque, look.torsion / arcmin, ".-", color=colour, label=label or None
        )
        for key, (text, style) in _LOADS.items():
            values = (look.errors[key] - look.errors[key].mean()) / arcmin
            x = look.angle / deg
            if look.superposed:
                error.plot(
                    x,
                    values,
                    ".",
                    color=colour,
                    ms=3 if key == "rated" else 1.5,
                    label=f"{prefix}{text}",
                )
            else:
                error.plot(
                    x, values, style, marker=".", color=colour, label=f"{prefix}{text}"
                )
        _orders(orders, look, colour, prefix)
        values = look.stress["von_mises"] / 1e6
        stress.plot(
            look.stress_angle / deg, values, ".-", color=colour, label=label or None
        )
    torsion.set_title("torsion, input locked")
    torsion.set_xlabel("output torque [N·m]")
    torsion.set_ylabel("torsion [arcmin]")
    error.set_title("output error, mean subtracted")
    error.set_xlabel("input angle [deg]")
    error.set_ylabel("error [arcmin]")
    error.legend(fontsize="small")
    orders.set_title("orders of the error (open: without load)")
    orders.set_xlabel("order [cycles per input turn]")
    orders.set_ylabel("amplitude [arcmin]")
    orders.set_ylim(bottom=0.0)  # after all are drawn, so that the top follows
    stress.set_title("von Mises stress, flexspline, rated load")
    stress.set_xlabel("input angle [deg]")
    stress.set_ylabel("stress [MPa]")
    stress.margins(y=0.3)
    for ax in (torsion, error, orders, stress):
        ax.grid(alpha=0.3)
        if len(looks) > 1 and ax is not error:
            ax.legend(fontsize="small")
    return png(figure, dpi=110)


def _orders(ax: Any, look: QuickLook, colour: str, prefix: str) -> None:
    """Draw the strongest orders as stems beside each other, rated load filled."""
    label: str | None = prefix.removesuffix(", ") or None
    for key, face in (("rated", colour), ("no_load", "white")):
        order = np.array(list(look.orders[key]))
        height = np.array(list(look.orders[key].values())) / arcmin
        ax.vlines(order, 0.0, height, color=colour, lw=1.2, alpha=0.6)
        ax.plot(order, height, "o", color=colour, mfc=face, ms=5, label=label)
        label = None
