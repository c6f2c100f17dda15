"""Format the keys and values of results for display."""

from __future__ import annotations

_UNITS = {
    "Nm": "N·m",
    "Nm_rad": "N·m/rad",
    "arcmin": "arcmin",
    "percent": "%",
    "N_mm": "N/mm",
    "mm": "mm",
    "rad_Nm": "rad/(N·m)",
    "rad_s_Nm": "rad/(s·N·m)",
    "uV_V_Nm": "µV/(V·N·m)",
    "per_mm": "1/mm",
    "factor": "",
    "Hz": "Hz",
}
"""Units by the last part of a key."""


_NAMES = {
    "ripple_rms_percent": ("output torque ripple, rms", "% of rated torque"),
    "ripple_pp_percent": ("output torque ripple, pp", "% of rated torque"),
    "transmission_accuracy_rated_arcmin": (
        "transmission accuracy at rated torque",
        "arcmin",
    ),
}
"""Name and unit of keys that do not say which quantity they mean."""


def words(key: str) -> tuple[str, str]:
    """Split a key of a spec sheet into its name in words and its unit.

    The unit is empty if the key does not end in a known one.

    >>> words("lost_motion_arcmin")
    ('lost motion', 'arcmin')
    >>> words("ripple_pp_percent")
    ('output torque ripple, pp', '% of rated torque')
    >>> words("radial_stiffness_N_mm"), words("compliance_rad_Nm")
    (('radial stiffness', 'N/mm'), ('compliance', 'rad/(N·m)'))
    """
    if key in _NAMES:
        return _NAMES[key]
    for suffix in sorted(_UNITS, key=len, reverse=True):
        if key.endswith(f"_{suffix}"):
            text = key.removesuffix(f"_{suffix}")
            text = key if suffix == "factor" else text
            return text.replace("_", " "), _UNITS[suffix]
    return key.replace("_", " "), ""


LASTING = 1e6
"""Longest displayed life [h]: more than a hundred years, where the formulas of bearing
life and fatigue are not meant to apply."""


def format_hours(value: float | None) -> str:
    """Format a life [h] with three digits; a bound beyond :data:`LASTING`.

    It becomes a dash if it is not known.

    Args:
        value: Life [h]; None if it is not known.

    >>> format_hours(379812.3), format_hours(1.44e12), format_hours(None)
    ('380,000', '> 1e6', '-')
    """
    if value is None:
        return "-"
    return f"{float(f'{value:.3g}'):,.12g}" if value <= LASTING else "> 1e6"


NOISE = 1e-6
"""Smallest displayed torsion or error of a run [arcmin] or [mm]. An exact controller
with rigid drives leaves rounding errors of 1e-11 mm and 1e-10 arcmin."""
NOISE_NOTE = "-: below 1e-6 arcmin or mm, where rounding errors decide"
"""Explanation of a dash in place of a torsion or an error."""


def above_noise(value: float | None) -> float | None:
    """A torsion or an error of a run; None if it is below :data:`NOISE`.

    Args:
        value: Value [arcmin] or [mm]; None if it is not known.

    >>> above_noise(0.07244), above_noise(1.27e-11)
    (0.07244, None)
    """
    return None if value is None or abs(value) < NOISE else value


def _has_noise(key: str) -> bool:
    return key.endswith(("_arcmin", "_mm")) and not key.endswith("_N_mm")


def format_named(key: str, value: object) -> str:
    """Format the value of a figure of a run for display; keys of lives end in ``_h``.

    Args:
        key: Key of the figure.
        value: Its value.

    >>> format_named("L10_h", 2e6), format_named("torsion_arcmin", 2e6)
    ('> 1e6', '2,000,000')
    >>> format_named("tool_path_rms_mm", 1.27e-11)
    '-'
    """
    if key.endswith("_h") and isinstance(value, float):
        return format_hours(value)
    if _has_noise(key) and isinstance(value, float):
        value = above_noise(value)
    return format_figure(value)


def format_figure(value: object) -> str:
    """Format a value for display.

    Floating-point numbers get four significant digits (three below 1e-4), None becomes
    a dash and a bool ``yes`` or ``no``. Everything else is converted by ``str``.

    >>> format_figure(0.123456), format_figure(None)
    ('0.1235', '-')
    """
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return str(value)
    if 1e4 <= abs(value) < 1e8:
        return f"{float(f'{value:.4g}'):,.0f}"
    if 0.0 < abs(value) < 1e-4:
        return f"{value:.2e}"
    return f"{value + 0.0:.4g}"


def short(joint: str) -> str:
    """Name of a joint in words, without the suffix ``_joint`` unless that is all."""
    return joint.removesuffix("_joint").replace("_", " ") or joint
