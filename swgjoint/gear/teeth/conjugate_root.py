"""The root of a conjugate tooth, from the end of the envelope to the root circle."""

from __future__ import annotations

from functools import cached_property
from math import atan2, sqrt

import numpy as np

from swgjoint.gear.design.sections import Conjugate
from swgjoint.gear.teeth.blank import Blank
from swgjoint.gear.teeth.envelope import Envelope
from swgjoint.gear.teeth.segments import Piece, Point, arc, line
from swgjoint.typing import Array
from swgjoint.units import mm

ROOT_END = 0.98
"""Largest angle from the tooth axis to the end of a fillet of default radius, divided
by half the angular pitch [-]. A short root land remains."""
SHORTEST = 4e-6
"""Smallest length of a piece [m]. Shorter pieces are omitted, and the next piece
continues in tangential direction."""


class RootBuilder:
    """Builds the straight line and the fillet that join the envelope to the root.

    Args:
        start: Blank of the generated member.
        envelope: Envelope of the flank of the other member.

    Raises:
        DesignError: If the thickness coefficient of the member exceeds 1.
    """

    def __init__(self, start: Blank, envelope: Envelope) -> None:
        self.start, self.envelope = start, envelope
        if start.spec.thickness_coefficient > 1.0:
            raise start.fault(
                "thickness_coefficient",
                "the tooth would be thicker than the conjugate tooth; accepted: <= 1",
            )
        # clockwise rotation of the envelope; it is negative if backlash makes the tooth
        # thinner
        turn = start.half_thickness - 0.5 * start.half_pitch
        c, d = np.cos(turn), np.sin(turn)
        self.turn = np.array([[c, -d], [d, c]])

    def _fillet(
        self, leave: tuple[Point, Array], radius: float, limit: float
    ) -> tuple[float, Point] | None:
        """Length of the line and centre of the fillet [m]; None if it does not fit.

        The line starts at the departure P with tangent t and normal n. The centre
        P + l t + r n of a fillet of radius r is at the distance r_D +- r from the axis,
        which is a quadratic equation for the length l.
        """
        start = self.start
        (px, py), n = leave
        t = start.side * np.array([n[1], -n[0]])
        q = np.array([px, py]) + radius * n
        goal = start.root + start.side * radius
        along = float(q @ t)
        square = along**2 - float(q @ q) + goal**2
        if square < 0.0 or goal <= 0.0:
            return None
        length = -along - start.side * sqrt(square)
        centre = q + length * t
        if length < SHORTEST or polar_angle((centre[0], centre[1])) > limit:
            return None
        return length, (float(centre[0]), float(centre[1]))

    def _root(self, leave: tuple[Point, Array]) -> tuple[list[Piece], float] | None:
        """Line and fillet with the radius of the design or the largest that fits.

        The second value is the angle from the tooth axis to the end of the fillet
        [rad]. None if no fillet fits.
        """
        spec = self.start.spec.profile
        assert isinstance(spec, Conjugate)
        if spec.root_radius_mm is not None:
            return self._root_with(
                leave, spec.root_radius_mm * mm, self.start.half_pitch
            )
        low, high = 0.0, 2.0 * self.start.module
        best: tuple[list[Piece], float] | None = None
        for _ in range(14):
            middle = 0.5 * (low + high)
            built = self._root_with(leave, middle, ROOT_END * self.start.half_pitch)
            if built is None:
                high = middle
            else:
                low, best = middle, built
        return best

    def _root_with(
        self, leave: tuple[Point, Array], radius: float, limit: float
    ) -> tuple[list[Piece], float] | None:
        """Line and fillet of a given radius, and the angle to its end [rad].

        None if they do not fit. The fillet must end within the angle ``limit`` from the
        tooth axis [rad].
        """
        start = self.start
        fillet = self._fillet(leave, radius, limit)
        if fillet is None:
            return None
        length, centre = fillet
        (px, py), n = leave
        side = start.side
        t = side * np.array([n[1], -n[0]])
        first = atan2(-n[1], -n[0])
        # the arc ends on the ray from the gear axis through its centre
        last = atan2(-side * centre[1], -side * centre[0])
        turn = (last - first + np.pi) % (2.0 * np.pi) - np.pi
        if side * turn <= 0.0:
            return None
        corner = (float(px + length * t[0]), float(py + length * t[1]))
        pieces: list[Piece] = [
            line("straight", (px, py), corner),
            arc("fillet", centre, radius, first, first + turn, False),
        ]
        return (pieces, polar_angle(centre)) if self._clear(pieces) else None

    def _clear(self, pieces: list[Piece]) -> bool:
        """Whether the mating tip touches neither the line nor the fillet."""
        points = self._tips
        for piece in pieces:
            distance, _, _, inside = piece.project(points, self.start.side)
            if (distance[inside] < -1e-12).any():
                return False
        return True

    @cached_property
    def _tips(self) -> Array:
        """Points of the mating flank at positions near the lobe (n, 2) [m].

        They are in the frame of the generated tooth, rotated for the backlash.
        """
        envelope = self.envelope
        points, _, _ = envelope.given.evaluate(
            np.linspace(*envelope.given.contact_range, 150)
        )
        parts = []
        for motion in envelope.motions:
            theta = np.linspace(-0.25, 0.25, 201) * motion.half_range
            moved = motion.map_to(envelope.receiver, theta)
            wide = np.broadcast_to(points, (len(theta), *points.shape))
            parts.append(moved.points(wide).reshape(-1, 2))
        return np.asarray(np.concatenate(parts) @ self.turn)


def polar_angle(point: Point) -> float:
    """Angle of a point from the axis of the tooth [rad]."""
    return atan2(point[0], point[1])
