"""The 3D bearing of the wave generator: its outer race on its balls.

In its plane the race bends and stretches like the nonlinear ring of
:mod:`swgjoint.fe.rings`, on Hertz balls with clearance on the cam. Its outside
(:mod:`swgjoint.fe.solid.wave_generator.race_outside`) is straight over its width and
rolls about the circumferential direction
(:mod:`swgjoint.fe.solid.wave_generator.race_roll`), by u(s) at its edges.

All balls are assumed to roll in the middle plane of race and face width, in grooves
that transmit no moment about the circumferential direction. Along the axis the grooves
leave the race free (normal clearances allow tenths of a millimetre, and the race may
warp) or hold it (no warping, and sixteen times the roll stiffness at two lobes). These
are two bounds. The axial motion does not shift the outside. A slope of the wave
generator does not apply to the race, which adopts the slope of the bore; a crown is
ground on its outside.
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
"""Coordinates of a node: values, then derivatives by the parameter of an element."""
NODE = 2 * len(KINDS)
SIGN = np.tile([-1.0, -1.0, 1.0, 1.0], 2)
"""Factors that close half a ring."""
# of both nodes of an element: value and derivative, first and last
PLANE = np.array([0, 1, 4, 5, 8, 9, 12, 13])
ROLL = np.array([2, 6, 10, 14])
AXIAL = np.array([3, 7, 11, 15])
ANCHOR = 1e-11
"""Stiffness added to every step against unconstrained motions, relative to the largest
one [-]. At 1e-9 the race of size 25 and ratio 100 halved its error at every step."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidRace:
    """Outer race, balls and cam around the sectors of a model.

    Coordinates form an array (sectors, 2, 4) [m] of nodes at the first faces of the
    sectors, value or derivative, and x and y of the mean line, u or w.
    """

    on_balls: RaceOnBalls
    half: bool
    outside: RaceOutside
    roll: RaceRoll
    axially_free: bool = True
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
        """Start of a search: a race deflected by the lobes and pressed on their balls.

        Args:
            alpha: Wave-generator angle [rad].
            rotation: Rotation of race and flexspline [rad].
            closed: Coordinate z at which the coned bore meets the undeformed one [m].
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
        """Undeformed coordinates of every node in the frame of its tooth (2, 4) [m]."""
        still = np.zeros((2, len(KINDS)))
        still[:, :2] = self.on_balls.race.reference[0]
        still[:, :2] = rotate(still[:, :2], -0.5 * self.pitch)
        return still

    def displacements(self, race: Array, rotation: float) -> Array:
        """Displacements of the nodes in frames that rotate with the flexspline.

        Args:
            race: Coordinates (N, 2, 4) [m].
            rotation: Rotation of the flexspline [rad].
        """
        angle = self.pitch * np.arange(self.sectors, dtype=np.float64) + rotation
        flat = rotate(race[..., :2], -angle[:, None])
        return np.concatenate([flat, race[..., 2:]], axis=-1) - self._still

    def coordinates(self, displaced: Array, rotation: float) -> Array:
        """Coordinates (N, 2, 4) [m], the inverse of :meth:`displacements`.

        Args:
            displaced: Displacements in the frames of the teeth (N, 2, 4) [m].
            rotation: Rotation of the flexspline [rad].
        """
        race = displaced + self._still
        angle = self.pitch * np.arange(self.sectors, dtype=np.float64) + rotation
        flat = rotate(race[..., :2], angle[:, None])
        return np.concatenate([flat, race[..., 2:]], axis=-1)

    def elements(self, race: Array) -> Array:
        """Coordinates of both nodes of the elements (N, 16)."""
        nodes = race.reshape(len(race), NODE)
        last = np.roll(nodes, -1, axis=0)
        if self.half:
            last[-1] *= SIGN
        return np.concatenate([nodes, last], axis=1)

    def forces(self, race: Array, alpha: float) -> RaceForces:
        """Forces of race and balls.

        Args:
            race: Coordinates (N, 2, 4) [m].
            alpha: Wave-generator angle [rad].
        """
        plane_ring, n = self.on_balls.race, self.sectors
        plane = race[..., :2]
        whole = np.concatenate([plane, -plane]) if self.half else plane
        q = whole.ravel()
        nodal, blocks = plane_ring.forces(q)
        gradient, hessian = np.zeros((n, 2 * NODE)), np.zeros((n, 2 * NODE, 2 * NODE))
        gradient[:, PLANE[:4]] = nodal.reshape(-1, 4)[:n]
        hessian[:, PLANE[:, None], PLANE] = blocks[:n]
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
        out = np.concatenate([ROLL, AXIAL])
        moved = self.elements(race)[:, out]
        pulled = moved @ self.roll.stiffness
        gradient[:, out] += pulled
        hessian[:, out[:, None], out] += self.roll.stiffness
        bent = 0.5 * float(np.einsum("si,si->", moved, pulled))
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
        """Approximate feet of the balls on the race, element number plus parameter."""
        centre = self.on_balls.balls(alpha, self.phase)[0]
        angle = np.arctan2(-centre[:, 0], centre[:, 1])
        begin = np.arctan2(-race[0, 0, 0], race[0, 0, 1])
        return np.asarray(np.mod(angle - begin, 2.0 * pi) / self.pitch)

    def _fixed(self, race: Array) -> Mask:
        """Mask of fixed coordinates: node 0 prevents rotation and axial motion."""
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
            points: Points of every sector in the global frame (N, b, 3) [m].
            start: Initial guess of their parameters on the elements (b,).

        Returns:
            Gap (N, b) [m], derivatives by the points (N, b, 3) and by the coordinates
            of both nodes of the elements (N, b, 16).
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
