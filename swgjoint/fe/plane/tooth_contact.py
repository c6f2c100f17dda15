"""Closest points between the deformed flanks of flexspline and circular spline.

Both flanks are smooth curves: the analytic profile plus a cubic spline of displacements
that are averaged over the contact patch. Straight facets between the nodes would add
their chord error, about a micrometre, to a kinematic error of a few micrometres.

The search uses mirrored frames: the left flank of a tooth is reflected about the tooth
axis, so that every flank is treated as a right one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from swgjoint.fe.plane.circular_spline import (
    BEYOND,
    CORNER,
    MIRROR,
    CircularSpline,
    FlankSplines,
)
from swgjoint.fe.plane.compiled_search import CompiledSearch, Flanks, SeenFeet
from swgjoint.fe.plane.contact_points import Contacts, node_weights, outward_normals
from swgjoint.fe.plane.corotation import rotate
from swgjoint.typing import Array, Index, Mask

SAMPLES_PER_NODE = 2
"""Number of gap samples per flank node in a fast search."""
DENSE_SAMPLES = 8
"""Number of gap samples per flank node in a thorough search."""
REFINEMENTS = 6
"""Largest number of Newton iterations that refine a contact point."""
REFINED = 1e-12
"""Change of the arc lengths below which the refinement ends [m]."""
MERGE = 1e-6
"""Distance below which two points count as one contact, as a fraction of the flank
length [-]."""
NEAR = 0.02
"""Excess of the gap of a sample near a minimum over the largest gap of a candidate, as
a fraction of the flank length [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothContact:
    """Search for contact candidates at one state."""

    element: Flanks
    """Flanks of the flexspline."""
    circular_spline: CircularSpline
    """Flanks of the circular spline."""
    circular_spline_flank: Array
    """Displacements of the circular spline's flank nodes in the frames of its teeth,
    including manufacturing errors (N_c, 2 n_c) [m]; no columns if it is rigid."""
    angle: Array
    """Angles of the sector frames relative to the circular spline (N,) [rad]."""
    bearing: Array
    """Polar angles of the teeth relative to the circular spline (N,) [rad]; each tooth
    enters the nearest tooth space."""
    rubs: bool = False
    """Whether to determine the derivatives along the flanks that friction needs."""

    @cached_property
    def _circular_spline_flanks(self) -> FlankSplines | None:
        """Displacements of the circular spline's flanks; None for rigid flanks.

        They are in the mirrored frames; flank ``side`` of tooth ``tooth`` has the index
        2 tooth + side.
        """
        nodes = self.circular_spline.mirror_flanks(self.circular_spline_flank)
        if nodes is None:
            return None
        return FlankSplines.fit(self.circular_spline.spline, nodes)

    @cached_property
    def _compiled(self) -> CompiledSearch | None:
        """The same search in compiled code; None if it is not available."""
        limits = dict(corner=CORNER, beyond=BEYOND, refined=REFINED)
        return CompiledSearch.for_flanks(
            self.element,
            self.circular_spline,
            self.circular_spline.mirror_flanks(self.circular_spline_flank),
            self.angle,
            self.bearing,
            teeth_in_model=len(self.circular_spline_flank),
            limits={**limits, "refinements": REFINEMENTS},
        )

    def search(
        self,
        flank: Array,
        reach: float,
        held: Contacts | None,
        *,
        thorough: bool = True,
        searched: Mask | None = None,
    ) -> Contacts:
        """Contact candidates: local minima of the gap, plus points that carry force.

        The gap must not be negative at any point of a flank, which is a continuum of
        conditions. On conforming flanks (straight on straight) the minimum of the gap
        jumps from one end of the contact to the other. Points that carry force
        therefore stay in the working set, next to the new minima (exchange method of
        semi-infinite programming).

        Args:
            flank: Displacements of the flank nodes in the sector frames (N, 2 n_b) [m].
            reach: Largest gap of a candidate [m].
            held: Points of the last iteration that carry force; None if there are none.
            thorough: Whether to sample the gap densely, on the displaced circular
                spline: minima on conforming flanks can be closer than the nodes.
            searched: Whether to search each flank (N, 2); None for all.
        """
        if searched is None:
            searched = np.ones((len(flank), 2), dtype=bool)
        low, high = self.element.flank_range
        limit = reach + NEAR * (high - low)
        if self._compiled is not None:
            dense = DENSE_SAMPLES if thorough else 0
            sector, side, station = self._compiled.find_minima(
                flank, searched, SAMPLES_PER_NODE, dense, limit
            )
        else:
            sector, side, station = self._minima(flank, searched, limit, thorough)
        if held is not None and len(held):
            sector, side, station = held.add_places(
                sector, side, station, MERGE * (high - low)
            )
        contacts = self.gather(sector, side, station, flank)
        return contacts.chosen(np.flatnonzero(contacts.gap < reach))

    def _minima(
        self, flank: Array, searched: Mask, limit: float, thorough: bool
    ) -> tuple[Index, Index, Array]:
        """Sectors, sides and arc lengths [m] of the local minima of the gap, each (n,).

        ``limit`` is the largest gap of a sample near a minimum [m]; for the other
        arguments see :meth:`search`.
        """
        element = self.element
        size = element.flank_size
        # flanks in their mirrored frames: (N, 2 sides, size, 2)
        shaped = flank.reshape(-1, 2, size, 2) * MIRROR[:, None, :]
        chosen = np.flatnonzero(searched)
        sides = shaped.reshape(-1, size, 2)[chosen]
        sector, side = np.divmod(chosen, 2)
        s, gap, sector, side = self._sampled(
            SAMPLES_PER_NODE, sides, sector, side, rigid=True
        )
        near = gap.min(axis=1, initial=np.inf) < limit
        gap, sector, side = gap[near], sector[near], side[near]
        if thorough:
            s, gap, sector, side = self._sampled(
                DENSE_SAMPLES, shaped[sector, side], sector, side, rigid=False
            )
        padded = np.full((len(gap), gap.shape[1] + 2), np.inf)
        padded[:, 1:-1] = gap
        minimum = (
            np.isfinite(gap)
            & (gap <= padded[:, :-2])
            & (gap < padded[:, 2:])
            & (gap < limit)
        )
        index, k = np.nonzero(minimum)
        sector, side = sector[index], side[index]
        station = self._refine(s[k], shaped[sector, side], sector, side, s[1] - s[0])
        return sector, side, station

    def _sampled(
        self, per_node: int, sides: Array, sector: Index, side: Index, *, rigid: bool
    ) -> tuple[Array, Array, Index, Index]:
        """Gaps at equally spaced points of flanks that reach into the circular spline.

        Args:
            per_node: Number of samples per flank node.
            sides: Displacements of the flanks in their mirrored frames (n, size, 2)
                [m].
            sector: Sector of each flank (n,).
            side: Side of each flank (n,).
            rigid: Whether to neglect the displacement of the circular spline.

        Returns:
            Arc lengths (n_samples,) [m], gaps (n_deep, n_samples) [m], sectors and
            sides (n_deep,).
        """
        element = self.element
        s = np.linspace(*element.flank_range, per_node * element.flank_size)
        base, outward, _ = element.profile.evaluate(s)
        points = base + element.spline(s) @ sides
        # a flank can touch only beyond the tip circle of the circular spline
        farthest = np.hypot(points[..., 0], points[..., 1]).max(axis=-1)
        deep = farthest > self.circular_spline.profile.addendum_radius
        sector, side = sector[deep], side[deep]
        seen = self.find_feet(
            points[deep].reshape(-1, 2),
            np.tile(outward, (len(sector), 1)),
            np.repeat(sector, s.size),
            np.repeat(side, s.size),
            rigid=rigid,
            steps=2,
        )
        return s, seen.feet.gap.reshape(len(sector), s.size), sector, side

    def find_feet(
        self,
        points: Array,
        outward: Array,
        sector: Index,
        side: Index,
        *,
        rigid: bool = False,
        start: Array | None = None,
        steps: int = 3,
    ) -> SeenFeet:
        """Feet, on the circular spline, of points in the mirrored sector frames.

        Args:
            points: Points on the displaced flanks (n, 2) [m].
            outward: Outward normals of the flexspline there (n, 2).
            sector: Sector of each point (n,).
            side: Side of each point (n,).
            rigid: Whether to neglect the displacement of the circular spline.
            start: Arc lengths near the feet (n,) [m]; by default the feet on the rigid
                flanks.
            steps: Number of Newton steps.
        """
        if self._compiled is not None:
            return self._compiled.see(
                points, outward, sector, side, rigid=rigid, start=start, steps=steps
            )
        circular_spline = self.circular_spline
        teeth = circular_spline.profile.teeth
        pitch = 2.0 * pi / teeth
        sign = np.where(side == 0, 1.0, -1.0)
        # in the mirrored global frame the tooth is at sign * angle, and its right flank
        # faces the left flank of the circular-spline tooth half a pitch clockwise from
        # the middle of the space
        space = np.round(sign * self.bearing[sector] / pitch)
        turn = sign * self.angle[sector] - (space - 0.5) * pitch
        seen = rotate(points, turn) * MIRROR[1]
        facing = rotate(outward, turn) * MIRROR[1]
        # tooth j of the circular spline is half a pitch counter-clockwise from space j
        tooth = np.where(side == 0, space - 1, -space).astype(np.int64)
        tooth %= len(self.circular_spline_flank)
        flanks = None if rigid else self._circular_spline_flanks
        feet = circular_spline.feet(
            seen,
            flanks,
            2 * tooth + 1 - side,
            facing=facing,
            start=start,
            steps=steps,
        )
        return SeenFeet(
            feet=feet,
            normal=rotate(feet.normal * MIRROR[1], -turn),
            rest=rotate(feet.rest * MIRROR[1], -turn),
            tooth=tooth,
        )

    def _displaced(self, s: Array, mirrored: Array) -> tuple[Array, Array, Array]:
        """Points of displaced flanks, tangents from tip to root, profile curvatures.

        Args:
            s: Arc lengths (n,) [m].
            mirrored: Displacements of the flanks in mirrored frames (n, size, 2) [m].
        """
        element = self.element
        base, outward, curvature = element.profile.evaluate(s)
        point = base + np.einsum("ks,ksi->ki", element.spline(s), mirrored)
        # tangent of the profile from tip to root: the outward normal turned clockwise
        tangent = np.stack([outward[:, 1], -outward[:, 0]], axis=-1)
        slope = np.einsum("ks,ksi->ki", element.spline(s, 1), mirrored)
        return point, tangent + slope, curvature

    def _refine(
        self,
        station: Array,
        mirrored: Array,
        sector: Index,
        side: Index,
        spacing: float,
    ) -> Array:
        """Minima of the gap, by Newton's method on its slope along the flank.

        Args:
            station: Arc lengths near the minima (n,) [m].
            mirrored: Displacements of the flanks in mirrored frames (n, size, 2) [m].
            sector: Sector of each point (n,).
            side: Side of each point (n,).
            spacing: Distance between the samples, half the width of the brackets [m].

        Returns:
            Arc lengths of the minima (n,) [m].
        """
        if self._compiled is not None:
            return self._compiled.refine(station, mirrored, sector, side, spacing)
        element = self.element
        low, high = element.flank_range
        low_s = np.maximum(station - spacing, low)
        high_s = np.minimum(station + spacing, high)
        s, foot = station, None
        for _ in range(REFINEMENTS):
            point, tangent, curvature = self._displaced(s, mirrored)
            seen = self.find_feet(
                point,
                outward_normals(tangent),
                sector,
                side,
                start=foot,
                steps=3 if foot is None else 2,
            )
            foot, corner = seen.feet.station, seen.feet.corner
            slope = np.einsum("ki,ki->k", seen.normal, tangent)
            relative = curvature + seen.feet.curvature
            if corner.any():
                # at a corner, find the point of the flank that is closest to it
                beside = np.einsum("ki,ki->k", seen.rest, tangent)
                slope = np.where(corner, beside, slope)
                depth = np.einsum("ki,ki->k", seen.rest, seen.normal)
                relative = np.where(corner, 1.0 + curvature * depth, relative)
            # shrink the bracket around the minimum and stay inside
            high_s = np.where(slope > 0.0, s, high_s)
            low_s = np.where(slope <= 0.0, s, low_s)
            newton = s - slope / np.where(np.abs(relative) > 1e-3, relative, 1e-3)
            good = (relative > 1e-3) & (newton >= low_s) & (newton <= high_s)
            last, s = s, np.where(good, newton, 0.5 * (low_s + high_s))
            if np.abs(s - last).max(initial=0.0) < REFINED:
                break
        return s

    def gather(
        self,
        sector: Index,
        side: Index,
        station: Array,
        flank: Array,
        *,
        weighted: bool = True,
    ) -> Contacts:
        """Contacts with all their derivatives at given points of the flanks.

        Args:
            sector: Sector of each point (n,).
            side: Side of each point (n,).
            station: Arc length of each point (n,) [m].
            flank: Displacements of the flank nodes in the sector frames (N, 2 n_b) [m].
            weighted: Whether the derivatives are needed; compiled code may omit them.

        Returns:
            The contacts; the gap of a point that faces no flank is infinite.
        """
        if self._compiled is not None:
            at = sector, side, station, flank
            return self._compiled.gather(*at, rubs=self.rubs, weighted=weighted)
        element, mirror = self.element, MIRROR[side]
        size, n = element.flank_size, len(sector)
        shaped = flank.reshape(-1, 2, size, 2)[sector, side]
        spline = element.spline(station) if n else np.zeros((0, size))
        mirrored, tangent, _ = self._displaced(station, shaped * mirror[:, None, :])
        point = mirrored * mirror
        seen = self.find_feet(mirrored, outward_normals(tangent), sector, side)
        gap = seen.contact_gaps(station, tangent, element.flank_range)
        normal = seen.normal * mirror
        # in the mirrored frame the flexspline's normal is -n: its tangent is J n
        tangent = np.stack([-seen.normal[:, 1], seen.normal[:, 0]], axis=-1) * mirror
        # a flank and the flank that it faces are on opposite sides of their teeth, so
        # that mirroring reverses tangents
        facing, out = MIRROR[1 - side], seen.feet.normal
        circular_spline_normal = out * facing
        circular_spline_tangent = np.stack([out[:, 1], -out[:, 0]], axis=-1) * facing
        circular_spline_shapes = np.zeros((n, 0))
        slip, none = np.full(n, np.nan), np.zeros((n, 0))
        if seen.feet.station is not None:
            circular_spline_shapes = self.circular_spline.spline(seen.feet.station)
            slip = station + seen.feet.station
        return Contacts(
            sector=sector,
            side=side,
            station=station,
            gap=gap,
            normal=normal,
            point=point,
            weight=node_weights(side, spline, normal),
            tooth=seen.tooth,
            circular_spline_weight=-node_weights(
                1 - side, circular_spline_shapes, circular_spline_normal
            ),
            tangent=tangent,
            sliding=node_weights(side, spline, tangent) if self.rubs else none,
            circular_spline_sliding=-node_weights(
                1 - side, circular_spline_shapes, circular_spline_tangent
            )
            if self.rubs
            else none,
            slip=slip,
        )
