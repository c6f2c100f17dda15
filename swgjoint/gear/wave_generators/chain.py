"""Outlines composed of arcs, lines and parabolas."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.gear.wave_generators.curve import ClosedCurve
from swgjoint.gear.wave_generators.pieces import OutlinePiece
from swgjoint.kernels import kernels
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain(ClosedCurve):
    """Closed convex outline of consecutive pieces; the first starts on the +y axis."""

    pieces: tuple[OutlinePiece, ...]
    """Pieces in counter-clockwise order."""
    major: float = field(init=False)
    """Largest radius [m]."""

    def __post_init__(self) -> None:
        largest = max(piece.largest_radius() for piece in self.pieces)
        object.__setattr__(self, "major", largest)

    @cached_property
    def stations(self) -> Array:
        """Arc length at the junctions, both ends included (n_pieces + 1,) [m]."""
        lengths = [piece.length for piece in self.pieces]
        return np.concatenate([[0.0], np.cumsum(lengths)])

    @property
    def perimeter(self) -> float:
        """Length of the closed outline [m]."""
        return float(self.stations[-1])

    @cached_property
    def rows(self) -> Array:
        """Description for compiled loops; see :attr:`ClosedCurve.rows`."""
        return np.array([piece.row for piece in self.pieces])

    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures; see :meth:`ClosedCurve.evaluate`.

        At a junction, the piece that starts there is evaluated.
        """
        along = self._within(s)
        last = len(self.pieces) - 1
        owner = np.clip(
            np.searchsorted(self.stations, along, side="right") - 1, 0, last
        )
        points, normals = np.empty((*along.shape, 2)), np.empty((*along.shape, 2))
        curvature = np.empty(along.shape)
        for k in np.unique(owner):
            here = owner == k
            points[here], normals[here], curvature[here] = self.pieces[k].evaluate_at(
                along[here] - self.stations[k]
            )
        return points, normals, curvature

    @cached_property
    def _starts(self) -> tuple[Array, Array]:
        """Points [m] and unit tangents at the starts of the pieces (n_pieces, 2)."""
        at = [piece.evaluate_at(np.zeros(1)) for piece in self.pieces]
        normals = np.concatenate([normal for _, normal, _ in at])
        tangents = np.stack([-normals[:, 1], normals[:, 0]], axis=-1)
        return np.concatenate([point for point, _, _ in at]), tangents

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distance, normal and curvature; see :class:`ClosedCurve`.

        For each point, the foot is sought on the pieces whose end normals enclose the
        point.
        """
        if (native := kernels()) is not None:
            found = np.empty((len(points), 4))
            native.outline_distance(np.ascontiguousarray(points), self.rows, found)
            return found[:, 0], found[:, 1:3], found[:, 3]
        starts, tangents = self._starts
        # whether a point is after the normal at the start of a piece, (n_pieces, n)
        after = np.einsum("kj,nj->kn", tangents, points)
        after = after >= np.einsum("kj,kj->k", tangents, starts)[:, None]
        strip = after & ~np.roll(after, -1, axis=0)
        # far inside, where normals of a parabola intersect, a point may be in no strip;
        # all pieces are then searched
        strip |= ~strip.any(axis=0)
        n = len(points)
        nearest = np.full(n, np.inf)
        distance, curvature = np.empty(n), np.empty(n)
        normals = np.empty((n, 2))
        for piece, inside in zip(self.pieces, strip, strict=True):
            index = np.flatnonzero(inside)
            if not index.size:
                continue
            foot, normal, bend = piece.evaluate_at(piece.foot(points[index]))
            rel = points[index] - foot
            size = np.hypot(rel[:, 0], rel[:, 1])
            better = size < nearest[index]
            take = index[better]
            nearest[take] = size[better]
            distance[take] = np.sum(rel[better] * normal[better], axis=-1)
            normals[take], curvature[take] = normal[better], bend[better]
        return distance, normals, curvature

    def corners(self) -> Array:
        """Corner angle at each piece's end, zero where smooth (n_pieces,) [rad]."""
        _, after = self._starts
        ends = [
            piece.evaluate_at(np.array([piece.length]))[1][0] for piece in self.pieces
        ]
        before = np.array([[-n[1], n[0]] for n in ends])
        after = np.roll(after, -1, axis=0)
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        return np.asarray(np.arctan2(cross, np.sum(before * after, axis=-1)))

    def gaps(self) -> Array:
        """Distance from each piece's end to the next piece (n_pieces,) [m]."""
        starts, _ = self._starts
        ends = [
            piece.evaluate_at(np.array([piece.length]))[0][0] for piece in self.pieces
        ]
        return np.asarray(np.hypot(*(np.array(ends) - np.roll(starts, -1, axis=0)).T))
