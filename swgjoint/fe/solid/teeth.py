"""Tooth contact over the face width: the 2D contact search in every plane of the mesh.

The flanks of the circular spline are parallel to the axis, so that a point of a
flexspline flank touches them in its own plane z = const. Crowning makes the teeth of
the flexspline thinner towards both ends of the face width. Crowned flanks also touch
between the planes of the mesh, see :mod:`swgjoint.fe.solid.flank_minima`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from swgjoint.fe.plane.circular_spline import CircularSpline
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.tooth_contact import ToothContact
from swgjoint.fe.solid.across import crown_bend
from swgjoint.fe.solid.circular_spline import ElasticCircularSpline
from swgjoint.fe.solid.corotation import SolidFrames, spin
from swgjoint.fe.solid.flank_minima import FlankSurfaces
from swgjoint.fe.solid.flank_points import FlankPoints
from swgjoint.fe.solid.strip.strip import Strip
from swgjoint.fe.solid.tooth_rows import ToothRows, flank_candidates
from swgjoint.fe.solid.wave_generator.surface import crown
from swgjoint.typing import Array, Index

Place = tuple[SolidFrames, Array, Array]
"""Frames of the toothed segments, flank nodes (N, n_planes, 2 n_b, 3) [m] and angles of
the frames (N,) [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlankCrowning:
    """Crowning of the flexspline's flanks over the face width."""

    height: float = 0.0
    """Material removed at the edges of the face width [m]."""
    width: float = 1.0
    """Face width [m]."""
    circular: bool = False
    """Whether the crown is a circular arc instead of a parabola."""

    def displacement(self, strip: Strip) -> Array:
        """Displacement of the flank nodes that represents the removed material.

        It is in x and y of the frame of a tooth and points into the tooth
        (n_planes, 2 n_b, 2) [m].
        """
        stations = strip.mesh.teeth.plane.flank_stations[:-1]
        _, outward, _ = strip.profile.evaluate(stations)
        both = np.concatenate([outward, outward * np.array([-1.0, 1.0])])
        depth, _ = crown(
            strip.mesh.teeth.z, self.height, self.width, circular=self.circular
        )
        return np.asarray(-depth[:, None, None] * both)


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidTeeth:
    """Flanks of both members and the search for contact between them."""

    strip: Strip
    """Condensed strip of the flexspline."""
    circular_spline: CircularSpline
    """Profile of the circular spline and weights of its flank nodes in a plane."""
    elastic_circular_spline: ElasticCircularSpline | None
    """Elastic circular spline; None if it is rigid."""
    circular_spline_teeth: int
    """Number of teeth of the circular spline in the model, N_c."""
    crowning: FlankCrowning
    shift: Array | None = None
    """Shifts of the flexspline's teeth by manufacturing errors, in the frames of the
    teeth (N, 2) [m]; None for perfect teeth."""
    circular_spline_shift: Array | None = None
    """Shifts of the circular spline's teeth by manufacturing errors, in the frames of
    the teeth (N_c, 2) [m]; None for perfect teeth. They need an elastic circular
    spline."""
    tilt: Array | None = None
    """Slope of the circular spline's axis in x and y (2,) [rad]; None without. This
    axis is fixed in space and intersects that of the drive at mid-face."""

    @property
    def circular_spline_dofs(self) -> int:
        """Number of flank degrees of freedom of a tooth of the circular spline, n_c.

        It is zero if the circular spline is rigid.
        """
        return (
            0
            if self.elastic_circular_spline is None
            else self.elastic_circular_spline.flank.shape[1]
        )

    def displace_circular_spline(self, force: Array) -> Array:
        """Displacements of the flanks of the circular spline (N_c, n_c) [m].

        Args:
            force: Forces on these flanks (N_c, n_c) [N].
        """
        if self.elastic_circular_spline is None:
            return np.zeros_like(force)
        return self.elastic_circular_spline.displacement(force)

    def find(
        self,
        frame: SolidFrames,
        force: Array,
        circular_spline_moved: Array,
        reach: float,
        held: ToothRows | None,
        *,
        thorough: bool,
        stay: bool = False,
        circular_spline_rotation: float = 0.0,
        held_force: Array | None = None,
    ) -> ToothRows:
        """Find the candidate contacts at a state.

        Args:
            frame: Frames of the toothed segments.
            force: Forces at the loaded degrees of freedom of these segments (N, n_b)
                [N].
            circular_spline_moved: Displacements of the flanks of the circular spline,
                see :meth:`displace_circular_spline` (N_c, n_c) [m].
            reach: Largest gap of a candidate [m].
            held: Contacts of the last iteration that carry force; None if there are
                none.
            thorough: Whether to search between the nodes, see
                :meth:`swgjoint.fe.plane.tooth_contact.ToothContact.search`.
            stay: See :func:`swgjoint.fe.solid.tooth_rows.flank_candidates`.
            circular_spline_rotation: Rotation of the circular spline [rad].
            held_force: Normal forces of the held contacts (n,) [N]; without them there
                are no slopes.
        """
        # deflected flank nodes, seen in every plane from the rotated frame of the tooth
        strip = self.strip
        n, planes, size = len(frame.turn), strip.planes, 2 * strip.flank_size
        teeth, flank = strip.teeth, strip.flank_dofs
        moved = frame.displacement @ teeth.loaded_from_masters[:flank].T
        moved += force @ teeth.compliance[:, :flank]
        local = strip.flank + moved.reshape(n, planes, size, 3)
        turn = frame.turn
        nodes = local.reshape(n, -1, 3) @ turn.transpose(0, 2, 1)
        nodes = nodes.reshape(local.shape)
        angle = np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1])
        flat = rotate(nodes[..., :2], -angle[:, None, None])
        plane_flank = flat - strip.flank[..., :2] + self.crowning.displacement(strip)
        if self.shift is not None:
            plane_flank = plane_flank + self.shift[:, None, None]
        centre = flat.mean(axis=2)
        seen = angle - circular_spline_rotation
        # displacements of the circular spline: elastic ones, shifts and tilt
        shape = self.circular_spline_teeth, planes, self.circular_spline_dofs // planes
        displacements = circular_spline_moved.reshape(shape) + np.tile(
            self._circular_spline_offset(circular_spline_rotation), shape[2] // 2
        )
        # the 2D search in every plane; between the planes crowned flanks are closer
        z, old = strip.mesh.teeth.z, held if held is not None and len(held) else None
        crowned = self.crowning.height > 0.0
        beyond = crown_bend(self.crowning.height, z) if crowned else 0.0
        parts, searches = list[Contacts](), list[ToothContact]()
        flanks = plane_flank.reshape(n, planes, -1).transpose(1, 0, 2)
        for p in range(planes):
            search = ToothContact(
                element=strip,
                circular_spline=self.circular_spline,
                circular_spline_flank=displacements[:, p],
                angle=seen,
                bearing=seen - np.arctan2(centre[:, p, 0], centre[:, p, 1]),
            )
            kept = None
            if old is not None and not crowned:
                kept = old.contacts.chosen(np.flatnonzero(old.plane == p))
            found = search.search(flanks[p], reach + beyond, kept, thorough=thorough)
            searches.append(search)
            parts.append(found)
        contacts = reduce(Contacts.join, parts)
        plane = np.repeat(np.arange(planes), [len(part) for part in parts])
        place = frame, nodes, angle
        if not crowned:
            return self._in_planes(contacts, plane, place)
        # minima between the planes
        surfaces = FlankSurfaces(searches=tuple(searches), flank=flanks)
        seeds, before = surfaces.seeds(contacts, plane), None
        if old is not None:
            before = FlankPoints.from_contacts(
                old.contacts, (old.z - z[0]) / (z[1] - z[0]), planes
            )
        points, loads = flank_candidates(
            surfaces, seeds, reach, before, held_force, stay=stay
        )
        return self._between(surfaces, points, loads, place)

    def _between(
        self,
        surfaces: FlankSurfaces,
        points: FlankPoints,
        loads: Array,
        place: Place,
    ) -> ToothRows:
        """Candidates between the planes, and slopes of their gaps.

        Args:
            surfaces: Gaps of the flanks.
            points: Places of the candidates (n,).
            loads: Forces of the first of them, which are minima; without force they
                have no slopes (m,) [N].
            place: Frames, flank nodes and angles.
        """
        strip, frame = self.strip, place[0]
        gaps = surfaces.gaps(points)
        n, planes = len(points), strip.planes
        # a minimum that carries force moves, unless it is at an end
        rolls, bend, skew = surfaces.springs(gaps)
        rolls[: len(loads)] &= (loads > 0.0)[:, None]
        rolls[len(loads) :] = False
        # weights of the contacts in the planes
        value, along, across = gaps.sums()
        across -= skew[:, None, None] * along
        some, way = np.nonzero(rolls)
        of = np.concatenate([np.arange(n), some])
        sums = np.concatenate([value, np.stack([along, across], axis=1)[some, way]])
        spring = np.zeros(len(of))
        spring[n:] = bend[some, way] / loads[some]
        # the contacts in all planes, and their sums
        contacts, number = surfaces.contacts(points), np.tile(np.arange(planes), 3 * n)
        spline, push, turning, arm, facing_arm = (
            part.reshape(n, 3, planes, *part.shape[1:])[of]
            for part in self._directions(contacts, number, place)
        )
        sector, side = points.sector[of], points.side[of]
        row = np.arange(len(of))
        on_nodes = np.zeros((len(of), planes, 2, strip.flank_size, 3))
        on_nodes[row[:, None], np.arange(planes), side[:, None]] = np.einsum(
            "rkp,rkpb,rkpi->rpbi", sums, spline, push
        )
        weight = on_nodes.reshape(len(of), strip.flank_dofs)
        nearest = points.nearest[of]
        near = contacts.chosen((3 * of + 1) * planes + nearest)

        by_own, by_facing = (
            np.einsum(
                "rkp,rkpw->rpw",
                sums,
                part.reshape(n, 3, planes, part.shape[1])[of],
            )
            for part in (contacts.weight, contacts.circular_spline_weight)
        )
        near = replace(
            near,
            gap=np.einsum("rkp,rkp->r", sums, gaps.gap[of]),
            weight=by_own.sum(axis=1),
            circular_spline_weight=by_facing.sum(axis=1),
        )
        z = strip.mesh.teeth.z
        return ToothRows(
            contacts=near,
            plane=nearest,
            z=z[0] + (z[1] - z[0]) * points.place[of],
            slope=row >= n,
            spring=spring,
            weight=weight,
            circular_spline_weight=by_facing.reshape(
                len(of), planes * by_facing.shape[2]
            ),
            rows=self._by_masters(
                weight, np.einsum("rkp,rkpi->ri", sums, turning), sector, frame
            ),
            arm=np.einsum("rkp,rkp->r", sums, arm),
            circular_spline_arm=np.einsum("rkp,rkp->r", sums, facing_arm),
        )

    def circular_spline_place(self, circular_spline_rotation: float) -> Array:
        """Angular positions of the teeth of the circular spline (N_c,) [rad]."""
        # tooth j is half a pitch ahead of space j
        pitch = 2.0 * np.pi / self.circular_spline.profile.teeth
        return np.asarray(
            pitch * (np.arange(self.circular_spline_teeth) + 0.5)
            + circular_spline_rotation
        )

    def _circular_spline_offset(self, circular_spline_rotation: float) -> Array:
        """Displacement of the circular spline's teeth by shift and tilt in every plane.

        It is in the frames of the teeth (N_c, n_planes, 2) [m].
        """
        planes = self.strip.mesh.teeth.z
        offset = np.zeros((self.circular_spline_teeth, len(planes), 2))
        if self.circular_spline_shift is not None:
            offset += self.circular_spline_shift[:, None]
        if self.tilt is not None:
            turned = rotate(
                self.tilt, -self.circular_spline_place(circular_spline_rotation)
            )
            offset += np.multiply.outer(turned, planes).transpose(0, 2, 1)
        return offset

    def _in_planes(self, contacts: Contacts, plane: Index, place: Place) -> ToothRows:
        """Candidates in the planes with the derivatives of their gaps."""
        strip, n = self.strip, len(plane)
        spline, push, turning, arm, facing_arm = self._directions(
            contacts, plane, place
        )
        on_nodes = np.zeros((n, strip.planes, 2, strip.flank_size, 3))
        on_nodes[np.arange(n), plane, contacts.side] = (
            spline[:, :, None] * push[:, None, :]
        )
        weight = on_nodes.reshape(n, strip.flank_dofs)
        width = contacts.circular_spline_weight.shape[1]
        facing = np.zeros((n, strip.planes, width))
        facing[np.arange(n), plane] = contacts.circular_spline_weight
        return ToothRows(
            contacts=contacts,
            plane=plane,
            z=strip.mesh.teeth.z[plane],
            slope=np.zeros(n, dtype=bool),
            spring=np.zeros(n),
            weight=weight,
            circular_spline_weight=facing.reshape(n, strip.planes * width),
            rows=self._by_masters(weight, turning, contacts.sector, place[0]),
            arm=arm,
            circular_spline_arm=facing_arm,
        )

    def _directions(
        self, contacts: Contacts, plane: Index, place: Place
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Directions in which contacts in the planes push.

        Returns:
            Weights of the nodes of the flank (n, size); normals in the frames of the
            segments (n, 3); their moments about the middles of the segments (n, 3) [m];
            lever arms about the axes of the drive and of the circular spline, each (n,)
            [m].
        """
        # normals and points in the global frame, and the lever arms of the normals
        strip, (frame, nodes, angle) = self.strip, place
        sector, side, n = contacts.sector, contacts.side, len(plane)
        size, teeth = strip.flank_size, strip.teeth
        turn = frame.turn[sector]
        normal = np.zeros((n, 3))
        normal[:, :2] = rotate(contacts.normal, angle[sector])
        point = np.zeros((n, 3))
        point[:, :2] = rotate(contacts.point, angle[sector])
        spline = strip.spline(contacts.station) if n else np.zeros((0, size))
        on_side = nodes[sector, plane].reshape(n, 2, size, 3)[np.arange(n), side]
        point[:, 2] = np.einsum("kb,kb->k", spline, on_side[..., 2])
        arm = normal[:, 1] * point[:, 0] - normal[:, 0] * point[:, 1]
        facing_arm = arm
        if self.tilt is not None:
            x, y = np.multiply.outer(self.tilt, strip.mesh.teeth.z[plane])
            facing_arm = arm - (normal[:, 1] * x - normal[:, 0] * y)
        push = np.einsum("kji,kj->ki", turn, normal)
        at = np.einsum("kji,kj->ki", turn, point)
        middle = at - frame.centre[sector] - teeth.position.mean(axis=0)
        return spline, push, np.cross(middle, push), arm, facing_arm

    def _by_masters(
        self, weight: Array, turning: Array, sector: Index, frame: SolidFrames
    ) -> Array:
        """Derivatives of gaps by the masters in the global frame (n, 3 m) [-].

        Args:
            weight: Derivatives by the flank nodes in the frames of the segments
                (n, n_flank) [-].
            turning: Moments of the normals about the middles of the segments (n, 3)
                [m].
            sector: Sectors (n,).
            frame: Frames of the toothed segments.
        """
        # deformation and rotation of the frame
        n, m = len(sector), frame.position.shape[1]
        carried = weight @ self.strip.teeth.loaded_from_masters[: weight.shape[1]]
        s = -spin(frame.position[sector]).reshape(n, 3 * m, 3)
        turning = turning - np.einsum("km,kmw->kw", carried, s)
        rows = carried + np.einsum("kw,kwm->km", turning, frame.gradient[sector])
        rows = np.einsum("kij,kaj->kai", frame.turn[sector], rows.reshape(n, m, 3))
        return np.asarray(rows.reshape(n, 3 * m))

    def compliance(self, found: ToothRows) -> Array:
        """Compliance between candidates through the teeth of both members (n, n) [m/N].

        The masters of the flexspline are fixed.
        """
        flank = self.strip.flank_dofs
        flank_compliance = self.strip.teeth.compliance[:flank, :flank]
        sector = found.contacts.sector
        same = sector[:, None] == sector[None, :]
        matrix = np.where(same, found.weight @ flank_compliance @ found.weight.T, 0.0)
        if self.elastic_circular_spline is not None:
            matrix += self.elastic_circular_spline.contact_compliance(
                found.contacts.tooth,
                found.circular_spline_weight,
                self.circular_spline_teeth,
            )
        matrix[np.diag_indices(len(found))] += found.spring
        return matrix
