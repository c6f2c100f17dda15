"""Equilibria of a drive over torque and input angle, row by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.fe.following import AnyState, Follower, Unloaded
from swgjoint.fe.state_arrays import packed, settled, unpacked
from swgjoint.maps.unfinished import UNREADABLE, Unfinished

Array = NDArray[np.float64]

EVERY = 4
"""Of the positions are solved in the second pitch, too."""
FAINT = 1e-8
"""Part of the torque that takes up a clearance, that acts at its ends: no stiffness is
zero."""
_POSITION, _REST, _TORQUES, _STATE = "position-{:04d}", "rest", "torques", "state"


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern(Generic[AnyState]):
    """Equilibria over one pitch, torques of either sign."""

    torque: Array
    """T, increasing, zero included [N·m]. Shape (n_torques,)."""
    table: Array
    """Output error, energy, tangent compliance, input torque. Shape (4, n_torques,
    n_angles)."""
    free: bool
    """Whether clearance leaves the output free without torque; the torques next to zero
    are then added, see :func:`across_clearance`."""
    truncated: bool
    """Whether torques are left out at which a solve failed, and those beyond."""
    states: dict[float, list[AnyState]]
    """Solved positions by torque, those without torque included."""
    info: dict[str, Any]
    """How well the pattern repeats and is its own mirror image."""


def solve_pattern(
    follow: Follower[AnyState],
    theta: Array,
    period: float,
    torques: list[float],
    *,
    small: float,
    rated: float,
    symmetric: bool,
    tick: Callable[[], None],
    keep: Unfinished | None = None,
    restored: Callable[[int], None] = lambda solves: None,
) -> Pattern[AnyState]:
    """Solve all positions; the claims that the map rests on are checked at one torque.

    Args:
        follow: The drive.
        theta: Input angles over one pitch (n_angles,) [rad].
        period: Of the pattern [rad].
        torques: To sample, zero excluded; positive ones if ``symmetric`` [N·m].
        small: Torque that takes up a clearance [N·m].
        rated: Next to it the claims are checked [N·m].
        symmetric: Whether the negative torques are the mirror image.
        tick: Called after every solve.
        keep: Where solved positions are kept, and taken up again; None keeps none.
        restored: Called with the number of solves that an interrupted run had done.

    Raises:
        ComputationError: If the unloaded drive or all torques cannot be solved.
    """
    rows = _Rows(follow=follow, small=small, tick=tick)
    done, solves = _restored(rows, keep, len(theta), torques)
    if done:
        restored(solves)
    for k in range(done, len(theta)):
        if k:
            rows.advance(float(theta[k]))
        else:
            rows.start(torques)
        if keep is not None:
            keep.write(_POSITION.format(k), rows.last())
    if not rows.states:
        raise ComputationError(
            "no torque can be solved; the smallest is"
            f" {min(torques, key=abs):g} N·m of {max(torques, key=abs):g} N·m"
        )
    tables = rows.tables(theta)
    check = min(rows.states, key=lambda t: abs(t - rated))
    state, second = rows.states[check][-1], []
    for k, angle in enumerate(theta[::EVERY]):
        name = f"second-pitch-{k:04d}"
        there = None if keep is None else _read(keep, name, like=state)
        if there is None:
            there = settled(follow.to_angle(state, period + float(angle)))
            if keep is not None:
                keep.write(name, packed(there, _STATE))
        state = there
        ok = state.outcome.ok
        second.append(follow.output_angle(state) if ok else np.nan)
        tick()
    again = np.array(second) - (period + theta[::EVERY]) / follow.ratio
    apart = np.abs(again - tables[check][0, ::EVERY]).max()
    info: dict[str, Any] = {
        "second_pitch": {
            "torque_Nm": check,
            "largest_difference_rad": float(apart),
            "peak_to_peak_rad": float(np.ptp(tables[check][0])),
        }
    }
    if symmetric:
        opposite = {-t: _mirrored(values) for t, values in tables.items() if t}
        solved = follow.to_torque(rows.rest[1].state, -check)
        image = follow.output_angle(solved) - theta[1] / follow.ratio
        image -= opposite[-check][0, 1]
        info["mirror"] = {
            "torque_Nm": -check,
            "difference_rad": float(image) if solved.outcome.ok else None,
        }
        tables |= opposite
    used = np.array(sorted(tables))
    return Pattern(
        torque=used,
        table=np.array([tables[t] for t in used]).swapaxes(0, 1),
        free=rows.free,
        truncated=len(rows.states) < len(torques),
        states={0.0: [one.state for one in rows.rest]} | rows.states,
        info=info,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rows(Generic[AnyState]):
    """Solved positions of each torque; the table grows position by position."""

    follow: Follower[AnyState]
    small: float
    """Torque that takes up a clearance [N·m]."""
    tick: Callable[[], None]
    rest: list[Unloaded[AnyState]] = field(default_factory=list)
    states: dict[float, list[AnyState]] = field(default_factory=dict)

    @property
    def free(self) -> bool:
        """Whether clearance leaves the output free without torque somewhere."""
        return any(one.sides is not None for one in self.rest)

    def start(self, torques: list[float]) -> None:
        """Load the first position from zero torque outwards until a solve fails."""
        state = self.follow.meshed(self.follow.deflected())
        if not state.outcome.ok:
            raise _no_rest(0.0, state)
        self._stand(self.follow.unloaded(state, self.small), 0.0)
        for sign in (1.0, -1.0):
            state = self._towards(sign)
            for torque in sorted((t for t in torques if t * sign > 0.0), key=abs):
                state = self.follow.to_torque(state, torque)
                if not state.outcome.ok:
                    break
                state = settled(state)
                self.states[torque] = [state]
                self.tick()

    def advance(self, theta: float) -> None:
        """Add a position to every torque; drop those that fail and those beyond."""
        self._stand(self.follow.unloaded_to(self.rest[-1], theta), theta)
        lost = set()
        for torque in sorted(self.states, key=abs):
            if (torque > 0.0) not in lost:
                state = self.follow.to_angle(self.states[torque][-1], theta)
                if not state.outcome.ok:
                    state = self.follow.to_torque(self._towards(torque), torque)
                if state.outcome.ok:
                    self.states[torque].append(settled(state))
                    self.tick()
                    continue
            lost.add(torque > 0.0)
            del self.states[torque]

    def tables(self, theta: Array) -> dict[float, Array]:
        """Output error, energy, tangent compliance, input torque of every torque.

        Shape (4, n) each. Clearance adds rows, see :func:`across_clearance`.
        """
        found = {torque: self._table(row, theta) for torque, row in self.states.items()}
        found[0.0] = self._table([one.state for one in self.rest], theta)
        if self.free:
            for side, sign in ((0, 1.0), (1, -1.0)):
                if not any(torque * sign > 0.0 for torque in self.states):
                    continue
                row = [
                    one.sides[side]
                    if one.sides is not None
                    else self.follow.to_torque(one.state, sign * self.small)
                    for one in self.rest
                ]
                taken_up = self._table(row, theta)
                begin, onset = across_clearance(found[0.0], taken_up, sign * self.small)
                found |= {sign * self.small: taken_up, begin: onset}
            # the same stiffness on both sides of the middle
            found[0.0][2] = onset[2]
        return found

    def _stand(self, unloaded: Unloaded[AnyState], theta: float) -> None:
        if not unloaded.state.outcome.ok:
            raise _no_rest(theta, unloaded.state)
        self.rest.append(settled(unloaded))
        self.tick()

    def last(self) -> dict[str, Any]:
        """Arrays of the last position, all torques that could be solved there."""
        arrays = packed(self.rest[-1], _REST) | {_TORQUES: np.array([*self.states])}
        for j, row in enumerate(self.states.values()):
            arrays |= packed(row[-1], f"{_STATE}-{j}")
        return arrays

    def take(self, arrays: Mapping[str, Any], torques: list[float]) -> int:
        """Add a position as :meth:`last` gave it; the number of its solves.

        Raises:
            ValueError: If it does not follow the positions before.
        """
        rest: Any = unpacked(arrays, _REST)
        torque: list[float] = np.asarray(arrays[_TORQUES]).tolist()
        found: dict[float, Any] = {
            t: unpacked(arrays, f"{_STATE}-{j}") for j, t in enumerate(torque)
        }
        if not isinstance(rest, Unloaded):
            raise ValueError("no position without torque")
        if not found.keys() <= (self.states.keys() if self.rest else {*torques}):
            raise ValueError(f"other torques: {torque}")
        like = self.rest[0].state if self.rest else rest.state
        for state in (rest.state, *(rest.sides or ()), *found.values()):
            _check_like(state, like)
        self.rest.append(rest)
        for t in [t for t in self.states if t not in found]:
            del self.states[t]
        for t, state in found.items():
            self.states.setdefault(t, []).append(state)
        return 1 + len(found)

    def _towards(self, torque: float) -> AnyState:
        """Where a torque of this sign begins at the last position."""
        rest = self.rest[-1]
        if rest.sides is None:
            return rest.state
        return rest.sides[0 if torque > 0.0 else 1]

    def _table(self, states: list[AnyState], theta: Array) -> Array:
        follow = self.follow
        rows = [
            (follow.output_angle(s), s.energy, s.compliance, follow.input_torque(s))
            for s in states
        ]
        values = np.array(rows).T
        values[0] -= theta / follow.ratio
        return values


def _restored(
    rows: _Rows[Any], keep: Unfinished | None, count: int, torques: list[float]
) -> tuple[int, int]:
    """Take up the positions of an interrupted run: how many, and their solves."""
    solves = 0
    for k in range(count if keep is not None else 0):
        assert keep is not None
        name = _POSITION.format(k)
        arrays = keep.read(name)
        if arrays is None:
            return k, solves
        try:
            solves += rows.take(arrays, torques)
        except UNREADABLE as error:
            keep.ignored(name, error)
            return k, solves
    return (count, solves) if keep is not None else (0, 0)


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


def _mirrored(values: Array) -> Array:
    """The same drive under the opposite torque, seen in a mirror.

    At -T and -theta: opposite error and input torque, same energy and compliance.
    """
    back = np.roll(values[:, ::-1], 1, axis=1)
    return np.asarray(back * np.array([-1.0, 1.0, 1.0, -1.0])[:, None])
