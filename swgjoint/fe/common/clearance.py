"""Rows of a map across a clearance in which the unloaded output is free."""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array

FAINT = 1e-8
"""Torque at the ends of a clearance as a fraction of the torque that takes it up [-].
It is greater than zero so that the stiffness inside the clearance is not zero."""
HELD = 0.1
"""Torque at the ends of the clearance as a fraction of the torque that takes it up [-].

A map holds the output in the clearance by this torque, 0.1 % of the rated torque. With
less of it, the harmonics that the map lacks, rather than the middle of the clearance,
would determine where an unloaded output stands."""

NARROWED = 0.8
"""Largest half width of the clearance as a fraction of the torsion under the torque
after the one that takes it up [-]."""


def across_clearance(
    rest: Array, taken_up: Array, torque: float, faint: float = FAINT
) -> tuple[float, Array]:
    r"""Point at which the teeth begin to hold an output that is free without torque.

    From the middle of the clearance to this point the torque rises to the fraction
    ``faint`` of the torque T that takes up the clearance. There the stiffness
    begins to grow, and it reaches K under T after a further rotation
    :math:`\ell = 3 T / 2 K`. A linear spring would reach T after a rotation of T/K and
    store the energy :math:`T^2 / 2 K`; the growing stiffness stores nearly the same
    energy over :math:`\ell`. If few teeth touch long before the others, they hold the
    output with a small part of K and store more energy E. A growing stiffness stores
    at most :math:`T \ell / 2`, so :math:`\ell` is at least :math:`2 E / T`.

    Args:
        rest: Output error [rad], energy [J], compliance [rad/(N·m)] and input torque
            [N·m] in the middle of the clearance (4, n).
        taken_up: The same quantities under ``torque`` (4, n).
        torque: Small torque T that takes up the clearance, of either sign [N·m].
        faint: Torque at the point as a fraction of T [-].

    Returns:
        Torque at the point [N·m] and the four quantities there (4, n).
    """
    begin = faint * torque
    apart = taken_up[0] - rest[0]  # against the sign of the torque
    stiff = 1.5 * torque * taken_up[2] / -apart
    soft = 2.0 * (taken_up[1] - rest[1]) / (torque * -apart)
    way = np.clip(1.0 - np.maximum(stiff, soft), 0.1, 1.0)
    onset = rest.copy()
    onset[0] += way * apart
    onset[1] -= 0.5 * begin * way * apart
    onset[2] = -way * apart / begin
    onset[3] += faint * (taken_up[3] - rest[3])
    return begin, onset


def with_onsets(table: Array, small: float, faint: float = FAINT) -> Array:
    """Table with rows added at both ends of the clearance.

    Args:
        table: Output angle [rad], strain energy [J] and compliance [rad/(N·m)]
            (3, n_torques, n_sets); its compliance at zero torque is replaced.
        small: Torque that takes up the clearance, in the rows next to zero [N·m].
        faint: Torque at the ends of the clearance as a fraction of ``small`` [-].

    Returns:
        Table (3, n_torques + 2, n_sets).
    """
    zero = table.shape[1] // 2
    # the fourth quantity of a pattern, the input torque, is unused here
    rows = np.concatenate([table, np.zeros_like(table[:1])])
    sides = [
        across_clearance(rows[:, zero], rows[:, zero + side], side * small, faint)[1][
            :3
        ]
        for side in (-1, 1)
    ]
    table[2, zero] = sides[1][2]  # the same stiffness on both sides of the middle
    table = np.insert(table, zero + 1, sides[1], axis=1)
    return np.insert(table, zero, sides[0], axis=1)


def add_clearance(
    table: dict[float, Array], signs: list[float], small: float, faint: float
) -> None:
    """Add rows at the ends of the clearance to a table by torque, in place.

    Args:
        table: Output error [rad], energy [J], compliance [rad/(N·m)] and input torque
            [N·m] (4, n_angles) by torque [N·m], with those that take up the clearance.
        signs: Signs of the torques, 1.0, -1.0 or both.
        small: Torque that takes up the clearance [N·m].
        faint: Torque at its ends as a fraction of ``small`` [-].
    """
    rest = table[0.0]
    for sign in signs:
        begin, onset = across_clearance(rest, table[sign * small], sign * small, faint)
        table[begin] = onset
        # the same stiffness on both sides of the middle
        rest[2] = onset[2]
    if faint != FAINT:
        begins = [sign * faint * small for sign in signs]
        ends = [abs(t) * np.abs(table[t][0] - rest[0]) for t in begins]
        # work of this torque up to the ends of the clearance
        for t in (0.0, *begins):
            table[t][1] -= 0.5 * np.mean(ends)


def with_mean_clearance(table: Array, levels: Array) -> tuple[Array, Array]:
    r"""Table of a drive whose clearance has its mean width at all angles.

    The width of the clearance varies with the errors by as much as the torsion under
    the torque that takes it up, and a map would need thousands of harmonics for ends
    that move. It is narrower where the drive would otherwise have passed its torsion
    under the next torque. Its middle, which is the kinematic error, varies as computed,
    and so does the torsion from the next torque on. Up to there the torque T(x) is of
    third degree between the rows, and its integral provides the energy.

    Args:
        table: Output angle [rad], energy [J] and compliance [rad/(N·m)] at the torques
            +-levels and zero, increasing (3, n_torques, n).
        levels: Magnitudes of the torques; the first one takes up the clearance
            (n_levels,) [N·m].

    Returns:
        Table with rows at the ends of the clearance (3, n_torques + 2, n), and its
        torques (n_torques + 2,) [N·m].
    """
    table, zero, small = table.copy(), levels.size, float(levels[0])
    half = 0.5 * float((table[0, zero - 1] - table[0, zero + 1]).mean())
    soft = float(table[2, [zero - 1, zero + 1]].mean())
    table[1, zero] = table[1, zero].mean()
    for end, sign in ((zero - 1, 1.0), (zero + 1, -1.0)):
        # the torsion must grow up to the next torque
        beyond = sign * (table[0, end - int(sign)] - table[0, zero])
        table[0, end] = table[0, zero] + sign * np.minimum(half, NARROWED * beyond)
        table[1, end], table[2, end] = table[1, zero], soft
    table = with_onsets(table, small, HELD)
    torque = np.append(HELD * small, levels)
    torque = np.concatenate([-torque[::-1], [0.0], torque])
    zero += 1
    for step in (-1, 1):
        for k in range(zero, zero + 3 * step, step):
            way = table[0, k] - table[0, k + step]
            begin, end = 1.0 / table[2, [k, k + step]]
            gain = 0.5 * way * (torque[k] + torque[k + step])
            gain += way**2 * (begin - end) / 12.0
            shift = table[1, k] + gain - table[1, k + step]
            outside = slice(k + 1, None) if step > 0 else slice(None, k)
            table[1, outside] += shift
    return table, torque


def spring_energy(up: Array, down: Array, small: float) -> Array:
    """Energy that a map stores between the middle and an end of the clearance [J].

    Args:
        up: Output angle under the torque that takes up the clearance [rad].
        down: Output angle under the opposite torque [rad].
        small: That torque [N·m].
    """
    return 0.25 * HELD * small * (down - up)
