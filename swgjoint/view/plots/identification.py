"""Picture of an identification: measured and modelled torques, residuals, loop."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.pictures import save_png
from swgjoint.units import arcmin

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swgjoint.identify.identification import Identified

_TURNS = 4
"""Number of input turns over which the kinematic error is drawn."""
_LABELS = {"output_torque": "output torque", "motor_torque": "motor torque"}


def png(identified: Identified) -> bytes:
    """The picture of an identification as a PNG file."""
    out = io.BytesIO()
    save_png(picture(identified), out, dpi=120)
    return out.getvalue()


def picture(identified: Identified) -> Figure:
    """Draw each torque channel with its residual, the torsion loop and the error."""
    from matplotlib.figure import Figure

    measured = identified.model.measured_torques()
    figure = Figure(figsize=(12.0, 3.2 * (len(measured) + 1)), layout="constrained")
    axes = figure.subplots(len(measured) + 1, 2)
    time = identified.samples.time[identified.model.kept]
    for row, (key, torque) in zip(axes, measured.items(), strict=False):
        left = identified.residuals[key]
        _line(row[0], time, torque, "measured", color="0.6", lw=2.0)
        _line(row[0], time, torque - left, "model", color="tab:blue", lw=0.8)
        row[0].set_ylabel(f"{_LABELS[key]} [N·m]")
        row[0].legend(loc="upper right")
        _line(row[1], time, left, "", color="tab:red", lw=0.6)
        row[1].set_ylabel(
            f"measured minus model [N·m]\nrms {np.sqrt(np.mean(left**2)):.2g}"
        )
        for ax in row:
            ax.set_xlabel("time [s]")
    _loop(axes[-1, 0], identified)
    _error(axes[-1, 1], identified)
    figure.suptitle(identified.drive.info["source"])
    return figure


def _line(ax: Any, x: Any, y: Any, label: str, **style: Any) -> None:
    """Draw a line that is interrupted where samples were excluded."""
    gaps = np.flatnonzero(np.diff(x) > 1.5 * np.median(np.diff(x))) + 1
    broken = np.insert(np.asarray(y, float), gaps, np.nan)
    ax.plot(np.insert(np.asarray(x, float), gaps, np.nan), broken, label=label, **style)


def _loop(ax: Any, identified: Identified) -> None:
    """Draw the measured torque over the torsion, and the spring curve of the map."""
    drive, model = identified.drive, identified.model
    values = np.array([e.value for e in identified.estimates.values()])
    a, b = model.amplitudes(values).T
    error = identified.estimates["zero"].value + model.cos @ a + model.sin @ b
    torque = model.measured_torques().get("output_torque")
    if torque is None:
        torque = model.ratio * model.measured_torques()["motor_torque"]
    x = (model.torsion + error)[model.kept]
    ax.plot(x / arcmin, torque, ".", ms=1.5, color="0.6", label="measured")
    along = np.linspace(x.min(), x.max(), 400)
    ax.plot(
        along / arcmin,
        drive.coefficients(along, 1)[:, 0, 0],
        color="tab:blue",
        label="spring curve of the map",
    )
    ax.set_xlabel("torsion [arcmin]")
    ax.set_ylabel("output torque [N·m]")
    ax.legend(loc="upper left")


def _error(ax: Any, identified: Identified) -> None:
    """Draw the kinematic error of the map over the first input turns."""
    ax.set_xlabel("input turns")
    ax.set_ylabel("kinematic error [arcmin]")
    if not len(identified.model.orders):
        ax.text(0.5, 0.5, "no orders fitted", ha="center", transform=ax.transAxes)
        return
    drive = identified.drive
    turns = np.linspace(0.0, _TURNS, 200 * _TURNS)
    theta = 2.0 * np.pi * turns
    error = drive.error_at(drive.phases(theta, theta / drive.ratio))[0]
    ax.plot(turns, error / arcmin)
