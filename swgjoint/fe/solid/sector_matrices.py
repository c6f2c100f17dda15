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

from swgjoint.typing import Array, Index, Mask


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


@dataclass(frozen=True, kw_only=True, eq=False)
class SupportedSectors:
    """Matrices of the sectors with some degrees of freedom prescribed."""

    matrices: SectorMatrices
    held: Index
    """Prescribed degrees of freedom of every sector (h,)."""
    fixed: Mask | None
    """Further ones of each sector (N, n); None without any."""
    sign: Array
    """Factors on the degrees of freedom of the face that closes the ring."""
    scale: float
    """Diagonal of the prescribed degrees of freedom [N/m]."""

    def __len__(self) -> int:
        return len(self.matrices)

    def __getitem__(self, sector: int) -> Array:
        """Matrix of a sector (n, n), a new array."""
        matrix, still = self.matrices[sector], self.held
        if self.fixed is not None:
            still = np.union1d(still, np.flatnonzero(self.fixed[sector]))
        matrix[still] = 0.0
        matrix[:, still] = 0.0
        matrix[still, still] = self.scale
        if sector == len(self) - 1:
            size = len(self.sign)
            matrix[-size:] *= self.sign[:, None]
            matrix[:, -size:] *= self.sign
        return matrix
