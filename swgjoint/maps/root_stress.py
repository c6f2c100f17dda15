"""Signed stress in the tooth root of the flexspline, from the fields of a map.

The fields contain the von Mises stress at the points of the displayed surface. At a
free surface in uniaxial tension or compression it equals the magnitude of the principal
stress along the surface. The sign is that of the dilatation of the surface there: of
the area of the adjacent triangles or, in a 2D map, of the length of the adjacent edges.

Limitations: a peak between the displayed points is missed, and the surface of a 3D map
has points only at both edges of the face width; the stress of a pressed surface is not
uniaxial, and in shear the sign is arbitrary.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.fields import DriveFields
from swgjoint.typing import Array

ROOT_PART = 0.25
"""Part of the tooth height, from the root land, that counts as the tooth root [-]."""
TOOTHED = 0.5
"""Part of the largest tooth height that a plane across the axis needs to be part of the
toothed rim [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SignedRootStress:
    """Signed von Mises stress at the points of the tooth root."""

    torque: Array
    """Output torques, increasing [N·m]. Shape (n_torques,)."""
    first_place: Array
    """First stored place at each torque [rad]. Shape (n_torques,)."""
    period: float
    """Period of the place [rad]."""
    stress: Array
    """Stress, positive in tension [Pa]. Shape (n_torques, n_places, n_points)."""

    def evaluate_at(self, place: Array, torque: Array, point: int) -> Array:
        """Stress of one point at given places and torques [Pa]. Shape (n,).

        Values are interpolated linearly, as in :meth:`.DriveFields.evaluate_at`.

        Args:
            place: Angle of the tooth relative to the first lobe [rad]. Shape (n,).
            torque: Output torques inside the stored range [N·m]. Shape (n,).
            point: Index of the point.
        """
        table = self.stress[:, :, point]
        count = table.shape[1]
        last = max(len(self.torque) - 2, 0)
        low = np.clip(np.searchsorted(self.torque, torque) - 1, 0, last)
        high = np.minimum(low + 1, len(self.torque) - 1)
        step = np.where(high > low, self.torque[high] - self.torque[low], 1.0)
        share = np.clip((torque - self.torque[low]) / step, 0.0, 1.0)
        total = np.zeros(len(place))
        for row, weight in ((low, 1.0 - share), (high, share)):
            x = (place - self.first_place[row]) / self.period * count
            floor = np.floor(x)
            part, k = x - floor, floor.astype(np.int64) % count
            total += weight * (1.0 - part) * table[row, k]
            total += weight * part * table[row, (k + 1) % count]
        return total


def root_stress(fields: DriveFields) -> SignedRootStress:
    """Signed stress of the tooth root of the flexspline.

    Args:
        fields: Fields of a map.
    """
    points = root_points(fields)
    stress = fields.von_mises[:, :, points] * _signs(fields, points)
    return SignedRootStress(
        torque=fields.torque,
        first_place=fields.first_place,
        period=fields.period,
        stress=np.asarray(stress, dtype=float),
    )


def root_points(fields: DriveFields) -> NDArray[np.int64]:
    """Indices of the surface points in the tooth root, at least one (n,).

    The tooth root reaches from the root land up to :data:`ROOT_PART` of the tooth
    height. The root land is at the edge of the tooth sector, the tip in its middle.
    """
    x, y, z = fields.points.T
    radius, angle = np.hypot(x, y), np.abs(np.arctan2(x, y))
    tolerance = 1e-6 * radius.max()
    planes = np.round(z / tolerance)
    outer = []  # plane, radii of root land and tip
    for plane in np.unique(planes):
        here = planes == plane
        side = here & (angle > (1.0 - 1e-3) * angle[here].max())
        outer.append((plane, radius[side].max(), radius[here].max()))
    height = max(tip - land for _, land, tip in outer)
    chosen = np.zeros(len(radius), dtype=bool)
    for plane, land, tip in outer:
        if tip - land >= max(TOOTHED * height, tolerance):
            top = land + ROOT_PART * (tip - land)
            inside = (radius >= land - 10.0 * tolerance) & (radius <= top)
            chosen |= (planes == plane) & inside
    if not chosen.any():  # a ring without teeth: all of its surface
        chosen[:] = True
    return np.flatnonzero(chosen)


def _signs(fields: DriveFields, points: NDArray[np.int64]) -> Array:
    """Sign of the surface dilatation (n_torques, n_places, n_points)."""
    flat = not np.ptp(fields.points[:, 2])
    if flat:
        faces = _surface_edges(fields)
    else:  # without the end faces of the teeth, whose triangles reach to the bore
        faces = fields.triangles[np.ptp(fields.points[fields.triangles, 2], axis=1) > 0]
    rest = _measure(fields.points, faces)
    signs = np.empty((*fields.von_mises.shape[:2], len(points)))
    touching = [np.flatnonzero((faces == point).any(axis=1)) for point in points]
    for k, displacement in enumerate(fields.displacement):
        now = _measure(fields.points + displacement.astype(float), faces)
        for n, near in enumerate(touching):
            grown = now[:, near].sum(axis=1) - rest[near].sum()
            signs[k, :, n] = np.where(grown < 0.0, -1.0, 1.0)
    return signs


def _measure(points: Array, faces: NDArray[np.int64]) -> Array:
    """Lengths of edges (n, 2), or twice the areas of triangles (n, 3) [m or m²]."""
    side = points[..., faces[:, 1], :] - points[..., faces[:, 0], :]
    if faces.shape[1] == 3:
        side = np.cross(side, points[..., faces[:, 2], :] - points[..., faces[:, 0], :])
    return np.asarray(np.linalg.norm(side, axis=-1))


def _surface_edges(fields: DriveFields) -> NDArray[np.int64]:
    """Edges of a 2D section on its free surface (n, 2), without the sector's sides."""
    t = fields.triangles
    edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    edges = edges[count == 1]
    angle = np.arctan2(fields.points[:, 0], fields.points[:, 1])
    side = np.abs(angle) > (1.0 - 1e-3) * np.abs(angle).max()
    along = side[edges].all(axis=1) & (
        np.ptp(angle[edges], axis=1) < np.abs(angle).max()
    )
    return np.asarray(edges[~along], dtype=np.int64)
