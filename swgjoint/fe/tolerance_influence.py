"""How the gap of every tooth acts on the output of the drive in the plane."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.corotation import rotate, turned
from swgjoint.fe.cyclic import CyclicFactor
from swgjoint.fe.influence import Gaps, Influence, pivoted
from swgjoint.fe.linearise import Linearised, linearise
from swgjoint.fe.ring import RingModel
from swgjoint.fe.state import State
from swgjoint.fe.tooth_contact import Contacts

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

REACH = 0.03
"""Gap up to which a contact may close, in lobe heights."""
STATIONS = 15
"""Points along a flank that may touch, beside those of the perfect drive: contacts
wander along flanks that conform."""
SUPPORTS = 2
"""Nodes a sector that may touch the wave generator, beside those that do: with all of
them psi changes by 0.5 % of its peak to peak."""


def influence(model: RingModel, state: State, *, ring_is_output: bool) -> Influence:
    """Condense a drive with perfect teeth at an equilibrium.

    Args:
        model: All sectors, an elastic circular spline, a rigid wave generator, no
            errors of the teeth, no friction.
        state: The equilibrium.
        ring_is_output: Whether the circular spline is the output.
    """
    shifts = (model.tooth_shift, model.ring_tooth_shift)
    flawed = any(shift is not None and shift.any() for shift in shifts)
    if model.half or model.friction is not None or flawed:
        raise ValueError("needs all sectors, without friction and errors of the teeth")
    if model.race is not None:
        raise ValueError("needs a rigid wave generator")
    element, compliance = model.element, model.circular_spline.compliance
    assert compliance is not None
    ring = linearise(model, state, None if ring_is_output else state.torque)
    contacts, carries = _tooth_contacts(model, ring, state)
    supports = _Supports.of(model, ring, state)
    n, m = len(contacts), len(contacts) + len(supports.sector)
    rows = ring.gap_gradient(contacts)

    # columns: forces on teeth, forces or displacements at the wave generator, then the
    # anchor that keeps the rotation regular and the rotation of the flexspline
    load = np.zeros((*ring.gradient.shape, m + 2))
    load[contacts.sector, :, np.arange(n)] = rows
    moved = np.zeros_like(load)
    supports.fill(load[:, :, n:m], moved[:, :, n:m])
    load[:, :, m], load[:, :, m + 1] = ring.anchor, ring.rotation_gradient
    right = np.concatenate(
        [load - ring.hessian @ moved, -ring.gradient[:, :, None]], axis=2
    )
    right[ring.known] = 0.0
    response = CyclicFactor(ring.anchored(), 2 * element.face_size).solve(right)
    response[:, :, :-1] += moved
    residual = ring.hessian @ response
    residual[:, :, :-1] -= load
    residual[:, :, -1] += ring.gradient

    # gaps, or forces where closed; the equations of anchor and rotation; the rotation
    # of the circular spline, which turns towards the teeth with a lever arm
    system = np.zeros((m + 3, m + 3))
    answers = np.concatenate(
        [
            np.einsum("kn,knl->kl", rows, response[contacts.sector]),
            supports.rows(response, residual),
            np.einsum("snf,snl->fl", load[:, :, m:], response),
        ]
    )
    system[: m + 2, : m + 2], offset = answers[:, :-1], answers[:, -1]
    local = contacts.weight @ element.flank_compliance
    same = contacts.sector[:, None] == contacts.sector[None, :]
    system[:n, :n] += np.where(same, local @ contacts.weight.T, 0.0)
    system[:n, :n] += compliance.between(
        contacts.tooth, contacts.ring_weight, model.ring_teeth
    )
    system[m, m] -= 1.0 / ring.anchor_stiffness
    arm = np.einsum("ki,ki->k", turned(contacts.point), contacts.normal)
    system[:n, m + 2] = system[m + 2, :n] = -arm
    # gaps as if the tooth forces of the state were gone
    old = np.einsum("kb,kb->k", local, state.flank_force[contacts.sector])
    old += np.einsum(
        "kb,kb->k", contacts.ring_weight, ring.ring_elastic[contacts.tooth]
    )
    offset[:n] += contacts.gap - old
    offset[n:m] += supports.gap
    offset = np.append(offset, -state.torque if ring_is_output else 0.0)

    found = pivoted(
        system,
        offset,
        Gaps(
            sector=contacts.sector,
            tooth=contacts.tooth,
            direction=np.stack(
                [_by_shift(contacts.weight), _by_shift(contacts.ring_weight)]
            ),
            by_tilt=np.zeros((n, 2)),  # a plane has no axis
            carries=carries,
        ),
        closed_supports=supports.closed,
        free=[m, m + 1, m + 2] if ring_is_output else [m],
        output=m + 2 if ring_is_output else m + 1,
        sign=1.0 if ring_is_output else -1.0,
        angle=state.ring_rotation if ring_is_output else state.rotation,
        torque=state.torque,
    )
    return replace(found, supports=supports.place)


def _by_shift(weight: Array) -> Array:
    """Derivative by a common shift of all flank nodes (n, 2)."""
    return np.asarray(weight.reshape(len(weight), -1, 2).sum(axis=1))


def _tooth_contacts(
    model: RingModel, ring: Linearised, state: State
) -> tuple[Contacts, Mask]:
    """Points that may touch, and which of them carry force at the state."""
    held = state.contacts
    if held is None or not len(held):
        raise ValueError("needs an equilibrium whose teeth carry force")
    reach = REACH * model.lobe_height
    near = ring.search.search(ring.flank, reach, held)
    stations, step = np.linspace(*model.element.flank_range, STATIONS, retstep=True)
    flanks = np.unique(2 * near.sector + near.side)
    key = np.repeat(flanks, STATIONS)
    place = np.tile(stations, flanks.size)
    beside = (2 * near.sector + near.side)[:, None] == key
    beside &= np.abs(near.station[:, None] - place) < 0.5 * step
    added = np.flatnonzero(~beside.any(axis=0))
    more = near.chosen(np.zeros(added.size, dtype=np.int64))
    sector, side = np.divmod(key[added], 2)
    more = replace(more, sector=sector, side=side, station=place[added])
    found = ring.search.search(ring.flank, reach, Contacts.joined(held, more))
    nearest = held.nearest_in(found)
    carries = np.zeros(len(found), bool)
    carries[nearest] = True
    return found, carries


@dataclass(frozen=True, kw_only=True, eq=False)
class _Supports:
    """Nodes that touch the wave generator or may do so; k of them."""

    sector: Index
    node: Index
    """Among the bore nodes of the sector, 0 is the corner that two sectors share."""
    dof: Index
    """Normal component in the basis of the node."""
    closed: Mask
    gap: Array
    """Zero where closed [m]."""
    place: Array
    """In the frame of the wave generator (k, 2) [m]."""

    @classmethod
    def of(cls, model: RingModel, ring: Linearised, state: State) -> _Supports:
        gap, touching = ring.wave_generator_gap, state.touching
        spread = np.arange(SUPPORTS) * gap.shape[1] // SUPPORTS
        used = np.zeros_like(touching)
        used[:, spread] = gap[:, spread] < REACH * model.lobe_height
        sector, node = np.nonzero(used | touching)
        closed = touching[sector, node]
        place = model.skeleton(state)[:, model.bore_nodes][sector, node]
        return cls(
            sector=sector,
            node=node,
            dof=ring.normal_dofs[node],
            closed=closed,
            gap=np.where(closed, 0.0, gap[sector, node]),
            place=rotate(place, -state.wave_generator_angle),
        )

    def fill(self, load: Array, moved: Array) -> None:
        """Unit forces where open, unit openings where closed (N, n_dofs, k)."""
        k = np.arange(len(self.sector))
        load[self.sector, self.dof, k] = ~self.closed
        moved[self.sector, self.dof, k] = self.closed
        corner = (self.node == 0) & self.closed
        moved[self.sector[corner] - 1, moved.shape[1] - 2, k[corner]] = 1.0

    def rows(self, response: Array, residual: Array) -> Array:
        """Normal displacements where open, forces where closed (k, n_columns)."""
        force = residual[self.sector, self.dof]
        force += np.where(
            (self.node == 0)[:, None],
            residual[self.sector - 1, residual.shape[1] - 2],
            0.0,
        )
        moved = response[self.sector, self.dof]
        return np.where(self.closed[:, None], force, moved)
