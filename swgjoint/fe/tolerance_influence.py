r"""How the gap of every tooth acts on the output: the drive linearised at one state.

A perfect drive at equilibrium is condensed to its unilateral contacts, those of the
teeth and those of the wave generator. An unknown v is the force of a contact that is
open there, and the opening of one that is closed. With errors of the teeth that change
the gaps by :math:`\delta g`, and with another torque,

.. math:: 0 \le v \perp w = w_0 + Q\,\delta g + r\,(T - T_0) + M v \ge 0 , \quad
    \psi = \psi_0 + a^T v + b^T \delta g + c\,(T - T_0) .

Without errors v is zero. To first order in the gaps the answer would be the forces of
the perfect drive, but errors of a few micrometres change which teeth carry and where
the rim lifts off: the influences are superposed in this problem, not in its solution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.corotation import turned
from swgjoint.fe.cyclic import CyclicFactor
from swgjoint.fe.linearise import Linearised, linearise
from swgjoint.fe.pivoting import solve_active, solve_many
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
SOFTEST = 3e-6
"""Least stiffness of a motion that opens contacts, in that of a single one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Equilibria with errors, one entry per set of errors; NaN where there is none."""

    output_angle: Array
    """psi [rad]."""
    potential: Array
    """U + T psi, up to a constant of the influence [J]."""
    compliance: Array
    """-d(psi)/dT at fixed input [rad/(N·m)]."""
    active: Mask
    """Contacts that differ from the perfect drive; a start for other torques."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Influence:
    """The condensed drive at one equilibrium; m contacts, the first n of teeth."""

    sector: Index
    """Tooth of the flexspline of every tooth contact (n,)."""
    tooth: Index
    """Tooth of the circular spline (n,)."""
    direction: Array
    """Derivatives of its gap by the shifts of these teeth (2, n, 2)."""
    closed: Mask
    """Contacts that carry force in the perfect drive (m,)."""
    torque: float
    """T_0 [N·m]."""
    matrix: Array
    """M (m, m)."""
    slack: Array
    """w_0 (m,)."""
    by_gap: Array
    """Q (m, n)."""
    by_torque: Array
    """r (m,)."""
    angle: float
    """psi_0 [rad]."""
    angle_by_value: Array
    """a (m,)."""
    angle_by_gap: Array
    """b (n,)."""
    angle_by_torque: float
    """c [rad/(N·m)]."""

    def gap_change(self, flexspline: Array, circular_spline: Array) -> Array:
        """Change of the gaps by shifts of the teeth in their frames.

        Args:
            flexspline: Shape (..., N, 2) [m].
            circular_spline: Shape (..., N_c, 2) [m].

        Returns:
            Shape (..., n) [m].
        """
        own, other = self.direction
        return np.asarray(
            np.einsum("...ki,ki->...k", flexspline[..., self.sector, :], own)
            + np.einsum("...ki,ki->...k", circular_spline[..., self.tooth, :], other)
        )

    def respond(
        self, gap_change: Array, torque: float, start: Mask | None = None
    ) -> Response:
        """Equilibria of the linearised drive with errors.

        Args:
            gap_change: One set of errors per row (n_sets, n) [m].
            torque: T [N·m].
            start: Active sets of a solution nearby.
        """
        load = torque - self.torque
        dg = gap_change
        offset = self.slack + dg @ self.by_gap.T + load * self.by_torque
        found = solve_many(self.matrix, offset, start)
        v = found.value
        angle = self.angle + v @ self.angle_by_value + dg @ self.angle_by_gap
        angle += load * self.angle_by_torque

        # d Pi = -forces . d gaps + psi dT while v = 0; then dPi/dv = +-w, and v.w = 0
        n, teeth = dg.shape[1], self.closed[: dg.shape[1]]
        force = np.where(teeth, self.slack[:n] + 0.5 * dg @ self.by_gap[:n].T, 0.0)
        unchanged = -np.sum(force * dg, axis=1) + load * (
            self.angle + dg @ self.angle_by_gap + 0.5 * load * self.angle_by_torque
        )
        sign = np.where(self.closed, 0.5, -0.5)
        potential = unchanged + np.sum(sign * v * offset, axis=1)

        moves = solve_active(self.matrix, self.by_torque, found.active)
        slope = self.angle_by_torque + moves @ self.angle_by_value
        ok = found.solved
        return Response(
            output_angle=np.where(ok, angle, np.nan),
            potential=np.where(ok, potential, np.nan),
            compliance=np.where(ok, -slope, np.nan),
            active=found.active,
        )


def influence(model: RingModel, state: State, *, ring_is_output: bool) -> Influence:
    """Condense a drive with perfect teeth at an equilibrium.

    Args:
        model: All sectors, an elastic circular spline, no errors of the teeth, no
            friction.
        state: The equilibrium.
        ring_is_output: Whether the circular spline is the output.
    """
    shifts = (model.tooth_shift, model.ring_tooth_shift)
    flawed = any(shift is not None and shift.any() for shift in shifts)
    if model.half or model.friction is not None or flawed:
        raise ValueError("needs all sectors, without friction and errors of the teeth")
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

    closed = np.concatenate([carries, np.zeros(m - n, bool)])
    output = m + 2 if ring_is_output else m + 1
    free = [m, m + 1, m + 2] if ring_is_output else [m]
    inside = np.concatenate([np.flatnonzero(closed), free])
    pivoted, forward = _pivot(system, inside)
    start = forward @ offset
    closed[n:m] = supports.closed
    matrix = pivoted[:m, :m]
    matrix[closed, closed] += _stiffening(matrix[np.ix_(closed, closed)])
    sign = 1.0 if ring_is_output else -1.0  # of T in the row of the output
    return Influence(
        sector=contacts.sector,
        tooth=contacts.tooth,
        direction=np.stack(
            [_by_shift(contacts.weight), _by_shift(contacts.ring_weight)]
        ),
        closed=closed,
        torque=state.torque,
        matrix=matrix,
        slack=start[:m],
        by_gap=forward[:m, :n],
        by_torque=sign * pivoted[:m, output],
        angle=state.ring_rotation if ring_is_output else state.rotation,
        angle_by_value=pivoted[output, :m],
        angle_by_gap=forward[output, :n],
        angle_by_torque=sign * float(pivoted[output, output]),
    )


def _stiffening(block: Array) -> Array:
    """What makes the stiffness against openings positive (n,).

    Where all contacts open the flexspline moves freely, and under preload the stiffness
    of that motion may be negative, by a millionth; no equilibrium is there, but the
    search for one passes.
    """
    size = np.diag(block)
    scale = np.sqrt(size)
    lowest = float(np.linalg.eigvalsh(block / scale[:, None] / scale)[0])
    return np.asarray(max(0.0, SOFTEST - lowest) * size)


def _pivot(system: Array, inside: Index) -> tuple[Array, Array]:
    """Exchange unknowns and rows of a linear map y = A z + q.

    Args:
        system: A (k, k).
        inside: Where the row becomes the unknown.

    Returns:
        The exchanged map (k, k), and the factor that q gets (k, k).
    """
    k = len(system)
    outside = np.setdiff1d(np.arange(k), inside)
    inverse = np.linalg.inv(system[np.ix_(inside, inside)])
    reach = system[np.ix_(outside, inside)] @ inverse
    pivoted, forward = np.empty_like(system), np.zeros_like(system)
    pivoted[np.ix_(inside, inside)] = inverse
    pivoted[np.ix_(outside, inside)] = reach
    pivoted[np.ix_(inside, outside)] = -inverse @ system[np.ix_(inside, outside)]
    pivoted[np.ix_(outside, outside)] = (
        system[np.ix_(outside, outside)] - reach @ system[np.ix_(inside, outside)]
    )
    forward[np.ix_(inside, inside)] = -inverse
    forward[np.ix_(outside, inside)] = -reach
    forward[outside, outside] = 1.0
    return pivoted, forward


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

    @classmethod
    def of(cls, model: RingModel, ring: Linearised, state: State) -> _Supports:
        gap, touching = ring.wave_generator_gap, state.touching
        spread = np.arange(SUPPORTS) * gap.shape[1] // SUPPORTS
        used = np.zeros_like(touching)
        used[:, spread] = gap[:, spread] < REACH * model.lobe_height
        sector, node = np.nonzero(used | touching)
        closed = touching[sector, node]
        return cls(
            sector=sector,
            node=node,
            dof=ring.normal_dofs[node],
            closed=closed,
            gap=np.where(closed, 0.0, gap[sector, node]),
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
