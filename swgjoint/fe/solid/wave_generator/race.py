"""The bearing of the wave generator in 3D: its outer race on its balls.

In its plane the race bends and stretches as the nonlinear ring of
:mod:`swgjoint.fe.rings`. It rests on balls in Hertzian contact, with clearance, on the
cam. The outside of the race (:mod:`swgjoint.fe.solid.wave_generator.race_outside`) is
straight over its width. Its sections roll about the circumferential direction
(:mod:`swgjoint.fe.solid.wave_generator.race_roll`), which displaces the edges by u(s).

All balls are assumed to roll in the middle plane of race and face width, in grooves
that transmit no moment about the circumferential direction. Two bounds are available
for the axial motion. A free race may warp, since normal clearances allow tenths of a
millimetre. A held race cannot warp, and its roll stiffness with two lobes is sixteen
times as large. The axial motion does not shift the outside. The slope of the wave
generator does not apply, because the race adopts the slope of the bore. The crown of
the wave generator is ground on the outside of the race.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.race import RaceForces
from swgjoint.fe.rings.race_on_balls import RaceOnBalls, pressed_form
from swgjoint.fe.solid.wave_generator.race_outside import RaceOutside
from swgjoint.fe.solid.wave_generator.race_roll import RaceRoll
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array, Mask

KINDS = ("x", "y", "roll", "axial")
"""Functions along the race; a node has their values and then their derivatives by the
parameter of an element."""
NODE = 2 * len(KINDS)
"""Number of coordinates of a node."""
SIGN = np.tile([-1.0, -1.0, 1.0, 1.0], 2)
"""Factors on the coordinates of a node where half a race closes."""
# coordinates of an element: values and derivatives at its first node, then at its last
PLANE = np.array([0, 1, 4, 5, 8, 9, 12, 13])
ROLL = np.array([2, 6, 10, 14])
AXIAL = np.array([3, 7, 11, 15])
ANCHOR = 1e-11
"""Stiffness added to the tangent against unconstrained motions, relative to its largest
entry [-]. It slows Newton's method: with 1e-9 an iteration only halved the error of the
race of size 25 and ratio 100."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidRace:
    """Outer race, balls and cam, with one element of the race per sector of a model.

    The coordinates of the race are an array (sectors, 2, 4) [m]. Its axes are the
    nodes, which are on the first faces of the sectors; value and derivative by the
    parameter of the element; and x and y of the mean line, the roll displacement u of
    the edges and the axial displacement w.
    """

    on_balls: RaceOnBalls
    """The race in its plane, with balls and cam."""
    half: bool
    """Whether the model is half of the race; the other half is a copy rotated by
    180 deg."""
    outside: RaceOutside
    """Outer surface of the race."""
    roll: RaceRoll
    """Out-of-plane stiffness of the race."""
    axially_free: bool = True
    """Whether the grooves leave the race free along the axis."""
    phase: float = 0.0
    """Angle of ball 0 from the major axis at alpha = 0 [rad]."""

    @classmethod
    def from_design(
        cls, design: Design, *, half: bool, axially_free: bool = True
    ) -> SolidRace:
        """Race of a design, with as many elements as its flexspline has sectors.

        Args:
            design: A drive whose wave generator has a ball bearing.
            half: Whether to model half of the race.
            axially_free: Whether the grooves leave the race free along the axis.
        """
        on_balls = RaceOnBalls.from_design(design, design.drive.teeth_flexspline)
        return cls(
            on_balls=on_balls,
            half=half,
            outside=RaceOutside.from_design(design),
            roll=RaceRoll.from_bearing(on_balls.bearing, on_balls.race),
            axially_free=axially_free,
        )

    @property
    def sectors(self) -> int:
        """Number of elements in the model."""
        return self.on_balls.race.elements // (2 if self.half else 1)

    @property
    def pitch(self) -> float:
        """Angle of an element [rad]."""
        return 2.0 * pi / self.on_balls.race.elements

    def covers(self, z: Array) -> Mask:
        """Mask of the positions z along the axis [m] that are on the race."""
        return self.outside.covers(z)

    def initial_guess(self, alpha: float, rotation: float, closed: float) -> Array:
        """Approximate coordinates of the deflected race (sectors, 2, 4) [m].

        The race has two lobes that are 1 % higher than on unloaded balls, and it rolls
        with the coning of the bore.

        Args:
            alpha: Wave-generator angle [rad].
            rotation: Rotation of race and flexspline [rad].
            closed: Coordinate z at which the coned wall is not deflected [m].
        """
        on_balls = self.on_balls
        w0 = 1.01 * (on_balls.lobe_height + 0.5 * on_balls.bearing.clearance)
        phi = self.pitch * (np.arange(self.sectors) - 0.5) + rotation
        wave = 2.0 * (phi - alpha)
        race = np.zeros((self.sectors, 2, len(KINDS)))
        race[..., :2] = on_balls.race.two_lobes(w0, phi, alpha)
        roll = -0.5 * self.outside.width / closed * w0
        race[:, 0, 2] = roll * np.cos(wave)
        race[:, 1, 2] = -2.0 * self.pitch * roll * np.sin(wave)
        return race

    @property
    def _still(self) -> Array:
        """Undeformed coordinates of a node in the frame of its sector (2, 4) [m]."""
        still = np.zeros((2, len(KINDS)))
        still[:, :2] = self.on_balls.race.reference[0]
        still[:, :2] = rotate(still[:, :2], -0.5 * self.pitch)
        return still

    def displacements(self, race: Array, rotation: float) -> Array:
        """Displacements of the nodes in the rotated frames of the teeth (N, 2, 4) [m].

        Args:
            race: Coordinates (N, 2, 4) [m].
            rotation: Rotation of the flexspline [rad].
        """
        angle = self.pitch * np.arange(self.sectors, dtype=np.float64) + rotation
        flat = rotate(race[..., :2], -angle[:, None])
        return np.concatenate([flat, race[..., 2:]], axis=-1) - self._still

    def coordinates(self, displaced: Array, rotation: float) -> Array:
        """Coordinates in the global frame, the inverse of :meth:`displacements`.

        Args:
            displaced: Displacements in the rotated frames of the teeth (N, 2, 4) [m].
            rotation: Rotation of the flexspline [rad].
        """
        race = displaced + self._still
        angle = self.pitch * np.arange(self.sectors, dtype=np.float64) + rotation
        flat = rotate(race[..., :2], angle[:, None])
        return np.concatenate([flat, race[..., 2:]], axis=-1)

    def elements(self, race: Array) -> Array:
        """Coordinates of both nodes of every element (N, 16) [m]."""
        nodes = race.reshape(len(race), NODE)
        last = np.roll(nodes, -1, axis=0)
        if self.half:
            last[-1] *= SIGN
        return np.concatenate([nodes, last], axis=1)

    def forces(self, race: Array, alpha: float) -> RaceForces:
        """Forces, tangent and energy of race and balls.

        Args:
            race: Coordinates (N, 2, 4) [m].
            alpha: Wave-generator angle [rad].
        """
        # bending and stretching in the plane
        plane_ring, n = self.on_balls.race, self.sectors
        plane = race[..., :2]
        whole = np.concatenate([plane, -plane]) if self.half else plane
        q = whole.ravel()
        _, nodal, blocks = plane_ring.forces(q)
        gradient, hessian = np.zeros((n, 2 * NODE)), np.zeros((n, 2 * NODE, 2 * NODE))
        gradient[:, PLANE[:4]] = nodal.reshape(-1, 4)[:n]
        hessian[:, PLANE[:, None], PLANE] = blocks[:n]
        # contact with the balls on the elements of the model
        balls = self.on_balls.press_balls(q, alpha, self.phase, self._feet(race, alpha))
        on = np.flatnonzero(balls.overlap > 0.0)
        on = on[balls.seen.dofs[on, 0] // 4 < n]
        near, force = balls.seen.chosen(on), balls.force[on]
        slope = 1.5 * self.on_balls.ball_constant * np.sqrt(balls.overlap[on])
        rows = near.by_ring
        form = pressed_form(near, rows.shape[1], force, slope)
        sector = near.dofs[:, 0] // 4
        np.add.at(gradient, (sector[:, None], PLANE), -force[:, None] * rows[:, 0])
        np.add.at(
            hessian,
            (sector[:, None, None], PLANE[:, None], PLANE),
            np.swapaxes(rows, 1, 2) @ (form @ rows),
        )
        # roll and axial motion out of the plane
        out = np.concatenate([ROLL, AXIAL])
        moved = self.elements(race)[:, out]
        pulled = moved @ self.roll.stiffness
        gradient[:, out] += pulled
        hessian[:, out[:, None], out] += self.roll.stiffness
        bent = 0.5 * float(np.einsum("si,si->", moved, pulled))
        # weak springs and fixed coordinates against rigid motions
        largest = float(np.abs(np.einsum("sii->si", hessian)).max())
        every = np.arange(2 * NODE)
        hessian[:, every, every] += ANCHOR * largest
        fixed = self._fixed(race)
        gradient[fixed] = 0.0
        return RaceForces(
            gradient=gradient,
            hessian=hessian,
            fixed=fixed,
            balls=balls,
            energy=plane_ring.energy(q)
            + balls.energy
            + (2.0 if self.half else 1.0) * bent,
        )

    def _feet(self, race: Array, alpha: float) -> Array:
        """Approximate positions of the balls along the race, in elements (balls,)."""
        centre = self.on_balls.balls(alpha, self.phase)[0]
        angle = np.arctan2(-centre[:, 0], centre[:, 1])
        begin = np.arctan2(-race[0, 0, 0], race[0, 0, 1])
        return np.asarray(np.mod(angle - begin, 2.0 * pi) / self.pitch)

    def _fixed(self, race: Array) -> Mask:
        """Mask of fixed coordinates (N, 16).

        One coordinate of node 0 prevents the rotation of the race and another one its
        axial motion. In a held race all axial coordinates are fixed.
        """
        fixed = np.zeros((len(race), 2 * NODE), dtype=bool)
        x, y = race[0, 0, :2]
        first = [0 if abs(y) > abs(x) else 1, 3]
        fixed[0, first] = True
        fixed[-1, NODE + np.array(first)] = True
        if not self.axially_free:
            fixed[:, AXIAL] = True
        return fixed

    def gap(self, race: Array, points: Array, start: Array) -> tuple[Array, ...]:
        """Gap of bore nodes to the outside of the race, and its derivatives.

        Args:
            race: Coordinates (N, 2, 4) [m].
            points: Bore nodes of every sector in the global frame (N, b, 3) [m].
            start: Initial guess of their parameters on the elements, 0 to 1 (b,) [-].

        Returns:
            Gap (N, b) [m], and its derivatives by the points (N, b, 3) [-] and by the
            coordinates of both nodes of the elements (N, b, 16) [-].
        """
        elements = self.elements(race)
        line = elements[:, PLANE].reshape(-1, 4, 2)
        gap, by_point, by_line, by_edge = self.outside.gap(
            line, elements[:, ROLL], points, start
        )
        by_race = np.zeros((*gap.shape, 2 * NODE))
        by_race[..., PLANE] = by_line.reshape(*gap.shape, 8)
        by_race[..., ROLL] = by_edge
        return gap, by_point, by_race

    def bend_gap(
        self, race: Array, points: Array, start: Array
    ) -> tuple[Array, Array, Array]:
        """Second derivative of the gaps, see :meth:`RaceOutside.bend_gap`.

        Args:
            race: Coordinates (N, 2, 4) [m].
            points: Bore nodes of every sector in the global frame (N, b, 3) [m].
            start: Initial guess of their parameters on the elements, 0 to 1 (b,) [-].

        Returns:
            Coefficients of the quadratic form of sliding and turn (N, b, 2, 2), the
            derivative of the sliding by the points (N, b, 3), and the derivatives of
            sliding and turn by the coordinates of both nodes of the elements (N, b, 2,
            16).
        """
        line = self.elements(race)[:, PLANE].reshape(-1, 4, 2)
        form, by_point, by_line = self.outside.bend_gap(line, points, start)
        by_race = np.zeros((*form.shape[:3], 2 * NODE))
        by_race[..., PLANE] = by_line.reshape(*form.shape[:3], 8)
        return form, by_point, by_race
