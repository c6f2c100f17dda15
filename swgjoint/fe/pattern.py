"""Equilibria of a drive over torque and input angle, torques as each angle asks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.fe.following import AnyState, Follower, Unloaded
from swgjoint.fe.load_path import LoadPath
from swgjoint.fe.state_arrays import packed, settled, unpacked
from swgjoint.maps.samples import FullSolves
from swgjoint.maps.unfinished import UNREADABLE, Unfinished

Array = NDArray[np.float64]

EVERY = 4
"""Of the first positions are solved in the second pitch, too."""
FAINT = 1e-8
"""Part of the torque that takes up a clearance, that acts at its ends: no stiffness is
zero."""
ANGLE_GOAL = 0.02
"""Difference at unseen angles, in the peak to peak, at which the first angles suffice;
it grows with the root of their number: each doubling takes solves from the torques."""
STALLED = 0.7
"""Part of that difference which is left after a doubling that was worth it: more angles
do not cure what comes from the mesh."""
TORQUE_GOAL = 0.02
"""Estimated error between torques, in the same, at which they suffice."""
POTENTIAL_WEIGHT = 0.3
"""Of the estimated error of the complementary potential over a step of the angle, as
one of the input torque: errors of neighbouring angles are partly alike."""
LEAST_PEAK = 0.05
"""Peak to peak that counts at least, in the largest one over the torques."""
SNAP = 0.2
"""Part of an interval by which its division may move to a torque of a column beside."""
FEWEST_TORQUES = 40
"""Of one sign in the table."""
_SOLVES, _REST, _TORQUES, _STATE = "solves-{:04d}", "rest", "torques", "state"


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How many equilibria a map may take."""

    angles: int
    """Input positions over one pitch to begin with."""
    most_angles: int
    """To which they may be doubled; ``angles`` times a power of two."""
    solves: int
    """Equilibria of the samples and of those that judge the map."""
    unseen: tuple[int, int]
    """Torques of one sign, and angles of each, that judge the map."""
    torques: int
    """Most torques of one sign in the table."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern(Generic[AnyState]):
    """Equilibria over one pitch, torques of either sign."""

    theta: Array
    """Input positions, equally spaced over the pitch [rad]. Shape (n_angles,)."""
    torque: Array
    """T, increasing, zero included [N·m]. Shape (n_torques,)."""
    table: Array
    """Output error, energy, tangent compliance, input torque. Shape (4, n_torques,
    n_angles)."""
    solved: NDArray[np.bool_]
    """Torques that were solved at every angle; the others lie on the load paths, their
    input torque on a straight line. Shape (n_torques,)."""
    unseen: FullSolves
    """Equilibria at other angles and torques."""
    shortfall: str
    """What the solves did not suffice for; empty if they did."""
    free: bool
    """Whether clearance leaves the output free without torque; the torques next to zero
    are then added, see :func:`across_clearance`."""
    truncated: bool
    """Whether torques are left out at which a solve failed, and those beyond."""
    states: dict[float, list[AnyState]]
    """Positions at the torques that were solved everywhere, that without torque
    included."""
    info: dict[str, Any]
    """How well the pattern repeats and is its own mirror image, and what was solved."""


def solve_pattern(
    follow: Follower[AnyState],
    period: float,
    torques: list[float],
    effort: Effort,
    *,
    small: float,
    rated: float,
    symmetric: bool,
    tick: Callable[[], None],
    keep: Unfinished | None = None,
    restored: Callable[[int], None] = lambda solves: None,
) -> Pattern[AnyState]:
    """Solve as many angles and torques as the drive asks for.

    First the given torques at every angle. Angles are doubled until they predict others
    at these torques; then the load path of every angle is divided where its estimated
    error is largest, see :class:`swgjoint.fe.load_path.LoadPath`. The claims that the
    map rests on are checked at one torque.

    Args:
        follow: The drive.
        period: Of the pattern [rad].
        torques: To begin with, zero excluded; positive ones if ``symmetric`` [N·m].
        effort: Angles and solves.
        small: Torque that takes up a clearance [N·m].
        rated: Next to it the claims are checked [N·m].
        symmetric: Whether the negative torques are the mirror image.
        tick: Called after every solve.
        keep: Where solved positions are kept, and taken up again; None keeps none.
        restored: Called with the number of solves that an interrupted run had done.

    Raises:
        ComputationError: If the unloaded drive or all torques cannot be solved.
    """
    grid = _Grid(
        follow=follow,
        period=period,
        finest=effort.most_angles,
        levels=sorted(torques),
        small=small,
        tick=tick,
        keep=keep,
        restored=restored,
    )
    count = effort.angles
    grid.solve_columns(count)
    if not grid.levels:
        raise ComputationError(
            "no torque can be solved; the smallest is"
            f" {min(torques, key=abs):g} N·m of {max(torques, key=abs):g} N·m"
        )
    # the claims, at the angles that every map has
    check = min(grid.levels, key=lambda t: abs(t - rated))
    info: dict[str, Any] = {"second_pitch": _second_pitch(grid, check, count)}
    if symmetric:
        info["mirror"] = _mirror(grid, check, count)
    # angles that no sample has, first at the torques that all have
    places = _unseen_places(effort.unseen[1], effort.most_angles)
    others = [grid.unseen_column(place) for place in places]
    missed = grid.missed(count, others)
    reserved = len(others) * effort.unseen[0] * len(grid.signs)
    budget = effort.solves - reserved

    def angle_goal() -> float:
        return float(ANGLE_GOAL * np.sqrt(count / effort.angles))

    while missed > angle_goal() and 2 * count <= effort.most_angles:
        # no better between the torques than between the angles
        grid.divide(count, budget, max(TORQUE_GOAL, missed))
        if grid.solves + grid.cost(count) > budget:
            break
        count, before = 2 * count, missed
        grid.solve_columns(count)
        missed = grid.missed(count, others)
        if missed > STALLED * before:
            break
    doubt = grid.divide(count, budget, TORQUE_GOAL)
    shortfall = []
    if missed > angle_goal():
        shortfall.append(
            f"angles between {count} a pitch are off by up to {100.0 * missed:.2g} %"
        )
    if doubt > TORQUE_GOAL:
        shortfall.append(
            f"torques between the samples by an estimated {100.0 * doubt:.2g} %"
        )
    unseen = grid.unseen(others, effort.unseen[0])
    tables, solved = grid.tables(count, effort.torques)
    if symmetric:
        tables = with_mirrored_torques(tables)
        solved |= {-t for t in solved}
    used = np.array(sorted(tables))
    info["sampling"] = {
        "angles": count,
        "solves": grid.solves,
        "solves_per_angle": [
            len(column.states) + 1 for _, column in grid.chosen(count)
        ],
        "missed_at_unseen_angles": missed,
        "estimated_between_torques": doubt,
    }
    return Pattern(
        theta=grid.angles(count),
        torque=used,
        table=np.array([tables[t] for t in used]).swapaxes(0, 1),
        solved=np.isin(used, sorted(solved)),
        unseen=unseen,
        shortfall=", ".join(shortfall),
        free=grid.free,
        truncated=len(grid.levels) < len(torques),
        states=grid.states(count),
        info=info,
    )


@dataclass(kw_only=True, eq=False)
class _Column(Generic[AnyState]):
    """Equilibria at one angle."""

    theta: float
    rest: Unloaded[AnyState]
    states: dict[float, AnyState] = field(default_factory=dict)
    """By torque, that without torque excluded."""
    failed: set[float] = field(default_factory=set)
    """Torques that were tried in vain."""

    def towards(self, torque: float) -> AnyState:
        """Where a torque of this sign begins."""
        if self.rest.sides is None:
            return self.rest.state
        return self.rest.sides[0 if torque > 0.0 else 1]

    def nearest(self, torque: float) -> AnyState:
        """The equilibrium of the same sign at the nearest torque."""
        near = {t: s for t, s in self.states.items() if t * torque > 0.0}
        near[0.0] = self.towards(torque)
        return near[min(near, key=lambda t: abs(t - torque))]


@dataclass(kw_only=True, eq=False)
class _Grid(Generic[AnyState]):
    """Columns of equilibria, added to until they suffice.

    Angles are numbers on the finest grid of the pitch. All solves come in an order that
    the results alone decide: an interrupted run repeats it and reads what it has.
    """

    follow: Follower[AnyState]
    period: float
    finest: int
    levels: list[float]
    """Torques of every column; those that fail, and those beyond, are taken out."""
    small: float
    tick: Callable[[], None]
    keep: Unfinished | None
    restored: Callable[[int], None]
    columns: dict[float, _Column[AnyState]] = field(default_factory=dict)
    solves: int = 0
    parts: int = 0
    """Kept so far."""

    @property
    def free(self) -> bool:
        """Whether clearance leaves the output free without torque somewhere."""
        return any(one.rest.sides is not None for one in self.columns.values())

    @property
    def signs(self) -> list[float]:
        """Of the torques."""
        return [s for s in (1.0, -1.0) if any(t * s > 0.0 for t in self.levels)]

    def angles(self, count: int) -> Array:
        """Input positions of so many columns (count,) [rad]."""
        return self.period * np.arange(count) / count

    def chosen(self, count: int) -> Iterator[tuple[int, _Column[AnyState]]]:
        """So many columns, equally spaced, with their numbers."""
        for k in range(count):
            yield k, self.columns[k * (self.finest // count)]

    def states(self, count: int) -> dict[float, list[AnyState]]:
        """At the torques that all columns have."""
        columns = [column for _, column in self.chosen(count)]
        found = {0.0: [one.rest.state for one in columns]}
        return found | {t: [one.states[t] for one in columns] for t in self.levels}

    # -- solving -----------------------------------------------------------------------

    def solve_columns(self, count: int) -> None:
        """Make sure of so many columns, equally spaced."""
        step = self.finest // count
        for place in range(0, self.finest, step):
            if place not in self.columns:
                self.columns[place] = self._column(place)

    def unseen_column(self, place: float) -> _Column[AnyState]:
        """A column between those of the samples; it is none of them."""
        return self._column(place)

    def _column(self, place: float) -> _Column[AnyState]:
        """Rest and the common torques, from the column before, if there is one."""
        theta = self.period * place / self.finest
        before = max((p for p in self.columns if p < place), default=None)
        column = self._read(theta, self.levels)
        if column is None:
            if before is None:
                column = self._first()
            else:
                column = self._beside(self.columns[before], theta)
            self._write(column, list(column.states), rest=True)
        lost = [t for t in self.levels if t not in column.states]
        for sign in (1.0, -1.0):
            first = min((abs(t) for t in lost if t * sign > 0.0), default=np.inf)
            self.levels = [t for t in self.levels if t * sign < 0.0 or abs(t) < first]
        return column

    def _first(self) -> _Column[AnyState]:
        """Load the first position from zero torque outwards until a solve fails."""
        state = self.follow.meshed(self.follow.deflected())
        if not state.outcome.ok:
            raise _no_rest(0.0, state)
        column = self._rest(self.follow.unloaded(state, self.small), 0.0)
        for sign in (1.0, -1.0):
            state = column.towards(sign)
            for torque in sorted((t for t in self.levels if t * sign > 0.0), key=abs):
                state = self.follow.to_torque(state, torque)
                if not state.outcome.ok:
                    break
                state = settled(state)
                column.states[torque] = state
                self._count()
        return column

    def _beside(self, before: _Column[AnyState], theta: float) -> _Column[AnyState]:
        """The same torques a step on; none beyond one that fails."""
        column = self._rest(self.follow.unloaded_to(before.rest, theta), theta)
        lost = set()
        for torque in sorted(self.levels, key=abs):
            if (torque > 0.0) not in lost:
                state = self.follow.to_angle(before.states[torque], theta)
                if not state.outcome.ok:
                    state = self.follow.to_torque(column.nearest(torque), torque)
                if state.outcome.ok:
                    column.states[torque] = settled(state)
                    self._count()
                    continue
            lost.add(torque > 0.0)
        return column

    def _rest(self, unloaded: Unloaded[AnyState], theta: float) -> _Column[AnyState]:
        if not unloaded.state.outcome.ok:
            raise _no_rest(theta, unloaded.state)
        self._count()
        return _Column(theta=theta, rest=settled(unloaded))

    def _more(
        self,
        column: _Column[AnyState],
        torques: list[float],
        before: _Column[AnyState] | None = None,
    ) -> None:
        """Solve other torques of a column, each from the nearest equilibrium.

        That is one at the same angle, or at the same torque in the column before.
        """
        there = self._read(column.theta, torques, column)
        if there is None:
            found = []
            for torque in sorted(torques, key=lambda t: (t < 0.0, abs(t))):
                if before is not None and torque in before.states:
                    start = before.states[torque]
                    state = self.follow.to_angle(start, column.theta)
                else:
                    state = self.follow.to_torque(column.nearest(torque), torque)
                if state.outcome.ok:
                    column.states[torque] = settled(state)
                    found.append(torque)
                self._count()
            self._write(column, found, rest=False)
        column.failed |= {t for t in torques if t not in column.states}

    def _count(self) -> None:
        self.solves += 1
        self.tick()

    # -- interruptions -----------------------------------------------------------------

    def _write(
        self, column: _Column[AnyState], torques: list[float], *, rest: bool
    ) -> None:
        if self.keep is not None:
            arrays = packed(column.rest, _REST) if rest else {}
            arrays |= {_TORQUES: np.array(torques), "theta": np.array(column.theta)}
            for j, t in enumerate(torques):
                arrays |= packed(column.states[t], f"{_STATE}-{j}")
            self.keep.write(_SOLVES.format(self.parts), arrays)
        self.parts += 1

    def _read(
        self,
        theta: float,
        torques: list[float],
        column: _Column[AnyState] | None = None,
    ) -> _Column[AnyState] | None:
        """The next part of an interrupted run, added to a column if one is given."""
        if self.keep is None:
            return None
        name = _SOLVES.format(self.parts)
        arrays = self.keep.read(name)
        if arrays is None:
            return None
        try:
            found, solves = self._taken(arrays, theta, torques, column)
        except UNREADABLE as error:
            self.keep.ignored(name, error)
            return None
        self.parts += 1
        self.solves += solves
        self.restored(solves)
        return found

    def _taken(
        self,
        arrays: Mapping[str, Any],
        theta: float,
        torques: list[float],
        column: _Column[AnyState] | None,
    ) -> tuple[_Column[AnyState], int]:
        """A column from the arrays of a part, and the number of its solves.

        Raises:
            ValueError: If it does not follow the parts before.
        """
        if float(arrays["theta"]) != theta:
            raise ValueError("a position at another angle")
        solved: list[float] = np.asarray(arrays[_TORQUES]).tolist()
        if not {*solved} <= {*torques}:
            raise ValueError(f"other torques: {solved}")
        found: dict[float, Any] = {
            t: unpacked(arrays, f"{_STATE}-{j}") for j, t in enumerate(solved)
        }
        if column is not None:
            for state in found.values():
                _check_like(state, column.rest.state)
            column.states |= found
            return column, len(torques)
        rest: Any = unpacked(arrays, _REST)
        if not isinstance(rest, Unloaded):
            raise ValueError("no position without torque")
        like = self.columns[0].rest.state if self.columns else rest.state
        for state in (rest.state, *(rest.sides or ()), *found.values()):
            _check_like(state, like)
        return _Column(theta=theta, rest=rest, states=found), 1 + len(found)

    # -- figures -----------------------------------------------------------------------

    def figures(self, state: AnyState, theta: float) -> Array:
        """Output error, energy, compliance, input torque (4,)."""
        follow = self.follow
        error = follow.output_angle(state) - theta / follow.ratio
        return np.array(
            [error, state.energy, state.compliance, follow.input_torque(state)]
        )

    def _path(self, column: _Column[AnyState], sign: float) -> tuple[Array, Array]:
        """Torques [N·m] and figures (4, n) of one sign, outwards from zero."""
        top = max(abs(t) for t in self.levels if t * sign > 0.0)
        outward: list[float] = sorted(
            (t for t in column.states if t * sign > 0.0 and abs(t) <= top), key=abs
        )
        # a free output has no curve before its clearance is taken up
        first = 0.0 if column.rest.sides is None else sign * self.small
        states: list[AnyState] = [column.towards(sign)]
        states += [column.states[t] for t in outward]
        table = np.array([self.figures(s, column.theta) for s in states]).T
        return np.array([first, *outward]), table

    def path(
        self, column: _Column[AnyState], sign: float
    ) -> tuple[LoadPath, tuple[Array, Array]]:
        """The curve of one sign, and torque and input torque that were solved.

        Of negative torques it is the curve of the mirrored drive.
        """
        torque, table = self._path(column, sign)
        error, energy, compliance, moment = table
        curve = LoadPath(
            torque=sign * torque,
            output_error=sign * error,
            energy=energy,
            compliance=compliance,
        )
        return curve, (sign * torque, sign * moment)

    def missed(self, count: int, others: list[_Column[AnyState]]) -> float:
        """Largest part of the peak to peak that other angles are off by.

        At the common torques: output error, and input torque as the derivative of the
        complementary potential by the angle.
        """
        worst, columns = 0.0, [column for _, column in self.chosen(count)]
        for torque in [0.0, *self.levels]:
            if torque == 0.0 and self.free:
                continue

            error, energy, _, moment = self._row(columns, torque)
            potential = energy + torque * error
            e, _, _, m = self._row(others, torque)
            parts = np.array([one.theta for one in others]) / self.period
            predicted, _ = _periodic(error, parts)
            _, slope = _periodic(potential, parts)
            slope = slope / self.period + torque / self.follow.ratio
            for own, there, told in ((error, e, predicted), (moment, m, slope)):
                height = np.ptp(np.concatenate([own, there]))
                worst = max(worst, float(np.abs(told - there).max() / height))
        return worst

    def _row(self, columns: list[_Column[AnyState]], torque: float) -> Array:
        """Figures of some columns at a torque that all of them have (4, n)."""
        return np.array(
            [
                self.figures(c.states[torque] if torque else c.rest.state, c.theta)
                for c in columns
            ]
        ).T

    def peaks(self, count: int, sign: float) -> tuple[Array, Array, Array]:
        """Torques, peak to peak over the angle of e and of the input torque there.

        Positive torques also where ``sign`` is negative.
        """
        paths = [self.path(column, sign) for _, column in self.chosen(count)]
        first = max(curve.torque[0] for curve, _ in paths)
        top = max(abs(t) for t in self.levels if t * sign > 0.0)
        torque = np.linspace(first, top, 49)
        errors = np.array([curve.at(torque)[0] for curve, _ in paths])
        moments = np.array([np.interp(torque, *solved) for _, solved in paths])
        heights = []
        for table in (errors, moments):
            height = np.ptp(table, axis=0)
            heights.append(np.maximum(height, LEAST_PEAK * height.max()))
        return torque, heights[0], heights[1]

    def cost(self, count: int) -> int:
        """Solves of so many columns: what as many others between them would take."""
        return sum(1 + len(column.states) for _, column in self.chosen(count))

    def divide(self, count: int, most: int, goal: float) -> float:
        """Divide load paths until their estimated errors meet a goal.

        Args:
            count: Of the columns.
            most: Solves in all.
            goal: Largest estimated error, in the peak to peak.

        Returns:
            The largest estimate that is left, in the peak to peak.
        """
        step = self.period / count
        while True:
            wanted: list[tuple[float, int, float]] = []
            for sign in self.signs:
                at, error, moment = self.peaks(count, sign)
                for k, column in self.chosen(count):
                    curve, _ = self.path(column, sign)
                    of_error, of_potential = curve.doubt
                    there = curve.division
                    # the input torque is the difference of G from angle to angle
                    part = np.maximum(
                        of_error / np.interp(there, at, error),
                        POTENTIAL_WEIGHT
                        * of_potential
                        / step
                        / np.interp(there, at, moment),
                    )
                    tried = sign * np.array(sorted(column.failed))
                    for j, torque in enumerate(there):
                        low, high = curve.torque[j], curve.torque[j + 1]
                        if not ((tried > low) & (tried < high)).any():
                            wanted.append((float(part[j]), k, sign * float(torque)))
            wanted.sort(reverse=True)
            worst = wanted[0][0] if wanted else 0.0
            chosen = [w for w in wanted if w[0] > goal]
            chosen = chosen[: max(0, most - self.solves)]
            if not chosen:
                return worst
            columns = [column for _, column in self.chosen(count)]
            for k, column in enumerate(columns):
                # the column before, and after the last one the first
                beside = (columns[k - 1], columns[(k + 1) % count])
                torques = [
                    _as_beside(torque, column, beside)
                    for _, number, torque in chosen
                    if number == k
                ]
                if torques:
                    self._more(column, torques, beside[0] if k else None)

    def unseen(self, others: list[_Column[AnyState]], count: int) -> FullSolves:
        """Equilibria at other angles, without torque and at so many other torques.

        Args:
            others: Columns at these angles.
            count: Torques of one sign.
        """
        rows = []
        for column in others:
            theta = column.theta
            error, _, _, moment = self.figures(column.rest.state, theta)
            rows.append((theta, 0.0, error, moment))
            torques = []
            for sign in self.signs:
                top = max(abs(t) for t in self.levels if t * sign > 0.0)
                torques += [sign * top * part for part in _unseen_parts(count)]
            self._more(column, torques)
            for torque in torques:
                if torque in column.states:
                    error, _, _, moment = self.figures(column.states[torque], theta)
                    rows.append((theta, torque, error, moment))
        angle, torque, errors, moments = np.array(rows).T
        return FullSolves(
            input_angle=angle,
            torque=torque,
            output_error=errors,
            input_torque=moments,
        )

    def tables(self, count: int, most: int) -> tuple[dict[float, Array], set[float]]:
        """Figures (4, count) by torque, and the torques that all columns solved.

        At most so many torques of one sign, next to those that all columns solved.

        Clearance adds rows, see :func:`across_clearance`.
        """
        columns = [column for _, column in self.chosen(count)]
        rest = np.array([self.figures(c.rest.state, c.theta) for c in columns]).T
        found = {0.0: rest}
        for sign in self.signs:
            paths = [self.path(column, sign) for column in columns]
            own = {abs(t) for t in self.levels if t * sign > 0.0}
            least = self.small if self.free else 0.0
            torque = _common_torques([curve for curve, _ in paths], own, least, most)
            if self.free:
                torque = np.concatenate([[least], torque])
            values = np.array(
                [
                    np.vstack([curve.at(torque), np.interp(torque, *solved)])
                    for curve, solved in paths
                ]
            )  # (count, 4, n)
            values *= np.array([sign, 1.0, 1.0, sign])[:, None]
            found |= {sign * float(t): values[:, :, j].T for j, t in enumerate(torque)}
            if self.free:
                taken_up = found[sign * self.small]
                begin, onset = across_clearance(rest, taken_up, sign * self.small)
                found[begin] = onset
                # the same stiffness on both sides of the middle
                rest[2] = onset[2]
        return found, {0.0, *self.levels}


def _as_beside(
    torque: float,
    column: _Column[AnyState],
    beside: tuple[_Column[AnyState], ...],
) -> float:
    """A torque near the wanted one that a column beside has, else the wanted one.

    To go on from there takes half the iterations of a change of the torque, and events
    move little from column to column.
    """
    own = [0.0, *(t for t in column.states if t * torque > 0.0)]
    low = max(t for t in map(abs, own) if t < abs(torque))
    high = min(t for t in map(abs, own) if t > abs(torque))
    part = SNAP * (high - low)
    near = [
        t
        for one in beside
        for t in one.states
        if t * torque > 0.0
        and abs(t - torque) < part
        and low + 0.5 * part < abs(t) < high - 0.5 * part
    ]
    return min(near, key=lambda t: abs(t - torque), default=torque)


def _common_torques(
    paths: list[LoadPath], own: set[float], least: float, most: int
) -> Array:
    """Torques of the table, closer together where the load paths have their events.

    Args:
        paths: Of all angles.
        own: Torques that all of them solved [N·m].
        least: Torque that all must exceed [N·m].
        most: Torques at most, next to those.
    """
    top = max(own)
    pool = np.concatenate([np.concatenate([p.torque, p.events]) for p in paths])
    pool = np.sort(pool[(pool > least) & (pool <= top)])
    count = int(
        np.clip(3 * len(pool) // (2 * len(paths)), min(FEWEST_TORQUES, most), most)
    )
    fine = np.linspace(least, top, 4001)
    rank = np.searchsorted(pool, fine, side="right") / pool.size
    share = (fine - least) / (top - least)
    # a half follows the events, a half is spread out, small torques a little closer
    measure = 0.5 * rank + 0.25 * share + 0.25 * np.sqrt(share)
    spread = np.interp((np.arange(count) + 0.5) / count, measure, fine)
    levels = np.array(sorted(own))
    # torques that nearly are one of those that were solved give way to it
    gap = np.abs(spread[:, None] - levels).min(axis=1)
    near = gap < 0.35 * np.gradient(spread)
    return np.sort(np.concatenate([spread[~near], levels]))


def _periodic(values: Array, parts: Array) -> tuple[Array, Array]:
    """Trigonometric interpolation over a period, and its slope by the part of it.

    Args:
        values: At equal steps (n,).
        parts: Of the period (m,).
    """
    n = len(values)
    modes = np.fft.rfft(values)[: (n + 1) // 2] / n
    modes[1:] *= 2.0
    wave = 2.0j * np.pi * np.arange(len(modes))
    phase = np.exp(parts[:, None] * wave)
    return (phase @ modes).real, (phase @ (wave * modes)).real


def _unseen_places(count: int, finest: int) -> list[float]:
    """Angles on the finest grid that no grid has, spread over the pitch."""
    # the golden section of a step, so that no grid comes near all of them
    return [finest * (k + 0.381966) / count for k in range(count)]


def _unseen_parts(count: int) -> Array:
    """Unseen torques in parts of the largest one, a half of them small ones.

    None is next to a torque at which all maps begin.
    """
    small = count // 2
    parts = [np.geomspace(0.021, 0.28, small), np.linspace(0.37, 0.97, count - small)]
    return np.concatenate(parts)


def _second_pitch(grid: _Grid[AnyState], torque: float, count: int) -> dict[str, float]:
    """How well the pattern repeats at some angles of the next pitch."""
    follow, theta = grid.follow, grid.angles(count)
    columns = [column for _, column in grid.chosen(count)]
    state, again = columns[-1].states[torque], []
    for k, angle in enumerate(theta[::EVERY]):
        name = f"second-pitch-{k:04d}"
        there = None if grid.keep is None else _read(grid.keep, name, like=state)
        if there is None:
            there = settled(follow.to_angle(state, grid.period + float(angle)))
            if grid.keep is not None:
                grid.keep.write(name, packed(there, _STATE))
        state = there
        ok = state.outcome.ok
        again.append(follow.output_angle(state) if ok else np.nan)
        grid._count()
    first = np.array([grid.figures(c.states[torque], c.theta)[0] for c in columns])
    apart = np.array(again) - (grid.period + theta[::EVERY]) / follow.ratio
    return {
        "torque_Nm": torque,
        "largest_difference_rad": float(np.abs(apart - first[::EVERY]).max()),
        "peak_to_peak_rad": float(np.ptp(first)),
    }


def _mirror(grid: _Grid[AnyState], torque: float, count: int) -> dict[str, Any]:
    """How well the drive is its own mirror image, at the second angle."""
    step = grid.finest // count
    one, image = grid.columns[step], grid.columns[grid.finest - step]
    solved = grid.follow.to_torque(one.rest.state, -torque)
    error = grid.figures(solved, one.theta)[0]
    wanted = -grid.figures(image.states[torque], image.theta)[0]
    ok = solved.outcome.ok
    return {
        "torque_Nm": -torque,
        "difference_rad": float(error - wanted) if ok else None,
    }


def _read(keep: Unfinished, name: str, *, like: AnyState) -> AnyState | None:
    """A state of an interrupted run; None if it did not get there."""
    arrays = keep.read(name)
    if arrays is None:
        return None
    try:
        state: AnyState = unpacked(arrays, _STATE)
        _check_like(state, like)
    except UNREADABLE as error:
        keep.ignored(name, error)
        return None
    return state


def _check_like(state: Any, like: Any) -> None:
    """Refuse a state that is not an equilibrium of the same model."""
    if type(state) is not type(like) or state.faces.shape != like.faces.shape:
        raise ValueError("a state of another model")
    if not np.isfinite(state.faces).all():
        raise ValueError("positions that are not finite")


def _no_rest(theta: float, state: AnyState) -> ComputationError:
    return ComputationError(
        f"no equilibrium without torque at input angle {theta:g} rad:"
        f" {state.outcome.value}"
    )


def across_clearance(
    rest: Array, taken_up: Array, torque: float
) -> tuple[float, Array]:
    r"""Where the teeth begin to hold an output that is free without torque.

    From the middle of the clearance the torque rises to the :data:`FAINT` part of the
    one that takes it up; there the stiffness begins to grow, to K under that torque at
    :math:`\ell = 3 T / 2 K`. A linear spring would begin at T/K with the energy
    :math:`T^2 / 2 K`; a stiffness that grows steadily stores nearly that on this way.

    Args:
        rest: Output error, energy, compliance and input torque in the middle (4, n).
        taken_up: The same under ``torque`` (4, n).
        torque: A small one [N·m].

    Returns:
        Torque [N·m] and table (4, n) of the begin.
    """
    begin = FAINT * torque
    apart = taken_up[0] - rest[0]  # against the sign of the torque
    way = np.clip(1.0 - 1.5 * torque * taken_up[2] / -apart, 0.1, 1.0)
    onset = rest.copy()
    onset[0] += way * apart
    onset[1] -= 0.5 * begin * way * apart
    onset[2] = -way * apart / begin
    onset[3] += FAINT * (taken_up[3] - rest[3])
    return begin, onset


def with_mirrored_torques(tables: dict[float, Array]) -> dict[float, Array]:
    """Tables of positive torques and their mirror images, around one rest.

    Without load the drive is its own mirror image but for round-off, which exceeds the
    energy of the smallest torques: both sides count from the mean of the two.
    """
    rest = tables[0.0]
    middle = 0.5 * (rest + _mirrored(rest))
    shift = np.zeros_like(rest)
    shift[:2] = (middle - rest)[:2]
    sides = {t: values + shift for t, values in tables.items() if t}
    return sides | {-t: _mirrored(v) for t, v in sides.items()} | {0.0: middle}


def _mirrored(values: Array) -> Array:
    """The same drive under the opposite torque, seen in a mirror.

    At -T and -theta: opposite error and input torque, same energy and compliance.
    """
    back = np.roll(values[:, ::-1], 1, axis=1)
    return np.asarray(back * np.array([-1.0, 1.0, 1.0, -1.0])[:, None])
