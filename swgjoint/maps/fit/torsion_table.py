"""Interpolation of potential curves over the torsion on common knots."""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array

BETWEEN = 2
"""Number of points added between two torques by :func:`refine_over_torque`."""


def interpolate_on_knots(torsion: Array, curve: Array, knots: Array) -> Array:
    """Quintic Hermite interpolation of many curves, with a parabola beyond the ends.

    Beyond an end, V'' is the mean of all curves at that end, because the end stiffness
    of a single curve jumps with the contacts of single teeth.

    Args:
        torsion: Torsion of the samples, increasing along the first axis [rad]. Shape
            (n, n_curves).
        curve: V [J], V' [N·m] and V'' [N·m/rad] at the samples. Shape (3, n, n_curves).
        knots: Torsion of the knots [rad]. Shape (n_knots,).

    Returns:
        V, V' and V'' at the knots. Shape (n_curves, 3, n_knots).
    """
    inside = np.clip(knots[:, None], torsion[0], torsion[-1])  # (n_knots, n_curves)
    at = (inside[:, None] >= torsion[None, 1:-1]).sum(axis=1)

    def ends(values: Array) -> tuple[Array, Array]:
        """Values at both ends of the interval of each knot."""
        return (
            np.take_along_axis(values, at, axis=0),
            np.take_along_axis(values, at + 1, axis=0),
        )

    x0, x1 = ends(torsion)
    h = x1 - x0
    (v0, v1), (s0, s1), (c0, c1) = (ends(values) for values in curve)
    s0, s1, c0, c1 = s0 * h, s1 * h, c0 * h**2, c1 * h**2
    # difference between the end values and the parabola of the start
    dv, ds, dc = v1 - v0 - s0 - 0.5 * c0, s1 - s0 - c0, c1 - c0
    a3, a4, a5 = (
        10 * dv - 4 * ds + 0.5 * dc,
        -15 * dv + 7 * ds - dc,
        6 * dv - 3 * ds + 0.5 * dc,
    )
    t = (inside - x0) / h
    value = v0 + t * (s0 + t * (0.5 * c0 + t * (a3 + t * (a4 + t * a5))))
    slope = (s0 + t * (c0 + t * (3 * a3 + t * (4 * a4 + t * 5 * a5)))) / h
    bend = (c0 + t * (6 * a3 + t * (12 * a4 + t * 20 * a5))) / h**2
    out = knots[:, None] - inside
    last = np.where(out < 0.0, curve[2, 0].mean(), curve[2, -1].mean())
    value += out * (slope + 0.5 * out * last)
    slope += out * last
    bend = np.where(out == 0.0, bend, last)
    return np.stack([value, slope, bend]).transpose(2, 0, 1)


def refine_over_torque(torsion: Array, curve: Array) -> tuple[Array, Array]:
    r"""Curves with :data:`BETWEEN` points added between two torques of one sign.

    Between two torques the complementary potential :math:`G(T) = T x - V` is a quintic
    with the values of :math:`G' = x` and :math:`G'' = 1 / V''` at both ends, so that
    the compliance is a cubic of the torque. Where contacts separate and others close,
    the compliance has a maximum between two torques, which a quintic of the torsion
    cannot follow. In an interval in which the torsion would not increase, and next to
    zero torque, the curve is left as it is.

    Args:
        torsion: Torsion of the samples, increasing along the first axis [rad]. Shape
            (n, n_curves).
        curve: V [J], V' [N·m] and V'' [N·m/rad] at the samples; V' is the same for all
            curves. Shape (3, n, n_curves).

    Returns:
        Torsion and curves with more points, in the same units.
    """
    torque = curve[1, :, 0]
    parts = np.arange(1, BETWEEN + 1) / (BETWEEN + 1.0)
    complementary = np.stack([curve[1] * torsion - curve[0], torsion, 1.0 / curve[2]])
    rows, added = [torsion[:1]], [curve[:, :1]]
    for k in range(torque.size - 1):
        both = slice(k, k + 2)
        if torque[both].all():
            between = torque[k] + parts * (torque[k + 1] - torque[k])
            # (n_curves, 3, BETWEEN)
            found = interpolate_on_knots(
                curve[1, both], complementary[:, both], between
            )
            potential, x, bend = found.transpose(1, 2, 0)
            ways = np.diff(np.concatenate([torsion[[k]], x, torsion[[k + 1]]]), axis=0)
            falls = (ways <= 0.0).any(axis=0) | (bend <= 0.0).any(axis=0)
            more = np.stack(
                [
                    between[:, None] * x - potential,
                    np.broadcast_to(between[:, None], x.shape),
                    1.0 / bend,
                ]
            )
            if falls.any():
                start, end = torsion[both][:, falls]
                x[:, falls] = start + parts[:, None] * (end - start)
                for j in np.flatnonzero(falls):
                    more[:, :, j] = interpolate_on_knots(
                        torsion[both, [j]], curve[:, both, [j]], x[:, j]
                    )[0]
            rows.append(x)
            added.append(more)
        rows.append(torsion[[k + 1]])
        added.append(curve[:, [k + 1]])
    return np.concatenate(rows), np.concatenate(added, axis=1)
