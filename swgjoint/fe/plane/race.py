r"""The bearing of the wave generator in the plane: its outer race on its balls.

In place of a rigid surface the bore of the rim lies on the outer race, the nonlinear
ring of :mod:`swgjoint.fe.rings` on Hertz balls with clearance on the cam. Every
node of the bore presses on it through the half of the race that lies outside of its
mean line, t/2 thick, and nowhere pulls: with the distance d from that line

.. math:: g = d - \tfrac12 t, \quad U = \tfrac12 k\langle -g\rangle^2, \quad
    k = \frac{2 E b}{t}\,\ell

for a race of width b and a node that stands for a length :math:`\ell` of the bore. The
race turns with the flexspline; nothing rubs.
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
from swgjoint.typing import Array, Index, Mask

ELEMENTS = 190
"""Fewest elements of the race: eight between neighbouring balls of 23. Where a ball
stands on its element then is worth some 4e-5 of the torque, 1e-5 with twice as many."""
NODE = 4
"""Coordinates of a node: position and its derivative by the element parameter."""
PRESSED = 1.01
"""Lobes of the race at the start of a search over those of the unloaded balls."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RaceForces:
    """Race and balls at one state, by sectors of m coordinates."""

    gradient: Array
    """Gradient of their energy (N, m) [N]."""
    hessian: Array
    """(N, m, m) [N/m]."""
    fixed: Mask
    """What is held (N, m)."""
    balls: PressedBalls
    """All of the drive."""
    energy: float
    """Energy of race and balls, whole drive [J]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneRaceForces(RaceForces):
    """Race, balls and what presses the bore on them.

    Coordinates of a sector: its bore nodes but the last corner, then the nodes of the
    race from its first face to its last one; b and r of them, m together.
    """

    gap: Array
    """Gap of the bore nodes (N, b/2) [m]."""
    rows: Array
    """Its derivative (N, b/2, b + r)."""
    normal: Array
    """Out of the race at the bore nodes (N, b/2, 2)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneRace:
    """Outer race, balls and cam around the sectors of a plane model.

    Coordinates have the shape (sectors, m, 2, 2): nodes from the first face of every
    sector on, position or derivative, x and y, in metres.
    """

    on_balls: RaceOnBalls
    sectors: int
    """In the model."""
    per_sector: int
    """m, elements of the race on a sector."""
    half: bool
    places: Array
    """Bore nodes of a sector on its undeformed elements, 0 to m (b/2,)."""
    press: Array
    """k of these nodes [N/m]. Shape (b/2,)."""
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
        """That of a design.

        Args:
            design: The drive.
            element: Condensed sector of its flexspline.
            half: Half of the drive.
            cage_held: See :class:`RaceOnBalls`.
            phase: Of the balls.
            elements: Fewest of the race.
        """
        teeth, size = element.sectors, element.face_size
        per_sector = -(-elements // teeth)
        own = RaceOnBalls.from_design(design, teeth * per_sector)
        x = element.skeleton[np.r_[size - 1 : size + element.bore_size, -1]]
        apart = np.hypot(*np.diff(x, axis=0).T)
        # half of the intervals on both sides; a corner is shared by two sectors
        length = 0.5 * (apart + np.roll(apart, 1))
        steel = own.bearing
        yielding = 0.5 * steel.race_thickness / steel.material.youngs_modulus
        angle = np.arctan2(-x[:-1, 0], x[:-1, 1])
        return cls(
            on_balls=replace(own, cage_held=cage_held),
            sectors=teeth // (2 if half else 1),
            per_sector=per_sector,
            half=half,
            places=np.asarray((0.5 + angle * teeth / (2.0 * pi)) * per_sector),
            press=steel.race_width / yielding * length,
            phase=phase,
        )

    @property
    def size(self) -> int:
        """Coordinates of a sector's nodes, both faces counted: r."""
        return NODE * (self.per_sector + 1)

    @property
    def _pitch(self) -> float:
        """Angle of a sector [rad]."""
        return 2.0 * pi * self.per_sector / self.on_balls.race.elements

    @property
    def _turns(self) -> Array:
        """Angles of the sectors in the undeformed ring (N,) [rad]."""
        return self._pitch * np.arange(self.sectors, dtype=np.float64)

    def initial_guess(self, alpha: float, rotation: float) -> Array:
        """Start of a search: deflected by the lobes, pressed on the balls there.

        Args:
            alpha: Wave-generator angle [rad].
            rotation: Of race and flexspline [rad].
        """
        own, shape = self.on_balls, (self.sectors, self.per_sector, 2, 2)
        # the lobes of the rim and the clearance that it takes up
        w0 = PRESSED * (own.lobe_height + 0.5 * own.bearing.fit_clearance)
        step = self._pitch / self.per_sector
        phi = step * np.arange(shape[0] * shape[1]) - 0.5 * self._pitch + rotation
        return own.race.two_lobes(w0, phi, alpha).reshape(shape)

    @cached_property
    def _still(self) -> Array:
        """Undeformed coordinates in the frame of a tooth (m, 2, 2)."""
        still = self.on_balls.race.reference[: self.per_sector]
        return rotate(still, -0.5 * self._pitch)

    def displacements(self, race: Array, rotation: float) -> Array:
        """Motion of the nodes in the frames of the teeth, turned with the flexspline.

        Args:
            race: Coordinates.
            rotation: Of the flexspline [rad].
        """
        angle = (self._turns + rotation)[:, None, None]
        return rotate(race, -angle) - self._still

    def coordinates(self, displaced: Array, rotation: float) -> Array:
        """Coordinates of nodes that have moved so in the frames of the teeth."""
        angle = (self._turns + rotation)[:, None, None]
        return rotate(displaced + self._still, angle)

    def forces(
        self, race: Array, alpha: float, points: Array, touching: Mask
    ) -> PlaneRaceForces:
        """Race, balls and the bore's nodes on it.

        Args:
            race: Coordinates.
            alpha: Wave-generator angle [rad].
            points: Bore nodes (N, b/2, 2) [m].
            touching: Which of them press; one that has lifted off pulls while it is
                taken to touch.
        """
        own, n, m = self.on_balls, self.sectors, self.per_sector
        ring, bore = own.race, 2 * points.shape[1]
        flat = race.reshape(-1)
        q = np.concatenate([flat, -flat]) if self.half else flat
        gradient = np.zeros((n, bore + self.size))
        hessian = np.zeros((*gradient.shape, gradient.shape[1]))

        def add(sector: Index, dofs: Index, slope: Array | None, bend: Array) -> None:
            row = gradient.shape[1] * sector[:, None] + dofs
            if slope is not None:
                _add(gradient, row, slope)
            _add(hessian, gradient.shape[1] * row[:, :, None] + dofs[:, None, :], bend)

        # the race: its elements, and the balls in this part of it
        element = np.arange(n * m)
        local = bore + NODE * (element % m)[:, None] + np.arange(2 * NODE)
        nodal, blocks = ring.forces(q)
        gradient[:, bore : bore + NODE * m] = nodal[: flat.size].reshape(n, -1)
        add(element // m, local, None, blocks[: n * m])
        balls = own.press_balls(q, alpha, self.phase, self._feet(race, alpha))
        on = np.flatnonzero(balls.overlap > 0.0)
        on = on[balls.seen.dofs[on, 0] < flat.size]
        near, force = balls.seen.chosen(on), balls.force[on]
        form = pressed_form(
            near, 3, force, 1.5 * own.ball_constant * np.sqrt(balls.overlap[on])
        )
        rows, under = near.by_ring, near.dofs[:, 0] // NODE
        add(
            under // m,
            local[under],
            -force[:, None] * rows[:, 0],
            np.swapaxes(rows, 1, 2) @ form @ rows,
        )

        # the bore, every node on the element below it
        first = np.minimum(self.places.astype(np.int64), m - 1)
        below = (m * np.arange(n)[:, None] + first).ravel()
        start = (m * np.arange(n)[:, None] + self.places).ravel()
        seen = distances_to_ring(
            ring, q, points.reshape(-1, 2), start, inside=False, own=below
        )
        gap = seen.distance - 0.5 * own.bearing.race_thickness
        k = np.where(touching, self.press, 0.0).ravel()
        force = -k * gap
        rows = np.zeros((len(gap), 3, 2 + 2 * NODE))
        rows[:, 0, :2], rows[:, 1, :2] = seen.normal, seen.tangent
        rows[:, :, 2:] = seen.by_ring
        node = np.tile(np.arange(points.shape[1]), n)
        dofs = np.concatenate([2 * node[:, None] + np.arange(2), local[below]], axis=1)
        sector = below // m
        bend = np.swapaxes(rows, 1, 2) @ pressed_form(seen, 3, force, k) @ rows
        add(sector, dofs, -force[:, None] * rows[:, 0], bend)
        gap_rows = np.zeros((len(gap), gradient.shape[1]))
        np.put_along_axis(gap_rows, dofs, rows[:, 0], axis=1)

        pressed = 0.5 * float(-force @ gap) * (2.0 if self.half else 1.0)
        shape = points.shape[:2]
        return PlaneRaceForces(
            gap=gap.reshape(shape),
            rows=gap_rows.reshape(*shape, -1),
            normal=seen.normal.reshape(points.shape),
            gradient=gradient,
            hessian=hessian,
            fixed=self._fixed(race, bore),
            balls=balls,
            energy=ring.energy(q) + balls.energy + pressed,
        )

    def _feet(self, race: Array, alpha: float) -> Array:
        """Places of the balls on the race, about."""
        centre = self.on_balls.balls(alpha, self.phase)[0]
        angle = np.arctan2(-centre[:, 0], centre[:, 1])
        begin = np.arctan2(-race[0, 0, 0, 0], race[0, 0, 0, 1])
        share = self.per_sector / self._pitch
        return np.asarray(np.mod(angle - begin, 2.0 * pi) * share)

    def _fixed(self, race: Array, bore: int) -> Mask:
        """The race could turn in its place: node 0 does not."""
        fixed = np.zeros((self.sectors, bore + self.size), dtype=bool)
        x, y = race[0, 0, 0]
        held = 0 if abs(y) > abs(x) else 1
        fixed[0, bore + held] = True
        fixed[-1, bore + self.size - NODE + held] = True
        return fixed


def _add(total: Array, place: Index, values: Array) -> None:
    """Add values at flat places, which may repeat; np.add.at takes ten times longer."""
    summed = np.bincount(place.ravel(), values.ravel(), total.size)
    total += summed.reshape(total.shape)
