"""Starts of searches for equilibria at further input angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic

from swgjoint.fe.common.following import Follower
from swgjoint.fe.common.layout_angles import AnyState

SHARED = 4
"""Number of angles after an equilibrium at which searches under the same torque start
from its tangent. At the fourth of 16 angles of a pitch the increments of
size-25-100-bought decrease as with a tangent of its own, by a factor of 20 and more per
iteration."""


@dataclass(kw_only=True, eq=False)
class Turning(Generic[AnyState]):
    """Turns equilibria to further angles, from the trend over the angles before.

    The latest solver near an equilibrium is kept; in 3D, it contains a factorised
    tangent of 0.15 GB for half of size-25-100-bought.
    """

    follow: Follower[AnyState]
    """Solver that follows the equilibria of the drive."""
    _near: tuple[AnyState, Follower[AnyState]] | None = None

    def forget(self) -> None:
        """Forget the latest solver."""
        self._near = None

    def start(
        self, before: Sequence[AnyState], theta: float
    ) -> tuple[AnyState, Follower[AnyState]]:
        """Start of the search at an angle, and the solver to use.

        The equilibrium whose tangent the solver has depends only on the number of
        equilibria before, so that a resumed run uses the same one.

        Args:
            before: Equilibria under the same torque at angles before, the nearest one
                last.
            theta: Input angle [rad].
        """
        own = before[(len(before) - 1) // SHARED * SHARED]
        if self._near is None or self._near[0] is not own:
            self._near = None  # the memory is needed for the next one
            self._near = own, self.follow.near(own)
        follow = self._near[1]
        if len(before) == 1:
            return before[0], follow
        return self.follow.extrapolate(before[-1], before[-2], theta), follow
