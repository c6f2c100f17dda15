r"""Outer surface of the wave generator's outer race, which supports the rim's bore.

The surface is straight over its width except for a crown of depth c(z). Roll of the
race moves its edge at z = b/2 outward by u and the other edge inward. A point of the
bore at a distance d from the mean line of a race of thickness t and width b has the gap

.. math:: g = d - \tfrac12 t + c(z) - \frac{2z}{b}\,u ,

where z is measured from the middle of the race.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.rings.hermite_ring import hermite
from swgjoint.fe.solid.wave_generator.surface import crown
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array, Mask
from swgjoint.units import mm, um


@dataclass(frozen=True, kw_only=True)
class RaceOutside:
    """Outer surface of the race."""

    thickness: float
    """Thickness t of the race [m]."""
    width: float
    """Width b of the race [m]."""
    crowning: float
    """Depth of the crown at the edges of the face width [m]."""
    face_width: float
    """Face width of the teeth [m]."""
    circular: bool
    """Whether the crown is a circular arc instead of a parabola."""

    @classmethod
    def from_design(cls, design: Design) -> RaceOutside:
        """Outer surface of a design's race."""
        bearing, shape = BallBearing.from_design(design), design.micro_geometry
        return cls(
            thickness=bearing.race_thickness,
            width=bearing.race_width,
            crowning=shape.wave_generator_crowning_um * um,
            face_width=design.drive.face_width_mm * mm,
            circular=shape.crowning_kind == "circular",
        )

    def covers(self, z: Array) -> Mask:
        """Mask of the positions z along the axis [m] that are on the race."""
        return np.asarray(np.abs(z) <= 0.5 * self.width * (1.0 + 1e-9))

    def gap(
        self, line: Array, edge: Array, points: Array, start: Array
    ) -> tuple[Array, ...]:
        """Gap of points to the outside, and its derivatives.

        The cubic of an element is extrapolated to points beyond its ends.

        Args:
            line: Mean line by element: x and y of value and derivative by the parameter
                at the first node, then at the last node (N, 4, 2) [m].
            edge: Roll displacements u in the same order (N, 4) [m].
            points: Points of every sector in the global frame (N, b, 3) [m].
            start: Initial guess of their parameters on the elements, 0 to 1 (b,) [-].

        Returns:
            Gap (N, b) [m], and its derivatives by the points (N, b, 3), by the mean
            line (N, b, 4, 2) and by u (N, b, 4) [-].
        """
        value, first, second = hermite(self._foot(line, points, start))
        # distance from the mean line, roll at the foot and its derivative along the
        # outside
        r, v, w = (h @ line for h in (value, first, second))
        flat, z = points[..., :2], points[..., 2]
        length = np.hypot(v[..., 0], v[..., 1])
        tangent = v / length[..., None]
        normal = np.stack([tangent[..., 1], -tangent[..., 0]], -1)
        distance = np.sum((flat - r) * normal, axis=-1)
        spread = 1.0 - distance * np.sum(normal * w, axis=-1) / length**2
        lever = 2.0 * z / self.width
        roll = np.einsum("sba,sa->sb", value, edge)
        rolls = np.einsum("sba,sa->sb", first, edge) / (length * spread)
        lowered, by_z = crown(z, self.crowning, self.face_width, circular=self.circular)
        gap = distance - 0.5 * self.thickness + lowered - lever * roll
        # roll varies along the race: the foot of a point moves by u_t + d beta
        along = (lever * rolls)[..., None]
        by_point = np.empty(points.shape)
        by_point[..., :2] = normal - along * tangent
        by_point[..., 2] = by_z - 2.0 / self.width * roll
        turn = (lever * rolls * distance / length)[..., None]
        moved = -value[..., :, None] * by_point[..., None, :2]
        moved -= (turn * first)[..., :, None] * normal[..., None, :]
        return gap, by_point, moved, -lever[..., None] * value

    def bend_gap(
        self, line: Array, points: Array, start: Array
    ) -> tuple[Array, Array, Array]:
        r"""Second derivative of the gap of points to the outside, without roll.

        If a point slides by :math:`\sigma` along the mean line and the line turns by
        :math:`\vartheta` towards it, the gap changes to second order by half of

        .. math:: \frac{\kappa\sigma^2 - 2\sigma\vartheta - D\vartheta^2}
            {1 + \kappa D}

        with the distance D and the curvature :math:`\kappa` of the line.

        Args:
            line: Mean line by element, see :meth:`gap` (N, 4, 2) [m].
            points: Points of every sector in the global frame (N, b, 3) [m].
            start: Initial guess of their parameters on the elements, 0 to 1 (b,) [-].

        Returns:
            Coefficients (N, b, 2, 2) of the quadratic form of sliding and turn, the
            derivative of the sliding by the points (N, b, 3), and the derivatives of
            sliding and turn by the mean line (N, b, 2, 4, 2).
        """
        value, first, second = hermite(self._foot(line, points, start))
        r, v, w = (h @ line for h in (value, first, second))
        length = np.hypot(v[..., 0], v[..., 1])
        tangent = v / length[..., None]
        normal = np.stack([tangent[..., 1], -tangent[..., 0]], -1)
        distance = np.sum((points[..., :2] - r) * normal, axis=-1)
        curvature = -np.sum(normal * w, axis=-1) / length**2
        ones = np.ones_like(distance)
        form = np.stack([curvature, -ones, -ones, -distance], axis=-1)
        form /= (1.0 + curvature * distance)[..., None]
        by_point = np.concatenate([tangent, 0.0 * ones[..., None]], axis=-1)
        slope = first / length[..., None]
        by_line = np.stack(
            [
                -value[..., :, None] * tangent[..., None, :],
                slope[..., :, None] * normal[..., None, :],
            ],
            axis=2,
        )
        return form.reshape(*distance.shape, 2, 2), by_point, by_line

    def _foot(self, line: Array, points: Array, start: Array) -> Array:
        """Parameters of the feet of points on the mean line (N, b) [-].

        Found by Newton's method.
        """
        flat = points[..., :2]
        xi = np.broadcast_to(start, flat.shape[:2]).copy()
        for _ in range(8):
            r, v, w = (h @ line for h in hermite(xi))
            rest = flat - r
            step = np.sum(rest * v, axis=-1) / np.sum(v * v - rest * w, axis=-1)
            xi += np.clip(step, -1.0, 1.0)
            if np.abs(step).max() < 1e-12:
                break
        return np.asarray(xi)
