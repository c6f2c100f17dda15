"""Errors of the teeth and of the axis, pitch by pitch over the cycle of the drive."""

from __future__ import annotations

from math import lcm, pi

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.corotation import rotate
from swgjoint.gear.design.design import Design, MemberName
from swgjoint.gear.design.tolerances import ToothErrors, axis_tilt, tooth_errors
from swgjoint.typing import Array, Index

MEMBERS: tuple[MemberName, MemberName] = ("flexspline", "circular_spline")
"""Members with teeth."""
ROWS = 1024
"""Number of pitches whose gap changes are added at once."""


def pitches_of(design: Design) -> int:
    """Number of pitches after which errors of teeth and axis repeat; 1 without any."""
    shifts = [tooth_errors(design, member).shift for member in MEMBERS]
    counts = [len(shift) for shift in shifts if shift.any()]
    if axis_tilt(design).any() and design.drive.layout != "wave_generator_fixed":
        counts.append(round(2.0 * pi / pitch_of(design)))
    return lcm(*counts)


def pitch_of(design: Design) -> float:
    """Input rotation after which the teeth are in an equivalent position [rad]."""
    return 2.0 * pi / design.periodicity


def shift_errors(errors: ToothErrors, pitches: Index, layout: str) -> Array:
    """Shifts of the teeth that replace those of the first pitch after whole pitches.

    Args:
        errors: Errors of the teeth of one member.
        pitches: Numbers of pitches by which the input has turned (n,).
        layout: Layout of the drive, which names the fixed member.

    Returns:
        Shifts in the frames of the teeth (n, n_teeth, 2) [m].
    """
    count = len(errors.shift)
    # a turning wave generator advances to the next teeth; at a fixed one the preceding
    # teeth arrive
    onwards = -pitches if layout == "wave_generator_fixed" else pitches
    # the shifts twice in a row contain those after any number of pitches
    twice = np.concatenate([errors.shift, errors.shift]).ravel()
    first = 2 * (np.asarray(onwards) % count)
    shifts = sliding_window_view(twice, 2 * count)[first]
    return np.asarray(shifts.reshape(-1, count, 2))


def gap_changes(at: Influence, design: Design, pitches: Index) -> Array:
    """Changes of the tooth gaps by the errors of teeth and axis after whole pitches.

    The shifts of a member repeat after as many pitches as it has teeth, and the gap
    changes of both members add up. They are therefore computed once per tooth of either
    member.

    Args:
        at: Influence of the tooth gaps at the first pitch.
        design: The drive.
        pitches: Numbers of pitches by which the input has turned (n,).

    Returns:
        Gap changes, as :meth:`swgjoint.fe.common.influence.Influence.gap_change` gives
        for :func:`gap_errors` (n, n_contacts) [m].
    """
    change = np.zeros((len(pitches), len(at.sector)))
    for member, contact, by_shift in zip(
        MEMBERS, (at.sector, at.tooth), at.direction, strict=True
    ):
        errors = tooth_errors(design, member)
        count = len(errors.shift)
        shifts = shift_errors(errors, np.arange(count), design.drive.layout)
        own = np.einsum("pki,ki->pk", shifts[:, contact], by_shift)
        # part by part: copies of all rows would take longer than the sums
        for k in range(0, len(pitches), ROWS):
            change[k : k + ROWS] += own[pitches[k : k + ROWS] % count]
    if (slope := axis_slope(design, pitches)).any():
        change += slope @ at.by_tilt.T
    return change


def gap_errors(design: Design, pitches: Index) -> tuple[Array, Array, Array]:
    """Shifts of the teeth of both members and slope of the axis after whole pitches.

    Args:
        design: The drive.
        pitches: Numbers of pitches by which the input has turned (n,).

    Returns:
        Shifts of the flexspline's teeth (n, N, 2) [m] and of the circular spline's
        teeth (n, N_c, 2) [m], and slope of the circular spline's axis (n, 2) [rad], all
        of them referred to the first pitch.
    """
    flexspline, circular_spline = (
        shift_errors(tooth_errors(design, member), pitches, design.drive.layout)
        for member in MEMBERS
    )
    return flexspline, circular_spline, axis_slope(design, pitches)


def axis_slope(design: Design, pitches: Index) -> Array:
    """Slope of the circular spline's axis relative to the turned wave generator.

    With a fixed wave generator it is constant.

    Args:
        design: The drive.
        pitches: Numbers of pitches by which the input has turned (n,).

    Returns:
        Slope (n, 2) [rad].
    """
    stands = design.drive.layout == "wave_generator_fixed"
    angle = np.asarray((0.0 if stands else -pitch_of(design)) * pitches, dtype=float)
    return rotate(axis_tilt(design), angle)
