"""Statistics of the recorded signals of one joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swgjoint.typing import Array
from swgjoint.units import arcmin

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


def ripple_figures(ripple: Array, rated: float) -> dict[str, float]:
    """Root mean square and peak-to-peak value of a torque ripple.

    Args:
        ripple: Torque ripple [N·m]. Shape (n,).
        rated: Rated torque of the drive [N·m].
    """
    return {
        "ripple_rms_percent": float(100.0 * np.sqrt(np.mean(ripple**2)) / rated),
        "ripple_pp_percent": float(100.0 * np.ptp(ripple) / rated),
    }


def error_figures(run: Run, j: int) -> dict[str, dict[str, float]]:
    """Statistics of transmission error and torsion at constant speed.

    Args:
        run: The run.
        j: Index of the joint.
    """
    signals = {
        "transmission_error_arcmin": run.transmission_error,
        "torsion_arcmin": run.torsion,
    }
    return {
        key: signal_statistics(signal[run.steady, j] / arcmin)
        for key, signal in signals.items()
    }


def signal_statistics(values: Array) -> dict[str, float]:
    """Mean, root mean square and peak-to-peak value of a signal, in its unit."""
    return {
        "mean": float(np.mean(values)),
        "rms": float(np.sqrt(np.mean(values**2))),
        "pp": float(np.ptp(values)),
    }
