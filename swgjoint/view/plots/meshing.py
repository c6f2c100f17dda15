"""Picture of a simulation of meshing: results over the wave-generator angle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from swgjoint.pictures import png

_KINDS = {"tensile": "tab:red", "compressive": "tab:blue", "von_mises": "0.3"}


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
