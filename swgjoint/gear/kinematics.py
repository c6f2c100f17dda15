"""Layouts, signed ratios and the two gear angles in which a drive is periodic."""

from __future__ import annotations

from typing import Literal, get_args

Layout = Literal["circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed"]
LAYOUTS: tuple[str, ...] = get_args(Layout)

# Coefficients (d/dtheta, d/dpsi) of alpha, the angle of the wave generator relative to
# the circular spline, and of beta, its angle relative to the flexspline. theta is the
# input angle and psi the output angle.
_ANGLES: dict[str, tuple[tuple[int, int], tuple[int, int]]] = {
    "circular_spline_fixed": ((1, 0), (1, -1)),
    "flexspline_fixed": ((1, -1), (1, 0)),
    "wave_generator_fixed": ((0, -1), (-1, 0)),
}


def ratio(layout: str, teeth_flexspline: int, teeth_circular_spline: int) -> float:
    """Signed ratio i of input to output rotation [-].

    With the wave generator as input, :math:`i = z_D/(z_D - z_F)`, where D is the driven
    and F the fixed member: for 120/122 teeth, -60 with the circular spline fixed and
    +61 with the flexspline fixed. With the wave generator fixed, the flexspline is the
    input and the circular spline the output.

    Args:
        layout: Which member is fixed, one of :data:`LAYOUTS`.
        teeth_flexspline: Number of teeth of the flexspline.
        teeth_circular_spline: Number of teeth of the circular spline.

    Raises:
        ValueError: If the layout is unknown.

    Source:
        Thesis eq. (2.2), after Musser.

    >>> ratio("circular_spline_fixed", 120, 122)
    -60.0
    >>> ratio("flexspline_fixed", 120, 122)
    61.0
    """
    if layout == "circular_spline_fixed":
        return teeth_flexspline / (teeth_flexspline - teeth_circular_spline)
    if layout == "flexspline_fixed":
        return teeth_circular_spline / (teeth_circular_spline - teeth_flexspline)
    if layout == "wave_generator_fixed":
        return teeth_circular_spline / teeth_flexspline
    raise ValueError(f"layout {layout!r} unknown; accepted: {', '.join(LAYOUTS)}")


def angle_coefficients(layout: str) -> tuple[tuple[int, int], tuple[int, int]]:
    """Derivatives of the gear angles alpha and beta with respect to theta and psi [-].

    Alpha is the angle of the wave generator relative to the circular spline, and beta
    its angle relative to the flexspline. Theta is the input angle and psi the output
    angle.

    Returns:
        Derivatives of alpha with respect to theta and psi, then those of beta.

    Raises:
        KeyError: If the layout is not one of :data:`LAYOUTS`.
    """
    return _ANGLES[layout]


def member_angles(layout: str, theta: float, psi: float) -> tuple[float, float, float]:
    """Rotation of wave generator, flexspline and circular spline [rad].

    All angles are relative to the fixed member.

    Args:
        layout: Which member is fixed, one of :data:`LAYOUTS`.
        theta: Input angle [rad].
        psi: Output angle [rad].

    Raises:
        KeyError: If the layout is not one of :data:`LAYOUTS`.
    """
    angles = {
        "circular_spline_fixed": (theta, psi, 0.0),
        "flexspline_fixed": (theta, 0.0, psi),
        "wave_generator_fixed": (0.0, theta, psi),
    }
    return angles[layout]


def periodicity(layout: str, teeth_flexspline: int, teeth_circular_spline: int) -> int:
    """Number of identical cycles of a gear without errors per input turn.

    This is the tooth count of the fixed member or, with the wave generator fixed, that
    of the flexspline, which is then the input.

    Args:
        layout: Which member is fixed, one of :data:`LAYOUTS`.
        teeth_flexspline: Number of teeth of the flexspline.
        teeth_circular_spline: Number of teeth of the circular spline.
    """
    return (
        teeth_circular_spline if layout == "circular_spline_fixed" else teeth_flexspline
    )
