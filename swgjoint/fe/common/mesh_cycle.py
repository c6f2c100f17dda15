"""Adaptive sampling of equilibria of a drive over torque and input angle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.fe.common.clearance import FAINT
from swgjoint.fe.common.columns.angle_columns import AngleColumn, SolvedColumns
from swgjoint.fe.common.columns.torque_choice import Ripple, no_ripple, unseen_places
from swgjoint.fe.common.columns.torque_columns import ColumnGrid
from swgjoint.fe.common.following import Follower
from swgjoint.fe.common.layout_angles import AnyState
from swgjoint.maps.fit.between_angles import even_steps, with_mirrored_torques
from swgjoint.maps.fit.contact_corners import ContactCorners
from swgjoint.maps.samples import FullSolves
from swgjoint.maps.unfinished import UnfinishedSeries
from swgjoint.typing import Array

EVERY = 4
"""Stride of the input positions that are solved again one pitch later."""
ANGLE_GOAL = 0.02
"""Goal for the error at the validation angles with the initial number of angles, as a
fraction of the peak-to-peak value [-]. It grows with the square root of the number of
angles, because each doubling leaves fewer solves for the torques."""
GOAL = 0.04
"""Goal for the error at the validation angles and torques, as a fraction of the
peak-to-peak value [-]."""
STALLED = 0.7
"""Largest ratio of the errors after and before a doubling of the angles with which they
are doubled again [-]. A larger ratio indicates mesh errors, which more angles do not
remove."""
CORNER_GOAL = 0.03
"""Goal for the estimated error between the angles, as a fraction of the peak-to-peak
value [-]."""
TORQUE_GOAL = 0.04
"""Goal for the estimated error between the torques, as a fraction of the peak-to-peak
value [-]."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Budget of equilibria of a map."""

    angles: int
    """Initial number of input positions over one pitch."""
    most_angles: int
    """Largest number of input positions, ``angles`` times a power of two."""
    solves: int
    """Largest number of equilibria for sampling and validation together."""
    unseen: tuple[int, int]
    """Number of validation torques of one sign, and number of validation angles."""
    torques: int
    """Largest number of torques of one sign in the table."""
    faint: float = FAINT
    """Torque at the ends of a clearance as a fraction of the torque that takes it up
    [-]."""
    beyond: bool = False
    """Whether to solve, at the end, one torque of each sign beyond the largest one."""
    corners: float = 0.0
    """Fraction of the solves that may be added, beyond the budget, at angles where the
    contact changes between the samples, if the goals are met otherwise [-]."""
    worst: bool = False
    """Whether to validate the map where it is likely to be least accurate, if need be
    beyond the budget."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern(Generic[AnyState]):
    """Equilibria over one pitch and torques of both signs."""

    theta: Array
    """Input positions, equally spaced over the pitch (n_angles,) [rad]."""
    solved_angles: NDArray[np.bool_]
    """Whether each position was solved (n_angles,). All other values are interpolated
    over the angle."""
    torque: Array
    """Torques T, increasing, including zero (n_torques,) [N·m]."""
    table: Array
    """Output error [rad], energy [J], tangent compliance [rad/(N·m)] and input torque
    [N·m] (4, n_torques, n_angles)."""
    solved: NDArray[np.bool_]
    """Whether each torque was solved at every angle (n_torques,). All other rows are
    interpolated along the load paths; their input torque is interpolated linearly."""
    unseen: FullSolves
    """Validation equilibria at other angles and torques."""
    shortfall: str
    """Text about the goals that were missed; empty if all were reached."""
    free: bool
    """Whether clearance leaves the unloaded output free at any angle. If so, the table
    has additional torques next to zero, see :func:`across_clearance`."""
    truncated: bool
    """Whether initial torques are missing because a solve failed at them or at a
    smaller torque."""
    states: dict[float, list[AnyState]]
    """Equilibria at all angles by torque [N·m]: zero and the solved initial torques."""
    info: dict[str, Any]
    """Record of the sampling, and of the checks of periodicity and mirror symmetry."""
    corners: dict[float, ContactCorners]
    """Predicted contact changes between the angles, by sign of the torque."""
    solve_at: Callable[[Sequence[tuple[float, float]]], FullSolves | None]
    """Solves for equilibria at further torques [N·m] and input angles [rad]."""


def solve_mesh_cycle(
    follow: Follower[AnyState],
    period: float,
    torques: list[float],
    effort: Effort,
    *,
    small: float,
    rated: float,
    symmetric: bool,
    tick: Callable[[], None],
    keep: UnfinishedSeries | None = None,
    ripple: Callable[[SolvedColumns[AnyState]], Ripple] = lambda solved: no_ripple,
) -> Pattern[AnyState]:
    """Pattern of a drive, sampled at as many angles and torques as it needs.

    The initial torques are solved at every angle. The number of angles is doubled until
    they predict the validation angles at these torques, and torques are added where the
    estimated error of the load paths is largest, see
    :class:`swgjoint.fe.common.load_path.LoadPath`. Then the number of angles is doubled
    while the errors at the validation torques are too large. Finally, a torque beyond
    the largest one may be solved, see :meth:`ColumnGrid.go_beyond`. All this stays
    within a budget of solves. Periodicity and mirror symmetry, on which the map relies,
    are checked at one torque.

    Args:
        follow: Solver that follows the equilibria of the drive.
        period: Period of the pattern in the input angle [rad].
        torques: Initial torques without zero; only positive ones if ``symmetric``
            [N·m].
        effort: Budget of angles, torques and solves.
        small: Torque that takes up the clearance of the teeth [N·m].
        rated: Rated torque; the checks are made at the level closest to it [N·m].
        symmetric: Whether the drive under negative torques is the mirror image of the
            drive under positive ones.
        tick: Called after every solve.
        keep: Store of equilibria, from which an interrupted run resumes; None stores
            none.
        ripple: Function that takes the columns at all initial angles and returns lower
            bounds of the peak-to-peak values by which the errors between samples are
            divided.

    Returns:
        The sampled pattern.

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
    grid.solve_columns(effort.angles)
    if not grid.levels:
        raise ComputationError(
            f"no equilibrium under the smallest torque, {min(torques, key=abs):g} N·m"
            f" (largest: {max(torques, key=abs):g} N·m)"
        )
    grid.ripple = ripple(grid)
    info = _checks(grid, effort.angles, rated, symmetric=symmetric)
    # validation angles, which are not sampled
    places = unseen_places(effort.unseen[1], effort.most_angles)
    others = [grid.unseen_column(place) for place in places]
    reached = _refine_at_levels(grid, effort, others)
    unseen = grid.unseen(others, effort.unseen[0])
    reached = _refine_at_unseen(grid, effort, others, unseen, reached)
    if effort.beyond:
        grid.go_beyond(reached.count)
    used, table, solved = _table(grid, reached.count, effort, symmetric=symmetric)
    own = grid.parts(reached.count)
    theta = grid.angles(even_steps(own, reached.count))
    return Pattern(
        theta=theta,
        solved_angles=np.isin(np.arange(theta.size), np.round(own * theta.size)),
        torque=used,
        table=table,
        solved=solved,
        unseen=unseen,
        shortfall=_shortfall(reached),
        free=grid.free,
        truncated=not {*torques} <= {*grid.levels},
        states=grid.states(reached.count, torques),
        info=info | {"sampling": _record(grid, reached)},
        corners=grid.corners(reached.count),
        solve_at=partial(grid.solve_positions, reached.count),
    )


@dataclass(frozen=True, kw_only=True)
class _Reached:
    """Number of angles and accuracy that the refinement has reached."""

    count: int
    """Number of angles."""
    missed: float
    """Error at the validation angles, as a fraction of the peak-to-peak value [-]."""
    doubt: float
    """Estimated error between the torques, as a fraction of the peak-to-peak value [-].
    """


def _checks(
    grid: ColumnGrid[AnyState], count: int, rated: float, *, symmetric: bool
) -> dict[str, Any]:
    """Checks of periodicity and mirror symmetry at the initial angles."""
    torque = min(grid.levels, key=lambda t: abs(t - rated))
    info: dict[str, Any] = {"second_pitch": _second_pitch(grid, torque, count)}
    if symmetric:
        info["mirror"] = _mirror(grid, torque, count)
    return info


def _refine_at_levels(
    grid: ColumnGrid[AnyState], effort: Effort, others: list[AngleColumn[AnyState]]
) -> _Reached:
    """Refine angles and torques until the initial torques are predicted well.

    Args:
        grid: Columns at the initial angles.
        effort: Budget, from which the validation solves are reserved.
        others: Columns at the validation angles.

    Returns:
        Number of angles and accuracy reached.
    """
    reserved = len(others) * effort.unseen[0] * len(grid.signs)
    count, levels = effort.angles, [0.0, *grid.levels]
    missed = grid.largest_miss(count, others, levels)
    while True:
        # the torques need not be resolved better than the angles
        most = _budget(grid, effort, count, reserved)
        grid.divide(count, most, max(TORQUE_GOAL, missed))
        goal = float(ANGLE_GOAL * np.sqrt(count / effort.angles))
        if missed <= goal or not _can_double(grid, effort, count, reserved):
            break
        count, before = 2 * count, missed
        grid.solve_columns(count)
        missed = grid.largest_miss(count, others, levels)
        if missed > STALLED * before:
            break
    most = _budget(grid, effort, count, reserved)
    doubt = grid.divide(count, most, TORQUE_GOAL)
    return _Reached(count=count, missed=missed, doubt=doubt)


def _refine_at_unseen(
    grid: ColumnGrid[AnyState],
    effort: Effort,
    others: list[AngleColumn[AnyState]],
    unseen: FullSolves,
    reached: _Reached,
) -> _Reached:
    """Refine the angles while the validation torques are predicted too poorly.

    Contact changes between the angles may occur at torques other than the initial ones.

    Args:
        grid: Columns so far.
        effort: Budget of solves.
        others: Columns at the validation angles.
        unseen: Equilibria at these angles and the validation torques.
        reached: Number of angles and accuracy so far.

    Returns:
        Number of angles and accuracy reached.
    """
    torques = np.unique(unseen.torque)
    count, doubt = reached.count, reached.doubt
    missed = grid.largest_miss(count, others, torques)
    while missed > GOAL and _can_double(grid, effort, count, 0):
        count, before = 2 * count, missed
        grid.solve_columns(count)
        doubt = grid.divide(count, _budget(grid, effort, count, 0), TORQUE_GOAL)
        missed = grid.largest_miss(count, others, torques)
        if missed > STALLED * before:
            break
    # if larger errors are left, a few angles do not cure them
    met = missed <= GOAL and doubt <= TORQUE_GOAL
    before, more = grid.solves, effort.corners * grid.solves * met
    if grid.divide_angles(count, int(before + 0.6 * more), CORNER_GOAL):
        doubt = grid.divide(count, int(before + more), TORQUE_GOAL)
        missed = grid.largest_miss(count, others, torques)
    return _Reached(count=count, missed=missed, doubt=doubt)


def _budget(
    grid: ColumnGrid[AnyState], effort: Effort, count: int, reserved: int
) -> int:
    """Number of solves available for samples up to the largest torque."""
    last = count * len(grid.signs) if effort.beyond else 0
    return effort.solves - reserved - last


def _can_double(
    grid: ColumnGrid[AnyState], effort: Effort, count: int, reserved: int
) -> bool:
    """Whether the budget allows twice the angles, the new ones with one more torque."""
    solves = grid.solves + count * (2 + len(grid.levels))
    fits = solves <= _budget(grid, effort, count, reserved)
    return 2 * count <= effort.most_angles and fits


def _shortfall(reached: _Reached) -> str:
    """Text about the goals that the refinement missed; empty if it reached all."""
    parts = []
    if reached.missed > GOAL:
        parts.append(
            "error at the validation angles and torques:"
            f" {100.0 * reached.missed:.2g} % of the peak-to-peak value"
        )
    if reached.doubt > TORQUE_GOAL:
        parts.append(
            "estimated error between the sampled torques:"
            f" {100.0 * reached.doubt:.2g} % of the peak-to-peak value"
        )
    return "; ".join(parts)


def _table(
    grid: ColumnGrid[AnyState], count: int, effort: Effort, *, symmetric: bool
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Torques, table and mask of the solved torques, as in :class:`Pattern`."""
    tables, solved = grid.tables(count, effort.torques, effort.faint)
    if symmetric:
        tables = with_mirrored_torques(tables, count)
        solved |= {-t for t in solved}
    used = np.array(sorted(tables))
    table = np.array([tables[t] for t in used]).swapaxes(0, 1)
    return used, table, np.isin(used, sorted(solved))


def _record(grid: ColumnGrid[AnyState], reached: _Reached) -> dict[str, Any]:
    """Record of the numbers of angles and solves and of the remaining errors."""
    columns = grid.all_columns(reached.count)
    return {
        "angles": reached.count,
        "angles_between": len(grid.between),
        "solves": grid.solves,
        "solves_per_angle": [len(column.states) + 1 for column in columns],
        "missed_at_unseen_angles": reached.missed,
        "estimated_between_torques": reached.doubt,
    }


def _second_pitch(
    grid: ColumnGrid[AnyState], torque: float, count: int
) -> dict[str, float]:
    """Record of the difference of the output error between the first two pitches."""
    follow, theta = grid.follow, grid.angles(count)
    columns = [column for _, column in grid.chosen(count)]
    state, again = columns[-1].states[torque], []
    for angle in grid.period + theta[::EVERY]:
        solve = partial(follow.to_angle, state, float(angle))
        turned = grid.solve_at(float(angle), torque, solve)
        again.append(np.nan if turned is None else follow.output_angle(turned))
        state = state if turned is None else turned
        grid.count()
    first = np.array([grid.figures(c.states[torque], c.theta)[0] for c in columns])
    apart = np.array(again) - (grid.period + theta[::EVERY]) / follow.ratio
    return {
        "torque_Nm": torque,
        "largest_difference_rad": float(np.abs(apart - first[::EVERY]).max()),
        "peak_to_peak_rad": float(np.ptp(first)),
    }


def _mirror(grid: ColumnGrid[AnyState], torque: float, count: int) -> dict[str, Any]:
    """Record of the difference of the output error between drive and mirror image.

    The difference is evaluated at the second angle. It is None if the solve under the
    opposite torque fails. The search starts from the mirror image if the model provides
    it; a drive without this symmetry has its equilibrium elsewhere.
    """
    step = grid.finest // count
    one, image = grid.columns[step], grid.columns[grid.finest - step]
    mirrored = grid.follow.mirror(image.states[torque])
    if mirrored is None:
        solve = partial(grid.follow.to_torque, one.rest.state, -torque)
    else:
        solve = partial(grid.follow.to_angle, mirrored, one.theta)
    opposite = grid.solve_at(one.theta, -torque, solve)
    difference = None
    if opposite is not None:
        wanted = -grid.figures(image.states[torque], image.theta)[0]
        difference = float(grid.figures(opposite, one.theta)[0] - wanted)
    return {"torque_Nm": -torque, "difference_rad": difference}
