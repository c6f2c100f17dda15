r"""Influence of every tooth gap on the output: the drive linearised at one state.

A perfect drive at equilibrium is condensed to its unilateral contacts: those of the
teeth and those of the wave generator. If a contact is open at the equilibrium, its
unknown v is its force and its slack w is its gap. If it is closed, v is its opening and
w is its force. Under tooth errors that change the gaps by :math:`\delta g`, and under
another torque T,

.. math:: 0 \le v \perp w = w_0 + Q\,\delta g + r\,(T - T_0) + M v \ge 0 , \quad
    \psi = \psi_0 + a^T v + b^T \delta g + c\,(T - T_0) .

Without errors and at the torque T_0 of the equilibrium, v is zero. To first order in
the gap changes the response would follow from the contact forces of the perfect drive,
but errors of a few micrometres change which teeth carry load and where the rim lifts
off. The influences are therefore superposed in the data of this problem rather than in
its solution.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.common.pivoting import exchange
from swgjoint.fe.common.strip_problems import StripProblems
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index, Mask

MOST_CHANGES = 60
"""Largest number of contact changes that are followed in each direction of torque."""
SOFTEST = 3e-6
"""Lower bound of the stiffness against motions that open several contacts, relative to
the stiffness against opening a single one [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Equilibria with errors, one entry per set of errors; NaN if unsolved."""

    output_angle: Array
    """Output angle psi (n_sets,) [rad]."""
    potential: Array
    """Potential U + T psi relative to the equilibrium at which the drive is linearised
    (n_sets,) [J]."""
    compliance: Array
    """Compliance -d(psi)/dT at fixed input (n_sets,) [rad/(N·m)]."""
    active: Mask
    """Contacts whose state differs from that in the perfect drive (n_sets, m); an
    initial guess for other torques."""
    margin: Array | None = None
    """How far each contact is from a change of its state, see
    :class:`swgjoint.fe.common.strip_problems.StripSolution` (n_sets, m)."""
    approach: Array | None = None
    """Approach of the strips beyond their linear law (n_sets, n_strips) [m]."""
    force: Array | None = None
    """Forces of the strips (n_sets, n_strips) [N]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Influence:
    """Drive condensed at one equilibrium to m contacts, n of them at teeth.

    The contacts at teeth come first.
    """

    sector: Index
    """Flexspline tooth of each tooth contact (n,)."""
    tooth: Index
    """Circular-spline tooth of each tooth contact (n,)."""
    direction: Array
    """Derivatives of the tooth gaps with respect to the shifts of the flexspline tooth
    and of the circular-spline tooth (2, n, 2) [-]."""
    by_tilt: Array
    """Derivatives of the tooth gaps with respect to the slope of the circular spline's
    axis (n, 2) [m/rad]."""
    closed: Mask
    """Whether each contact carries force in the perfect drive (m,)."""
    torque: float
    """Torque T_0 of the equilibrium [N·m]."""
    matrix: Array
    """Matrix M (m, m): derivatives of the slacks with respect to the unknowns."""
    slack: Array
    """Slacks w_0 at the equilibrium (m,): gaps of open contacts [m], forces of closed
    contacts [N]."""
    by_gap: Array
    """Derivatives Q of the slacks with respect to the gap changes (m, n)."""
    by_torque: Array
    """Derivatives r of the slacks with respect to the torque (m,)."""
    angle: float
    """Output angle psi_0 of the equilibrium [rad]."""
    angle_by_value: Array
    """Derivatives a of the output angle with respect to the unknowns v (m,)."""
    angle_by_gap: Array
    """Derivatives b of the output angle with respect to gap changes (n,) [rad/m]."""
    angle_by_torque: float
    """Derivative c of the output angle with respect to the torque [rad/(N·m)]."""
    strips: Strips | None = None
    """Contact strips of the teeth, whose indentation law is linearised in M; None if
    the teeth do not indent or their law is linear."""
    supports: Array | None = None
    """Positions of the other contacts in the frame of the wave generator (m - n, 2)
    [m]; 2D models only."""

    def __getstate__(self) -> dict[str, Any]:
        """The fields alone: what they determine is not sent to other processes."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @cached_property
    def with_supports(self) -> Influence:
        """Influence that also accepts gap changes at the wave generator.

        They follow those of the teeth, so that there are m gap changes. At an open
        contact the change adds to the gap. At a closed contact, whose unknown is the
        opening, a receding outline opens the contact without any motion of the node.
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
        """Changes of the tooth gaps due to shifts of the teeth in their frames.

        Args:
            flexspline: Shifts of the flexspline's teeth (..., N, 2) [m].
            circular_spline: Shifts of the circular spline's teeth (..., N_c, 2) [m].
            tilt: Slope of the circular spline's axis (..., 2) [rad]; None for zero.

        Returns:
            Gap changes (..., n) [m].
        """
        by_flexspline, by_ring = self.direction
        change = np.einsum(
            "...ki,ki->...k", flexspline[..., self.sector, :], by_flexspline
        )
        change += np.einsum(
            "...ki,ki->...k", circular_spline[..., self.tooth, :], by_ring
        )
        if tilt is not None:
            change += tilt @ self.by_tilt.T
        return np.asarray(change)

    def respond(
        self, gap_change: Array, torque: float, start: Mask | None = None
    ) -> Response:
        """Equilibria of the linearised drive with tooth errors.

        Args:
            gap_change: Gap changes, one set of errors per row (n_sets, n) [m]; m
                columns with :attr:`with_supports`.
            torque: Torque T [N·m].
            start: Active sets of a nearby solution (n_sets, m); None for empty sets.
        """
        load = torque - self.torque
        # in place: arrays of many problems are large
        offset = gap_change @ self.by_gap.T
        offset += self.slack + load * self.by_torque
        solution = self._problems.solve(offset, start)
        # the approach of the strips beyond their linear law acts like a gap change
        dg, v = gap_change, solution.value
        if self.strips is not None:
            dg = gap_change.copy()
            dg[:, : len(self.sector)] += solution.approach[:, self.strips.strip]
            offset += solution.approach @ self._problems.by_strip.T
        angle = self.angle + v @ self.angle_by_value + dg @ self.angle_by_gap
        angle += load * self.angle_by_torque

        # d Pi = -forces . d gaps + psi dT while v = 0; then dPi/dv = +-w, and v.w = 0.
        # The offset contains dg in full, the mean force on the way half of it.
        teeth = np.flatnonzero(self.closed[: dg.shape[1]])
        force = offset[:, teeth] - load * self.by_torque[teeth] + self.slack[teeth]
        unchanged = -0.5 * np.sum(force * dg[:, teeth], axis=1) + load * (
            self.angle + dg @ self.angle_by_gap + 0.5 * load * self.angle_by_torque
        )
        sign = np.where(self.closed, 0.5, -0.5)
        offset *= v
        potential = unchanged + offset @ sign
        if self.strips is not None:
            potential += self.strips.excess_energy(solution.force)
        slope = self.angle_by_torque + solution.slope
        ok = solution.solved
        return Response(
            output_angle=np.where(ok, angle, np.nan),
            potential=np.where(ok, potential, np.nan),
            compliance=np.where(ok, -slope, np.nan),
            active=solution.active,
            margin=solution.margin,
            approach=solution.approach,
            force=np.where(ok[:, None], solution.force, np.nan),
        )

    @cached_property
    def _problems(self) -> StripProblems:
        """What the complementarity problems of all errors and torques share."""
        return StripProblems(
            matrix=self.matrix,
            closed=self.closed,
            by_load=self.by_torque,
            by_value=self.angle_by_value,
            strips=self.strips,
            by_gap=self.by_gap[:, : len(self.sector)],
            output_by_gap=self.angle_by_gap[: len(self.sector)],
        )

    def changes(self, low: float, high: float, contact: Index) -> ContactChanges:
        """Contact changes over a torque range in the drive without tooth errors.

        Args:
            low: Smallest torque [N·m].
            high: Largest torque [N·m].
            contact: Numbers that identify the contacts (m,).
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
        """Contact changes on the path of the solution over the torque.

        The solution is linear between the changes, each of which exchanges one unknown
        (parametric principal pivoting). The path ends after :data:`MOST_CHANGES`
        changes at the latest.

        Args:
            sign: Sign of the change of torque.
            reach: Magnitude of the change of torque [N·m].

        Returns:
            Contacts that change, each with the change of torque [N·m], and the
            compliances before, between and after the changes [rad/(N·m)].
        """
        if (native := kernels()) is not None:
            path = native.follow_path(
                *map(np.ascontiguousarray, (self.matrix, self.slack)),
                sign * self.by_torque,
                np.ascontiguousarray(self.angle_by_value),
                reach,
                MOST_CHANGES,
            )
            if path is None:
                raise np.linalg.LinAlgError("singular contacts")
            events = [(contact, away) for contact, away, _ in path[:-1]]
            slopes = [sign * slope for _, _, slope in path]
            return events, [-float(self.angle_by_torque + s) for s in slopes]
        offset = np.stack([self.slack, sign * self.by_torque], axis=1)
        active = np.zeros(len(offset), bool)
        changes, compliances, away = list[tuple[int, float]](), list[float](), 0.0
        while True:
            inside = np.flatnonzero(active)
            block = self.matrix[np.ix_(inside, inside)]
            moves = np.linalg.solve(block, -offset[inside])
            solution = offset + self.matrix[:, inside] @ moves
            solution[inside] = moves
            slope = sign * moves[:, 1] @ self.angle_by_value[inside]
            compliances.append(-float(self.angle_by_torque + slope))
            value, rate = solution.T
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
    """Tooth contacts of a condensed drive and the effect of errors on their gaps."""

    sector: Index
    """Flexspline tooth of each contact (n,)."""
    tooth: Index
    """Circular-spline tooth of each contact (n,)."""
    direction: Array
    """Derivatives of the gaps with respect to the shifts of the flexspline tooth and of
    the circular-spline tooth (2, n, 2) [-]."""
    by_tilt: Array
    """Derivatives of the gaps with respect to the slope of the circular spline's axis
    (n, 2) [m/rad]."""
    carries: Mask
    """Whether each contact carries force (n,)."""
    strips: Strips | None = None
    """Contact strips whose law is linearised in the system; None without any."""


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
    """Complementarity problem of a condensed drive, relative to its equilibrium.

    Args:
        system: Matrix (k, k). Its rows are the tooth gaps, the responses of the
            supports on the wave generator and the equations of further unknowns. Its
            columns are the tooth forces, the unknowns of the supports (the opening of a
            closed support, the force of an open one) and the further unknowns.
        offset: Values of the rows if all unknowns are zero (k,).
        gaps: Tooth contacts, to which the first n rows belong.
        closed_supports: Whether each support in the next m - n rows is closed (m - n,).
        free: Numbers of the further unknowns that are determined by their equations.
        output: Row of the output angle or, if the angle is an unknown, of its torque.
        sign: Factor of the torque T in that row, including its sign.
        angle: Output angle of the equilibrium [rad].
        torque: Torque T of the equilibrium [N·m].

    Raises:
        numpy.linalg.LinAlgError: If a closed contact opens without resistance or the
            system is singular.
    """
    n = len(gaps.carries)
    m = n + len(closed_supports)
    closed = np.concatenate([gaps.carries, closed_supports])
    inside = np.concatenate([np.flatnonzero(gaps.carries), free])
    exchanged, forward = exchange(system, inside)
    start = forward @ offset
    matrix = exchanged[:m, :m]
    held = np.diag(system)[:m][closed]
    matrix[closed, closed] += _stiffening(matrix[np.ix_(closed, closed)], held)
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
        strips=gaps.strips,
    )


def _stiffening(block: Array, held: Array) -> Array:
    """Addition to the diagonal that makes the stiffness against openings positive (n,).

    If all contacts open, the flexspline moves freely. Under preload the relative
    stiffness of that motion may be negative by about a millionth. No equilibrium has
    this contact state, but the search may pass through it. The same motion opens the
    contact of a tooth that alone holds the output. Its stiffness becomes
    :data:`SOFTEST` times that of the contact with the output held.

    Args:
        block: Derivatives of the forces with respect to the openings (n, n).
        held: Diagonal of the system with the output held: compliances of teeth [m/N],
            stiffnesses of supports [N/m] (n,).
    """
    size = np.diag(block).copy()
    alone = size < SOFTEST / held
    added = np.zeros(size.size)
    added[alone] = SOFTEST / held[alone] - size[alone]
    size[alone] = 1.0 / held[alone]
    scale = np.sqrt(size)
    scaled = (block + np.diag(added)) / scale[:, None] / scale
    lowest = float(np.linalg.eigvalsh(scaled)[0])
    return np.asarray(added + max(0.0, SOFTEST - lowest) * size)
