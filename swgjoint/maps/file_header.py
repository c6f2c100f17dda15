"""The JSON header of a ``.swg`` file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from swgjoint.faults import Section
from swgjoint.maps.hysteresis import Jenkin

MAX_NAME = 300
"""Longest name of a map, and longest path quoted in full in a message [characters]."""


class RatingsHeader(Section):
    """Catalogue torques [N·m]."""

    rated_torque: float
    repeated_peak: float
    momentary_peak: float
    T1: float
    T2: float
    source: str
    ratcheting_torque: float | None = None


class JenkinHeader(Section):
    """One Jenkin element of the hysteresis; the keys state the units."""

    stiffness_Nm_rad: float
    yield_torque_Nm: float
    yield_curve_Nm: list[list[float]] = Field(default_factory=list)

    @classmethod
    def from_element(cls, element: Jenkin) -> dict[str, Any]:
        """The JSON values of an element."""
        header: dict[str, Any] = {
            "stiffness_Nm_rad": float(element.stiffness),
            "yield_torque_Nm": float(element.yield_torque),
        }
        if element.yield_curve:
            header["yield_curve_Nm"] = [
                [float(at), float(f)] for at, f in element.yield_curve
            ]
        return header

    def element(self) -> Jenkin:
        """The element."""
        curve: Any = tuple(tuple(point) for point in self.yield_curve_Nm)
        return Jenkin(
            stiffness=self.stiffness_Nm_rad,
            yield_torque=self.yield_torque_Nm,
            yield_curve=curve,
        )


class FrictionHeader(Section):
    """Friction of the wave generator; the keys state the units, ``load`` has none."""

    stiffness_Nm_rad: float
    coulomb_Nm: float
    static_Nm: float
    stribeck_speed_rad_s: float
    viscous_Nms_rad: float
    load: float
    bending_Nm: float
    damping_Nms_rad: float
    source: str


FRICTION_KEYS = {
    "stiffness_Nm_rad": "stiffness",
    "coulomb_Nm": "coulomb",
    "static_Nm": "static",
    "stribeck_speed_rad_s": "stribeck_speed",
    "viscous_Nms_rad": "viscous",
    "load": "load",
    "bending_Nm": "bending",
    "damping_Nms_rad": "damping",
    "source": "source",
}
"""Fields of :class:`Friction` by their keys in the file."""


class Header(Section):
    """The JSON header of a ``.swg`` file."""

    format: Literal["swgjoint drive map"]
    schema_version: int
    units: dict[str, str]
    versions: dict[str, str]
    name: Annotated[str, Field(max_length=MAX_NAME)]
    level: str
    layout: str
    teeth_flexspline: int
    teeth_circular_spline: int
    damping_ratio: float
    ratings: RatingsHeader
    hysteresis: list[JenkinHeader] = Field(default_factory=list)
    friction: FrictionHeader | None = None
    fields_period_rad: float | None = None
    info: dict[str, Any]
