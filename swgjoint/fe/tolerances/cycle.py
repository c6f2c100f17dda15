"""The cycle of the teeth: errors of both members and of the axis, pitch by pitch."""

from __future__ import annotations

from math import lcm, pi

import numpy as np

from swgjoint.fe.plane.corotation import rotate
from swgjoint.gear.design.design import Design, MemberName
from swgjoint.gear.design.tolerances import ToothErrors, axis_tilt, tooth_errors
from swgjoint.typing import Array, Index

MEMBERS: tuple[MemberName, MemberName] = ("flexspline", "circular_spline")


def pitches_of(design: Design) -> int:
    """Pitches after which errors of teeth and axis repeat; 1 without such errors."""
    shifts = [tooth_errors(design, member).shift for member in MEMBERS]
    counts = [len(shift) for shift in shifts if shift.any()]
    if axis_tilt(design).any() and design.drive.layout != "wave_generator_fixed":
        counts.append(round(2.0 * pi / pitch_of(design)))
    return lcm(*counts)


def pitch_of(design: Design) -> float:
    """Input angle after which the teeth stand alike [rad]."""
    return 2.0 * pi / design.periodicity


def shift_errors(errors: ToothErrors, pitches: Index, layout: str) -> Array:
    """Shifts of the teeth that stand where those of the first pitch stood.

    Args:
        errors: Of one member.
        pitches: Whole pitches that the input has moved on (n,).
        layout: Which member is fixed.

    Returns:
        In the frames of the teeth (n, n_teeth, 2) [m].
    """
    count = len(errors.shift)
    # the lobes move on to the next teeth; a wave generator that stands still sees the
    # teeth come from behind
    onwards = -pitches if layout == "wave_generator_fixed" else pitches
    return np.asarray(errors.shift[(np.arange(count) + onwards[:, None]) % count])


def gap_errors(design: Design, pitches: Index) -> tuple[Array, Array, Array]:
    """Shifts of both members' teeth and slope of the axis after whole pitches.

    As the first pitch sees them: (n, N, 2), (n, N_c, 2) [m], (n, 2) [rad].
    """
    own, other = (
        shift_errors(tooth_errors(design, member), pitches, design.drive.layout)
        for member in MEMBERS
    )
    return own, other, axis_slope(design, pitches)


def axis_slope(design: Design, pitches: Index) -> Array:
    """Slope of the axis, turned back with the wave generator to the first pitch.

    Args:
        design: The drive.
        pitches: Whole pitches that the input has moved on (n,).

    Returns:
        Shape (n, 2) [rad].
    """
    stands = design.drive.layout == "wave_generator_fixed"
    angle = np.asarray((0.0 if stands else -pitch_of(design)) * pitches, dtype=float)
    return rotate(axis_tilt(design), angle)
