"""Columns of equilibria: solution and storage.

A column contains the equilibria of a drive under several torques at one input angle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Generic, TypeVar, cast

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.common.columns.turning import Turning
from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.following import Follower, Unloaded
from swgjoint.fe.common.layout_angles import AnyState
from swgjoint.fe.common.load_path import LoadPath
from swgjoint.fe.common.state_arrays import copy_contiguous, pack_solve, unpack_solve
from swgjoint.maps.samples import FullSolves
from swgjoint.maps.unfinished import UnfinishedSeries
from swgjoint.typing import Array

T = TypeVar("T")


@dataclass(kw_only=True, eq=False)
class AngleColumn(Generic[AnyState]):
    """Equilibria at one input angle."""

    theta: float
    """Input angle [rad]."""
    rest: Unloaded[AnyState]
    """Equilibrium without torque."""
    states: dict[float, AnyState] = field(default_factory=dict)
    """Equilibria by nonzero torque [N·m]."""
    failed: set[float] = field(default_factory=set)
    """Torques whose solve failed [N·m]."""
    changes: dict[float, ContactChanges | None] = field(default_factory=dict)
    """Contact changes that an equilibrium predicts, by its torque [N·m]; None without a
    prediction."""
    paths: dict[float, tuple[LoadPath, tuple[Array, Array]]] = field(
        default_factory=dict
    )
    """Latest load curve for each sign of the torque, see :meth:`ColumnGrid.path`."""

    def start_towards(self, torque: float) -> AnyState:
        """State from which loading by a torque of this sign [N·m] starts."""
        if self.rest.sides is None:
            return self.rest.state
        return self.rest.sides[0 if torque > 0.0 else 1]

    def nearest(self, torque: float) -> AnyState:
        """Equilibrium at the nearest torque of this sign or at the start of loading."""
        near = {t: s for t, s in self.states.items() if t * torque > 0.0}
        near[0.0] = self.start_towards(torque)
        return near[min(near, key=lambda t: abs(t - torque))]


@dataclass(kw_only=True, eq=False)
class SolvedColumns(Generic[AnyState]):
    """Columns of equilibria at neighbouring angles, solved in sequence and stored.

    Angles are identified by their place on the finest grid of the pitch: an integer for
    the columns of the samples, a fraction between them. The order of all solves depends
    on nothing but the results, so that a resumed run repeats the order and can read the
    stored results.
    """

    follow: Follower[AnyState]
    """Solver that follows the equilibria of the drive."""
    period: float
    """Period of the pattern in the input angle [rad]."""
    finest: int
    """Number of angles of the finest grid."""
    levels: list[float]
    """Torques of every column [N·m]. If a torque fails in one column, it is removed
    together with all larger ones of the same sign."""
    small: float
    """Torque that takes up the clearance of the teeth [N·m]."""
    tick: Callable[[], None]
    """Called after every solve."""
    keep: UnfinishedSeries | None
    """Store of solved equilibria; None stores none."""
    columns: dict[float, AngleColumn[AnyState]] = field(default_factory=dict)
    """Columns by their place on the finest grid."""
    failed: list[float] = field(default_factory=list)
    """Torques between the levels whose solves failed [N·m]."""
    beyond: list[float] = field(default_factory=list)
    """Additional torques beyond the largest level, at most one of each sign [N·m]."""
    between: list[float] = field(default_factory=list)
    """Places of the columns between equally spaced ones, increasing."""
    solves: int = 0
    """Number of solves that count against the budget."""
    like: AnyState | None = None
    """First state; stored states of another type or shape are rejected."""
    _turning: Turning[AnyState] = field(init=False)

    def __post_init__(self) -> None:
        self._turning = Turning(follow=self.follow)

    @property
    def free(self) -> bool:
        """Whether clearance leaves the unloaded output free at any of the angles."""
        return any(one.rest.sides is not None for one in self.columns.values())

    @property
    def signs(self) -> list[float]:
        """Signs that occur among the torque levels: 1.0, -1.0 or both."""
        return [s for s in (1.0, -1.0) if any(t * s > 0.0 for t in self.levels)]

    def angles(self, count: int) -> Array:
        """Input angles of ``count`` equally spaced columns [rad], shape (count,)."""
        return self.period * np.arange(count) / count

    def chosen(self, count: int) -> Iterator[tuple[int, AngleColumn[AnyState]]]:
        """Iterate over ``count`` equally spaced columns with their numbers."""
        for k in range(count):
            yield k, self.columns[k * (self.finest // count)]

    def all_columns(self, count: int) -> list[AngleColumn[AnyState]]:
        """``count`` equally spaced columns and those between them."""
        places = {*range(0, self.finest, self.finest // count), *self.between}
        return [self.columns[place] for place in sorted(places)]

    def parts(self, count: int) -> Array:
        """Angles of the sampled columns as fractions of the period (n,)."""
        return np.array([one.theta for one in self.all_columns(count)]) / self.period

    def states(
        self, count: int, torques: Iterable[float]
    ) -> dict[float, list[AnyState]]:
        """Equilibria of equally spaced columns at zero torque and at common torques.

        Args:
            count: Number of equally spaced columns.
            torques: Torques of interest [N·m]; those that are not levels are ignored.

        Returns:
            One state per column, by torque.
        """
        columns = [column for _, column in self.chosen(count)]
        rest = {0.0: [one.rest.state for one in columns]}
        levels = [t for t in torques if t in self.levels]
        return rest | {t: [one.states[t] for one in columns] for t in levels}

    # -- solving -----------------------------------------------------------------------

    def solve_columns(self, count: int) -> None:
        """Solve those of ``count`` equally spaced columns that are still missing."""
        step = self.finest // count
        places = [p for p in range(0, self.finest, step) if p not in self.columns]
        if not self.columns:
            self.columns[places.pop(0)] = self._first()
        for place in places:
            self.columns[place] = self._unloaded(place)
        # one torque after the other, so that only one tangent is in memory
        for torque in sorted(self.levels, key=abs):
            for place in places:
                self._load(self.columns[place], torque)
        self._turning.forget()

    def unseen_column(self, place: float) -> AngleColumn[AnyState]:
        """Validation column at a place between the samples; it is not added to them."""
        return self._column(place)

    def _column(self, place: float) -> AngleColumn[AnyState]:
        """Column solved at all levels, starting from the preceding columns."""
        column = self._unloaded(place)
        for torque in sorted(self.levels, key=abs):
            self._load(column, torque)
        return column

    def _drop(self, torque: float) -> None:
        """Remove a torque and all larger ones of its sign from the levels."""
        most = abs(torque)
        self.levels = [t for t in self.levels if t * torque < 0.0 or abs(t) < most]

    def _before(self, theta: float) -> list[AngleColumn[AnyState]]:
        """Columns at smaller angles."""
        return [one for _, one in sorted(self.columns.items()) if one.theta < theta]

    def _first(self) -> AngleColumn[AnyState]:
        """First column, loaded from zero torque outwards until a solve fails."""

        def unloaded() -> Unloaded[AnyState]:
            state = self.follow.engage(self.follow.deflect())
            if not state.outcome.ok:
                raise _no_rest(0.0, state)
            return self.follow.unload(state, self.small)

        column = self._rest(0.0, unloaded)
        for sign in (1.0, -1.0):
            state = column.start_towards(sign)
            for torque in sorted((t for t in self.levels if t * sign > 0.0), key=abs):
                loaded = self.solve_at(
                    0.0, torque, partial(self.follow.to_torque, state, torque)
                )
                if loaded is None:
                    self._drop(torque)
                    break
                column.states[torque] = state = loaded
                self.count()
        return column

    def _unloaded(self, place: float) -> AngleColumn[AnyState]:
        """Column without load, from the preceding columns."""
        theta = self.period * place / self.finest
        before = self._before(theta)

        def unloaded() -> Unloaded[AnyState]:
            rest, follow = before[-1].rest, self.follow
            if all(one.rest.sides is None for one in before[-2:]):
                states = [one.rest.state for one in before]
                start, follow = self._turning.start(states, theta)
                rest = replace(rest, state=start)
            return follow.turn_unloaded(rest, theta)

        return self._rest(theta, unloaded)

    def _load(self, column: AngleColumn[AnyState], torque: float) -> None:
        """Solve a level of a column; if that fails, drop it and all larger ones."""
        if torque not in self.levels:
            return

        def beside() -> AnyState:
            near = [one.states[torque] for one in self._before(column.theta)]
            start, follow = self._turning.start(near, column.theta)
            state = follow.to_angle(start, column.theta)
            if state.outcome.ok:
                return state
            return self.follow.to_torque(column.nearest(torque), torque)

        state = self.solve_at(column.theta, torque, beside)
        if state is None:
            self._drop(torque)
        else:
            column.states[torque] = state
            self.count()

    def _rest(
        self, theta: float, solve: Callable[[], Unloaded[AnyState]]
    ) -> AngleColumn[AnyState]:
        """New column that contains its unloaded equilibrium only."""

        def sound() -> Unloaded[AnyState]:
            unloaded = solve()
            if not unloaded.state.outcome.ok:
                raise _no_rest(theta, unloaded.state)
            return unloaded

        rest = self._recalled(theta, 0.0, sound)
        self.like = rest.state if self.like is None else self.like
        self.count()
        return AngleColumn(theta=theta, rest=rest)

    def _more(
        self,
        column: AngleColumn[AnyState],
        torques: list[float],
        beside: Sequence[AngleColumn[AnyState]] = (),
    ) -> None:
        """Solve additional torques of a column, each from a nearby equilibrium.

        The search starts from the equilibria at the same torque in the columns
        ``beside``, the nearest one last, which halves the number of iterations, or
        otherwise from the nearest torque in the same column.
        """
        for torque in sorted(torques, key=lambda t: (t < 0.0, abs(t))):
            there = [one.states[torque] for one in beside if torque in one.states]
            solve = partial(self._one_more, column, torque, there)
            state = self.solve_at(column.theta, torque, solve)
            if state is None:
                column.failed.add(torque)
            else:
                column.states[torque] = state
            self.count()

    def _one_more(
        self, column: AngleColumn[AnyState], torque: float, there: list[AnyState]
    ) -> AnyState:
        """Equilibrium of a column, from those under the same torque if any."""
        if not there:
            return self.follow.to_torque(column.nearest(torque), torque)
        start, follow = self._turning.start(there, column.theta)
        return follow.to_angle(start, column.theta)

    def solve_positions(
        self, count: int, positions: Sequence[tuple[float, float]]
    ) -> FullSolves | None:
        """Equilibria at given torques and angles between the columns.

        Each is solved from the nearest torque of the nearest column. A position whose
        solve fails is omitted.

        Args:
            count: Number of equally spaced columns.
            positions: Output torque, not zero [N·m], and input angle [rad] of each.

        Returns:
            The equilibria; None without any.
        """
        columns = [column for _, column in self.chosen(count)]
        rows = []
        try:
            for torque, theta in positions:
                # the last column is not the nearest one of the next pitch
                nearest = min(round(theta / self.period * count), count - 1)
                solve = partial(self._between, columns[nearest], torque, theta)
                state = self.solve_at(theta, torque, solve)
                self.count()
                if state is not None:
                    error, _, _, moment = self.figures(state, theta)
                    rows.append((theta, torque, error, moment))
        finally:
            self.flush()
        return FullSolves.from_rows(rows) if rows else None

    def _between(
        self, column: AngleColumn[AnyState], torque: float, theta: float
    ) -> AnyState:
        """Equilibrium near a column, under the torque and at the angle."""
        return self.follow.to_position(column.nearest(torque), torque, theta)

    def count(self) -> None:
        """Count one more solve and report it."""
        self.solves += 1
        self.tick()

    # -- interruptions -----------------------------------------------------------------

    def solve_at(
        self, theta: float, torque: float, solve: Callable[[], AnyState]
    ) -> AnyState | None:
        """Equilibrium under a torque, either solved or read from the store.

        Args:
            theta: Input angle [rad].
            torque: Output torque, not zero [N·m].
            solve: Function that solves for the equilibrium.

        Returns:
            The equilibrium; None if the solve failed.
        """

        def sound() -> AnyState | None:
            state = solve()
            return state if state.outcome.ok else None

        return self._recalled(theta, torque, sound)

    def flush(self) -> None:
        """Write the solves that are not yet in the store."""
        if self.keep is not None:
            self.keep.flush()

    def _recalled(self, theta: float, torque: float, solve: Callable[[], T]) -> T:
        """Result of a solve, read from the store if the store contains it."""
        if self.keep is not None:
            stored = self.keep.read(
                partial(unpack_solve, theta=theta, torque=torque, like=self.like)
            )
            if stored is not None:
                return cast(T, stored[0])
        result = copy_contiguous(solve())
        if self.keep is not None:
            self.keep.write(pack_solve(result, theta=theta, torque=torque))
        return result

    # -- values ------------------------------------------------------------------------

    def figures(self, state: AnyState, theta: float) -> Array:
        """Values of an equilibrium that enter the tables.

        Args:
            state: The equilibrium.
            theta: Its input angle [rad].

        Returns:
            Output error [rad], strain energy [J], compliance [rad/(N·m)] and input
            torque [N·m], shape (4,).
        """
        follow = self.follow
        error = follow.output_angle(state) - theta / follow.ratio
        return np.array(
            [error, state.energy, state.compliance, follow.input_torque(state)]
        )


def _no_rest(theta: float, state: AnyState) -> ComputationError:
    """Error for an input angle at which the unloaded drive cannot be solved."""
    return ComputationError(
        f"no equilibrium without torque at input angle {theta:g} rad:"
        f" {state.outcome.value}"
    )
