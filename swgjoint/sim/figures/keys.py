"""Figures that comparisons and specifications use, by the side of their limit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

ERROR = "transmission_error_arcmin"
UPPER = (
    "ripple_rms_percent",
    "ripple_pp_percent",
    ERROR,
    "transmission_error_ripple_arcmin",
    "torsion_arcmin",
    "tool_path_rms_mm",
    "tool_ap_mm",
    "tool_rp_mm",
    "von_mises_MPa",
    "peak_torque_of_rating",
    "cubed_mean_torque_of_rating",
    "wall_s",
)
"""Figures that a specification bounds from above."""
LOWER = (
    "K1_Nm_rad",
    "resonance_Hz",
    "fatigue_safety_factor",
    "L10_h",
    "goodman_safety",
    "real_time_factor",
)
"""Figures that a specification bounds from below."""
OF_CYCLE = ("L10_h", "goodman_safety")
"""Figures of the duty cycle, which a scene without ``[[cycle]]`` does not have."""
RIPPLE = (
    "ripple_rms_percent",
    "ripple_pp_percent",
    "transmission_error_ripple_arcmin",
)
"""Ripple figures, which a drive without harmonics does not have."""


def is_lower_bound(row: Mapping[str, Any], key: str) -> bool:
    """Whether orders that the step leaves out may raise a figure of a comparison.

    Args:
        row: Figures of an argument by key.
        key: Key of the figure.
    """
    if key == ERROR:
        return bool(row["transmission_error_is_lower_bound"])
    return key in RIPPLE and bool(row["ripple_is_lower_bound"])
