"""Equilibria of a drive over torque and input angle, torques as each angle asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.fe.common.following import AnyState, Follower
from swgjoint.fe.common.torque_choice import unseen_places
from swgjoint.fe.common.torque_columns import ColumnGrid
from swgjoint.maps.samples import FullSolves
from swgjoint.maps.unfinished import Unfinished
from swgjoint.typing import Array

EVERY = 4
"""Of the first positions are solved in the second pitch, too."""
ANGLE_GOAL = 0.02
"""Difference at unseen angles, in the peak to peak, at which the first angles suffice;
it grows with the root of their number: each doubling takes solves from the torques."""
GOAL = 0.04
"""The same difference at unseen torques, where those of the samples count, too."""
STALLED = 0.7
"""Part of a difference which is left after a doubling that was worth it: more angles
do not cure what comes from the mesh."""
TORQUE_GOAL = 0.04
"""Estimated error between torques, in the same, at which they suffice."""


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
    beyond: bool = False
    """Whether one torque of each sign beyond the largest one is solved at the end."""


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
) -> Pattern[AnyState]:
    """Solve as many angles and torques as the drive asks for.

    First the given torques at every angle. Angles are doubled until they predict others
    at these torques; then torques are added where the estimated error of the load paths
    is largest, see :class:`swgjoint.fe.common.load_path.LoadPath`, and angles where
    others are still missed. Last comes a torque beyond the largest one, see
    :meth:`ColumnGrid.go_beyond`. The claims that the map rests on are checked at one
    torque.

    Args:
        follow: The drive.
        period: Of the pattern [rad].
        torques: To begin with, zero excluded; positive ones if ``symmetric`` [N·m].
        effort: Angles and solves.
        small: Torque that takes up a clearance [N·m].
        rated: Next to it the claims are checked [N·m].
        symmetric: Whether the negative torques are the mirror image.
        tick: Called after every solve.
        keep: Where equilibria are kept, and taken up again; None keeps none.

    Raises:
        ComputationError: If the unloaded drive or all torques cannot be solved.
    """
    grid: ColumnGrid[AnyState] = ColumnGrid(
        follow=follow,
        period=period,
        finest=effort.most_angles,
        levels=sorted(torques),
        small=small,
        tick=tick,
        keep=keep,
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
    places = unseen_places(effort.unseen[1], effort.most_angles)
    others = [grid.unseen_column(place) for place in places]
    first = [0.0, *grid.levels]
    missed = grid.largest_miss(count, others, first)
    reserved = len(others) * effort.unseen[0] * len(grid.signs)

    def budget() -> int:
        """What the samples may take; a torque beyond the largest one comes last."""
        last = count * len(grid.signs) if effort.beyond else 0
        return effort.solves - reserved - last

    def doubles(goal: float) -> bool:
        """Whether more angles are wanted, and a torque for them all still fits."""
        fits = grid.solves + grid.cost(count) + count <= budget()
        return missed > goal and 2 * count <= effort.most_angles and fits

    def angle_goal() -> float:
        return float(ANGLE_GOAL * np.sqrt(count / effort.angles))

    while True:
        # no better between the torques than between the angles
        doubt = grid.divide(count, budget(), max(TORQUE_GOAL, missed))
        if not doubles(angle_goal()):
            break
        count, before = 2 * count, missed
        grid.solve_columns(count)
        missed = grid.largest_miss(count, others, first)
        if missed > STALLED * before:
            break
    doubt = grid.divide(count, budget(), TORQUE_GOAL)
    # contacts may change between the angles under other torques alone
    unseen = grid.unseen(others, effort.unseen[0])
    reserved = 0
    missed = grid.largest_miss(count, others, np.unique(unseen.torque))
    while doubles(GOAL):
        count, before = 2 * count, missed
        grid.solve_columns(count)
        doubt = grid.divide(count, budget(), TORQUE_GOAL)
        missed = grid.largest_miss(count, others, np.unique(unseen.torque))
        if missed > STALLED * before:
            break
    if effort.beyond:
        grid.go_beyond(count)
    shortfall = []
    if missed > GOAL:
        shortfall.append(
            f"other torques and angles are off by up to {100.0 * missed:.2g} %"
        )
    if doubt > TORQUE_GOAL:
        shortfall.append(
            f"torques between the samples by an estimated {100.0 * doubt:.2g} %"
        )
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
        truncated=not {*torques} <= {*grid.levels},
        states=grid.states(count, torques),
        info=info,
    )


def _second_pitch(
    grid: ColumnGrid[AnyState], torque: float, count: int
) -> dict[str, float]:
    """How well the pattern repeats at some angles of the next pitch."""
    follow, theta = grid.follow, grid.angles(count)
    columns = [column for _, column in grid.chosen(count)]
    state, again = columns[-1].states[torque], []
    for angle in grid.period + theta[::EVERY]:
        solve = partial(follow.to_angle, state, float(angle))
        found = grid.solve_at(float(angle), torque, solve)
        again.append(np.nan if found is None else follow.output_angle(found))
        state = state if found is None else found
        grid.count()
    first = np.array([grid.figures(c.states[torque], c.theta)[0] for c in columns])
    apart = np.array(again) - (grid.period + theta[::EVERY]) / follow.ratio
    return {
        "torque_Nm": torque,
        "largest_difference_rad": float(np.abs(apart - first[::EVERY]).max()),
        "peak_to_peak_rad": float(np.ptp(first)),
    }


def _mirror(grid: ColumnGrid[AnyState], torque: float, count: int) -> dict[str, Any]:
    """How well the drive is its own mirror image, at the second angle."""
    step = grid.finest // count
    one, image = grid.columns[step], grid.columns[grid.finest - step]
    solve = partial(grid.follow.to_torque, one.rest.state, -torque)
    found = grid.solve_at(one.theta, -torque, solve)
    difference = None
    if found is not None:
        wanted = -grid.figures(image.states[torque], image.theta)[0]
        difference = float(grid.figures(found, one.theta)[0] - wanted)
    return {"torque_Nm": -torque, "difference_rad": difference}


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
