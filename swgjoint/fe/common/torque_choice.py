"""Choice of the torques of a map, and of the torques and angles of its validation."""

from __future__ import annotations

import numpy as np

from swgjoint.fe.common.load_path import LoadPath
from swgjoint.typing import Array

FEWEST_TORQUES = 40
"""Smallest number of torques of one sign that a table gets, if permitted."""


def common_torques(
    paths: list[LoadPath], own: set[float], least: float, most: int
) -> Array:
    """Torques of a table, denser where the compliance of the load paths jumps.

    Args:
        paths: Load paths of all angles.
        own: Positive torques that were solved at all angles [N·m].
        least: Lower bound of the added torques [N·m].
        most: Largest number of added torques.

    Returns:
        Solved and added torques, increasing (n,) [N·m].
    """
    top = max(own)
    pool = np.concatenate([np.concatenate([p.torque, p.events]) for p in paths])
    pool = np.sort(pool[(pool > least) & (pool <= top)])
    count = int(
        np.clip(3 * len(pool) // (2 * len(paths)), min(FEWEST_TORQUES, most), most)
    )
    fine = np.linspace(least, top, 4001)
    rank = np.searchsorted(pool, fine, side="right") / pool.size
    share = (fine - least) / (top - least)
    # half of the torques follow the jumps; the others are slightly denser near zero
    measure = 0.5 * rank + 0.25 * share + 0.25 * np.sqrt(share)
    spread = np.interp((np.arange(count) + 0.5) / count, measure, fine)
    levels = np.array(sorted(own))
    # drop torques that almost coincide with a solved one
    gap = np.abs(spread[:, None] - levels).min(axis=1)
    near = gap < 0.35 * np.gradient(spread)
    return np.sort(np.concatenate([spread[~near], levels]))


def periodic(values: Array, parts: Array) -> tuple[Array, Array]:
    """Trigonometric interpolation over a period, and its derivative.

    Args:
        values: Values at equal steps over the period (n, ...).
        parts: Positions as fractions of the period (m,) [-].

    Returns:
        Values, and derivatives with respect to the fraction of the period, each
        (m, ...).
    """
    n = len(values)
    modes = np.fft.rfft(values, axis=0)[: (n + 1) // 2] / n
    modes[1:] *= 2.0
    wave = 2.0j * np.pi * np.arange(len(modes))
    phase = np.exp(parts[:, None] * wave)
    return (phase @ modes).real, ((phase * wave) @ modes).real


def unseen_places(count: int, finest: int) -> list[float]:
    """Validation angles, spread over the pitch and between the angles of all grids.

    Args:
        count: Number of validation angles.
        finest: Number of angles of the finest grid.

    Returns:
        Angles as multiples of the step of the finest grid, not integers [-].
    """
    # offset by the golden section of their spacing, so that no grid is near all of them
    return [finest * (k + 0.381966) / count for k in range(count)]


def unseen_parts(count: int) -> Array:
    """Validation torques as fractions of the largest torque [-], half of them small.

    None of them is close to the initial torques of a map.
    """
    small = count // 2
    parts = [np.geomspace(0.021, 0.28, small), np.linspace(0.37, 0.97, count - small)]
    return np.concatenate(parts)
