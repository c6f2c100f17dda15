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

from swgjoint.typing import Array, Index

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
GAUSS = 0.5 * (_POINTS + 1.0), 0.5 * _WEIGHTS
"""Gauss points and weights on an element [-]. They suffice because the bending of an
element is linear and its stretch nearly constant."""
_EYE = np.eye(2)
_CROSS = np.array([[0.0, 1.0], [-1.0, 0.0]])  # v x w = v . (_CROSS w)


def hermite(xi: Array) -> tuple[Array, Array, Array]:
    """Shape functions and first two derivatives at parameters (n,), each (n, 4)."""
    x, one = xi, np.ones_like(xi)
    value = [
        1 - 3 * x**2 + 2 * x**3,
        x - 2 * x**2 + x**3,
        3 * x**2 - 2 * x**3,
        x**3 - x**2,
    ]
    first = [
        6 * x**2 - 6 * x,
        1 - 4 * x + 3 * x**2,
        6 * x - 6 * x**2,
        3 * x**2 - 2 * x,
    ]
    second = [12 * x - 6 * one, 6 * x - 4 * one, 6 * one - 12 * x, 6 * x - 2 * one]
    return np.stack(value, -1), np.stack(first, -1), np.stack(second, -1)


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
        return np.concatenate([x, np.roll(x, -1, axis=0)], axis=1)

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
        local = self.nodal(q)[element]
        value, first, second = (np.einsum("na,nai->ni", h, local) for h in hermite(xi))
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
    def _shape(self) -> tuple[Array, Array]:
        """Both derivatives of the shape functions at the Gauss points, each (3, 4)."""
        _, first, second = hermite(GAUSS[0])
        return first, second

    def _strains(self, q: Array) -> tuple[Array, ...]:
        """Both derivatives, length, stretch and curvature at all Gauss points."""
        first, second = self._shape
        local = self.nodal(q)
        v = np.einsum("ga,eai->egi", first, local)
        w = np.einsum("ga,eai->egi", second, local)
        length = np.hypot(v[..., 0], v[..., 1])
        cross = v[..., 0] * w[..., 1] - v[..., 1] * w[..., 0]
        return v, w, length, length / self.step, cross / length**2 / self.step

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
        stretch0, turning0 = self._unstrained
        density = self.stretching * (stretch - stretch0) ** 2
        density += self.bending * (turning - turning0) ** 2
        return float(0.5 * self.step * (density @ GAUSS[1]).sum())

    def forces(self, q: Array) -> tuple[Array, Array]:
        """Gradient of the energy (size,) [N] and Hessians (elements, 8, 8) [N/m]."""
        v, w, length, stretch, turning = self._strains(q)
        stretch0, turning0 = self._unstrained
        h = self.step
        hoop = self.stretching * (stretch - stretch0)
        moment = self.bending * (turning - turning0)
        weight = h * GAUSS[1]

        unit = v / length[..., None]
        square = length**2
        turn_w = w @ _CROSS.T  # derivative of v x w with respect to v
        turn_v = -v @ _CROSS.T  # derivative with respect to w
        cross = turning * square * h
        d_v = (turn_w - (2.0 * cross / square)[..., None] * v) / square[..., None] / h
        d_w = turn_v / square[..., None] / h
        # gradients of stretch and curvature with respect to (v, w)
        s = np.concatenate([unit / h, np.zeros_like(unit)], axis=-1)
        k = np.concatenate([d_v, d_w], axis=-1)
        grad = hoop[..., None] * s + moment[..., None] * k

        def outer(a: Array, b: Array) -> Array:
            return np.asarray(a[..., :, None] * b[..., None, :])

        def scaled(matrix: Array, by: Array) -> Array:
            return np.asarray(matrix * by[..., None, None])

        hess = self.stretching * outer(s, s) + self.bending * outer(k, k)
        eye = np.broadcast_to(_EYE, (*length.shape, 2, 2))
        hess[..., :2, :2] += scaled(eye - outer(unit, unit), hoop / length / h)
        mixed = outer(turn_w, v)
        mixed = mixed + np.swapaxes(mixed, -1, -2)
        vv = -scaled(mixed, 2.0 / square**2) - scaled(eye, 2.0 * cross / square**2)
        vv += scaled(outer(v, v), 8.0 * cross / square**3)
        vw = scaled(np.broadcast_to(_CROSS, eye.shape), 1.0 / square)
        vw -= scaled(outer(v, turn_v), 2.0 / square**2)
        hess[..., :2, :2] += scaled(vv, moment / h)
        hess[..., :2, 2:] += scaled(vw, moment / h)
        hess[..., 2:, :2] += np.swapaxes(scaled(vw, moment / h), -1, -2)

        first, second = self._shape
        both = np.stack([first, second], axis=1)  # (g, 2, 4)
        grad = grad.reshape(*length.shape, 2, 2)
        element = np.einsum("g,gpa,egpi->eai", weight, both, grad, optimize=True)
        gradient = np.zeros(self.size)
        np.add.at(gradient, self.dofs, element.reshape(self.elements, 8))
        hess = hess.reshape(*length.shape, 2, 2, 2, 2)
        matrix = np.einsum(
            "g,gpa,egpiqj,gqb->eaibj", weight, both, hess, both, optimize=True
        )
        return gradient, matrix.reshape(self.elements, 8, 8)

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
        place = start
        for _ in range(6):
            r, v, w = self.evaluate_at(q, place, own)
            rest = points - r
            slope = np.einsum("ni,ni->n", rest, v)
            gain = np.einsum("ni,ni->n", v, v) - np.einsum("ni,ni->n", rest, w)
            step = slope / gain
            place = place + np.clip(step, -2.0, 2.0)
            if np.abs(step).max(initial=0.0) < 1e-10:
                break
        return place
