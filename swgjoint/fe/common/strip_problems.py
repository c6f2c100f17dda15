r"""Many complementarity problems of one linearised drive whose teeth indent each other.

All problems share the matrix M of :mod:`swgjoint.fe.common.influence`. It contains the
line of the indentation law of each contact strip at one force, see
:class:`swgjoint.fe.common.indentation.Strips`. Under tooth errors of several
micrometres the force on a tooth changes from nothing to hundreds of newtons, and its
strip becomes two to four times stiffer. The approach c of the strips beyond the line
acts like an additional change of their gaps:

.. math:: 0 \le v \perp w = q + M v + B c \ge 0 , \quad c_j = h(F_j) - s_j F_j - o_j ,

with the force :math:`F_j` of strip j, the sum of the forces of its contacts.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.common.pivot_base import Base, next_to, similar_parts, similar_sets
from swgjoint.fe.common.pivoting import SINGLES, TOLERANCE, TRIES, solve_many
from swgjoint.fe.common.strip_slopes import slopes_by_load
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index, Mask

EXACT = 1e-14
"""Largest error of the approach of a strip [m]."""
ROUNDS = 60
"""Largest number of corrections of the approach of the strips in the numpy version,
each of which divides its error by about four."""
PART = 128
"""Largest number of similar problems that share a base, see :class:`Base`."""
TOGETHER = 512
"""Largest number of consecutive problems with guesses that share a base."""
GROUP = 4
"""Number of parts without guesses that are solved one after another: the first problem
of a part starts from a solution of the part before it."""
SAMPLES = 12
"""Number of problems that are solved first to find a base for judging similarity."""
PROBES = 5
"""Number of problems of a part whose solutions determine its base."""
FEW = 24
"""Mean number of active unknowns up to which a part is solved without a base, if a base
would save no more. With a base, what is left to solve for are the differences from it,
but a base costs as much as some thirty problems."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StripSolution:
    """Solutions of :class:`StripProblems`, one problem per row; NaN if unsolved."""

    value: Array
    """Unknowns v, zero where not active (n_problems, m)."""
    active: Mask
    """Active sets (n_problems, m)."""
    approach: Array
    """Approach c of the strips beyond the line (n_problems, n_strips) [m]."""
    force: Array
    """Forces of the strips (n_problems, n_strips) [N]."""
    slope: Array
    """Derivative of a^T v + b^T c with respect to the load (n_problems,)."""
    solved: Mask
    """Whether each problem was solved (n_problems,)."""
    margin: Array
    """How far each contact is from a change of its state: scaled unknowns where active,
    minus the scaled slacks elsewhere (n_problems, m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StripProblems:
    """Matrix and strips that m contacts share, the first ones of them at teeth."""

    matrix: Array
    """Matrix M (m, m), positive definite."""
    closed: Mask
    """Whether the slack of a contact is its force, and its unknown the opening (m,)."""
    by_load: Array
    """Change of the offset q per unit of load (m,)."""
    by_value: Array
    """Change a of the output per unknown (m,)."""
    strips: Strips | None
    """Contact strips of the first contacts; None if the teeth do not indent."""
    by_gap: Array
    """Change of the offset per change of the gap of these contacts (m, n)."""
    output_by_gap: Array
    """Change of the output per change of the gap of these contacts (n,)."""

    def solve(self, offset: Array, start: Mask | None = None) -> StripSolution:
        """Solve the problems of all rows q of the offset.

        Args:
            offset: Offsets q (n_problems, m).
            start: Guess of the active sets (n_problems, m), similar ones one after
                another; None for empty sets.
        """
        if kernels() is None:
            return self._solve_in_rounds(offset, start)
        solution = self._solve_compiled(offset, start)
        failed = np.flatnonzero(~solution.solved)
        if failed.size:
            # Lemke's method, which only the numpy version has, may still find them
            again = self._solve_in_rounds(offset[failed], None)
            for item in fields(solution):
                getattr(solution, item.name)[failed] = getattr(again, item.name)
        return solution

    # -- strips ------------------------------------------------------------------------

    @cached_property
    def _strip(self) -> Index:
        """Number of the strip of each contact, -1 without one (m,)."""
        numbers = np.full(len(self.matrix), -1, dtype=np.int64)
        if self.strips is not None:
            numbers[: self.strips.strip.size] = self.strips.strip
        return numbers

    @cached_property
    def sums(self) -> Array:
        """Matrix that adds up what belongs to a strip (n, n_strips)."""
        if self.strips is None:
            return np.zeros((self.by_gap.shape[1], 0))
        sums = np.zeros((self.by_gap.shape[1], self.strips.force.size))
        sums[np.arange(self.strips.strip.size), self.strips.strip] = 1.0
        return sums

    @cached_property
    def by_strip(self) -> Array:
        """Change B of the offset per approach of a strip (m, n_strips)."""
        return np.asarray(self.by_gap @ self.sums)

    @cached_property
    def output_by_strip(self) -> Array:
        """Change b of the output per approach of a strip (n_strips,)."""
        return np.asarray(self.output_by_gap @ self.sums)

    # -- numpy -------------------------------------------------------------------------

    def _solve_in_rounds(self, offset: Array, start: Mask | None) -> StripSolution:
        """Reference: solve with given approaches, correct them until they agree."""
        count, strips = len(offset), self.strips
        n = self.sums.shape[0]
        approach = np.zeros((count, self.sums.shape[1]))
        force, active = np.zeros_like(approach), start
        agreed = np.full(count, strips is None)
        for _ in range(ROUNDS):
            solution = solve_many(
                self.matrix, offset + approach @ self.by_strip.T, active
            )
            active = solution.active
            if strips is None:
                break
            forces = np.where(self.closed, solution.slack, solution.value)
            force = forces[:, :n] @ self.sums
            wanted, _ = strips.excess(force)
            agreed = np.abs(wanted - approach).max(axis=1) <= EXACT
            if (agreed | ~solution.solved).all():
                break
            approach = np.where(solution.solved[:, None], wanted, approach)
        solved = solution.solved & agreed
        return StripSolution(
            value=solution.value,
            active=solution.active,
            approach=approach,
            force=force,
            slope=np.where(
                solved, slopes_by_load(self, solution.active, force), np.nan
            ),
            solved=solved,
            margin=solution.value * self._scale - solution.slack / self._scale,
        )

    # -- compiled ----------------------------------------------------------------------

    @cached_property
    def _scale(self) -> Array:
        """Square roots of the diagonal of the matrix (m,)."""
        return np.asarray(np.sqrt(np.diag(self.matrix)))

    @cached_property
    def _origin(self) -> Base:
        """The problems with all unknowns inactive."""
        scale = self._scale
        return Base(
            inside=np.zeros(0, dtype=np.int64),
            columns=np.zeros(0, dtype=np.int64),
            forward=np.zeros((len(scale), 0)),
            matrix=self.matrix / scale[:, None] / scale,
            by_strip=self.by_strip / scale[:, None],
            by_load=self.by_load / scale,
            by_value=self.by_value / scale,
            output_by_strip=self.output_by_strip,
            slope=0.0,
            line=np.zeros(self.sums.shape[1]),
        )

    @cached_property
    def _unit(self) -> Array:
        """Force per scaled slack of closed contacts, or unknown of open ones (m,)."""
        return np.where(self.closed, self._scale, 1.0 / self._scale)

    @cached_property
    def _by_contact(self) -> Array:
        """Forces of the strips per scaled slack or unknown (n_strips, m) [N]."""
        n, count = self.sums.shape
        by_contact = np.zeros((count, len(self.matrix)))
        by_contact[:, :n] = self.sums.T * self._unit[:n]
        return by_contact

    def _forces(self, active: Mask, result: Array) -> Array:
        """Forces of the strips (n_problems, n_strips) [N].

        Args:
            active: Active sets (n_problems, m).
            result: Scaled unknowns where active, scaled slacks elsewhere
                (n_problems, m).
        """
        n = len(self.sums)
        # unknowns of open contacts, slacks of closed ones
        carries = active[:, :n] != self.closed[:n]
        forces = np.where(carries, result[:, :n], 0.0)
        return np.asarray(forces @ self._by_contact[:, :n].T)

    def _with_lines_at(self, force: Array) -> Base:
        """The problems with lines that touch the law at mean forces.

        Args:
            force: Forces of the strips in some of the problems (k, n_strips) [N].
        """
        loaded = force > 0.0
        if self.strips is None or not loaded.any():
            return self._origin
        count = loaded.sum(axis=0)
        # a strip that carries nothing here may carry as much as others elsewhere
        mean = force.sum() / count.sum()
        at = np.where(count > 0, force.sum(axis=0) / np.maximum(count, 1), 0.5 * mean)
        return self._origin.with_lines(
            self.strips.law.slope(at) - self.strips.line,
            self._by_contact * self.closed,
            self._by_contact * ~self.closed,
        )

    @cached_property
    def _lined(self) -> Base | None:
        """The problems with lines that touch the law at usual forces, if known."""
        usual = None if self.strips is None else self.strips.usual
        return None if usual is None else self._with_lines_at(usual[None])

    @cached_property
    def _law(self) -> tuple[Array, Array, Array]:
        """Constants of the law, and compliances [m/N] and offsets [m] of its lines."""
        if self.strips is None:
            return np.zeros(4), np.zeros(0), np.zeros(0)
        return self.strips.law.constants, self.strips.line, self.strips.line_offset

    def _native(self, base: Base) -> Any:
        """Matrix and strips of a base as the compiled loop takes them."""
        native = kernels()
        assert native is not None
        law, line, line_offset = self._law
        closed = self.closed.copy()
        closed[base.inside] ^= True
        return native.StripProblems(
            np.ascontiguousarray(base.matrix.T),
            np.ascontiguousarray(base.by_strip.T),
            self._strip,
            closed,
            self._unit,
            np.ascontiguousarray(base.by_load),
            np.ascontiguousarray(base.by_value),
            np.ascontiguousarray(base.output_by_strip),
            line + base.line,
            line_offset,
            law,
        )

    @cached_property
    def _native_origin(self) -> Any:
        return self._native(self._origin)

    def _solve_compiled(self, offset: Array, start: Mask | None) -> StripSolution:
        """Block principal pivoting with Newton's method for the strips."""
        scale, (count, m), n_strips = self._scale, offset.shape, self.sums.shape[1]
        q = offset / scale
        tolerance = TOLERANCE * np.abs(q).max(axis=1, initial=1e-300)
        active = np.zeros((count, m), bool) if start is None else start.copy()
        result, approach = np.empty((count, m)), np.empty((count, n_strips))
        slope, solved = np.empty(count), np.empty(count, dtype=bool)
        force = np.empty(approach.shape)

        def solve(
            part: Index | slice, base: Base, problems: Any, before: Index
        ) -> None:
            # consecutive problems are solved in place
            own, ends, done = base.offset_of(q[part]), active[part], solved[part]
            values, moved, slopes = result[part], approach[part], slope[part]
            ends[:, base.inside] ^= True
            limits = tolerance[part], EXACT, TRIES, SINGLES
            problems.solve(own, *limits, before, ends, values, moved, slopes, done)
            ends[:, base.inside] ^= True
            forces = self._forces(ends, values)
            moved += base.line * forces
            slopes += base.slope
            force[part] = forces
            if not isinstance(part, slice):
                result[part], active[part], approach[part] = values, ends, moved
                slope[part], solved[part] = slopes, done

        def chosen(sets: Mask, size: int) -> tuple[Base, Any]:
            """Base for problems whose active sets are like these (k, m)."""
            ends = sets.mean(axis=0) > 0.5
            saved = sets.sum(axis=1) - (sets ^ ends).sum(axis=1)
            if size == 1 or not sets.size or saved.mean() <= FEW:
                return self._origin, self._native_origin
            base = self._origin.exchange(ends)
            return base, self._native(base)

        def solve_guessed(parts: list[Index]) -> None:
            for part in parts:
                base, problems = chosen(active[part], part.size)
                solve(part, base, problems, np.full(part.size, -1))

        def solve_together(parts: list[Index]) -> None:
            for rows in parts:
                part = slice(rows[0], rows[-1] + 1)
                base = lined.exchange(active[part].mean(axis=0) > 0.5)
                solve(part, base, self._native(base), np.zeros(0, dtype=np.int64))

        def collect(part: Index, otherwise: Mask) -> Mask:
            """Active sets of the problems of a part that were solved (k, m)."""
            sound = part[solved[part]]
            return active[sound] if sound.size else otherwise

        def solve_unguessed(parts: list[Index]) -> None:
            """Start from the most similar problem that is solved already."""
            last = first_sets
            for part in parts:
                base, problems = common
                rows, before = next_to(similar_at[part])
                part = part[rows]
                active[part[0]] = last.mean(axis=0) > 0.5
                if crowded and part.size > 4 * PROBES:
                    probes = part[:: -(-part.size // PROBES)]
                    solve(probes, base, problems, np.arange(probes.size) - 1)
                    last = collect(probes, last)
                    base, problems = chosen(last, part.size)
                    active[part[0]] = last.mean(axis=0) > 0.5
                solve(part, base, problems, before)
                last = collect(part, last)

        if start is None:
            samples = np.concatenate([part[:1] for part in similar_parts(q, PART)])
            samples = samples[:: -(-samples.size // SAMPLES)]
            first, rest = samples[:1], samples[1:]
            solve(first, self._origin, self._native_origin, np.full(1, -1))
            active[rest[:1]] = active[first]
            solve(rest, *chosen(active[first], count), np.arange(rest.size) - 1)
            first_sets = collect(samples, np.zeros((1, m), bool))
            common = chosen(first_sets, count)
            # one part is like the samples
            crowded = count > PART and first_sets.sum(axis=1).mean() > FEW
            similar_at = common[0].offset_of(q)
            parts, solve_parts = similar_parts(similar_at, PART), solve_unguessed
            groups = [parts[k : k + GROUP] for k in range(0, len(parts), GROUP)]
        elif count < PART:
            groups, solve_parts = [similar_sets(start, PART)], solve_guessed
        else:
            numbers, solve_parts = np.arange(count), solve_together
            groups = [[p] for p in np.array_split(numbers, -(-count // TOGETHER))]
            if self._lined is not None:
                lined = self._lined
            else:
                first = numbers[:: -(-count // SAMPLES)]
                solve(first, self._origin, self._native_origin, np.full(first.size, -1))
                lined = self._with_lines_at(force[first])
        if len(groups) == 1:
            solve_parts(groups[0])
        else:
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                list(pool.map(solve_parts, groups))
        solved &= np.isfinite(result).all(axis=1) & np.isfinite(slope)
        margin = np.where(active, result, -result)
        result = np.maximum(margin, 0.0) / scale
        return StripSolution(
            value=result,
            active=active,
            approach=approach,
            force=force,
            slope=slope,
            solved=solved,
            margin=margin,
        )
