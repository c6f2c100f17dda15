"""Figures that comparisons and specifications use, by the side of their limit."""

from __future__ import annotations

UPPER = (
    "ripple_rms_percent",
    "ripple_pp_percent",
    "transmission_error_arcmin",
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
