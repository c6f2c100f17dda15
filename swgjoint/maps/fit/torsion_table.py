"""Interpolation of potential curves over the torsion on common knots."""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array


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
