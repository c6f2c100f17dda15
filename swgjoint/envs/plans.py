"""Plans and sensor noise of many episodes, within a bounded memory.

Where whole episodes do not fit, only a window of each is kept. The following window is
computed from the coefficients of the plan and from a copy of the random generator, with
the same results to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.typing import Array

MEMORY = 512 * 10**6
"""Largest size of all windows [bytes]."""
SHORTEST_WINDOW = 16
"""Smallest number of instants in a window."""


@dataclass(frozen=True, kw_only=True)
class PlanSize:
    """Numbers of episodes, instants, joints and channels of the sensors."""

    count: int
    """Number of episodes."""
    instants: int
    """Number of instants of an episode, including its start."""
    joints: int
    """Number of joints."""
    rows: int = 5
    """Number of values that the plan has for each joint."""
    channels: int
    """Number of channels of the sensors."""
    shared: bool
    """Whether all episodes follow the same plan."""

    @property
    def window(self) -> int:
        """Number of instants that are kept of every episode."""
        values = self.channels + (0 if self.shared else self.rows * self.joints)
        fitting = MEMORY // (8 * values * self.count)
        return min(self.instants, max(fitting, SHORTEST_WINDOW))


class Plans:
    """Plan and noise of every episode at its current instant and the next ones.

    A plan consists of position, velocity, acceleration, load torque and known torque of
    the links, and of further rows of some environments. Its shape is (n_rows, n_joints)
    at every instant. The noise consists of one standard normal number per channel.
    """

    def __init__(
        self,
        size: PlanSize,
        draw: Callable[[np.random.Generator], tuple[Any, Array]],
        sample: Callable[[Any, slice], Array],
    ) -> None:
        """Prepare the windows.

        Args:
            size: Numbers of episodes, instants, joints and channels.
            draw: Function that draws the coefficients of a plan, and the plan. Shape
                (instants, n_rows, n_joints).
            sample: Function that computes a part of a plan from its coefficients. Shape
                (part, n_rows, n_joints).
        """
        self._size, self._draw, self._sample = size, draw, sample
        self._window = window = size.window
        self._whole = window == size.instants
        """Whether the windows cover whole episodes."""
        rows = np.arange(size.count)
        self._rows = rows
        kept = size.instants if size.shared else window
        own = 1 if size.shared else size.count
        self._plan = np.zeros((own, kept, size.rows, size.joints))
        self._planned = np.zeros_like(rows) if size.shared else rows
        self._noise = np.zeros((size.count, window, size.channels))
        self._first = np.zeros(size.count, dtype=np.intp)
        """First instants of the windows. Shape (n,)."""
        self._drawn: list[Any] = [None] * size.count
        self._rngs: list[np.random.Generator | None] = [None] * size.count

    def begin(self, k: int, rng: np.random.Generator) -> None:
        """Draw plan and noise of an episode.

        Args:
            k: Index of the episode.
            rng: Its random generator.
        """
        size, window = self._size, self._window
        drawn, plan = self._draw(rng)
        self._drawn[k], self._first[k] = drawn, 0
        self._plan[self._planned[k]] = plan[: self._plan.shape[1]]
        if self._whole:
            rng.standard_normal(out=self._noise[k])
            return
        self._rngs[k] = own = deepcopy(rng)
        noise = rng.standard_normal((size.instants, size.channels))
        self._noise[k] = noise[:window]
        own.standard_normal((window, size.channels))

    def move_to(self, instant: NDArray[np.intp]) -> None:
        """Move windows so that they contain the instants after the given ones.

        Args:
            instant: Current instants, each the previous one or one further. Shape (n,).
        """
        if self._whole:
            return
        last = self._size.instants - 1
        ends = (instant - self._first == self._window - 1) & (instant < last)
        for k in np.flatnonzero(ends):
            first = int(instant[k])
            part = slice(first, min(first + self._window, last + 1))
            count, rng = part.stop - first, self._rngs[k]
            assert rng is not None
            self._noise[k, 0] = self._noise[k, -1]
            self._noise[k, 1:count] = rng.standard_normal(
                (count - 1, self._size.channels)
            )
            if not self._size.shared:
                self._plan[k, :count] = self._sample(self._drawn[k], part)
            self._first[k] = first

    def plan_at(
        self, instant: NDArray[np.intp], rows: NDArray[np.intp] | None = None
    ) -> Array:
        """Plans of episodes. Shape (m, n_rows, n_joints).

        Args:
            instant: Instant of each of the episodes, in its window. Shape (m,).
            rows: Indices of the episodes; None: all. Shape (m,).
        """
        if self._size.shared:
            return np.asarray(self._plan[0, instant])
        return np.asarray(self._plan[self._place(instant, rows)])

    def noise_at(
        self, instant: NDArray[np.intp], rows: NDArray[np.intp] | None = None
    ) -> Array:
        """Noise of episodes. Shape (m, n_channels).

        Args:
            instant: Instant of each of the episodes, in its window. Shape (m,).
            rows: Indices of the episodes; None: all. Shape (m,).
        """
        return np.asarray(self._noise[self._place(instant, rows)])

    def _place(
        self, instant: NDArray[np.intp], rows: NDArray[np.intp] | None
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and places of instants in the windows."""
        first = self._first if rows is None else self._first[rows]
        here = instant if self._whole else instant - first
        return self._rows if rows is None else rows, here

    def views_of_one(self) -> tuple[Array, Array]:
        """Views of the plan and the noise of a single episode of one joint.

        Shapes (instants, 5) and (instants, n_channels).
        """
        return self._plan[0, :, :, 0], self._noise[0]

    def whole_noise(self) -> Array:
        """Copy of the whole noise. Shape (n, instants, n_channels).

        Raises:
            InputError: If only windows of the episodes fit into the memory.
        """
        size = self._size
        if not self._whole:
            fitting = size.count * self._window // size.instants
            raise InputError(
                f"{size.count} whole episodes of {size.instants} instants; accepted: up"
                f" to {fitting}, which fill {MEMORY / 1e6:g} MB"
            )
        return self._noise.copy()

    def whole_plans(self) -> Array:
        """Copy of the whole plans. Shape (n, instants, n_rows, n_joints)."""
        if self._size.shared or self._whole:
            return self._plan[self._planned]
        every = slice(0, self._size.instants)
        return np.stack([self._sample(drawn, every) for drawn in self._drawn])
