"""Which torques and angles a map samples, and at which it is judged."""

from __future__ import annotations

import numpy as np

from swgjoint.fe.common.load_path import LoadPath
from swgjoint.typing import Array

FEWEST_TORQUES = 40
"""Of one sign in the table."""


def common_torques(
    paths: list[LoadPath], own: set[float], least: float, most: int
) -> Array:
    """Torques of the table, closer together where the load paths have their events.

    Args:
        paths: Of all angles.
        own: Torques that all of them solved [N·m].
        least: Torque that all must exceed [N·m].
        most: Torques at most, next to those.
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
    # a half follows the events, a half is spread out, small torques a little closer
    measure = 0.5 * rank + 0.25 * share + 0.25 * np.sqrt(share)
    spread = np.interp((np.arange(count) + 0.5) / count, measure, fine)
    levels = np.array(sorted(own))
    # torques that nearly are one of those that were solved give way to it
    gap = np.abs(spread[:, None] - levels).min(axis=1)
    near = gap < 0.35 * np.gradient(spread)
    return np.sort(np.concatenate([spread[~near], levels]))


def periodic(values: Array, parts: Array) -> tuple[Array, Array]:
    """Trigonometric interpolation over a period, and its slope by the part of it.

    Args:
        values: At equal steps (n, ...).
        parts: Of the period (m,).

    Returns:
        Two of (m, ...).
    """
    n = len(values)
    modes = np.fft.rfft(values, axis=0)[: (n + 1) // 2] / n
    modes[1:] *= 2.0
    wave = 2.0j * np.pi * np.arange(len(modes))
    phase = np.exp(parts[:, None] * wave)
    return (phase @ modes).real, ((phase * wave) @ modes).real


def unseen_places(count: int, finest: int) -> list[float]:
    """Angles on the finest grid that no grid has, spread over the pitch."""
    # the golden section of a step, so that no grid comes near all of them
    return [finest * (k + 0.381966) / count for k in range(count)]


def unseen_parts(count: int) -> Array:
    """Unseen torques in parts of the largest one, a half of them small ones.

    None is next to a torque at which all maps begin.
    """
    small = count // 2
    parts = [np.geomspace(0.021, 0.28, small), np.linspace(0.37, 0.97, count - small)]
    return np.concatenate(parts)
