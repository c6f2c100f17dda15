"""Compliance of the teeth of a ring: blocks that depend on the offset of the teeth."""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array, Index


def respond(offsets: Index, blocks: Array, force: Array) -> Array:
    """Displacement of all teeth (N, n_rows) [m].

    Args:
        offsets: k - j of the responding and the loaded tooth (n_offsets,).
        blocks: Response in the frames of the teeth (n_offsets, n_rows, n_b) [m/N].
        force: On the flanks of every tooth (N, n_b) [N].
    """
    result = np.zeros((len(force), blocks.shape[1]))
    loaded = np.flatnonzero(force.any(axis=1))
    for offset, block in zip(offsets, blocks, strict=True):
        result[(loaded + offset) % len(force)] += force[loaded] @ block.T
    return result


def contact_compliance(
    offsets: Index, blocks: Array, tooth: Index, weight: Array, teeth: int
) -> Array:
    """Compliance between contact points (n, n) [m/N].

    Args:
        offsets: As in :func:`respond`.
        blocks: Of the flanks (n_offsets, n_b, n_b) [m/N].
        tooth: Tooth of each point (n,).
        weight: Derivative of its gap by the flank displacement (n, n_b).
        teeth: Teeth in the model.
    """
    apart = (tooth[:, None] - tooth[None, :]) % teeth
    result = np.zeros((len(tooth), len(tooth)))
    for offset, block in zip(offsets, blocks, strict=True):
        i, j = np.nonzero(apart == offset % teeth)
        if i.size:
            # few pairs are that far apart: no products of all points
            result[i, j] += np.einsum("kb,kb->k", weight[i] @ block, weight[j])
    return result
