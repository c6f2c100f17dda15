"""Starts of searches for equilibria at further input angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Generic

from swgjoint.fe.common.following import AnyState, Follower

SHARED = 4
"""Number of angles after an equilibrium at which searches under the same torque start
from its tangent. At the fourth of 16 angles of a pitch the increments of
size-25-100-bought decrease as with a tangent of its own, by a factor of 20 and more per
iteration."""


@dataclass(kw_only=True, eq=False)
class Turning(Generic[AnyState]):
    """Turns equilibria to further angles, from the trend over the angles before.

    Solvers near an equilibrium are kept by torque until they are no longer needed; in
    3D, each contains a factorised tangent of 0.1 GB.
    """

    follow: Follower[AnyState]
    """Solver that follows the equilibria of the drive."""
    near: dict[float, tuple[AnyState, Follower[AnyState]]] = field(default_factory=dict)
    """An equilibrium and the solver near it, by torque [N·m]."""

    def start(
        self, before: Sequence[AnyState], torque: float, theta: float
    ) -> tuple[AnyState, Follower[AnyState]]:
        """Start of the search at an angle, and the solver to use.

        The equilibrium whose tangent the solver has depends only on the number of
        equilibria before, so that a resumed run uses the same one.

        Args:
            before: Equilibria under the same torque at angles before, the nearest one
                last.
            torque: The torque [N·m].
            theta: Input angle [rad].
        """
        own = before[(len(before) - 1) // SHARED * SHARED]
        known = self.near.pop(torque, None)
        if known is None or known[0] is not own:
            known = own, self.follow.near(own)
        self.near[torque] = known
        if len(before) == 1:
            return before[0], known[1]
        return self.follow.extrapolate(before[-1], before[-2], theta), known[1]
