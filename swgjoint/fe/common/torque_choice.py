"""Choice of the torques and angles that a map samples and at which it is validated."""

from __future__ import annotations

import numpy as np

from swgjoint.fe.common.load_path import LoadPath
from swgjoint.typing import Array

FEWEST_TORQUES = 40
"""Smallest number of torques of one sign in a table."""


def common_torques(
    paths: list[LoadPath], own: set[float], least: float, most: int
) -> Array:
    """Torques of the table, denser where the load paths have their events.

    Args:
        paths: Load paths of all angles.
        own: Torques that were solved at all angles [N·m].
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
    # half follows the events; half is spread out, slightly denser at small torques
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
        Values and derivatives by the fraction of the period, each (m, ...).
    """
    n = len(values)
    modes = np.fft.rfft(values, axis=0)[: (n + 1) // 2] / n
    modes[1:] *= 2.0
    wave = 2.0j * np.pi * np.arange(len(modes))
    phase = np.exp(parts[:, None] * wave)
    return (phase @ modes).real, ((phase * wave) @ modes).real


def unseen_places(count: int, finest: int) -> list[float]:
    """Angles between those of all grids, spread over the pitch.

    Args:
        count: Number of angles.
        finest: Number of steps of the finest grid.

    Returns:
        Places in steps of the finest grid.
    """
    # offset by the golden section of a step, so that no grid comes near all of them
    return [finest * (k + 0.381966) / count for k in range(count)]


def unseen_parts(count: int) -> Array:
    """Validation torques as fractions of the largest one, half of them small.

    None of them is close to the initial torques of a map.
    """
    small = count // 2
    parts = [np.geomspace(0.021, 0.28, small), np.linspace(0.37, 0.97, count - small)]
    return np.concatenate(parts)
