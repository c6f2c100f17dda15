"""Thin-ring model of a design: rim, outer race, balls on a rigid cam, teeth.

The model is 2D, in the frame of the circular spline; alpha is the wave-generator angle.
The rim is a line with the stiffness of its toothed sector, and the race is a second
line inside the rim. Rim and race are in unilateral contact. The compliance of this
contact is that of half the thickness of the rim plus half the thickness of the race.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swgjoint.errors import DesignError
from swgjoint.fe.plane.drive2d import sector
from swgjoint.fe.rings.facing import FacingSurface
from swgjoint.fe.rings.hermite_ring import GAUSS, HermiteRing
from swgjoint.fe.rings.race_on_balls import RaceOnBalls
from swgjoint.fe.rings.sections import rim_section, tooth_pair_stiffness
from swgjoint.fe.rings.teeth import ThinRingTeeth
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.bearing.checks import bearing_checks
from swgjoint.gear.design.check import raise_faults
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import tooth_errors
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.typing import Index
from swgjoint.units import mm

ELEMENTS = 190
"""Smallest number of elements of a ring: eight between neighbouring balls if there are
23 of them."""
PER_ELEMENT = GAUSS[0][[0, 2]]
"""Element parameters of both contact points of bore and race, equally weighted [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ThinRing(RaceOnBalls):
    """Rim, race, balls, cam and teeth of a drive, in SI units."""

    rim: HermiteRing
    """Toothed rim of the flexspline."""
    nodes_per_tooth: int
    """Number of nodes of the rim per tooth."""
    teeth: ThinRingTeeth
    """Teeth of both members."""
    press: float
    """Contact stiffness of bore and race per length of the rim's line [N/m^2]."""

    @cached_property
    def bore(self) -> FacingSurface:
        """Points of the rim's bore that may touch the race."""
        place = np.arange(self.rim.elements)[:, None] + PER_ELEMENT
        offset = self.bearing.bore_radius - self.rim.radius
        return FacingSurface(ring=self.rim, place=place.ravel(), offset=offset)

    @property
    def press_per_point(self) -> float:
        """Contact stiffness of bore and race at each contact point [N/m]."""
        return self.press * self.rim.step / len(PER_ELEMENT)

    @property
    def size(self) -> int:
        """Number of degrees of freedom of both rings."""
        return self.rim.size + self.race.size

    @cached_property
    def order(self) -> Index:
        """Positions of the coordinates in an order of narrow bandwidth (size,).

        Both rings are numbered together, starting at node 0 and proceeding alternately
        in both directions. The bandwidth of the closed rings is thus only twice that of
        open ones.
        """
        count = self.rim.elements
        place = np.arange(count)
        place = np.where(2 * place < count, 2 * place, 2 * (count - place) - 1)
        both = 8 * place[:, None] + np.arange(8)
        return np.concatenate([both[:, :4].ravel(), both[:, 4:].ravel()])


def check_modelled(design: Design) -> None:
    """Reject features that the ring model lacks.

    Raises:
        DesignError: If the design has any; one line per key.
    """
    drive, faults = design.drive, []
    if design.wave_generator.bearing is None:
        faults.append(
            "wave_generator.bearing is absent: the ring model needs the ball bearing of"
            " the wave generator; accepted: this table, or the 2d model"
        )
    if drive.layout != "circular_spline_fixed":
        faults.append(
            f"drive.layout = {drive.layout!r}: the ring model expects"
            " 'circular_spline_fixed'"
        )
    if design.wave_generator.kind not in ("elliptical", "cosine", "table"):
        faults.append(
            f"wave_generator.kind = {design.wave_generator.kind!r}: the ring model"
            " expects 'elliptical', 'cosine' or 'table'"
        )
    if faults:
        raise DesignError("\n".join(f"{drive.name}: {fault}" for fault in faults))


def thin_ring(design: Design) -> ThinRing:
    """Thin-ring model of a design.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks.
    """
    check_modelled(design)
    raise_faults(bearing_checks(design))
    bearing = BallBearing.from_design(design)
    flexspline = tooth_profile(design, "flexspline")
    circular_spline = tooth_profile(design, "circular_spline")
    flexspline_sector = sector(design, "flexspline", flexspline)
    ring_sector = sector(design, "circular_spline", circular_spline)
    section = rim_section(flexspline_sector)
    count = flexspline.teeth
    per_tooth = max(1, -(-ELEMENTS // count))
    rim = HermiteRing(
        radius=section.neutral_radius,
        elements=count * per_tooth,
        stretching=section.stretching,
        bending=section.bending,
    )
    thickness = design.flexspline.rim_mm * mm
    rim_steel = design.material_of("flexspline").youngs_modulus
    yielding = 0.5 * (
        thickness / rim_steel + bearing.race_thickness / bearing.material.youngs_modulus
    )
    circular_spline_errors = tooth_errors(design, "circular_spline").shift
    return ThinRing(
        **vars(RaceOnBalls.from_design(design, rim.elements)),
        rim=rim,
        nodes_per_tooth=per_tooth,
        teeth=ThinRingTeeth(
            flexspline=flexspline,
            circular_spline=circular_spline,
            foot_radius=section.neutral_radius,
            stiffness=tooth_pair_stiffness(flexspline_sector, ring_sector),
            shift=tooth_errors(design, "flexspline").shift,
            circular_spline_shift=circular_spline_errors
            if circular_spline_errors.any()
            else None,
        ),
        press=bearing.race_width / yielding,
    )
