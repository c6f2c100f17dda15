r"""The circular spline: rigid, or elastic with its outer diameter fixed or free.

Its strains are small, so the model is linear. In the frames of the teeth, the block
:math:`G_{k-j}` of a block-circulant compliance gives the flank displacement of tooth k
per force on the flanks of tooth j. If the outer diameter is fixed, the blocks decay
within a few teeth; if it is free, the circular spline can become oval.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from swgjoint.fe.common.block_circulant import (
    SharedShapes,
    contact_compliance,
    respond,
)
from swgjoint.fe.common.cyclic import CyclicFactor
from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array, Index

NEGLIGIBLE = 1e-9
"""Size, divided by that of the largest block, below which blocks are dropped [-]."""
CORNER = 0.05
"""Largest distance from a corner at which it is a contact candidate, as a fraction of
the flank length [-]."""
BEYOND = 1e-9
"""Overshoot past the end of the flank from which a foot counts as a corner, as a
fraction of the flank length [-]."""
MIRROR = np.array([[1.0, 1.0], [-1.0, 1.0]])
"""Signs of vectors in mirrored frames: rows for the right and the left flank."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Compliance:
    """Response of the teeth to flank forces, by the tooth offset k - j."""

    element: Superelement
    """Condensed sector of the circular spline."""
    offsets: Index
    """Offsets k - j of the responding tooth k from the loaded tooth j (n_offsets,)."""
    flank: Array
    """Flank displacement per flank force, G (n_offsets, 2 n_b, 2 n_b) [m/N]."""
    skeleton: Array
    """Skeleton displacement per flank force (n_offsets, 2 n_a, 2 n_b) [m/N]."""

    def displacement(self, force: Array) -> Array:
        """Flank displacement (N, 2 n_b) [m] under flank forces (N, 2 n_b) [N]."""
        return self._by_shapes.respond(force)

    @cached_property
    def _by_shapes(self) -> SharedShapes:
        return SharedShapes.from_blocks(self.offsets, self.flank)

    def skeleton_displacement(self, force: Array) -> Array:
        """Skeleton displacement (N, 2 n_a) [m] under flank forces (N, 2 n_b) [N]."""
        return respond(self.offsets, self.skeleton, force)

    def contact_compliance(self, tooth: Index, weight: Array, teeth: int) -> Array:
        """Compliance between contact points.

        Args:
            tooth: Tooth of each point (n,).
            weight: Derivative of each point's gap with respect to the flank
                displacements of its tooth (n, 2 n_b) [-].
            teeth: Number of teeth in the model.

        Returns:
            Change of each gap per force at each point (n, n) [m/N].
        """
        return contact_compliance(self.offsets, self.flank, tooth, weight, teeth)


def circular_spline_compliance(
    element: Superelement, *, free_rim: bool = False
) -> Compliance:
    """Compliance of a circular spline under forces on its flanks.

    Args:
        element: Condensed sector of the circular spline.
        free_rim: Whether the outer diameter can deform. If so, only its mean
            translation and rotation are held, and equal shares of the reaction act on
            its nodes; otherwise the nodes are fixed.
    """
    n_teeth, size = element.sectors, element.face_size
    n_a = len(element.skeleton)
    pitch = 2.0 * np.pi / n_teeth
    # express the last face in the next tooth's frame, where it is the first face
    turn = np.eye(2 * n_a)
    corner = rotate(np.eye(2), np.array(pitch)).T
    for node in range(n_a - size, n_a):
        turn[2 * node : 2 * node + 2, 2 * node : 2 * node + 2] = corner
    matrix = turn.T @ element.stiffness @ turn
    load = turn.T @ element.flank_from_skeleton.T
    rhs = np.zeros((n_teeth, *load.shape))
    outside = np.r_[size - 1 : n_a - size, n_a - 1]  # outer diameter and its corners
    scale = float(np.mean(np.diag(element.stiffness)))
    blocks = np.broadcast_to(matrix, (n_teeth, *matrix.shape))
    if free_rim:
        nodes = outside[:-1]  # the last corner is the next tooth's first
        rigid = _rigid_modes(element.skeleton, n_teeth)
        held = rigid[:, nodes].reshape(n_teeth, -1, 3)
        weight = np.einsum("tia,tib->ab", held, held)
        # resultant of the flank forces, reacted in equal shares by the outer nodes
        resultant = (element.flank_from_skeleton @ rigid[0].reshape(-1, 3)).T
        share = -held @ np.linalg.solve(weight, resultant)
        dofs = (2 * nodes[:, None] + np.arange(2)).ravel()
        rhs[:, dofs] = share
        rhs[0] += load
        # three springs, which carry no load, suppress the rigid-body motion
        blocks, first = blocks.copy(), 2 * nodes[0]
        for tooth, dof in ((0, first), (0, first + 1), (n_teeth // 2, first)):
            blocks[tooth, dof, dof] += scale
    else:
        fixed = (2 * outside[:, None] + np.arange(2)).ravel()
        matrix[fixed] = 0.0
        matrix[:, fixed] = 0.0
        matrix[fixed, fixed] = scale
        load[fixed] = 0.0
        rhs[0] = load
        blocks = np.broadcast_to(matrix, blocks.shape)
    skeleton = turn @ CyclicFactor(blocks, 2 * size).solve(rhs)
    if free_rim:
        moved = np.einsum("tia,til->al", held, skeleton[:, dofs])
        drift = np.linalg.solve(weight, moved)
        skeleton -= rigid.reshape(n_teeth, -1, 3) @ drift
    flank = element.flank_from_skeleton @ skeleton
    flank[0] += element.flank_compliance
    strength = np.abs(flank).max(axis=(1, 2))
    kept = np.flatnonzero(strength > NEGLIGIBLE * strength.max())
    offsets = np.where(kept > n_teeth // 2, kept - n_teeth, kept)
    return Compliance(
        element=element, offsets=offsets, flank=flank[kept], skeleton=skeleton[kept]
    )


def _rigid_modes(skeleton: Array, teeth: int) -> Array:
    """Two translations and a rotation in the frames of the teeth (N, n_a, 2, 3)."""
    angle = np.asarray(2.0 * np.pi / teeth * np.arange(teeth), dtype=np.float64)
    shape = (teeth, *skeleton.shape)
    shifts = [
        np.broadcast_to(rotate(axis, -angle)[:, None], shape) for axis in np.eye(2)
    ]
    return np.stack(
        [*shifts, np.broadcast_to(rotate_right_angle(skeleton), shape)], axis=-1
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class CircularSpline:
    """Tooth surface of the circular spline that the flexspline's teeth touch."""

    profile: ToothProfile
    """Undeformed tooth profile."""
    compliance: Compliance | None = None
    """Compliance of the teeth; None for a rigid circular spline and for one plane of a
    3D model."""
    weights: CubicSpline | None = None
    """Weights of the flank nodes in a plane of a 3D model; None in a 2D model."""

    @property
    def flank_dofs(self) -> int:
        """Degrees of freedom of the flanks of one tooth; zero if rigid."""
        if self.compliance is None and self.weights is None:
            return 0
        return 4 * int(self.spline.c.shape[-1])

    @property
    def spline(self) -> CubicSpline:
        """Weights of one flank's nodes over the arc length [m]; elastic teeth only."""
        if self.weights is not None:
            return self.weights
        assert self.compliance is not None
        return self.compliance.element.spline

    def mirror_flanks(self, flank: Array) -> Array | None:
        """Displacements of flank nodes in mirrored frames (2 N_c, n_nodes, 2) [m].

        Flank ``side`` of tooth ``tooth`` has the index 2 tooth + side.

        Args:
            flank: Displacements in the frames of the teeth (N_c, 2 n_c) [m].

        Returns:
            The displacements; None for rigid flanks.
        """
        if not self.flank_dofs:
            return None
        shaped = flank.reshape(-1, 2, self.flank_dofs // 4, 2) * MIRROR[:, None, :]
        return np.asarray(shaped.reshape(-1, *shaped.shape[2:]))

    def feet(
        self,
        points: Array,
        flanks: FlankSplines | None,
        index: Index,
        *,
        facing: Array | None = None,
        start: Array | None = None,
        steps: int = 3,
    ) -> Feet:
        """Feet of points on right flanks, found on the deformed curves.

        If the foot of a point is beyond an end of its flank, the point faces the corner
        there: its gap is the distance to the corner along the normal of the flexspline
        at the point. The gap is infinite if the corner is farther away than
        :data:`CORNER`, if ``facing`` is None, or if the flanks are rigid.

        Args:
            points: Points in the frame of a circular-spline tooth, mirrored where
                necessary so that they face its right flank (n, 2) [m].
            flanks: Flank displacements in that frame; None for rigid flanks.
            index: Number, in ``flanks``, of the flank that each point faces (n,).
            facing: Normals of the flexspline at the points, in that frame (n, 2).
            start: Arc lengths near the feet (n,) [m]; by default the feet on the rigid
                flank.
            steps: Number of Newton steps. Each multiplies the error of the foot by gap
                times curvature; the error of the gap is of second order in that of the
                foot.
        """
        outside = np.zeros(len(points), dtype=bool)
        if flanks is None or start is None:
            gap, normal, curvature = self.profile.signed_distance(points)
            if flanks is None:
                return Feet(
                    gap=gap,
                    normal=normal,
                    curvature=curvature,
                    corner=outside,
                    rest=np.zeros_like(points),
                )
            outside = ~np.isfinite(gap)
            inside = np.where(outside, 0.0, gap)
            start = self._station(points - inside[:, None] * normal)
        low, high = float(flanks.breaks[0]), float(flanks.breaks[-1])
        s, wanted = start, start
        side = -1.0 if self.profile.internal else 1.0
        for _ in range(steps):
            base, outward, curvature = self.profile.evaluate(s)
            moved, slope = flanks.evaluate_at(index, s)
            tangent = side * np.stack([outward[:, 1], -outward[:, 0]], axis=-1) + slope
            rest = points - base - moved
            size = np.hypot(tangent[:, 0], tangent[:, 1])
            unit = tangent / size[:, None]
            normal = side * np.stack([-unit[:, 1], unit[:, 0]], axis=-1)
            gap = rest[:, 0] * normal[:, 0] + rest[:, 1] * normal[:, 1]
            along = (rest[:, 0] * unit[:, 0] + rest[:, 1] * unit[:, 1]) / size
            wanted = s + along / np.maximum(1.0 + curvature * gap, 0.1)
            s = np.clip(wanted, low, high)
        corner = np.abs(wanted - s) > BEYOND * (high - low)
        rest = np.zeros_like(points)
        gap = np.where(outside & ~corner, np.inf, gap)
        if corner.any():
            at = np.flatnonzero(corner)
            end = (
                self.profile.evaluate(s[at])[0]
                + flanks.evaluate_at(index[at], s[at])[0]
            )
            rest[at] = points[at] - end
            gap[at] = np.inf
            if facing is not None:
                normal = normal.copy()
                normal[at] = -facing[at]
                depth = np.einsum("ki,ki->k", rest[at], normal[at])
                near = np.hypot(rest[at, 0], rest[at, 1]) < CORNER * (high - low)
                gap[at] = np.where(near, depth, np.inf)
        return Feet(
            gap=gap,
            normal=normal,
            curvature=curvature,
            corner=corner,
            rest=rest,
            station=s,
        )

    @cached_property
    def stations_by_radius(self) -> tuple[Array, Array]:
        """Arc lengths and radii [m] along the rigid flank, radii increasing."""
        stations = self.spline.x
        table = np.linspace(float(stations[0]), float(stations[-1]), 400)
        points, _, _ = self.profile.evaluate(table)
        radius = np.hypot(points[:, 0], points[:, 1])
        order = np.argsort(radius)
        return table[order], radius[order]

    def _station(self, foot: Array) -> Array:
        """Arc lengths [m] of points on the rigid flank, from their radii."""
        table, radius = self.stations_by_radius
        return np.interp(np.hypot(foot[:, 0], foot[:, 1]), radius, table)


@dataclass(frozen=True, kw_only=True, eq=False)
class FlankSplines:
    """Displacements of flanks as cubic splines along the profile."""

    breaks: Array
    """Arc lengths at the ends of the intervals (n_intervals + 1,) [m]."""
    coefficients: Array
    """Coefficients (n_flanks, n_intervals, 4, 2) of ascending powers of the distance
    [m] from the start of the interval; displacements in metres."""

    @classmethod
    def fit(cls, spline: CubicSpline, nodes: Array) -> FlankSplines:
        """Splines of the averaged displacements of flanks.

        Args:
            spline: Weights of the flank nodes as functions of the arc length [m].
            nodes: Node displacements (n_flanks, n_nodes, 2) [m].
        """
        cardinal = np.asarray(spline.c)[::-1]  # (4, n_intervals, n_nodes)
        order, intervals, n_nodes = cardinal.shape
        # one product: rows by interval and power, columns by flank and component
        rows = cardinal.transpose(1, 0, 2).reshape(-1, n_nodes)
        product = rows @ nodes.transpose(1, 0, 2).reshape(n_nodes, -1)
        shaped = product.reshape(intervals, order, len(nodes), 2)
        return cls(
            breaks=np.asarray(spline.x),
            coefficients=np.ascontiguousarray(shaped.transpose(2, 0, 1, 3)),
        )

    def evaluate_at(self, flank: Index, s: Array) -> tuple[Array, Array]:
        """Displacement and its derivative with respect to the arc length.

        Args:
            flank: Number of the flank of each point (n,).
            s: Arc length of each point (n,) [m].

        Returns:
            Displacement (n, 2) [m] and derivative (n, 2) [-].
        """
        j = np.searchsorted(self.breaks, s, side="right") - 1
        j = np.clip(j, 0, len(self.breaks) - 2)
        c, d = self.coefficients[flank, j], (s - self.breaks[j])[:, None]
        value = c[:, 0] + d * (c[:, 1] + d * (c[:, 2] + d * c[:, 3]))
        return value, c[:, 1] + d * (2.0 * c[:, 2] + d * 3.0 * c[:, 3])


@dataclass(frozen=True, kw_only=True, eq=False)
class Feet:
    """Feet of points on a flank of the circular spline."""

    gap: Array
    """Signed distance of each point from the flank (n,) [m]; infinite if there is
    neither a perpendicular foot nor a corner within reach."""
    normal: Array
    """Outward normal of the flank at the foot; at a corner, the opposite of the
    flexspline's normal (n, 2)."""
    curvature: Array
    """Curvature of the undeformed profile at the foot (n,) [1/m]."""
    corner: NDArray[np.bool_]
    """Whether the foot is an end of the flank instead of a perpendicular foot (n,)."""
    rest: Array
    """Vector from that end to the point; zero for a perpendicular foot (n, 2) [m]."""
    station: Array | None = None
    """Arc length of the foot on the profile (n,) [m]; None for a rigid flank."""
