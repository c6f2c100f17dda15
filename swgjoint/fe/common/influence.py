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

from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.pivoting import exchange, solve_active, solve_many
from swgjoint.typing import Array, Index, Mask

MOST_CHANGES = 60
"""Changes of contact on one side of a torque that are followed."""
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
    by_tilt: Array
    """The same by the slope of the circular spline's axis (n, 2) [m/rad]."""
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
    supports: Array | None = None
    """Where the other contacts lie, in the frame of the wave generator (m - n, 2) [m];
    in the plane only."""

    def with_supports(self) -> Influence:
        """The same, gap changes of the wave generator behind those of the teeth.

        Such a change adds to the gap of an open contact. A closed one has its opening
        as the unknown: an outline that recedes is an opening that the node has not
        made.
        """
        n = len(self.sector)
        closed = self.closed[n:]
        outline = -self.matrix[:, n:] * closed
        outline[n:] += np.diag(~closed)
        angle = -self.angle_by_value[n:] * closed
        return replace(
            self,
            by_gap=np.concatenate([self.by_gap, outline], axis=1),
            angle_by_gap=np.concatenate([self.angle_by_gap, angle]),
        )

    def gap_change(
        self, flexspline: Array, circular_spline: Array, tilt: Array | None = None
    ) -> Array:
        """Change of the gaps by shifts of the teeth in their frames.

        Args:
            flexspline: Shape (..., N, 2) [m].
            circular_spline: Shape (..., N_c, 2) [m].
            tilt: Slope of the circular spline's axis (..., 2) [rad].

        Returns:
            Shape (..., n) [m].
        """
        own, other = self.direction
        change = np.einsum("...ki,ki->...k", flexspline[..., self.sector, :], own)
        change += np.einsum(
            "...ki,ki->...k", circular_spline[..., self.tooth, :], other
        )
        if tilt is not None:
            change += tilt @ self.by_tilt.T
        return np.asarray(change)

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

    def changes(self, low: float, high: float, contact: Index) -> ContactChanges:
        """Changes of contact over the torque, without errors of the teeth.

        Args:
            low: Smallest torque [N·m].
            high: Largest one [N·m].
            contact: Numbers of the contacts (m,).
        """
        below, c_below = self._followed(-1.0, self.torque - low)
        above, c_above = self._followed(1.0, high - self.torque)
        which = [k for k, _ in below[::-1]] + [k for k, _ in above]
        places = [self.torque - t for _, t in below[::-1]]
        places += [self.torque + t for _, t in above]
        return ContactChanges(
            torque=np.array(places),
            contact=contact[np.array(which, dtype=np.int64)],
            compliance=np.array(c_below[:0:-1] + c_above),
        )

    def _followed(
        self, sign: float, reach: float
    ) -> tuple[list[tuple[int, float]], list[float]]:
        """Follow the solution over the torque, linear between changes of contact.

        Each change is the exchange of one unknown: principal pivots in a single
        parameter. More than :data:`MOST_CHANGES` of them end the path.

        Args:
            sign: Of the change of the torque.
            reach: Its size [N·m].

        Returns:
            Contacts that change, with the change of the torque [N·m]; compliances
            before, between and after them [rad/(N·m)].
        """
        offset = np.stack([self.slack, sign * self.by_torque], axis=1)
        active = np.zeros(len(offset), bool)
        changes, compliances, away = list[tuple[int, float]](), list[float](), 0.0
        while True:
            inside = np.flatnonzero(active)
            block = self.matrix[np.ix_(inside, inside)]
            moves = np.linalg.solve(block, -offset[inside])
            found = offset + self.matrix[:, inside] @ moves
            found[inside] = moves
            slope = sign * moves[:, 1] @ self.angle_by_value[inside]
            compliances.append(-float(self.angle_by_torque + slope))
            value, rate = found.T
            falling = np.flatnonzero(rate < 0.0)
            if not falling.size or len(changes) == MOST_CHANGES:
                return changes, compliances
            left = np.maximum(value + away * rate, 0.0)[falling] / -rate[falling]
            if away + left.min() > reach:
                return changes, compliances
            first = int(falling[left.argmin()])
            away += float(left.min())
            changes.append((first, away))
            active[first] ^= True


@dataclass(frozen=True, kw_only=True, eq=False)
class Gaps:
    """Tooth contacts of a condensed drive and how errors of the teeth change them."""

    sector: Index
    """Tooth of the flexspline (n,)."""
    tooth: Index
    """Tooth of the circular spline (n,)."""
    direction: Array
    """Derivatives of the gap by the shifts of these teeth (2, n, 2)."""
    by_tilt: Array
    """The same by the slope of the circular spline's axis (n, 2) [m/rad]."""
    carries: Mask
    """Which carry force (n,)."""


def pivot_system(
    system: Array,
    offset: Array,
    gaps: Gaps,
    *,
    closed_supports: Mask,
    free: list[int],
    output: int,
    sign: float,
    angle: float,
    torque: float,
) -> Influence:
    """The complementarity problem of a condensed drive, seen from its equilibrium.

    Args:
        system: Gaps of the teeth, then of other supports by the forces there (by their
            openings where these are closed), then equations of further unknowns (k, k).
        offset: The same at zero unknowns (k,).
        gaps: Of the teeth, the first n rows.
        closed_supports: Of the next rows (m - n,).
        free: Further unknowns that their equations determine.
        output: Row of the output angle or, where it is free, of its torque.
        sign: Of T in that row.
        angle: Output angle of the equilibrium [rad].
        torque: T there [N·m].
    """
    n = len(gaps.carries)
    m = n + len(closed_supports)
    closed = np.concatenate([gaps.carries, closed_supports])
    inside = np.concatenate([np.flatnonzero(gaps.carries), free])
    exchanged, forward = exchange(system, inside)
    start = forward @ offset
    matrix = exchanged[:m, :m]
    matrix[closed, closed] += _stiffening(matrix[np.ix_(closed, closed)])
    return Influence(
        sector=gaps.sector,
        tooth=gaps.tooth,
        direction=gaps.direction,
        by_tilt=gaps.by_tilt,
        closed=closed,
        torque=torque,
        matrix=matrix,
        slack=start[:m],
        by_gap=forward[:m, :n],
        by_torque=sign * exchanged[:m, output],
        angle=angle,
        angle_by_value=exchanged[output, :m],
        angle_by_gap=forward[output, :n],
        angle_by_torque=sign * float(exchanged[output, output]),
    )


def _stiffening(block: Array) -> Array:
    """What makes the stiffness against openings positive (n,).

    Where all contacts open the flexspline moves freely, and under preload the stiffness
    of that motion may be negative, by a millionth; no equilibrium is there, but the
    search for one passes.
    """
    size = np.diag(block)
    if not (size > 0.0).all():
        raise np.linalg.LinAlgError("no stiffness against an opening")
    scale = np.sqrt(size)
    lowest = float(np.linalg.eigvalsh(block / scale[:, None] / scale)[0])
    return np.asarray(max(0.0, SOFTEST - lowest) * size)
