"""Outer race on balls and a rigid cam: Hertz contact with clearance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.rings.facing import Facing, distances_to_ring
from swgjoint.fe.rings.hermite_ring import HermiteRing
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import flawed_wave_generator, wave_generator_offset
from swgjoint.gear.teeth.neutral_line import NeutralLine
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedBalls:
    """Hertz contact of the race with the balls, which sit on the cam."""

    seen: Facing
    """Distances of the ball centres from the race."""
    overlap: Array
    """Overlap of each ball with race and cam together (balls,) [m]."""
    force: Array
    """Ball forces Q (balls,) [N]."""
    push: Array
    """Force vectors on the race (balls, 2) [N]."""
    input_torque: float
    """Power of the ball forces divided by the speed of the wave generator [N·m]."""
    cage_torque: float
    """Power of the ball forces divided by the speed of the cage relative to the cam
    [N·m]."""

    @property
    def energy(self) -> float:
        """Energy of the Hertz contacts [J]."""
        return 0.4 * float(self.force @ self.overlap)


@dataclass(frozen=True, kw_only=True, eq=False)
class RaceOnBalls:
    """Race, balls and cam, in SI units."""

    race: HermiteRing
    """Outer race."""
    bearing: BallBearing
    """Dimensions and material of the bearing."""
    ball_constant: float
    """Hertz constant K of one ball, F = K overlap^1.5 [N/m^1.5]."""
    cam: NeutralLine
    """Line on which the ball centres move when the balls sit on the cam."""
    cam_offset: Array
    """Centre of the cam in the frame of the wave generator (2,) [m]."""
    lobe_height: float
    """Radial deflection that remains after the clearances are taken up [m]."""
    ratio: float
    """Signed ratio i of input to output speed [-]."""
    cage_held: bool = False
    """Whether the cage is fixed to the cam instead of rolling. The balls then have the
    same positions in every tooth pitch, and only their passage is neglected."""

    @classmethod
    def from_design(cls, design: Design, elements: int) -> RaceOnBalls:
        """Race, balls and cam of a design.

        Args:
            design: A drive whose wave generator has a ball bearing.
            elements: Number of elements of the race.
        """
        bearing = BallBearing.from_design(design)
        inwards = (
            0.5 * (bearing.fit_clearance + bearing.clearance + bearing.ball_diameter)
            + bearing.race_thickness
        )
        outline = flawed_wave_generator(design)
        length = outline.perimeter - 2.0 * pi * inwards
        return cls(
            race=HermiteRing(
                radius=bearing.race_radius,
                elements=elements,
                stretching=bearing.race_stretching,
                bending=bearing.race_bending,
            ),
            bearing=bearing,
            ball_constant=bearing.hertz_constant(),
            cam=NeutralLine(
                outline=outline,
                lobes=design.lobes,
                radius=length / (2.0 * pi),
                offset=-inwards,
            ),
            cam_offset=wave_generator_offset(design),
            lobe_height=lobe_height(design)
            - 0.5 * (bearing.clearance + bearing.fit_clearance),
            ratio=design.ratio,
        )

    @property
    def cage_lag(self) -> float:
        """Rotation of the cage relative to the cam per rotation of the cam [-]."""
        if self.cage_held:
            return 0.0
        return -self.bearing.cage_share * (1.0 - 1.0 / self.ratio)

    def balls(self, alpha: float, phase: float) -> tuple[Array, Array, Array]:
        """Ball centres on the cam and their derivatives with respect to both angles.

        The cage lags behind the wave generator as in rolling without slip, unless it is
        held. The race turns with the flexspline at the ideal ratio.

        Args:
            alpha: Wave-generator angle [rad].
            phase: Angle of ball 0 from the major axis at alpha = 0 [rad].

        Returns:
            Centres [m] and their derivatives with respect to ``alpha`` and ``phase``
            [m/rad], each (balls, 2).
        """
        at = alpha, phase
        if at not in self._latest:
            self._latest.clear()
            self._latest[at] = self._placed(alpha, phase)
        return self._latest[at]

    @cached_property
    def _latest(self) -> dict[tuple[float, float], tuple[Array, Array, Array]]:
        """Latest result of :meth:`balls`, because a Newton iteration asks again."""
        return {}

    def _placed(self, alpha: float, phase: float) -> tuple[Array, Array, Array]:
        """Result of :meth:`balls`."""
        lag = self.cage_lag
        spacing = 2.0 * pi / self.bearing.balls * np.arange(self.bearing.balls)
        pose = self.cam.pose(phase + lag * alpha + spacing)
        centre = rotate(pose.point + self.cam_offset, alpha)
        rolled = rotate(pose.d_point, alpha)
        return centre, rotate_right_angle(centre) + lag * rolled, rolled

    def press_balls(
        self, race: Array, alpha: float, phase: float, feet: Array
    ) -> PressedBalls:
        """Contact of the balls with a race.

        Args:
            race: Coordinates of the race (size,) [m].
            alpha: Wave-generator angle [rad].
            phase: Angle of ball 0 from the major axis at alpha = 0 [rad].
            feet: Initial guess of the feet of the balls on the race (balls,).
        """
        centre, d_centre, d_phase = self.balls(alpha, phase)
        seen = distances_to_ring(self.race, race, centre, feet, inside=True)
        reach = 0.5 * (self.bearing.ball_diameter + self.bearing.race_thickness)
        overlap = np.maximum(reach - seen.distance, 0.0)
        force = self.ball_constant * overlap**1.5
        push = -force[:, None] * seen.normal  # outwards
        return PressedBalls(
            seen=seen,
            overlap=overlap,
            force=force,
            push=push,
            input_torque=float(np.sum(push * d_centre)),
            cage_torque=float(np.sum(push * d_phase)),
        )


def pressed_form(
    seen: Facing,
    count: int,
    force: Array,
    stiffness: Array,
    bend: Array | None = None,
) -> Array:
    r"""Second derivative :math:`k\,dg\,dg - F\,d^2g` of the energy of n contacts.

    Args:
        seen: Distances of the points from the ring.
        count: Number m of quantities: 3, or 4 with the rotation of the section.
        force: Contact forces F (n,) [N].
        stiffness: Contact stiffnesses k (n,) [N/m].
        bend: Factor of the squared rotation in n . d2p (n,) [m]; None for points that
            do not rotate.

    Returns:
        Derivatives with respect to u_n, u_t, beta (see
        :mod:`swgjoint.fe.rings.facing`) and, if m = 4, to the rotation of the section
        (n, m, m).
    """
    form = np.zeros((len(force), count, count))
    form[:, :3, :3] = -force[:, None, None] * seen.bends()
    form[:, 0, 0] += stiffness
    if bend is not None:
        form[:, 3, 3] -= force * bend
    return form
