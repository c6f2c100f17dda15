"""Torques and positions of the full solves that validate a map with tooth errors."""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array, Index

HARD = 0.02
"""Fraction of the positions from which half of those for validation are chosen [-]:
those whose output turns most between two sampled torques, because few contacts carry
the load. In 2,500 positions of the reference drive at 29 N·m, the map is off by 2.2
times as much (root mean square) at the 100 hardest ones as at all of them."""


def unseen_torques(levels: Array, rated_torque: float, *, has_play: bool) -> Array:
    """Zero, the middle between neighbouring torques, and the rated torque [N·m].

    Args:
        levels: Magnitudes of the sampled torques, increasing (n_levels,) [N·m].
        rated_torque: Rated torque [N·m].
        has_play: Whether the first of the levels takes up a clearance, within which
            there is no equilibrium to compare with.
    """
    ends = levels if has_play else np.append(0.0, levels)
    middle = 0.5 * (ends[1:] + ends[:-1])
    return np.unique(np.concatenate([[0.0, rated_torque], middle]))


def spread_positions(pitches: int, phases: int, count: int) -> Index:
    """Positions spread over the cycle and over the phases of a pitch.

    Args:
        pitches: Number of pitches of the cycle.
        phases: Number of positions in a pitch.
        count: Number of positions to choose.

    Returns:
        Numbers of positions (count,).
    """
    k = np.arange(count)
    # every second one is replaced later: the others have all phases, too
    phase = (k // 2 + k % 2 * (phases // 2)) % phases
    return k * pitches // count * phases + phase


def unseen_positions(table: Array, torque: Array, chosen: Index) -> tuple[Index, Array]:
    """Positions of the cycle and signs of the torques at them.

    Half of the chosen positions are replaced by those where the torsion varies most,
    and half of either kind have negative torques.

    Args:
        table: Output errors at the sampled positions (n_torques, n_positions) [rad].
        torque: Sampled torques, increasing, with zero (n_torques,) [N·m].
        chosen: Positions spread over the cycle (n,).

    Returns:
        Numbers of positions (n,) and signs (n,).
    """
    chosen, signs = chosen.copy(), np.where(np.arange(chosen.size) // 2 % 2, -1.0, 1.0)
    for sign in (1.0, -1.0):
        rows = sign * torque > 0.0
        replaced = np.flatnonzero((signs == sign) & (np.arange(chosen.size) % 2 == 1))
        if rows.sum() < 2 or not replaced.size:
            continue
        compliance = np.abs(np.diff(table[rows], axis=0))
        compliance /= np.diff(torque[rows])[:, None]
        relative = compliance / np.median(compliance, axis=1, keepdims=True)
        most = max(replaced.size, int(HARD * table.shape[1]))
        softest = np.sort(np.argsort(-relative.max(axis=0), kind="stable")[:most])
        chosen[replaced] = softest[
            np.arange(replaced.size) * softest.size // replaced.size
        ]
    return chosen, signs
