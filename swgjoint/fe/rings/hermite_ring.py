r"""Closed elastic ring of Hermite cubics with large rotations and small strains.

The coordinates of a node are its position and the derivative of the position with
respect to the element parameter. The mean line is therefore smooth, and a force may act
anywhere on it. The strain energy is

.. math:: U = \int \tfrac12 EA\,\varepsilon^2
    + \tfrac12 EI\,(\vartheta' - \vartheta_0')^2\,ds, \quad
    \varepsilon = |r'| - |r_0'|, \quad \vartheta' = \frac{r' \times r''}{|r'|^2},

where primes denote derivatives with respect to the arc length s of the undeformed ring,
the index 0 denotes the undeformed ring, and :math:`\vartheta` is the angle of the
tangent. Rotations are exact; the strain of a section is linear in the distance from the
mean line.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
GAUSS = 0.5 * (_POINTS + 1.0), 0.5 * _WEIGHTS
"""Gauss points and weights on an element [-]. They suffice because the bending of an
element is linear and its stretch nearly constant."""
_CROSS = np.array([[0.0, 1.0], [-1.0, 0.0]])  # v x w = v . (_CROSS w)


_CUBICS = np.array(
    [[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], dtype=np.float64
)
"""Coefficients of the four shape functions by power of the parameter."""
_POWERS = np.arange(1.0, 4.0)
_SLOPES = np.pad(_CUBICS[:, 1:] * _POWERS, ((0, 0), (0, 1)))
_BENDS = np.pad(_SLOPES[:, 1:] * _POWERS, ((0, 0), (0, 1)))
_SHAPES = np.concatenate([_CUBICS, _SLOPES, _BENDS]).T
"""Coefficients of shape functions, first and second derivatives (4, 12)."""


def hermite(xi: Array) -> tuple[Array, Array, Array]:
    """Shape functions and first two derivatives at parameters (...), each (..., 4)."""
    value, first, second = np.moveaxis(_shapes(xi), -2, 0)
    return value, first, second


def _shapes(xi: Array) -> Array:
    """Shape functions and first two derivatives at parameters (...), (..., 3, 4)."""
    powers = np.empty((*xi.shape, 4))
    powers[..., 0] = 1.0
    powers[..., 1] = xi
    powers[..., 2] = xi * xi
    powers[..., 3] = powers[..., 2] * xi
    return np.asarray(powers @ _SHAPES).reshape(*xi.shape, 3, 4)


_GAUSS_SHAPES = np.ascontiguousarray(_shapes(GAUSS[0])[:, 1:])
"""First two derivatives of the shape functions at the Gauss points (3, 2, 4)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HermiteRing:
    """Elastic ring about the origin.

    Node 0 is on the positive y axis, and the others follow counter-clockwise. The
    coordinates form an array (elements, 2, 2) whose axes are the node, position or
    derivative, and x or y. Arguments ``q`` contain them flattened (size,).
    """

    radius: float
    """Radius of the undeformed mean line [m]."""
    elements: int
    """Number of elements, equal to the number of nodes."""
    stretching: float
    """Axial stiffness E A [N]."""
    bending: float
    """Bending stiffness E I [N·m^2]."""

    @property
    def step(self) -> float:
        """Arc length of an element [m]."""
        return 2.0 * pi * self.radius / self.elements

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return 4 * self.elements

    @cached_property
    def reference(self) -> Array:
        """Coordinates of the undeformed ring (elements, 2, 2) [m]."""
        phi = 2.0 * pi / self.elements * np.arange(self.elements)
        outward = np.stack([-np.sin(phi), np.cos(phi)], -1)
        along = np.stack([-np.cos(phi), -np.sin(phi)], -1)
        return np.stack([self.radius * outward, self.step * along], axis=1)

    def two_lobes(self, height: float, angle: ArrayLike, major: float) -> Array:
        """Coordinates of nodes on a ring that two lobes deflect (n, 2, 2) [m].

        To first order the ring is not stretched: at the angle phi from the major axis
        the displacement is w0 cos 2 phi outwards and -w0/2 sin 2 phi counter-clockwise.

        Args:
            height: Deflection w0 at the major axis [m].
            angle: Angles of the undeformed nodes from +y (n,) [rad].
            major: Angle of the major axis from +y [rad].
        """
        angle = np.asarray(angle, dtype=np.float64)
        r, w0, wave = self.radius, height, 2.0 * (angle - major)
        outward = np.stack([-np.sin(angle), np.cos(angle)], -1)
        along = np.stack([-np.cos(angle), -np.sin(angle)], -1)
        w, v = w0 * np.cos(wave)[:, None], -0.5 * w0 * np.sin(wave)[:, None]
        place = (r + w) * outward + v * along
        # d/dphi: w' - v outwards, r + w + v' along
        dw, dv = -2.0 * w0 * np.sin(wave)[:, None], -w0 * np.cos(wave)[:, None]
        slope = (r + w + dv) * along + (dw - v) * outward
        return np.stack([place, slope * (2.0 * pi / self.elements)], axis=1)

    @cached_property
    def dofs(self) -> Index:
        """Degrees of freedom of every element (elements, 8)."""
        first = 4 * np.arange(self.elements)[:, None] + np.arange(4)
        return np.concatenate([first, np.roll(first, -1, axis=0)], axis=1)

    def nodal(self, q: Array) -> Array:
        """Coordinates of the two nodes of every element (elements, 4, 2) [m]."""
        x = q.reshape(self.elements, 2, 2)
        return np.concatenate([x, np.concatenate([x[1:], x[:1]])], axis=1)

    def evaluate_at(
        self, q: Array, place: Array, own: Index | None = None
    ) -> tuple[Array, Array, Array]:
        """Position and its first two derivatives by element parameter, each (n, 2) [m].

        Args:
            q: Coordinates of the ring (size,) [m].
            place: Element number plus parameter, any number of turns (n,).
            own: Elements whose cubics are extended, see :meth:`split` (n,).
        """
        element, xi = self.split(place, own)
        value, first, second = (_shapes(xi) @ self.nodal(q)[element]).swapaxes(0, 1)
        return value, first, second

    def split(self, place: Array, own: Index | None = None) -> tuple[Index, Array]:
        """Element numbers and parameters of positions along the ring, each (n,).

        Args:
            place: Element number plus parameter, any number of turns (n,).
            own: Elements whose cubics are extended to positions beyond their ends (n,);
                None for the elements that contain the positions.
        """
        if own is not None:
            return own, place - own
        whole = np.floor(place)
        return np.mod(whole, self.elements).astype(np.int64), place - whole

    @cached_property
    def _shape(self) -> Array:
        """First two derivatives of the position at the Gauss points, by coordinates.

        Shape (3, 4, 8).
        """
        return np.asarray(np.kron(_GAUSS_SHAPES, np.eye(2)), np.float64)

    def _strains(self, q: Array) -> tuple[Array, ...]:
        """First two derivatives, length, stretch and curvature at all Gauss points."""
        local = self.nodal(q).reshape(self.elements, 8)
        both = local @ self._shape.reshape(-1, 8).T
        both = both.reshape(self.elements, -1, 2, 2)
        v, w = both.transpose(2, 0, 1, 3)
        length = np.hypot(v[..., 0], v[..., 1])
        cross = v[..., 0] * w[..., 1] - v[..., 1] * w[..., 0]
        return both, length, length / self.step, cross / length**2 / self.step

    @cached_property
    def _unstrained(self) -> tuple[Array, Array]:
        """Stretch [-] and curvature [1/m] of the undeformed ring (elements, 3)."""
        *_, stretch, turning = self._strains(self.reference)
        return stretch, turning

    def strains(self, q: Array) -> tuple[Array, Array]:
        """Stretch [-] and change of curvature [1/m] amid the elements (elements,)."""
        middle = len(GAUSS[0]) // 2
        *_, stretch, turning = self._strains(q)
        stretch0, turning0 = self._unstrained
        return (stretch - stretch0)[:, middle], (turning - turning0)[:, middle]

    def energy(self, q: Array) -> float:
        """Strain energy [J]."""
        *_, stretch, turning = self._strains(q)
        return self._energy(stretch, turning)

    def _energy(self, stretch: Array, turning: Array) -> float:
        """Strain energy of stretches and curvatures at the Gauss points [J]."""
        stretch0, turning0 = self._unstrained
        density = self.stretching * (stretch - stretch0) ** 2
        density += self.bending * (turning - turning0) ** 2
        return float(0.5 * self.step * (density @ GAUSS[1]).sum())

    def forces(self, q: Array) -> tuple[float, Array, Array]:
        """Energy [J], its gradient (size,) [N] and Hessians (elements, 8, 8) [N/m]."""
        both, length, stretch, turning = self._strains(q)
        stretch0, turning0 = self._unstrained
        weight = self.step * GAUSS[1]
        hoop = weight * self.stretching * (stretch - stretch0)
        moment = weight * self.bending * (turning - turning0)
        if (native := kernels()) is not None:
            stiffness = np.stack([weight * self.stretching, weight * self.bending])
            element = np.empty((self.elements, 8))
            matrix = np.empty((self.elements, 8, 8))
            native.ring_forces(
                *(self.step, stiffness, _GAUSS_SHAPES, both, hoop, moment, turning),
                *(element, matrix),
            )
        else:
            element, matrix = self._parts(both, length, turning, hoop, moment)
        gradient = np.zeros(self.size)
        gradient += np.bincount(self.dofs.ravel(), element.ravel(), self.size)
        return self._energy(stretch, turning), gradient, matrix

    def _parts(
        self, both: Array, length: Array, turning: Array, hoop: Array, moment: Array
    ) -> tuple[Array, Array]:
        """Gradients (elements, 8) and Hessians (elements, 8, 8) of the elements.

        Args:
            both: First two derivatives of the position by the element parameter at the
                Gauss points (elements, 3, 2, 2) [m].
            length: Length of the first derivative (elements, 3) [m].
            turning: Curvature (elements, 3) [1/m].
            hoop: Derivative of the energy by the stretch (elements, 3) [J].
            moment: Derivative of the energy by the curvature (elements, 3) [J·m].
        """
        v, w = both.transpose(2, 0, 1, 3)
        h, weight, square = self.step, self.step * GAUSS[1], length**2

        # gradients of stretch and curvature with respect to (v, w)
        by_v = np.stack([w[..., 1], -w[..., 0]], axis=-1)  # of v x w
        by_w = np.stack([-v[..., 1], v[..., 0]], axis=-1)
        grad = np.zeros((*length.shape, 2, 4))
        s, k = grad[..., 0, :], grad[..., 1, :]
        s[..., :2] = v / (h * length)[..., None]
        k[..., :2] = (by_v / h - (2.0 * turning)[..., None] * v) / square[..., None]
        k[..., 2:] = by_w / (h * square)[..., None]

        # second derivatives of the stretch, then of the curvature
        twice = moment / (h * square)
        of_stretch = hoop / (h * length)
        along = 4.0 * moment * turning / square - 0.5 * of_stretch
        across = along[..., None] * v / square[..., None]
        across -= (2.0 * twice / square)[..., None] * by_v
        hess = np.zeros((*length.shape, 4, 4))
        vv = across[..., :, None] * v[..., None, :]
        hess[..., :2, :2] = vv + np.swapaxes(vv, -1, -2)
        diagonal = of_stretch - 2.0 * moment * turning / square
        hess[..., 0, 0] += diagonal
        hess[..., 1, 1] += diagonal
        vw = (-2.0 * twice / square)[..., None, None] * v[..., :, None]
        vw = vw * by_w[..., None, :] + twice[..., None, None] * _CROSS
        hess[..., :2, 2:] = vw
        hess[..., 2:, :2] = np.swapaxes(vw, -1, -2)

        stiffness = np.array([self.stretching, self.bending])
        scaled = (weight[:, None] * stiffness)[..., None] * grad
        hess += np.swapaxes(grad, -1, -2) @ scaled
        force = hoop[..., None] * s + moment[..., None] * k

        element = force.reshape(self.elements, -1) @ self._shape.reshape(-1, 8)
        by_dofs = (hess @ self._shape).reshape(self.elements, -1, 8)
        matrix = self._shape.reshape(-1, 8).T @ by_dofs
        return element, matrix

    def nearest(
        self, q: Array, points: Array, start: Array, own: Index | None = None
    ) -> Array:
        """Feet of the perpendiculars from points, element number plus parameter (n,).

        Args:
            q: Coordinates of the ring (size,) [m].
            points: The points (n, 2) [m].
            start: Initial guess of the feet, element number plus parameter (n,).
            own: Elements whose cubics are extended, see :meth:`split` (n,).
        """
        place, nodal = start, self.nodal(q)
        for _ in range(6):
            element, xi = self.split(place, own)
            r, v, w = (_shapes(xi) @ nodal[element]).swapaxes(0, 1)
            rest = points - r
            slope = np.einsum("ni,ni->n", rest, v)
            gain = np.einsum("ni,ni->n", v, v) - np.einsum("ni,ni->n", rest, w)
            step = slope / gain
            place = place + np.clip(step, -2.0, 2.0)
            if np.abs(step).max(initial=0.0) < 1e-10:
                break
        return place
