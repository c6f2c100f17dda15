"""Block-circulant compliance of the teeth of a ring: one block per tooth offset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index

LARGE = 200
"""Number of degrees of freedom of a flank from which the matrix products of BLAS are
faster than the compiled loops. With the 924 of size-25-100 in 3D they take half of the
time."""

ROUNDING = 1e-14
"""Singular value, divided by the largest, below which a shape is rounding error [-]."""


@dataclass(frozen=True, eq=False)
class SharedShapes:
    """Response of teeth to flank forces, in shapes that the far teeth share.

    A loaded tooth moves the others only through the faces between their sectors. With
    a displacement at n_f degrees of freedom of each of the two faces, the flanks of an
    unloaded tooth take 2 n_f shapes, whichever tooth is loaded. By reciprocity, forces
    on a flank move other teeth only by their work in these shapes.
    """

    own: Array
    """Displacement of a tooth per force on itself (n_b, n_b) [m/N]."""
    shapes: Array
    """Orthonormal shapes of the unloaded flanks (n_b, n_s) [-]."""
    offsets: Index
    """Offsets of the unloaded teeth from the loaded one (n_far,)."""
    far: Array
    """Their blocks in these shapes (n_far, n_s, n_s) [m/N]."""

    @classmethod
    def from_blocks(cls, offsets: Index, blocks: Array) -> SharedShapes:
        """Find the shapes that the blocks of a ring share.

        Args:
            offsets: Offsets as in :func:`respond`, each with the opposite one
                (n_offsets,).
            blocks: Displacements of one flank per force on another (n_offsets, n_b,
                n_b) [m/N].
        """
        away = offsets != 0
        beside = np.moveaxis(blocks[away], 0, 1).reshape(blocks.shape[1], -1)
        shapes, size, _ = np.linalg.svd(beside, full_matrices=False)
        shapes = shapes[:, size > ROUNDING * size.max(initial=0.0)]
        far = shapes.T @ blocks[away] @ shapes
        return cls(blocks[~away].sum(axis=0), shapes, offsets[away], far)

    def respond(self, force: Array) -> Array:
        """Displacements of all teeth, as :func:`respond` of all blocks.

        Args:
            force: Flank forces (N, n_b) [N].

        Returns:
            Displacements (N, n_b) [m].
        """
        beside = respond(self.offsets, self.far, force @ self.shapes)
        return np.asarray(force @ self.own.T + beside @ self.shapes.T)


def respond(offsets: Index, blocks: Array, force: Array) -> Array:
    """Displacements of all teeth under forces on their flanks.

    Args:
        offsets: Offsets k - j of the responding tooth k from the loaded tooth j
            (n_offsets,).
        blocks: Displacements of the responding tooth per force on the loaded one, in
            the frames of the teeth (n_offsets, n_rows, n_b) [m/N].
        force: Forces at the n_b degrees of freedom of the flanks of every tooth
            (N, n_b) [N].

    Returns:
        Displacements (N, n_rows) [m].
    """
    result = np.zeros((len(force), blocks.shape[1]))
    native = kernels()
    if native is not None and blocks.shape[2] < LARGE:
        native.respond(
            np.ascontiguousarray(offsets),
            np.ascontiguousarray(blocks),
            np.ascontiguousarray(force),
            result,
        )
        return result
    loaded = np.flatnonzero(force.any(axis=1))
    push = force[loaded]
    for offset, block in zip(offsets, blocks, strict=True):
        # the loaded sectors differ, and so do those at one offset from them
        result[(loaded + offset) % len(force)] += push @ block.T
    return result


def contact_compliance(
    offsets: Index,
    blocks: Array,
    tooth: Index,
    weight: Array,
    teeth: int,
    sides: Sequence[tuple[Index, Array]] = (),
) -> Array:
    """Compliance between contact points.

    Args:
        offsets: Offsets of the teeth as in :func:`respond`, each with the opposite one
            (n_offsets,).
        blocks: Displacements of one flank per force on another (n_offsets, n_b, n_b)
            [m/N]; by reciprocity, the block of the opposite offset is the transpose.
        tooth: Tooth of each point (n,).
        weight: Derivative of each gap with respect to the flank displacements (n, n_b)
            [-].
        teeth: Number of teeth in the model.
        sides: Sets of degrees of freedom that no point shares, with their rows of the
            blocks; a point then takes part of the operations. None for one set.

    Returns:
        Compliance matrix (n, n) [m/N].
    """
    native = kernels()
    if native is not None and blocks.shape[1] < LARGE:
        # half a model has two offsets of the whole circle in one
        block_of, after = np.full(teeth, -1), np.full(len(offsets), -1)
        for k in reversed(range(len(offsets))):
            at = offsets[k] % teeth
            block_of[at], after[k] = k, block_of[at]
        result = np.empty((len(tooth), len(tooth)))
        native.contact_compliance(
            block_of,
            after,
            blocks,
            np.ascontiguousarray(tooth),
            np.ascontiguousarray(weight),
            result,
        )
        return result
    apart = (tooth[:, None] - tooth[None, :]) % teeth
    result = np.zeros((len(tooth), len(tooth)))
    for rows, part in sides or [(np.arange(blocks.shape[1]), blocks)]:
        own = weight[:, rows]
        has = np.asarray(own.any(axis=1), dtype=bool)
        for offset, block in zip(offsets, part, strict=True):
            if offset < 0:
                continue  # added as the transpose of the opposite offset
            pairs = apart == offset % teeth
            pairs[~has] = False
            responds = np.flatnonzero(pairs.any(axis=1))
            added = np.where(pairs[responds], own[responds] @ block @ weight.T, 0.0)
            result[responds] += added
            if offset > 0:
                result[:, responds] += added.T
    return result
