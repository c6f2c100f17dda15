"""Sum of the energies of many small parts, and its banded tangent."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_banded

from swgjoint.typing import Array, Index


class BandedAssembly:
    """Energy, gradient and Hessian of many small parts."""

    def __init__(self, size: int) -> None:
        self.energy = 0.0
        self.gradient = np.zeros(size)
        self._parts: list[tuple[str, Index, Array]] = []

    def add(
        self, name: str, dofs: Index, gradient: Array | None, hessian: Array
    ) -> None:
        """Parts with degrees of freedom (n, m), gradients (n, m), Hessians (n, m, m).

        The gradient is None where it has been counted.
        """
        if gradient is not None:
            self.gradient += np.bincount(
                dofs.ravel(), gradient.ravel(), len(self.gradient)
            )
        self._parts.append((name, dofs, hessian))

    def shares(self, way: Array) -> dict[str, float]:
        """Energy of the tangent along a displacement, twice, by part."""
        found: dict[str, float] = {}
        for name, dofs, hessian in self._parts:
            moved = way[dofs]
            value = float(np.einsum("ni,nij,nj->", moved, hessian, moved))
            found[name] = found.get(name, 0.0) + value
        return found

    def solve(self, order: Index, held: int, right: Array, anchor: float) -> Array:
        """Solve with one coordinate held and a part of the diagonal added.

        Args:
            order: Place of every coordinate in a narrow band.
            held: The coordinate that is held.
            right: Right-hand sides (size, n).
            anchor: Part of the largest diagonal entry.
        """
        size = len(order)
        rows, columns, values = [], [], []
        for _, dofs, hessian in self._parts:
            place, m = order[dofs], dofs.shape[1]
            rows.append(np.repeat(place, m, axis=1).ravel())
            columns.append(np.tile(place, (1, m)).ravel())
            values.append(hessian.ravel())
        row, column = np.concatenate(rows), np.concatenate(columns)
        band = int(np.abs(row - column).max())
        flat = (band + row - column) * size + column
        matrix = np.bincount(
            flat, np.concatenate(values), (2 * band + 1) * size
        ).reshape(2 * band + 1, size)
        largest = float(np.abs(matrix[band]).max())
        matrix[band] += anchor * largest
        # a spring far stiffer than anything else
        matrix[band, order[held]] += 1e6 * largest
        shuffled = np.empty_like(right)
        shuffled[order] = right
        solved = solve_banded((band, band), matrix, shuffled, check_finite=False)
        return np.asarray(solved[order])
