"""Vertices of the gap between bore and wave generator over the face width."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.solid.across import FLAT, WIDE, crown_bend, vertices
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.typing import Array, Mask


def find_vertices(
    model: SolidSectorModel, gap: Array, shared: Mask, kept: Mask | None
) -> tuple[Array, Mask, Array, Mask]:
    """Vertices of the gap along the axis.

    Args:
        model: The 3D model.
        gap: Gaps of the bore nodes (N, b) [m].
        shared: Mask of the lines whose contact is shared by several planes (N, L).
        kept: Mask of the lines whose contact remains so, see
            :func:`swgjoint.fe.solid.linearise.linearise` (N, L).

    Returns:
        Weights of the bore nodes in the gaps at the vertices and in the slopes there
        (N, 2 L, b); mask of the lines that have a vertex (N, L); second derivative of
        the gap at the vertex by the plane number (N, L) [m]; mask of the nodes that the
        vertices replace (N, b).
    """
    n, b = gap.shape
    planes = model.strip.planes
    lines = b // planes
    crown = crown_bend(model.wave_generator.crowning, model.strip.mesh.teeth.z)

    def over(nodal: NDArray[Any]) -> NDArray[Any]:
        return nodal.reshape(n, planes, lines).transpose(1, 0, 2).reshape(planes, -1)

    flat = np.full(n * lines, crown * FLAT if crown else inf)
    # lines with a shared contact need a larger bend before they get a vertex
    flat[shared.ravel()] *= WIDE
    flat[shared.ravel() & (True if kept is None else kept.ravel())] = inf
    seen = vertices(over(gap), flat)
    if model.race is not None:  # no vertex outside the width of the race
        beside = ~model.race.covers(model.strip.mesh.teeth.z @ seen.weight)
        seen.found[beside], seen.covered[:, beside] = False, False
    means = np.zeros((n, 2, lines, planes, lines))
    line = np.arange(lines)
    for k, weight in enumerate((seen.weight, seen.slope)):
        spread = weight.reshape(planes, n, lines).transpose(2, 1, 0)
        means[:, k, line, :, line] = spread
    return (
        means.reshape(n, 2 * lines, b),
        seen.found.reshape(n, lines),
        seen.bend.reshape(n, lines),
        seen.covered.reshape(planes, n, lines).transpose(1, 0, 2).reshape(n, b),
    )
