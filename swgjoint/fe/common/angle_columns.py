"""Columns of equilibria at one input angle each: how they are solved and kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Generic, TypeVar, cast

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.following import AnyState, Follower, Unloaded
from swgjoint.fe.common.load_path import LoadPath
from swgjoint.fe.common.state_arrays import copy_contiguous, pack, unpack
from swgjoint.maps.unfinished import Unfinished
from swgjoint.typing import Array

T = TypeVar("T")

_SOLVE, _STATE = "solve-{:04d}", "state"


@dataclass(kw_only=True, eq=False)
class AngleColumn(Generic[AnyState]):
    """Equilibria at one angle."""

    theta: float
    rest: Unloaded[AnyState]
    states: dict[float, AnyState] = field(default_factory=dict)
    """By torque, that without torque excluded."""
    failed: set[float] = field(default_factory=set)
    """Torques that were tried in vain."""
    changes: dict[tuple[float, float], ContactChanges | None] = field(
        default_factory=dict
    )
    """Changes of contact that an equilibrium predicts, by its torque and the sign."""
    paths: dict[float, tuple[LoadPath, tuple[Array, Array]]] = field(
        default_factory=dict
    )
    """The last curve of each sign, see :meth:`ColumnGrid.path`."""

    def start_towards(self, torque: float) -> AnyState:
        """Where a torque of this sign begins."""
        if self.rest.sides is None:
            return self.rest.state
        return self.rest.sides[0 if torque > 0.0 else 1]

    def nearest(self, torque: float) -> AnyState:
        """The equilibrium of the same sign at the nearest torque."""
        near = {t: s for t, s in self.states.items() if t * torque > 0.0}
        near[0.0] = self.start_towards(torque)
        return near[min(near, key=lambda t: abs(t - torque))]


@dataclass(kw_only=True, eq=False)
class SolvedColumns(Generic[AnyState]):
    """Columns of equilibria at neighbouring angles, solved in turn and kept.

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
    columns: dict[float, AngleColumn[AnyState]] = field(default_factory=dict)
    failed: list[float] = field(default_factory=list)
    """Torques between the levels that were tried in vain."""
    beyond: list[float] = field(default_factory=list)
    """Torques of every column beyond the levels, at most one of each sign."""
    solves: int = 0
    tried: int = 0
    """Solves and those that failed."""
    like: AnyState | None = None
    """The first state; an interrupted run holds none of another shape."""

    @property
    def free(self) -> bool:
        """Whether clearance leaves the output free without torque somewhere."""
        return any(one.rest.sides is not None for one in self.columns.values())

    @property
    def signs(self) -> list[float]:
        """Signs of the torques."""
        return [s for s in (1.0, -1.0) if any(t * s > 0.0 for t in self.levels)]

    def angles(self, count: int) -> Array:
        """Input positions of so many columns (count,) [rad]."""
        return self.period * np.arange(count) / count

    def chosen(self, count: int) -> Iterator[tuple[int, AngleColumn[AnyState]]]:
        """So many columns, equally spaced, with their numbers."""
        for k in range(count):
            yield k, self.columns[k * (self.finest // count)]

    def states(
        self, count: int, torques: Iterable[float]
    ) -> dict[float, list[AnyState]]:
        """Without torque, and at those of some torques that all columns have."""
        columns = [column for _, column in self.chosen(count)]
        found = {0.0: [one.rest.state for one in columns]}
        levels = [t for t in torques if t in self.levels]
        return found | {t: [one.states[t] for one in columns] for t in levels}

    # -- solving -----------------------------------------------------------------------

    def solve_columns(self, count: int) -> None:
        """Make sure of so many columns, equally spaced."""
        step = self.finest // count
        for place in range(0, self.finest, step):
            if place not in self.columns:
                self.columns[place] = self._column(place)

    def unseen_column(self, place: float) -> AngleColumn[AnyState]:
        """A column between those of the samples; it is none of them."""
        return self._column(place)

    def _column(self, place: float) -> AngleColumn[AnyState]:
        """Rest and the common torques, from the column before, if there is one."""
        theta = self.period * place / self.finest
        before = max((p for p in self.columns if p < place), default=None)
        if before is None:
            column = self._first()
        else:
            column = self._beside(self.columns[before], theta)
        lost = [t for t in self.levels if t not in column.states]
        for sign in (1.0, -1.0):
            first = min((abs(t) for t in lost if t * sign > 0.0), default=np.inf)
            self.levels = [t for t in self.levels if t * sign < 0.0 or abs(t) < first]
        return column

    def _first(self) -> AngleColumn[AnyState]:
        """Load the first position from zero torque outwards until a solve fails."""

        def unloaded() -> Unloaded[AnyState]:
            state = self.follow.engage(self.follow.deflect())
            if not state.outcome.ok:
                raise _no_rest(0.0, state)
            return self.follow.unload(state, self.small)

        column = self._rest(0.0, unloaded)
        for sign in (1.0, -1.0):
            state = column.start_towards(sign)
            for torque in sorted((t for t in self.levels if t * sign > 0.0), key=abs):
                found = self.solve_at(
                    0.0, torque, partial(self.follow.to_torque, state, torque)
                )
                if found is None:
                    break
                column.states[torque] = state = found
                self.count()
        return column

    def _beside(
        self, before: AngleColumn[AnyState], theta: float
    ) -> AngleColumn[AnyState]:
        """The same torques a step on; none beyond one that fails."""
        column = self._rest(
            theta, partial(self.follow.turn_unloaded, before.rest, theta)
        )

        def beside(torque: float) -> AnyState:
            state = self.follow.to_angle(before.states[torque], theta)
            if state.outcome.ok:
                return state
            return self.follow.to_torque(column.nearest(torque), torque)

        lost = set()
        for torque in sorted(self.levels, key=abs):
            if (torque > 0.0) in lost:
                continue
            state = self.solve_at(theta, torque, partial(beside, torque))
            if state is None:
                lost.add(torque > 0.0)
            else:
                column.states[torque] = state
                self.count()
        return column

    def _rest(
        self, theta: float, solve: Callable[[], Unloaded[AnyState]]
    ) -> AngleColumn[AnyState]:
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
        """Solve other torques of a column, each from the nearest equilibrium.

        That is one at the same torque in a column beside, from which it takes half the
        iterations, or else one at the same angle.
        """
        for torque in sorted(torques, key=lambda t: (t < 0.0, abs(t))):
            there = [one.states[torque] for one in beside if torque in one.states]
            if there:
                solve = partial(self.follow.to_angle, there[0], column.theta)
            else:
                near = column.nearest(torque)
                solve = partial(self.follow.to_torque, near, torque)
            state = self.solve_at(column.theta, torque, solve)
            if state is None:
                column.failed.add(torque)
            else:
                column.states[torque] = state
            self.count()

    def count(self) -> None:
        """One more solve is done."""
        self.solves += 1
        self.tick()

    # -- interruptions -----------------------------------------------------------------

    def solve_at(
        self, theta: float, torque: float, solve: Callable[[], AnyState]
    ) -> AnyState | None:
        """An equilibrium, solved now or before an interruption; None if that fails."""

        def sound() -> AnyState | None:
            state = solve()
            return state if state.outcome.ok else None

        return self._recalled(theta, torque, sound)

    def _recalled(self, theta: float, torque: float, solve: Callable[[], T]) -> T:
        """What is solved, or was by an interrupted run; a failure is kept, too."""
        name, self.tried = _SOLVE.format(self.tried), self.tried + 1
        if self.keep is not None:
            there = self.keep.read(name, partial(self._taken, theta, torque))
            if there is not None:
                return cast(T, there[0])
        found = copy_contiguous(solve())
        if self.keep is not None:
            at = {"theta": theta, "torque": torque}
            self.keep.write(name, at | pack(found, _STATE))
        return found

    def _taken(
        self, theta: float, torque: float, arrays: Mapping[str, Any]
    ) -> tuple[Unloaded[AnyState] | AnyState | None]:
        """An equilibrium from its arrays.

        Raises:
            ValueError: If it does not follow those before.
        """
        if (float(arrays["theta"]), float(arrays["torque"])) != (theta, torque):
            raise ValueError("an equilibrium at another angle or torque")
        found: Any = unpack(arrays, _STATE)
        if isinstance(found, Unloaded) != (torque == 0.0):
            raise ValueError("no equilibrium of this torque")
        states = [found] if torque else [found.state, *(found.sides or ())]
        for state in states:
            if state is not None:
                _check_like(state, self.like)
        return (found,)

    # -- figures -----------------------------------------------------------------------

    def figures(self, state: AnyState, theta: float) -> Array:
        """Output error, energy, compliance, input torque (4,)."""
        follow = self.follow
        error = follow.output_angle(state) - theta / follow.ratio
        return np.array(
            [error, state.energy, state.compliance, follow.input_torque(state)]
        )


def _check_like(state: Any, like: Any) -> None:
    """Refuse a state that is not an equilibrium of the same model."""
    if like is not None and (
        type(state) is not type(like) or state.faces.shape != like.faces.shape
    ):
        raise ValueError("a state of another model")
    if not np.isfinite(state.faces).all():
        raise ValueError("positions that are not finite")


def _no_rest(theta: float, state: AnyState) -> ComputationError:
    return ComputationError(
        f"no equilibrium without torque at input angle {theta:g} rad:"
        f" {state.outcome.value}"
    )
