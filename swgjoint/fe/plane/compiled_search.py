"""Interface to the compiled search for tooth contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol
from weakref import WeakKeyDictionary

import numpy as np
from scipy.interpolate import CubicSpline

from swgjoint.fe.plane.circular_spline import CircularSpline, Feet
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index, Mask

if TYPE_CHECKING:
    from swgjoint.kernels.compiled import Flank, Search

PAST = 1e-3
"""Distance of a corner past the tip of the flexspline from which the two tips have
slipped past each other and do not touch, as a fraction of the flank length [-]."""
_flanks: WeakKeyDictionary[Flanks | CircularSpline, Flank] = WeakKeyDictionary()
"""Compiled profiles of members, which every search between these members uses."""


class Flanks(Protocol):
    """Both flanks of the flexspline's teeth in one plane."""

    @property
    def profile(self) -> ToothProfile:
        """Profile of the right flank."""

    @property
    def spline(self) -> CubicSpline:
        """Weights of one flank's nodes in the displacement at an arc length [m]."""

    @property
    def flank_size(self) -> int:
        """Number of nodes of one flank."""

    @property
    def flank_range(self) -> tuple[float, float]:
        """Arc lengths between which a flank can touch [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenFeet:
    """Feet of points of the flexspline on the circular spline.

    The feet are in the mirrored frames of the circular spline's teeth, the vectors
    below in the mirrored sector frames.
    """

    feet: Feet
    """Feet on the flanks of the circular spline."""
    normal: Array
    """Normal at each foot (n, 2)."""
    rest: Array
    """Vector from a corner to each point; zero for a perpendicular foot (n, 2) [m]."""
    tooth: Index
    """Tooth of the circular spline that each point faces (n,)."""

    def contact_gaps(
        self, station: Array, tangent: Array, flank: tuple[float, float]
    ) -> Array:
        """Gaps of the points, infinite where two tips have slipped past each other.

        A corner of the circular spline that is beyond the tip of the flexspline, seen
        along the flank, has nothing to touch, although it is close to the tip.

        Args:
            station: Arc lengths of the points (n,) [m].
            tangent: Tangents of the flexspline there, from tip to root (n, 2) [-].
            flank: Arc lengths of the tip and of the root end of the flexspline's flank
                [m].

        Returns:
            The gaps (n,) [m].
        """
        beside = np.einsum("ki,ki->k", self.rest, tangent)
        corner = station - beside / np.hypot(tangent[:, 0], tangent[:, 1])
        past = self.feet.corner & (corner < flank[0] - PAST * (flank[1] - flank[0]))
        return np.where(past, np.inf, self.feet.gap)


@dataclass(frozen=True, kw_only=True, eq=False)
class CompiledSearch:
    """Compiled loops of :class:`swgjoint.fe.plane.tooth_contact.ToothContact`."""

    search: Search
    """The loops with the flanks of one state."""
    rigid: bool
    """Whether the circular spline is rigid."""
    radius: float
    """Radius of the circular spline's tips, beyond which points may touch [m]."""
    nodes: tuple[int, int]
    """Numbers of nodes of one flank of both members; zero for a rigid one."""

    @classmethod
    def for_flanks(
        cls,
        element: Flanks,
        circular_spline: CircularSpline,
        displaced: Array | None,
        angle: Array,
        bearing: Array,
        *,
        teeth_in_model: int,
        limits: dict[str, float],
    ) -> CompiledSearch | None:
        """Compiled search between two sets of flanks.

        Args:
            element: Flanks of the flexspline.
            circular_spline: Flanks of the circular spline.
            displaced: Displacements of the flank nodes of the circular spline in their
                mirrored frames (2 N_c, n_nodes, 2) [m]; None for rigid flanks.
            angle: Angles of the sector frames relative to the circular spline (N,)
                [rad].
            bearing: Polar angles of the teeth relative to the circular spline (N,)
                [rad].
            teeth_in_model: Number of teeth of the circular spline in the model.
            limits: Constants of the search, by the arguments of
                ``swgjoint.kernels.compiled.Limits``.

        Returns:
            The search; None if there are no compiled loops.
        """
        native = kernels()
        if native is None:
            return None
        facing, spline = circular_spline.profile, element.spline
        # rigid flanks need no arc lengths by radius: any two points will do
        stations, radii = np.arange(2.0), np.arange(2.0)
        breaks, weights, nodes = np.zeros(2), np.zeros((4, 1, 0)), np.zeros((0, 0, 2))
        if displaced is not None:
            stations, radii = circular_spline.stations_by_radius
            facing_spline, nodes = circular_spline.spline, displaced
            breaks, weights = facing_spline.x, facing_spline.c
        search: Search = native.Search(
            _flank_of(element),
            np.ascontiguousarray(spline.x),
            np.ascontiguousarray(spline.c),
            *element.flank_range,
            _flank_of(circular_spline),
            np.ascontiguousarray(radii),
            np.ascontiguousarray(stations),
            np.ascontiguousarray(breaks),
            np.ascontiguousarray(weights),
            np.ascontiguousarray(nodes),
            facing.teeth,
            teeth_in_model,
            np.ascontiguousarray(angle),
            np.ascontiguousarray(bearing),
            native.Limits(past=PAST, **limits),
        )
        return cls(
            search=search,
            rigid=displaced is None,
            radius=facing.addendum_radius,
            nodes=(element.flank_size, weights.shape[2]),
        )

    def find_minima(
        self, flank: Array, searched: Mask, coarse: int, dense: int, limit: float
    ) -> tuple[Index, Index, Array]:
        """Sectors, sides and arc lengths [m] of the local minima of the gap, each (n,).

        Args:
            flank: Displacements of the flank nodes in the sector frames (N, 2 n_b) [m].
            searched: Whether to search each flank (N, 2).
            coarse: Number of gap samples per flank node with a rigid circular spline.
            dense: Number of samples on the flanks that are near; zero for the others.
            limit: Largest gap of a sample near a minimum [m].
        """
        shaped = flank.reshape(len(flank), 2, -1, 2)
        return self.search.minima(
            np.ascontiguousarray(shaped),
            np.ascontiguousarray(searched),
            coarse,
            dense,
            limit,
            self.radius,
        )

    def gather(
        self,
        sector: Index,
        side: Index,
        station: Array,
        flank: Array,
        *,
        rubs: bool,
        weighted: bool = True,
    ) -> Contacts:
        """Contact points with all their derivatives at given points of the flanks.

        Args:
            sector: Sector of each point (n,).
            side: Side of each point (n,).
            station: Arc length of each point (n,) [m].
            flank: Displacements of the flank nodes in the sector frames (N, 2 n_b) [m].
            rubs: Whether to determine the derivatives along the flanks.
            weighted: Whether to determine those of the gaps.
        """
        n, (own, other) = len(sector), self.nodes
        real, tooth = np.empty((n, 8)), np.empty(n, dtype=np.int64)
        wanted = [weighted, weighted, rubs, rubs]
        weights = [
            np.zeros((n if some else 0, 2, size, 2))
            for some, size in zip(wanted, (own, other, own, other), strict=True)
        ]
        self.search.meet(
            np.ascontiguousarray(flank.reshape(len(flank), 2, -1, 2)),
            np.ascontiguousarray(sector),
            np.ascontiguousarray(side),
            np.ascontiguousarray(station),
            real,
            tooth,
            *weights,
        )
        by_flank, by_facing, sliding, facing_sliding = (
            part.reshape(n, 4 * part.shape[2] if some else 0)
            for some, part in zip(wanted, weights, strict=True)
        )
        return Contacts(
            sector=sector,
            side=side,
            station=station,
            gap=real[:, 0],
            normal=real[:, 1:3],
            point=real[:, 3:5],
            weight=by_flank,
            tooth=tooth,
            circular_spline_weight=by_facing,
            tangent=real[:, 5:7],
            sliding=sliding,
            circular_spline_sliding=facing_sliding,
            slip=real[:, 7],
        )

    def see(
        self,
        points: Array,
        outward: Array,
        sector: Index,
        side: Index,
        *,
        rigid: bool,
        start: Array | None,
        steps: int,
    ) -> SeenFeet:
        """Feet, on the circular spline, of points in the mirrored sector frames.

        Args:
            points: Points on the displaced flanks (n, 2) [m].
            outward: Outward normals of the flexspline there (n, 2).
            sector: Sector of each point (n,).
            side: Side of each point (n,).
            rigid: Whether to neglect the displacement of the circular spline.
            start: Arc lengths near the feet (n,) [m]; None starts from the feet on the
                rigid flanks.
            steps: Number of Newton steps.
        """
        n, rigid = len(points), rigid or self.rigid
        # columns: gap, normal and rest in the mirrored sector frame, curvature, arc
        # length, and normal and rest in the mirrored frame of the circular spline
        real, corner = np.empty((n, 11)), np.empty(n, dtype=np.bool_)
        tooth = np.empty(n, dtype=np.int64)
        self.search.see(
            np.ascontiguousarray(points),
            np.ascontiguousarray(outward),
            np.ascontiguousarray(sector),
            np.ascontiguousarray(side),
            rigid,
            start,
            steps,
            real,
            corner,
            tooth,
        )
        feet = Feet(
            gap=real[:, 0],
            normal=real[:, 7:9],
            curvature=real[:, 5],
            corner=corner,
            rest=real[:, 9:],
            station=None if rigid else real[:, 6],
        )
        return SeenFeet(feet=feet, normal=real[:, 1:3], rest=real[:, 3:5], tooth=tooth)

    def refine(
        self,
        station: Array,
        mirrored: Array,
        sector: Index,
        side: Index,
        spacing: float,
    ) -> Array:
        """Arc lengths of the minima of the gap (n,) [m].

        Args:
            station: Arc lengths near the minima (n,) [m].
            mirrored: Displacements of the flanks in mirrored frames (n, size, 2) [m].
            sector: Sector of each point (n,).
            side: Side of each point (n,).
            spacing: Distance between the samples, half the width of the brackets [m].
        """
        refined = np.array(station)
        self.search.refine(
            refined,
            np.ascontiguousarray(mirrored),
            np.ascontiguousarray(sector),
            np.ascontiguousarray(side),
            spacing,
        )
        return refined


def _flank_of(member: Flanks | CircularSpline) -> Flank:
    """Compiled profile of a member."""
    if (flank := _flanks.get(member)) is None:
        native, profile = kernels(), member.profile
        assert native is not None
        flank = _flanks[member] = native.Flank(
            profile.pieces, profile.edges, *profile.curves, profile.side
        )
    return flank
