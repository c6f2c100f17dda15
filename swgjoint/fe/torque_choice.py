"""Which torques and angles a map samples, and at which it is judged."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.load_path import LoadPath

Array = NDArray[np.float64]

SNAP = 0.3
"""Part of an interval by which its division may move to a torque of a column beside:
that takes half the iterations, and columns with the same torques have like errors,
which leave the input torque, their difference, alone."""
FEWEST_TORQUES = 40
"""Of one sign in the table."""


def torque_as_beside(
    torque: float, solved: Iterable[float], beside: Iterable[Iterable[float]]
) -> float:
    """A torque near the wanted one that a column beside has, else the wanted one.

    To go on from there takes half the iterations of a change of the torque, and events
    move little from column to column.

    Args:
        torque: The wanted one [N·m].
        solved: Torques of the column [N·m].
        beside: Torques of the columns beside [N·m].
    """
    own = [0.0, *(t for t in solved if t * torque > 0.0)]
    low = max(t for t in map(abs, own) if t < abs(torque))
    high = min(t for t in map(abs, own) if t > abs(torque))
    part = SNAP * (high - low)
    near = [
        t
        for one in beside
        for t in one
        if t * torque > 0.0
        and abs(t - torque) < part
        and low + 0.5 * part < abs(t) < high - 0.5 * part
    ]
    return min(near, key=lambda t: abs(t - torque), default=torque)


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
        values: At equal steps (n,).
        parts: Of the period (m,).
    """
    n = len(values)
    modes = np.fft.rfft(values)[: (n + 1) // 2] / n
    modes[1:] *= 2.0
    wave = 2.0j * np.pi * np.arange(len(modes))
    phase = np.exp(parts[:, None] * wave)
    return (phase @ modes).real, (phase @ (wave * modes)).real


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
