"""Sums over the harmonics of a map: kinematic error and derivatives of the potential.

The numpy versions are the reference; the compiled ones give the same bits, except
:func:`law_sums` of many harmonics, which differs by round-off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.kernels import kernels
from swgjoint.maps.phase_bounds import MANY
from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.maps.potential import Potential


def error_sums(
    drive: Potential, phases: Array
) -> tuple[Array, Array, tuple[Array, Array, Array]]:
    """Cosines and sines of phases, and the kinematic error there.

    Args:
        drive: The map.
        phases: Phases of the harmonics [rad]. Shape (..., n_harmonics).

    Returns:
        Cosines and sines in the shape of the phases, and e0 [rad] with its derivatives
        by theta and psi [-].
    """
    if (native := kernels()) is not None:
        count = phases.shape[-1]
        cos, sin = np.empty((2, *phases.shape))
        sums = np.empty((3, phases.size // count))
        native.error_sums(
            np.ascontiguousarray(phases).reshape(-1, count),
            np.ascontiguousarray(drive.kinematic_error),
            np.ascontiguousarray(drive.angle_orders),
            cos.reshape(-1, count),
            sin.reshape(-1, count),
            sums,
        )
        e0, by_theta, by_psi = sums.reshape(3, *phases.shape[:-1])
        return cos, sin, (e0, by_theta, by_psi)
    cos, sin = np.cos(phases), np.sin(phases)
    return cos, sin, _errors(drive, cos, sin)


def _errors(drive: Potential, cos: Array, sin: Array) -> tuple[Array, Array, Array]:
    """Kinematic error [rad] and its derivatives from cosines and sines of phases."""
    a, b = drive.kinematic_error.T
    slope = b * cos - a * sin
    n_theta, n_psi = drive.angle_orders.T
    return (
        np.sum(a * cos + b * sin, axis=-1),
        np.sum(slope * n_theta, axis=-1),
        np.sum(slope * n_psi, axis=-1),
    )


def error_sums_at(
    drive: Potential, theta: ArrayLike, psi: ArrayLike
) -> tuple[Array, Array, tuple[Array, Array, Array]]:
    """Result of :func:`error_sums` at given angles.

    Cosines and sines of many harmonics, as of tooth errors, are products of those of
    the few numbers of waves that they share, which takes less time. They differ from
    those of the phases by round-off.

    Args:
        drive: The map.
        theta: Input angle [rad].
        psi: Output angle [rad], of a shape that broadcasts with theta.
    """
    if len(drive.orders) - 1 <= MANY:
        return error_sums(drive, drive.phases(theta, psi))
    of_theta, of_psi, which = drive.wave_numbers
    theta, psi = np.broadcast_arrays(np.asarray(theta, float), np.asarray(psi, float))
    about_theta, about_psi = theta[..., None] * of_theta, psi[..., None] * of_psi
    c1, s1 = (f(about_theta)[..., which[:, 0]] for f in (np.cos, np.sin))
    c2, s2 = (f(about_psi)[..., which[:, 1]] for f in (np.cos, np.sin))
    cos, sin = c1 * c2 - s1 * s2, s1 * c2 + c1 * s2
    return cos, sin, _errors(drive, cos, sin)


class LawSums(NamedTuple):
    """Sums over the harmonics at given angles, in the shape of the angles."""

    torsion: Array
    """Torsion [rad]."""
    error_by_theta: Array
    """Derivative of the kinematic error by theta [-]."""
    error_by_psi: Array
    """Derivative of the kinematic error by psi [-]."""
    torque: Array
    """First derivative of the potential by the torsion [N·m]."""
    stiffness: Array
    """Second derivative of the potential by the torsion [N·m/rad]."""
    by_theta: Array
    """Derivative of the potential by theta at a fixed torsion [N·m]."""
    by_psi: Array
    """Derivative of the potential by psi at a fixed torsion [N·m]."""


def law_sums(
    drive: Potential,
    theta: ArrayLike,
    psi: ArrayLike,
    *,
    stiffness: bool = False,
    by_phase: bool = True,
    error_first: bool = False,
) -> LawSums:
    """Torsion and derivatives of the potential at given angles.

    Args:
        drive: The map.
        theta: Input angle [rad].
        psi: Output angle [rad], of a shape that broadcasts with theta.
        stiffness: Whether the stiffness is needed; otherwise it may be empty.
        by_phase: Whether the derivatives by the angles are needed, similarly.
        error_first: Whether the kinematic error of few harmonics is added before the
            output angle is subtracted. The last bit of the torsion decides which
            equilibrium is found where a map is not monotonic.
    """
    if len(drive.orders) - 1 > MANY and kernels() is not None:
        theta, psi = np.broadcast_arrays(theta, psi)
        flat = (np.array(angle, dtype=float).reshape(-1) for angle in (theta, psi))
        rows = np.empty((7, theta.size))
        _compiled(drive).evaluate(*flat, rows)
        return LawSums(*rows.reshape(7, *theta.shape))
    cos, sin, (e0, e_theta, e_psi) = error_sums_at(drive, theta, psi)
    ideal, output = np.asarray(theta, float) / drive.ratio, np.asarray(psi, float)
    x = ideal + e0 - output if error_first else ideal - output + e0
    wanted = ["torque"] + stiffness * ["stiffness"] + by_phase * ["by_phase"]
    torque, *others = potential_sums(drive, x, cos, sin, *wanted)
    k = others.pop(0) if stiffness else np.empty(0)
    by_theta, by_psi = others if by_phase else np.empty((2, 0))
    return LawSums(x, e_theta, e_psi, torque, k, by_theta, by_psi)


_made: WeakKeyDictionary[Potential, Any] = WeakKeyDictionary()


def _compiled(drive: Potential) -> Any:
    """Compiled sums of a map with many harmonics.

    Each contains the coefficients in the order in which they are added, of the
    intervals of the torsion that were needed.
    """
    if drive not in _made:
        native = kernels()
        assert native is not None
        _made[drive] = native.HarmonicSums(
            drive.torsion_knots,
            np.ascontiguousarray(drive.potential),
            np.ascontiguousarray(drive.end_stiffness),
            np.ascontiguousarray(drive.kinematic_error),
            np.ascontiguousarray(drive.angle_orders),
            *drive.wave_numbers,
            drive.ratio,
        )
    return _made[drive]


def derivative_sum(
    drive: Potential, torsion: ArrayLike, cos: Array, sin: Array, derivative: int
) -> Array:
    """The potential or a derivative of it by the torsion.

    Args:
        drive: The map.
        torsion: Torsion [rad].
        cos: Cosines of the phases. Shape (..., n_harmonics), where the torsion
            broadcasts with the other axes.
        sin: Sines of the phases.
        derivative: Order of the derivative, 0 to 2.

    Returns:
        Potential [J], torque [N·m] or stiffness [N·m/rad].
    """
    x = np.asarray(torsion, float)
    if derivative and x.shape == cos.shape[:-1] and kernels() is not None:
        row = "torque" if derivative == 1 else "stiffness"
        return potential_sums(drive, x, cos, sin, row)[0]
    ab = drive.coefficients(x, derivative)
    return np.asarray(np.sum(ab[..., 0] * cos + ab[..., 1] * sin, axis=-1))


def potential_sums(
    drive: Potential, torsion: Array, cos: Array, sin: Array, *wanted: str
) -> list[Array]:
    """Derivatives of the potential at given phases, in the shape of the torsion.

    Args:
        drive: The map.
        torsion: Torsion [rad].
        cos: Cosines of the phases. Shape (..., n_harmonics) with the axes of the
            torsion first.
        sin: Sines of the phases.
        wanted: ``torque`` and ``stiffness``, the first two derivatives by the torsion
            [N·m, N·m/rad], and ``by_phase``, the derivatives by theta and psi at a
            fixed torsion [N·m].

    Returns:
        The wanted arrays, in the order of this list.
    """
    chosen = [key in wanted for key in ("torque", "stiffness", "by_phase")]
    if (native := kernels()) is not None:
        count = cos.shape[-1]
        rows = np.empty((4, cos.size // count))
        native.potential_sums(
            np.ascontiguousarray(torsion, dtype=float).reshape(-1),
            np.ascontiguousarray(cos).reshape(-1, count),
            np.ascontiguousarray(sin).reshape(-1, count),
            np.ascontiguousarray(drive.angle_orders),
            drive.torsion_knots,
            np.ascontiguousarray(drive.potential),
            np.ascontiguousarray(drive.end_stiffness),
            *chosen,
            rows,
        )
        which = np.array([*chosen, chosen[-1]])
        return list(rows[which].reshape(-1, *cos.shape[:-1]))
    found = []
    for derivative, use in ((1, chosen[0]), (2, chosen[1])):
        if use:
            found.append(derivative_sum(drive, torsion, cos, sin, derivative))
    if chosen[2]:
        ab = drive.coefficients(torsion)
        by_phase = ab[..., 1] * cos - ab[..., 0] * sin
        n_theta, n_psi = drive.angle_orders.T
        found += [np.sum(by_phase * n, axis=-1) for n in (n_theta, n_psi)]
    return found
