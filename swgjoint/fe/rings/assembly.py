"""Sum of the potentials of many small parts, with its banded tangent."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_banded

from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index


class BandedAssembly:
    """Energy [J], gradient [N] and Hessian of the potential of many small parts."""

    def __init__(self, size: int) -> None:
        self.energy = 0.0
        self.gradient = np.zeros(size)
        self._parts: list[tuple[str, Index, Array]] = []

    def add(
        self, name: str, dofs: Index, gradient: Array | None, hessian: Array
    ) -> None:
        """Add the gradients and Hessians of n parts.

        Args:
            name: Name under which :meth:`shares` sums the parts.
            dofs: Degrees of freedom of the parts (n, m).
            gradient: Gradients (n, m) [N]; None if ``self.gradient`` already contains
                them.
            hessian: Hessians (n, m, m) [N/m].
        """
        if gradient is not None:
            self.gradient += np.bincount(
                dofs.ravel(), gradient.ravel(), len(self.gradient)
            )
        self._parts.append((name, dofs, hessian))

    def shares(self, way: Array) -> dict[str, float]:
        """Twice the tangent strain energy of a displacement, by name of the part [J].

        Args:
            way: Displacement of all degrees of freedom (size,) [m].
        """
        energies: dict[str, float] = {}
        for name, dofs, hessian in self._parts:
            moved = way[dofs]
            value = float(np.einsum("ni,nij,nj->", moved, hessian, moved))
            energies[name] = energies.get(name, 0.0) + value
        return energies

    def solve(self, order: Index, held: int, right: Array, anchor: float) -> Array:
        """Solutions with one coordinate fixed and an addition to the diagonal.

        Args:
            order: Position of every coordinate in an order of narrow bandwidth (size,).
            held: Number of the fixed coordinate.
            right: Right-hand sides (size, n) [N].
            anchor: Addition to the diagonal, relative to its largest entry [-].

        Returns:
            Solutions (size, n) [m].
        """
        size = len(order)
        places = [order[dofs] for _, dofs, _ in self._parts]
        # numpy finds the largest of many rows in a tenth of the time by columns
        columns = [place.T.copy() for place in places]
        band = max(int((c.max(0) - c.min(0)).max(initial=0)) for c in columns)
        shuffled = np.empty_like(right)
        shuffled[order] = right
        # a stable equilibrium has a positive definite matrix; on the way to it the
        # matrix may be indefinite
        if kernels() is not None:
            loads = shuffled.copy()
            if self._solve_definite(places, band, int(order[held]), loads, anchor):
                return loads[order]
        # row i of column j is entry (band + i - j, j) of the banded matrix
        flat = np.concatenate(
            [
                ((band + p) * size)[:, :, None] + (p * (1 - size))[:, None, :]
                for p in places
            ],
            axis=None,
        )
        values = [hessian.ravel() for _, _, hessian in self._parts]
        matrix = np.bincount(
            flat, np.concatenate(values), (2 * band + 1) * size
        ).reshape(2 * band + 1, size)
        largest = float(np.abs(matrix[band]).max())
        matrix[band] += anchor * largest
        # a spring far stiffer than anything else
        matrix[band, order[held]] += 1e6 * largest
        solved = solve_banded((band, band), matrix, shuffled, check_finite=False)
        return np.asarray(solved[order])

    def _solve_definite(
        self, places: list[Index], band: int, held: int, loads: Array, anchor: float
    ) -> bool:
        """Replace loads in the order of narrow bandwidth by the solutions.

        Args:
            places: Positions of the coordinates of all parts in this order.
            band: Largest distance of two coordinates of a part.
            held: Position of the fixed coordinate.
            loads: Right-hand sides (size, n) [N], solutions on return [m].
            anchor: Addition to the diagonal, relative to its largest entry [-].

        Returns:
            False if the matrix is not positive definite.
        """
        native = kernels()
        assert native is not None
        columns = np.zeros((len(loads), band + 1))
        for place, (_, _, hessian) in zip(places, self._parts, strict=True):
            native.add_banded(place, np.ascontiguousarray(hessian), columns)
        largest = float(np.abs(columns[:, 0]).max())
        columns[:, 0] += anchor * largest
        columns[held, 0] += 1e6 * largest
        return bool(native.solve_banded(columns, loads))
