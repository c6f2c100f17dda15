"""The outer race on its balls, which sit on the rigid cam: Hertz contact, clearance."""

from __future__ import annotations

from dataclasses import dataclass
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
    """Hertz contact of the balls, which sit on the cam, with the race."""

    seen: Facing
    overlap: Array
    """[m]. Shape (balls,)."""
    force: Array
    """Q (balls,) [N]."""
    push: Array
    """Forces on the race (balls, 2) [N]."""
    input_torque: float
    """Power per speed of the wave generator that moves the balls [N·m]."""
    cage_torque: float
    """Power per speed of the cage against the cam [N·m]."""

    @property
    def energy(self) -> float:
        """Energy of the Hertz contacts [J]."""
        return 0.4 * float(self.force @ self.overlap)


@dataclass(frozen=True, kw_only=True, eq=False)
class RaceOnBalls:
    """Race, balls and cam, in SI."""

    race: HermiteRing
    bearing: BallBearing
    ball_constant: float
    """K of one ball [N/m^1.5]."""
    cam: NeutralLine
    """Line of the ball centres when they sit on the cam."""
    cam_offset: Array
    """Its centre in the frame of the wave generator (2,) [m]."""
    lobe_height: float
    """Radial deflection that the clearances leave [m]."""
    ratio: float
    cage_held: bool = False
    """Whether the cage stands still on the cam instead of rolling: every pitch of the
    teeth then finds the balls in the same places, and only the passage of balls is
    lost."""

    @classmethod
    def from_design(cls, design: Design, elements: int) -> RaceOnBalls:
        """Those of a design, the race of so many elements."""
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

    def balls(self, alpha: float, phase: float) -> tuple[Array, Array, Array]:
        """Ball centres on the cam and their derivatives by alpha and by phase (n, 2).

        The cage lags behind the wave generator as rolling without slip has it; the race
        turns with the flexspline, at the ideal ratio.

        Args:
            alpha: Wave-generator angle [rad].
            phase: Angle of ball 0 from the major axis at alpha = 0 [rad].
        """
        lag = -self.bearing.cage_share * (1.0 - 1.0 / self.ratio)
        if self.cage_held:
            lag = 0.0
        spacing = 2.0 * pi / self.bearing.balls * np.arange(self.bearing.balls)
        pose = self.cam.pose(phase + lag * alpha + spacing)
        centre = rotate(pose.point + self.cam_offset, alpha)
        rolled = rotate(pose.d_point, alpha)
        return centre, rotate_right_angle(centre) + lag * rolled, rolled

    def press_balls(
        self, race: Array, alpha: float, phase: float, feet: Array
    ) -> PressedBalls:
        """The balls under a race.

        Args:
            race: Its coordinates.
            alpha: Wave-generator angle [rad].
            phase: As in :meth:`balls`.
            feet: Places on the race near the balls (balls,).
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
    r"""Second derivative :math:`k\,dg\,dg - F\,d^2g` by u_n, u_t, beta (n, m, m).

    Args:
        seen: The points.
        count: m, 3 or, with a turn of the section, 4.
        force: F (n,) [N].
        stiffness: k (n,) [N/m].
        bend: Factor of that turn squared in n . d2p (n,).
    """
    form = np.zeros((len(force), count, count))
    form[:, :3, :3] = -force[:, None, None] * seen.bends()
    form[:, 0, 0] += stiffness
    if bend is not None:
        form[:, 3, 3] -= force * bend
    return form
