"""The thin-ring model of a design: rim, outer race, balls on a rigid cam, teeth.

Plane, in the frame of the circular spline; the wave generator is turned by alpha. The
rim is a line with the stiffness of its toothed sector, the race another inside it. They
press on each other through half of either thickness, and nowhere pull.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import DesignError
from swgjoint.fe.corotation import rotate, turned
from swgjoint.fe.drive2d import sector
from swgjoint.fe.thin_ring.facing import Surface
from swgjoint.fe.thin_ring.hermite_ring import GAUSS, HermiteRing
from swgjoint.fe.thin_ring.sections import rim_section, tooth_pair_stiffness
from swgjoint.fe.thin_ring.teeth import Teeth
from swgjoint.gear.ball_bearing import BallBearing
from swgjoint.gear.bearing_checks import bearing_checks
from swgjoint.gear.check import raise_faults
from swgjoint.gear.design import Design
from swgjoint.gear.neutral_line import NeutralLine
from swgjoint.gear.profile import tooth_profile
from swgjoint.gear.tolerances import (
    flawed_wave_generator,
    tooth_errors,
    wave_generator_offset,
)
from swgjoint.gear.wave_generator import lobe_height
from swgjoint.units import mm

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ELEMENTS = 190
"""Fewest elements of a ring: eight between neighbouring balls of 23."""
PER_ELEMENT = GAUSS[0][[0, 2]]
"""Where bore and race are held apart, two points of equal weight on an element."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ThinRing:
    """All that an equilibrium needs, in SI."""

    rim: HermiteRing
    race: HermiteRing
    nodes_per_tooth: int
    bearing: BallBearing
    ball_constant: float
    """K of one ball [N/m^1.5]."""
    cam: NeutralLine
    """Line of the ball centres when they sit on the cam."""
    cam_offset: Array
    """Its centre in the frame of the wave generator (2,) [m]."""
    teeth: Teeth
    lobe_height: float
    """Radial deflection that the clearances leave [m]."""
    ratio: float
    press: float
    """Stiffness of bore against race per length [N/m^2]."""

    @cached_property
    def bore(self) -> Surface:
        """Points of the rim's bore that face the race."""
        place = np.arange(self.rim.elements)[:, None] + PER_ELEMENT
        offset = self.bearing.bore_radius - self.rim.radius
        return Surface(ring=self.rim, place=place.ravel(), offset=offset)

    @property
    def press_per_point(self) -> float:
        """[N/m]."""
        return self.press * self.rim.step / len(PER_ELEMENT)

    @property
    def size(self) -> int:
        """Degrees of freedom of both rings."""
        return self.rim.size + self.race.size

    @cached_property
    def order(self) -> Index:
        """Places of the coordinates in a narrow band.

        Both rings together, from node 0 both ways at once: the band of a closed ring is
        twice that of an open one. Shape (size,).
        """
        count = self.rim.elements
        place = np.arange(count)
        place = np.where(2 * place < count, 2 * place, 2 * (count - place) - 1)
        both = 8 * place[:, None] + np.arange(8)
        return np.concatenate([both[:, :4].ravel(), both[:, 4:].ravel()])

    def balls(self, alpha: float, phase: float) -> tuple[Array, Array, Array]:
        """Ball centres on the cam and their derivatives by alpha and by phase (n, 2).

        The cage lags behind the wave generator as rolling without slip has it; the race
        turns with the flexspline, at the ideal ratio.

        Args:
            alpha: Wave-generator angle [rad].
            phase: Angle of ball 0 from the major axis at alpha = 0 [rad].
        """
        lag = -self.bearing.cage_share * (1.0 - 1.0 / self.ratio)
        spacing = 2.0 * pi / self.bearing.balls * np.arange(self.bearing.balls)
        pose = self.cam.pose(phase + lag * alpha + spacing)
        centre = rotate(pose.point + self.cam_offset, alpha)
        rolled = rotate(pose.d_point, alpha)
        return centre, turned(centre) + lag * rolled, rolled


def check_modelled(design: Design) -> None:
    """Refuse what the ring model does not contain.

    Raises:
        DesignError: One line per key.
    """
    drive, faults = design.drive, []
    if design.wave_generator.bearing is None:
        faults.append(
            "wave_generator.bearing is absent: the ring model is that of a wave"
            " generator with its ball bearing; accepted: the table, or the 2d model"
        )
    if drive.layout != "circular_spline_fixed":
        faults.append(
            f"drive.layout = {drive.layout!r}: accepted by the ring model:"
            " 'circular_spline_fixed'"
        )
    if design.wave_generator.kind not in ("elliptical", "cosine", "table"):
        faults.append(
            f"wave_generator.kind = {design.wave_generator.kind!r}: a bearing of the"
            " ring model runs on 'elliptical', 'cosine' or 'table'"
        )
    if design.tolerances.misalignment_arcmin:
        faults.append(
            f"tolerances.misalignment_arcmin ="
            f" {design.tolerances.misalignment_arcmin:g}: the ring model is a plane;"
            " accepted: 0"
        )
    if design.friction.tooth_coefficient:
        faults.append(
            f"friction.tooth_coefficient = {design.friction.tooth_coefficient:g}: the"
            " ring model has no friction; accepted: 0, or the 2d model"
        )
    if faults:
        raise DesignError("\n".join(f"{drive.name}: {fault}" for fault in faults))


def thin_ring(design: Design) -> ThinRing:
    """Ring model of a design.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
    """
    check_modelled(design)
    raise_faults(bearing_checks(design))
    bearing = BallBearing.of(design)
    flexspline = tooth_profile(design, "flexspline")
    circular_spline = tooth_profile(design, "circular_spline")
    own = sector(design, "flexspline", flexspline)
    other = sector(design, "circular_spline", circular_spline)
    section = rim_section(own)
    count = flexspline.teeth
    per_tooth = max(1, -(-ELEMENTS // count))
    rim = HermiteRing(
        radius=section.neutral_radius,
        elements=count * per_tooth,
        stretching=section.stretching,
        bending=section.bending,
    )
    race = HermiteRing(
        radius=bearing.race_radius,
        elements=rim.elements,
        stretching=bearing.race_stretching,
        bending=bearing.race_bending,
    )
    inwards = (
        0.5 * (bearing.fit_clearance + bearing.clearance + bearing.ball_diameter)
        + bearing.race_thickness
    )
    outline = flawed_wave_generator(design)
    length = outline.perimeter - 2.0 * pi * inwards
    thickness = design.flexspline.rim_mm * mm
    rim_steel = design.material_of("flexspline").youngs_modulus
    yielding = 0.5 * (
        thickness / rim_steel + bearing.race_thickness / bearing.material.youngs_modulus
    )
    ring_errors = tooth_errors(design, "circular_spline").shift
    return ThinRing(
        rim=rim,
        race=race,
        nodes_per_tooth=per_tooth,
        bearing=bearing,
        ball_constant=bearing.hertz_constant(),
        cam=NeutralLine(
            outline=outline,
            lobes=design.lobes,
            radius=length / (2.0 * pi),
            offset=-inwards,
        ),
        cam_offset=wave_generator_offset(design),
        teeth=Teeth(
            flexspline=flexspline,
            circular_spline=circular_spline,
            foot_radius=section.neutral_radius,
            stiffness=tooth_pair_stiffness(own, other),
            shift=tooth_errors(design, "flexspline").shift,
            ring_shift=ring_errors if ring_errors.any() else None,
        ),
        lobe_height=lobe_height(design)
        - 0.5 * (bearing.clearance + bearing.fit_clearance),
        ratio=design.ratio,
        press=bearing.race_width / yielding,
    )
