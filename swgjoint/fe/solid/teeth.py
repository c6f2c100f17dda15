"""Tooth contact over the face width: the 2D contact search in every plane of the mesh.

The flanks of the circular spline are parallel to the axis, so that a point of a
flexspline flank touches them in its own plane z = const. Crowning makes the teeth of
the flexspline thinner towards both ends of the face width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.plane.circular_spline import CircularSpline
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.tooth_contact import ToothContact
from swgjoint.fe.solid.circular_spline import ElasticCircularSpline
from swgjoint.fe.solid.corotation import SolidFrames, spin
from swgjoint.fe.solid.strip.strip import Strip
from swgjoint.fe.solid.wave_generator.surface import crown
from swgjoint.typing import Array, Index


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
class ToothRows:
    """The n candidate contacts of all planes and the derivatives of their gaps."""

    contacts: Contacts
    """Candidates as the 2D search finds them in each plane."""
    plane: Index
    """Plane of each candidate (n,)."""
    weight: Array
    """Derivative of the gaps by the displacements of the flexspline's flank nodes, in
    the frames of its teeth (n, n_flank) [-]."""
    circular_spline_weight: Array
    """Derivative of the gaps by the displacements of the circular spline's flank nodes,
    in the frames of its teeth (n, n_c) [-]."""
    rows: Array
    """Derivative of the gaps by the masters of the toothed segments in the global frame
    (n, 3 m) [-]."""
    arm: Array
    """Lever arm of the normals: derivative of the gaps by a rotation of the whole
    flexspline about the axis of the drive (n,) [m]."""
    circular_spline_arm: Array
    """Lever arm about the axis of the circular spline: negative derivative of the gaps
    by a rotation of the circular spline (n,) [m]."""

    def __len__(self) -> int:
        return len(self.plane)

    def chosen(self, index: Index) -> ToothRows:
        """The candidates with the given indices."""
        picked = {
            key: getattr(self, key)[index]
            for key in self.__dataclass_fields__
            if key != "contacts"
        }
        return ToothRows(contacts=self.contacts.chosen(index), **picked)


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

    def find(
        self,
        frame: SolidFrames,
        force: Array,
        circular_spline_force: Array,
        reach: float,
        held: ToothRows | None,
        *,
        thorough: bool,
        circular_spline_rotation: float = 0.0,
    ) -> ToothRows:
        """Find the candidate contacts at a state.

        Args:
            frame: Frames of the toothed segments.
            force: Forces at the loaded degrees of freedom of these segments (N, n_b)
                [N].
            circular_spline_force: Forces on the flanks of the circular spline
                (N_c, n_c) [N].
            reach: Largest gap of a candidate [m].
            held: Contacts of the last iteration that carry force; None if there are
                none.
            thorough: Whether to search between the nodes, see
                :meth:`swgjoint.fe.plane.tooth_contact.ToothContact.search`.
            circular_spline_rotation: Rotation of the circular spline [rad].
        """
        # deflected flank nodes, seen in every plane from the rotated frame of the tooth
        strip = self.strip
        n, planes, size = len(frame.turn), strip.planes, 2 * strip.flank_size
        teeth, flank = strip.teeth, strip.flank_dofs
        moved = frame.displacement @ teeth.loaded_from_masters[:flank].T
        moved += force @ teeth.compliance[:, :flank]
        local = strip.flank + moved.reshape(n, planes, size, 3)
        nodes = np.einsum("sij,spbj->spbi", frame.turn, local)
        turn = frame.turn
        angle = np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1])
        flat = rotate(nodes[..., :2], -angle[:, None, None])
        plane_flank = flat - strip.flank[..., :2] + self.crowning.displacement(strip)
        if self.shift is not None:
            plane_flank = plane_flank + self.shift[:, None, None]
        centre = flat.mean(axis=2)
        seen = angle - circular_spline_rotation
        # displacements of the circular spline: elastic ones, shifts and tilt
        displacements = np.zeros((self.circular_spline_teeth, planes, 0))
        if self.elastic_circular_spline is not None:
            displacements = self.elastic_circular_spline.displacement(
                circular_spline_force
            )
            displacements = displacements.reshape(
                self.circular_spline_teeth, planes, -1
            )
        displacements = displacements + np.tile(
            self._circular_spline_offset(circular_spline_rotation),
            displacements.shape[2] // 2,
        )
        # the 2D search in every plane
        parts, numbers = [], []
        for p in range(planes):
            search = ToothContact(
                element=strip,
                circular_spline=self.circular_spline,
                circular_spline_flank=displacements[:, p],
                angle=seen,
                bearing=seen - np.arctan2(centre[:, p, 0], centre[:, p, 1]),
            )
            old = None
            if held is not None and len(held):
                old = held.contacts.chosen(np.flatnonzero(held.plane == p))
            in_plane = search.search(
                plane_flank[:, p].reshape(n, -1), reach, old, thorough=thorough
            )
            parts.append(in_plane)
            numbers.append(np.full(len(in_plane), p))
        contacts = parts[0]
        for part in parts[1:]:
            contacts = Contacts.join(contacts, part)
        return self._rows(contacts, np.concatenate(numbers), frame, nodes, angle)

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

    def _rows(
        self,
        contacts: Contacts,
        plane: Index,
        frame: SolidFrames,
        nodes: Array,
        angle: Array,
    ) -> ToothRows:
        """Candidates of the planes with the derivatives of their gaps."""
        # normals and points in the global frame, and the lever arms of the normals
        strip = self.strip
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
        circular_spline_arm = arm
        if self.tilt is not None:
            x, y = np.multiply.outer(self.tilt, strip.mesh.teeth.z[plane])
            circular_spline_arm = arm - (normal[:, 1] * x - normal[:, 0] * y)
        # derivatives by the flank nodes in the frames of the segments
        seen = np.einsum("kji,kj->ki", turn, normal)
        at = np.einsum("kji,kj->ki", turn, point)
        on_nodes = np.zeros((n, strip.planes, 2, size, 3))
        on_nodes[np.arange(n), plane, side] = spline[:, :, None] * seen[:, None, :]
        weight = on_nodes.reshape(n, strip.flank_dofs)
        # derivatives by the masters: deformation and rotation of the frame
        carried = weight @ teeth.loaded_from_masters[: strip.flank_dofs]
        m = frame.position.shape[1]
        middle = at - frame.centre[sector] - teeth.position.mean(axis=0)
        s = -spin(frame.position[sector]).reshape(n, 3 * m, 3)
        turning = np.cross(middle, seen) - np.einsum("km,kmw->kw", carried, s)
        rows = carried + np.einsum("kw,kwm->km", turning, frame.gradient[sector])
        rows = np.einsum("kij,kaj->kai", turn, rows.reshape(n, m, 3))
        width = contacts.circular_spline_weight.shape[1]
        circular_spline_weight = np.zeros((n, strip.planes, width))
        circular_spline_weight[np.arange(n), plane] = contacts.circular_spline_weight
        return ToothRows(
            contacts=contacts,
            plane=plane,
            weight=weight,
            circular_spline_weight=circular_spline_weight.reshape(
                n, strip.planes * width
            ),
            rows=rows.reshape(n, 3 * m),
            arm=arm,
            circular_spline_arm=circular_spline_arm,
        )

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
        return matrix
