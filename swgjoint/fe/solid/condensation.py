"""Condensation of the 3D drive to its contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.solid.corotation import SolidFrames, about_z
from swgjoint.fe.solid.linearise import SolidLinearised
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.tangent import SolidTangent, TangentResponse
from swgjoint.fe.solid.tooth_rows import ToothRows
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidates:
    """Tooth contacts of one state, with what does not depend on the wave generator."""

    rows: ToothRows
    """The n contacts."""
    compliance: Array
    """Compliance between them through the teeth of both members (n, n) [m/N]."""
    eased: Array
    """Changes of their gaps by the previous tooth forces (n,) [m]."""

    @classmethod
    def find(
        cls,
        model: SolidSectorModel,
        state: SolidState,
        frame: SolidFrames,
        search: tuple[float, bool, bool],
    ) -> Candidates:
        """Candidates near a state.

        Args:
            model: The 3D model.
            state: The state.
            frame: Frames of the toothed segments.
            search: Largest gap [m], and the options ``thorough`` and ``stay`` of
                :meth:`swgjoint.fe.solid.teeth.SolidTeeth.find`.
        """
        reach, thorough, stay = search
        moved = model.teeth.displace_circular_spline(state.circular_spline_force)
        rows = model.teeth.find(
            frame,
            model.loads(state),
            moved,
            reach,
            state.held,
            thorough=thorough,
            stay=stay,
            circular_spline_rotation=state.circular_spline_rotation,
            held_force=state.tooth_force,
        )
        return cls.from_rows(model, state, rows, moved)

    @classmethod
    def from_rows(
        cls,
        model: SolidSectorModel,
        state: SolidState,
        rows: ToothRows,
        circular_spline_moved: Array,
    ) -> Candidates:
        """Candidates of a state.

        Args:
            model: The 3D model.
            state: The state.
            rows: The contacts.
            circular_spline_moved: Displacements of the flanks of the circular spline
                (N_c, n_c) [m].
        """
        # few sectors have candidates
        strip = model.strip
        near, place = np.unique(rows.contacts.sector, return_inverse=True)
        flank = strip.flank_dofs
        pushed = model.loads(state)[near] @ strip.teeth.compliance[:, :flank]
        eased = np.einsum("kb,kb->k", rows.weight, pushed[place])
        if model.teeth.elastic_circular_spline is not None:
            facing = circular_spline_moved[rows.contacts.tooth]
            eased += np.einsum("kb,kb->k", rows.circular_spline_weight, facing)
        return cls(rows=rows, compliance=model.teeth.compliance(rows), eased=eased)


@dataclass(frozen=True, kw_only=True, eq=False)
class Condensed:
    """The linearised ring condensed to its n tooth contacts and two rotations.

    The unknowns are the n tooth forces and the increments of two rotations: that of the
    bore of the diaphragm and that of the circular spline. The results are the n gaps
    and the two moments that these members exert on their supports. With these signs the
    matrix is symmetric. Forces and moments are those of the model, which is half of the
    drive in a half model.
    """

    system: Array
    """Matrix from unknowns to results (n + 2, n + 2) in SI units."""
    offset: Array
    """Results if all unknowns are zero (n + 2,) [m] and [N·m]."""
    coupling: Array
    """Derivative of the gaps to the wave generator in the sector of each tooth contact
    by its force (n, p) [m/N]."""
    response: TangentResponse
    """Response of the ring to its own imbalance, a unit rotation of the bore of the
    diaphragm, and the tooth forces."""
    value: Array
    """Motion of the masters on the bore of the diaphragm if all unknowns are zero, and
    by a unit rotation (N, size, 2)."""

    def increment(self, unknown: Array) -> Array:
        """Increment of the coordinates of the sectors (N, size) [m].

        Args:
            unknown: The unknowns (n + 2,).
        """
        force, turn = unknown[:-2], unknown[-2]
        moved = self.response.combine(np.concatenate([[1.0, turn], force]))
        return np.asarray(moved + self.value @ np.array([1.0, turn]))


def condense(
    model: SolidSectorModel,
    state: SolidState,
    linear: SolidLinearised,
    tangent: SolidTangent,
    candidates: Candidates | None,
    rotation: float | None = None,
) -> Condensed:
    """Condense the ring to tooth contacts and rotations.

    Args:
        model: The 3D model.
        state: State at which the ring is linearised.
        linear: The linearised ring.
        tangent: Its factorised tangent, or that of a state nearby.
        candidates: Tooth contacts; None if there are none.
        rotation: Rotation of the bore of the diaphragm to which its unknown is relative
            [rad]; None for the rotation of the state.
    """
    masters, bore, strip = model.strip.masters, linear.bore, model.strip
    teeth_dofs, held = model.dofs(strip.teeth.masters), model.dofs(masters.held)
    n_sectors, size = linear.gradient.shape
    found = None if candidates is None else candidates.rows
    n = 0 if found is None else len(found)
    # two prescribed motions of the diaphragm's bore: to that rotation, and by a unit
    # rotation from there
    rotation = state.rotation if rotation is None else rotation
    target = np.einsum("ij,saj->sai", about_z(np.array(rotation)), model.reference)
    value = np.zeros((n_sectors, size, 2))
    still = target - model.masters(state)
    value[:, held, 0] = still[:, masters.held].reshape(n_sectors, -1)
    around = np.stack([-target[..., 1], target[..., 0], 0.0 * target[..., 2]], axis=-1)
    value[:, held, 1] = around[:, masters.held].reshape(n_sectors, -1)

    # derivatives of the tooth gaps, with the contact of the wave generator condensed
    rows, local, gap = np.zeros((n, size)), np.zeros((n, n)), np.zeros(n)
    coupling = np.zeros((n, bore.gap.shape[1]))
    if candidates is not None and found is not None and n:
        sector = found.contacts.sector
        flank = strip.flank_dofs
        at_bore = found.weight @ strip.teeth.compliance[:flank, flank:]
        at_bore = at_bore.reshape(n, -1, 3)
        coupling = np.einsum("kbi,kbi->kb", at_bore, bore.normal[sector])
        coupling = bore.with_vertices(coupling, sector)
        at_points = np.take_along_axis(coupling, bore.points[sector], axis=1)
        eased = (at_points[:, None] @ bore.inverse[sector])[:, 0]
        into = model.contact_dofs
        rows[:, into] = -(eased[:, None] @ bore.rows[sector])[:, 0]
        rows[:, teeth_dofs] += found.rows
        same = sector[:, None] == sector[None, :]
        local = candidates.compliance - np.where(same, eased @ at_points.T, 0.0)
        gap = found.contacts.gap - candidates.eased
        free = bore.among_points(bore.free_gap)
        gap -= np.einsum("kp,kp->k", eased, free[sector])

    # response of the ring to its own imbalance, a unit rotation and the tooth forces
    out_of, reaction = linear.gradient + linear.pushed, tangent.by_held @ value[:, held]
    loads = -reaction
    loads[:, :, 0] -= out_of
    at = np.zeros(0, dtype=np.int64) if found is None else found.contacts.sector
    response = tangent.respond(loads, at, rows, bore)
    products = response.products

    # gaps, and the moments of the bore of the diaphragm and of the circular spline
    system, offset = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    moved = np.einsum("sip,siq->pq", reaction, value)
    system[n, :n] = products[1, 2:]
    system[n, n] = products[1, 1] - moved[1, 1]
    offset[n] = products[1, 0] - moved[1, 0]
    offset[n] -= np.sum(value[:, held, 1] * out_of[:, held])
    if found is not None and n:
        prescribed = np.einsum("ki,kip->kp", rows, value[at])
        system[:n, :n] = products[2:, 2:] + local
        system[:n, n] = products[2:, 1] + prescribed[:, 1]
        offset[:n] = gap + products[2:, 0] + prescribed[:, 0]
        # a rotation of the circular spline changes the gaps by their lever arms
        system[:n, n + 1] = system[n + 1, :n] = -found.circular_spline_arm
    return Condensed(
        system=system,
        offset=offset,
        coupling=coupling,
        response=response,
        value=value,
    )
