"""Matrices of the sectors of a ring, assembled one at a time.

A sector has about 500 degrees of freedom, but its segments and contacts couple at most
200 of them. The matrix of one sector fits in the cache of a processor; those of all
sectors do not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorMatrices:
    """Symmetric matrices of N sectors as sums of smaller ones."""

    size: int
    """Number of degrees of freedom of a sector, n."""
    terms: tuple[tuple[Index, Array], ...]
    """Degrees of freedom (k,) and matrices over them (N, k, k), at least one pair."""

    def __len__(self) -> int:
        return len(self.terms[0][1])

    def __getitem__(self, sector: int) -> Array:
        """Matrix of a sector (n, n), a new array."""
        matrix = np.zeros(self.size**2)
        for place, (_, blocks) in zip(self._places, self.terms, strict=True):
            matrix[place] += blocks[sector].ravel()
        return matrix.reshape(self.size, self.size)

    def __iter__(self) -> Iterator[Array]:
        return (self[sector] for sector in range(len(self)))

    @cached_property
    def _places(self) -> list[Index]:
        """Place of each entry of the terms in a flattened matrix (k^2,).

        One addition per term takes half of the time of additions to its parts.
        """
        return [(dofs[:, None] * self.size + dofs).ravel() for dofs, _ in self.terms]

    def columns(self, dofs: Index) -> Array:
        """Columns of the matrices (N, n, h).

        Args:
            dofs: Degrees of freedom of the columns, all different (h,).
        """
        found = np.zeros((len(self), self.size, len(dofs)))
        for own, blocks in self.terms:
            _, of_block, of_column = np.intersect1d(own, dofs, return_indices=True)
            if len(of_block):
                found[:, own[:, None], of_column] += blocks[:, :, of_block]
        return found

    @property
    def mean_diagonal(self) -> float:
        """Mean of the diagonals of all matrices."""
        total = sum(float(np.einsum("sii->", blocks)) for _, blocks in self.terms)
        return total / (len(self) * self.size)
