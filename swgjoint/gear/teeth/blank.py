"""Blank of a tooth profile: circles, pitch and thickness of a member."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import Any

from swgjoint.errors import DesignError
from swgjoint.faults import unit_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.sections import Member
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.segments import Piece, Segment, arc
from swgjoint.units import deg, mm


class ToothFault(DesignError):
    """Error for a tooth that cannot be built, with the key of the member at fault.

    ``where`` names design and member, ``shown`` is the value of the key with its unit,
    and ``what`` states what is wrong and which values are accepted.
    """

    def __init__(self, where: str, key: str, shown: str, what: str) -> None:
        super().__init__(f"{where}.{key} = {shown}: {what}")
        self.where, self.key, self.shown, self.what = where, key, shown, what

    def __reduce__(self) -> tuple[type[DesignError], tuple[str]]:
        """Reduce to a plain design error with the same message for pickling."""
        return DesignError, (str(self),)

    def with_bounds(self, accepted: str) -> ToothFault:
        """The same fault with the accepted values in its message."""
        cause = self.what.partition("; accepted")[0]
        return ToothFault(
            self.where, self.key, self.shown, f"{cause}; accepted: {accepted}"
        )


@dataclass(frozen=True, kw_only=True)
class Blank:
    """Dimensions of one member in SI units, thesis eqs 3.13, 3.16, 3.17, 3.21, 3.22."""

    member: str
    """``flexspline`` or ``circular_spline``."""
    where: str
    """Names of design and member, for messages."""
    spec: Member
    """Table of the member in the design file."""
    teeth: int
    """Number of teeth."""
    internal: bool
    """Whether the teeth are internal."""
    module: float
    """Module [m]."""
    pitch: float
    """Pitch radius [m]."""
    tip: float
    """Tip radius [m]."""
    root: float
    """Root radius [m]."""

    @property
    def side(self) -> float:
        """+1 for external teeth, -1 for internal teeth."""
        return -1.0 if self.internal else 1.0

    @property
    def half_pitch(self) -> float:
        """Half the angular pitch, alpha_T [rad]."""
        return pi / self.teeth  # (3.21)

    @property
    def half_thickness(self) -> float:
        """Half the angular tooth thickness at the pitch circle, alpha_P [rad]."""
        return self.spec.thickness_coefficient * self.half_pitch / 2.0  # (3.22)

    @property
    def pressure_angle(self) -> float:
        """Angle between flank and radius at the pitch circle [rad]."""
        return self.spec.pressure_angle_deg * deg

    def fault(self, key: str, what: str) -> ToothFault:
        """Error that names a key of the member with its value and unit.

        Args:
            key: Dotted key of the member.
            what: What is wrong, then ``; accepted:`` and the accepted values.
        """
        value = self.value(key)
        unit = f" {unit_of(key)}".rstrip()
        shown = "its default" if value is None else f"{value}{unit}"
        return ToothFault(self.where, key, shown, what)

    def value(self, key: str) -> Any:
        """Value of a dotted key of the member, in the unit of the key."""
        value: Any = self.spec
        for name in key.split("."):
            value = getattr(value, name)
        return value

    def with_change(self, key: str, value: float) -> Blank:
        """Copy of the blank with a new value for a dotted key, which is not checked.

        Args:
            key: Dotted key of the member.
            value: New value, in the unit of the key.
        """
        table, _, last = key.rpartition(".")
        update = {last: value}
        if table:
            update = {table: getattr(self.spec, table).model_copy(update=update)}
        spec = self.spec.model_copy(update=update)
        tip, root = circles(spec, self.pitch, self.module, self.side)
        return replace(self, spec=spec, tip=tip, root=root)

    def lands(self, top: float, bottom: float) -> tuple[list[Piece], list[Piece]]:
        """Right halves of the top land and of the root land.

        Args:
            top: Angle from the tooth axis to the end of the top land [rad].
            bottom: Angle from the tooth axis to the start of the root land [rad].

        Returns:
            The piece of the top land and that of the root land, each as a list that is
            empty if the land has no length.
        """
        convex = not self.internal
        first: list[Piece] = []
        last: list[Piece] = []
        if top > 0.0:
            first = [
                arc("top_land", (0.0, 0.0), self.tip, pi / 2, pi / 2 - top, convex)
            ]
        if bottom < self.half_pitch:
            end = pi / 2 - self.half_pitch
            last = [
                arc("root_land", (0.0, 0.0), self.root, pi / 2 - bottom, end, convex)
            ]
        return first, last

    def profile(
        self,
        top: float,
        pieces: list[Piece],
        bottom: float,
        straight_length: float = 0.0,
    ) -> ToothProfile:
        """Profile composed of the lands and the pieces between them.

        Arcs and lines of zero length are omitted.

        Args:
            top: Angle from the tooth axis to the end of the top land [rad].
            pieces: Pieces of the flank from tip to root.
            bottom: Angle from the tooth axis to the start of the root land [rad].
            straight_length: Length of the straight segment, for reports [m].
        """
        first, last = self.lands(top, bottom)
        kept = [
            piece
            for piece in [*first, *pieces, *last]
            # an arc or a line of zero length has no direction
            if piece.length > 0.0 or not isinstance(piece, Segment)
        ]
        return ToothProfile(
            member=self.member,
            teeth=self.teeth,
            internal=self.internal,
            pitch_radius=self.pitch,
            addendum_radius=self.tip,
            dedendum_radius=self.root,
            segments=tuple(kept),
            straight_length=straight_length,
        )


def blank(design: Design, member: str) -> Blank:
    """Blank of a member.

    Args:
        design: The drive.
        member: ``flexspline`` or ``circular_spline``.
    """
    internal = member == "circular_spline"
    drive = design.drive
    spec = design.circular_spline if internal else design.flexspline
    teeth = drive.teeth_circular_spline if internal else drive.teeth_flexspline
    module = drive.module_mm * mm
    pitch = teeth * module / 2.0  # (3.13)
    tip, root = circles(spec, pitch, module, -1.0 if internal else 1.0)
    return Blank(
        member=member,
        where=f"{drive.name}: {member}",
        spec=spec,
        teeth=teeth,
        internal=internal,
        module=module,
        pitch=pitch,
        tip=tip,
        root=root,
    )


def circles(
    spec: Member, pitch: float, module: float, side: float
) -> tuple[float, float]:
    """Radii of the tip circle and the root circle of a member [m].

    Args:
        spec: Table of the member in the design file.
        pitch: Pitch radius [m].
        module: Module [m].
        side: +1 for external teeth, -1 for internal teeth.
    """
    return (
        pitch + side * spec.addendum_coefficient * module,  # (3.16)
        pitch - side * spec.dedendum_coefficient * module,  # (3.17)
    )
