r"""The bearing of the wave generator in the 2D model: an outer race on balls.

The outer race supports the bore of the rim in place of a rigid surface. It is the
nonlinear ring of :mod:`swgjoint.fe.rings` and rests on balls with Hertz contact and
clearance, which sit on the cam. Every node of the bore makes unilateral contact with
the race through its outer half, which is t/2 thick for a race thickness t. With the
distance d of the node from the mean line of the race,

.. math:: g = d - \tfrac12 t, \quad U = \tfrac12 k\langle -g\rangle^2, \quad
    k = \frac{2 E b}{t}\,\ell

for a race of width b and Young's modulus E and for a node that represents a length
:math:`\ell` of the bore. The race turns with the flexspline, and the contact has no
friction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.fe.rings.facing import distances_to_ring
from swgjoint.fe.rings.race_on_balls import PressedBalls, RaceOnBalls, pressed_form
from swgjoint.gear.design.design import Design
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index, Mask

ELEMENTS = 190
"""Smallest number of elements of the race, eight per ball if there are 23 balls. The
position of a ball within its element then changes the torque by about 4e-5 of its
value, and by 1e-5 with twice as many elements."""
NODE = 4
"""Number of coordinates per race node: x and y of its position and of the derivative of
the position with respect to the element parameter."""
PRESSED = 1.01
"""Lobe height of the race at the start of a search divided by that on unloaded balls
[-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RaceForces:
    """Forces of race and balls at one state, for N sectors of m coordinates."""

    gradient: Array
    """Gradient of their energy (N, m) [N]."""
    hessian: Array
    """Second derivative of their energy (N, m, m) [N/m]."""
    fixed: Mask
    """Whether each coordinate is held (N, m)."""
    balls: PressedBalls
    """Contact of the balls of the whole drive."""
    energy: float
    """Energy of race and balls of the whole drive [J]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneRaceForces(RaceForces):
    """Forces of race, balls and bore contact.

    A sector has m = b + r coordinates: b of its bore nodes without the last corner,
    then r of its race nodes from the first to the last face, both included.
    """

    gap: Array
    """Gap of the bore nodes (N, b/2) [m]."""
    rows: Array
    """Derivative of the gap with respect to the coordinates (N, b/2, b + r) [-]."""
    normal: Array
    """Outward normal of the race at the bore nodes (N, b/2, 2)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneRace:
    """Outer race, balls and cam below the sectors of a 2D model.

    Coordinates have the shape (sectors, m, 2, 2) [m]. The axes are the sector, the race
    node counted from its first face, position or derivative, and x or y.
    """

    on_balls: RaceOnBalls
    """Race, balls and cam."""
    sectors: int
    """Number of sectors in the model."""
    per_sector: int
    """Number m of race elements per sector."""
    half: bool
    """Whether the model is half of the drive."""
    places: Array
    """Positions of the bore nodes of a sector on its undeformed race elements, from 0
    to m (b/2,) [-]."""
    press: Array
    """Contact stiffness k of these nodes (b/2,) [N/m]."""
    phase: float = 0.0
    """Angle of ball 0 from the major axis at alpha = 0 [rad]."""

    @classmethod
    def from_design(
        cls,
        design: Design,
        element: Superelement,
        *,
        half: bool,
        cage_held: bool = False,
        phase: float = 0.0,
        elements: int = ELEMENTS,
    ) -> PlaneRace:
        """Bearing of the wave generator of a design.

        Args:
            design: The drive.
            element: Condensed sector of its flexspline.
            half: Whether to model half of the drive.
            cage_held: Whether the cage is fixed to the cam, see
                :class:`swgjoint.fe.rings.race_on_balls.RaceOnBalls`.
            phase: Angle of ball 0 from the major axis at alpha = 0 [rad].
            elements: Smallest number of elements of the race.
        """
        teeth, size = element.sectors, element.face_size
        per_sector = -(-elements // teeth)
        on_balls = RaceOnBalls.from_design(design, teeth * per_sector)
        x = element.skeleton[np.r_[size - 1 : size + element.bore_size, -1]]
        apart = np.hypot(*np.diff(x, axis=0).T)
        # each node represents half of the interval on either side; a corner also
        # represents half of the last interval of the neighbouring sector
        length = 0.5 * (apart + np.roll(apart, 1))
        bearing = on_balls.bearing
        yielding = 0.5 * bearing.race_thickness / bearing.material.youngs_modulus
        angle = np.arctan2(-x[:-1, 0], x[:-1, 1])
        return cls(
            on_balls=replace(on_balls, cage_held=cage_held),
            sectors=teeth // (2 if half else 1),
            per_sector=per_sector,
            half=half,
            places=np.asarray((0.5 + angle * teeth / (2.0 * pi)) * per_sector),
            press=bearing.race_width / yielding * length,
            phase=phase,
        )

    @property
    def size(self) -> int:
        """Number r of coordinates of a sector's race nodes, with both faces."""
        return NODE * (self.per_sector + 1)

    @property
    def _pitch(self) -> float:
        """Angle of a sector [rad]."""
        return 2.0 * pi * self.per_sector / self.on_balls.race.elements

    @property
    def _turns(self) -> Array:
        """Angles of the sectors in the undeformed ring (N,) [rad]."""
        return self._pitch * np.arange(self.sectors, dtype=np.float64)

    @property
    def _outside(self) -> float:
        """Distance of the outside of the race from its mean line [m]."""
        return 0.5 * self.on_balls.bearing.race_thickness

    def initial_guess(self, alpha: float, rotation: float) -> Array:
        """Start of a search: a two-lobe race that presses on the balls at its lobes.

        Args:
            alpha: Wave-generator angle [rad].
            rotation: Rotation of race and flexspline [rad].

        Returns:
            Coordinates (sectors, m, 2, 2) [m].
        """
        balls, shape = self.on_balls, (self.sectors, self.per_sector, 2, 2)
        # deflection of the rim at a lobe plus the clearance between rim and race
        w0 = PRESSED * (balls.lobe_height + 0.5 * balls.bearing.fit_clearance)
        step = self._pitch / self.per_sector
        phi = step * np.arange(shape[0] * shape[1]) - 0.5 * self._pitch + rotation
        return balls.race.two_lobes(w0, phi, alpha).reshape(shape)

    @cached_property
    def _still(self) -> Array:
        """Undeformed coordinates of a sector in its tooth frame (m, 2, 2) [m]."""
        still = self.on_balls.race.reference[: self.per_sector]
        return rotate(still, -0.5 * self._pitch)

    def displacements(self, race: Array, rotation: float) -> Array:
        """Displacements of the race in the tooth frames of the rigidly turned rim.

        Args:
            race: Coordinates (sectors, m, 2, 2) [m].
            rotation: Rotation of the flexspline [rad].
        """
        angle = (self._turns + rotation)[:, None, None]
        return rotate(race, -angle) - self._still

    def coordinates(self, displaced: Array, rotation: float) -> Array:
        """Coordinates of the race from its displacements.

        Inverse of :meth:`displacements`.

        Args:
            displaced: Displacements in these tooth frames (sectors, m, 2, 2) [m].
            rotation: Rotation of the flexspline [rad].
        """
        angle = (self._turns + rotation)[:, None, None]
        return rotate(displaced + self._still, angle)

    def forces(
        self, race: Array, alpha: float, points: Array, touching: Mask
    ) -> PlaneRaceForces:
        """Forces and tangent of race, balls and bore contact.

        Args:
            race: Coordinates (N, m, 2, 2) [m].
            alpha: Wave-generator angle [rad].
            points: Bore nodes (N, b/2, 2) [m].
            touching: Whether each node is assumed in contact (N, b/2). Such a node
                pulls if it has lifted off, until the active set releases it.
        """
        on_balls, n, m = self.on_balls, self.sectors, self.per_sector
        ring, bore = on_balls.race, 2 * points.shape[1]
        flat = race.reshape(-1)
        q = np.concatenate([flat, -flat]) if self.half else flat
        gradient = np.zeros((n, bore + self.size))
        hessian = np.zeros((*gradient.shape, gradient.shape[1]))

        # forces of the elements of the race and of the balls below this part of it
        _, nodal, blocks = ring.forces(q)
        gradient[:, bore : bore + NODE * m] = nodal[: flat.size].reshape(n, -1)
        blocks = blocks[: n * m].reshape(n, m, 2 * NODE, 2 * NODE)
        for k in range(m):
            local = slice(bore + NODE * k, bore + NODE * (k + 2))
            hessian[:, local, local] += blocks[:, k]
        balls = on_balls.press_balls(q, alpha, self.phase, self._feet(race, alpha))
        on = np.flatnonzero(balls.overlap > 0.0)
        on = on[balls.seen.dofs[on, 0] < flat.size]
        near, force = balls.seen.chosen(on), balls.force[on]
        stiffness = 1.5 * on_balls.ball_constant * np.sqrt(balls.overlap[on])
        form = pressed_form(near, 3, force, stiffness)
        rows, under = near.by_ring, near.dofs[:, 0] // NODE
        sector, dofs = (under // m)[:, None], self._local(under, bore)
        np.add.at(gradient, (sector, dofs), -force[:, None] * rows[:, 0])
        bend = np.swapaxes(rows, 1, 2) @ form @ rows
        at = sector[:, :, None], dofs[:, :, None], dofs[:, None, :]
        np.add.at(hessian, at, bend)

        # contact of every bore node with the race element below it
        contact = self._numpy_contact
        if kernels() is not None:
            contact = self._compiled_contact
        gap, normal, gap_rows = contact(q, points, touching, gradient, hessian)
        pressed = 0.5 * float(np.sum(self.press * gap**2, where=touching))
        return PlaneRaceForces(
            gap=gap,
            rows=gap_rows,
            normal=normal,
            gradient=gradient,
            hessian=hessian,
            fixed=self._fixed(race, bore),
            balls=balls,
            energy=ring.energy(q)
            + balls.energy
            + pressed * (2.0 if self.half else 1.0),
        )

    def _local(self, element: Index, bore: int) -> Index:
        """Coordinates within their sector of the nodes of race elements (n, 8)."""
        first = bore + NODE * (element % self.per_sector)
        return np.asarray(first[:, None] + np.arange(2 * NODE))

    def _numpy_contact(
        self, q: Array, points: Array, touching: Mask, gradient: Array, hessian: Array
    ) -> tuple[Array, Array, Array]:
        """Contact of every bore node with the race element below it.

        Args:
            q: Coordinates of the whole race (size,) [m].
            points: Bore nodes (N, b/2, 2) [m].
            touching: Whether each node is assumed in contact (N, b/2).
            gradient: Gradient to add to (N, b + r) [N].
            hessian: Second derivative to add to (N, b + r, b + r) [N/m].

        Returns:
            Gap (N, b/2), normal (N, b/2, 2) and derivative of the gap, see
            :class:`PlaneRaceForces`.
        """
        n, m, width = self.sectors, self.per_sector, gradient.shape[1]
        first = np.minimum(self.places.astype(np.int64), m - 1)
        below = (m * np.arange(n)[:, None] + first).ravel()
        start = (m * np.arange(n)[:, None] + self.places).ravel()
        seen = distances_to_ring(
            self.on_balls.race,
            q,
            points.reshape(-1, 2),
            start,
            inside=False,
            own=below,
        )
        gap = seen.distance - self._outside
        k = np.where(touching, self.press, 0.0).ravel()
        force = -k * gap
        rows = np.zeros((len(gap), 3, 2 + 2 * NODE))
        rows[:, 0, :2], rows[:, 1, :2] = seen.normal, seen.tangent
        rows[:, :, 2:] = seen.by_ring
        node = np.tile(np.arange(points.shape[1]), n)
        local = self._local(below, 2 * points.shape[1])
        dofs = np.concatenate([2 * node[:, None] + np.arange(2), local], axis=1)
        bend = np.swapaxes(rows, 1, 2) @ pressed_form(seen, 3, force, k) @ rows
        row = width * (below // m)[:, None] + dofs
        _add(gradient, row, -force[:, None] * rows[:, 0])
        _add(hessian, width * row[:, :, None] + dofs[:, None, :], bend)
        gap_rows = np.zeros((len(gap), width))
        np.put_along_axis(gap_rows, dofs, rows[:, 0], axis=1)
        shape = points.shape[:2]
        return (
            gap.reshape(shape),
            seen.normal.reshape(points.shape),
            gap_rows.reshape(*shape, -1),
        )

    def _compiled_contact(
        self, q: Array, points: Array, touching: Mask, gradient: Array, hessian: Array
    ) -> tuple[Array, Array, Array]:
        """The same as :meth:`_numpy_contact` in a compiled loop."""
        native, shape = kernels(), points.shape[:2]
        assert native is not None
        gap, normal = np.empty(shape), np.empty(points.shape)
        rows = np.empty((*shape, gradient.shape[1]))
        native.race_contact(
            self.places,
            self.press,
            self._outside,
            self.per_sector,
            q,
            np.ascontiguousarray(points),
            np.ascontiguousarray(touching),
            gap,
            normal,
            rows,
            gradient,
            hessian,
        )
        return gap, normal, rows

    def _feet(self, race: Array, alpha: float) -> Array:
        """Approximate positions of the balls along the race, in elements."""
        centre = self.on_balls.balls(alpha, self.phase)[0]
        angle = np.arctan2(-centre[:, 0], centre[:, 1])
        begin = np.arctan2(-race[0, 0, 0, 0], race[0, 0, 0, 1])
        share = self.per_sector / self._pitch
        return np.asarray(np.mod(angle - begin, 2.0 * pi) * share)

    def _fixed(self, race: Array, bore: int) -> Mask:
        """Coordinates to hold: node 0 along the race, which prevents its rotation."""
        fixed = np.zeros((self.sectors, bore + self.size), dtype=bool)
        x, y = race[0, 0, 0]
        held = 0 if abs(y) > abs(x) else 1
        fixed[0, bore + held] = True
        fixed[-1, bore + self.size - NODE + held] = True
        return fixed


def _add(total: Array, place: Index, values: Array) -> None:
    """Add values at flat indices that may repeat; ten times faster than np.add.at."""
    summed = np.bincount(place.ravel(), values.ravel(), total.size)
    total += summed.reshape(total.shape)
