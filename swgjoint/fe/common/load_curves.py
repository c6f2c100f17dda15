"""Compliance curves between neighbouring equilibria of a load path.

The torque x of each interval runs from 0 to 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.common.contact_changes import Steps
from swgjoint.typing import Array, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class Curves:
    """Compliance C over n intervals of length 1, each a cubic plus m jumps."""

    power: Array
    """Coefficients of the cubic in ascending powers (n, 4) [rad/(N·m)]."""
    place: Array
    """Positions of the jumps, from 0 to 1 (n, m)."""
    jump: Array
    """Jumps of the compliance (n, m) [rad/(N·m)]."""
    feasible: NDArray[np.bool_]
    """Whether a curve of this form meets the given values (n,)."""

    @classmethod
    def where(cls, mask: Mask, one: Curves, other: Curves) -> Curves:
        """Curves chosen from two sets, interval by interval.

        Args:
            mask: Intervals that take their curve from ``one`` (n,).
            one: Curves where the mask is true.
            other: Curves where it is false.
        """
        place, jump = [
            np.concatenate([mask[:, None] * a, ~mask[:, None] * b], axis=1)
            for a, b in ((one.place, other.place), (one.jump, other.jump))
        ]
        return cls(
            power=np.where(mask[:, None], one.power, other.power),
            place=place,
            jump=jump,
            feasible=np.where(mask, one.feasible, other.feasible),
        )

    @property
    def bend(self) -> Curves:
        """Deviation of the cubics from the straight lines between their end values."""
        power = self.power.copy()
        power[:, 1] = -power[:, 2:].sum(axis=1)
        power[:, 0] = 0.0
        return replace(self, power=power, jump=np.zeros_like(self.jump))

    def select(self, k: NDArray[np.intp]) -> Curves:
        """Curves of the intervals with indices ``k``."""
        return Curves(
            power=self.power[k],
            place=self.place[k],
            jump=self.jump[k],
            feasible=self.feasible[k],
        )

    def integrals(self, x: Array) -> tuple[Array, Array, Array]:
        """Compliance C at x (n,), and its first and second integrals from 0 to x."""
        k = np.arange(4)
        powers = x[:, None] ** k
        after = np.maximum(x[:, None] - self.place, 0.0)
        jumped = (x[:, None] >= self.place) * self.jump
        c = (self.power * powers).sum(axis=1) + jumped.sum(axis=1)
        once = (self.power * powers / (k + 1)).sum(axis=1) * x
        once += (self.jump * after).sum(axis=1)
        twice = (self.power * powers / ((k + 1) * (k + 2))).sum(axis=1) * x**2
        twice += 0.5 * (self.jump * after**2).sum(axis=1)
        return c, once, twice

    def integrals_on(self, grid: Array) -> tuple[Array, Array]:
        """First and second integrals of C at grid points of every interval (n, m)."""
        n, m = grid.shape
        k = np.repeat(np.arange(n), m)
        _, once, twice = self.select(k).integrals(grid.ravel())
        return once.reshape(n, m), twice.reshape(n, m)


def one_jump(c0: Array, change: Array, mean: Array, moment: Array) -> Curves:
    r"""Curves C0 + g x + (Delta - g) H(x - a) with given mean and moment.

    H is the unit step. With p = 1 - a the mean is g/2 + (Delta - g) p and the moment is
    g/6 + (Delta - g) p^2/2. Eliminating p leaves a quadratic equation for the slope g,
    whose root of smaller magnitude is used.

    Args:
        c0: Compliance C0 at the start of each interval (n,) [rad/(N·m)].
        change: Change Delta of C over the interval (n,) [rad/(N·m)].
        mean: Mean of C - C0 (n,) [rad/(N·m)].
        moment: Mean of (1 - x) (C - C0) (n,) [rad/(N·m)].
    """
    b = mean - 2.0 * moment - change / 3.0
    k = 2.0 * moment * change - mean**2
    root = np.sqrt(np.maximum(b**2 - k / 3.0, 0.0))
    below = -b - np.where(b < 0.0, -root, root)
    scale = np.abs(c0) + np.abs(mean)
    flat = np.abs(below) <= 1e-13 * scale
    slope = np.where(flat, change, 2.0 * k / np.where(flat, 1.0, below))
    jump = change - slope
    smooth = np.abs(jump) <= 1e-12 * scale
    after = (mean - 0.5 * slope) / np.where(smooth, 1.0, jump)
    after = np.where(smooth, 0.0, after)
    missed = np.abs(mean - 0.5 * slope - jump * after)
    missed += np.abs(moment - slope / 6.0 - 0.5 * jump * after**2)
    feasible = (after >= -1e-9) & (after <= 1.0 + 1e-9) & (missed <= 1e-9 * scale)
    power = np.stack([c0, slope, 0.0 * c0, 0.0 * c0], axis=1)
    return Curves(
        power=power,
        place=1.0 - np.clip(after, 0.0, 1.0)[:, None],
        jump=jump[:, None],
        feasible=feasible,
    )


def two_jumps(c0: Array, change: Array, mean: Array, moment: Array) -> Curves:
    """Curves that are constant except for two jumps of half the change each.

    Args:
        c0: Compliance C0 at the start of each interval (n,) [rad/(N·m)].
        change: Change of C over the interval (n,) [rad/(N·m)].
        mean: Mean of C - C0 (n,) [rad/(N·m)].
        moment: Mean of (1 - x) (C - C0) (n,) [rad/(N·m)].
    """
    scale = np.abs(c0) + np.abs(mean)
    flat = np.abs(change) <= 1e-12 * scale
    by = np.where(flat, 1.0, change)
    # jumps at a and b: sum of p = 1 - a and q = 1 - b, and sum of their squares
    total, squares = 2.0 * mean / by, 4.0 * moment / by
    apart = 2.0 * squares - total**2
    half = np.sqrt(np.maximum(apart, 0.0))
    # if the jumps coincide, round-off may make the discriminant negative
    slack = 1e-9 * scale / np.abs(by)
    after = 0.5 * np.stack([total + half, total - half], axis=1)
    inside = (after >= -1e-9).all(axis=1) & (after <= 1.0 + 1e-9).all(axis=1)
    return Curves(
        power=np.stack([c0, 0.0 * c0, 0.0 * c0, 0.0 * c0], axis=1),
        place=1.0 - np.clip(after, 0.0, 1.0),
        jump=np.repeat(0.5 * change[:, None], 2, axis=1),
        feasible=inside & ~flat & (apart >= -slack),
    )


def steps_on_cubic(
    c0: Array, change: Array, mean: Array, moment: Array, steps: list[Steps]
) -> Curves:
    """Curves with given steps, plus the cubic that then meets the four values.

    Args:
        c0: Compliance C0 at the start of each interval (n,) [rad/(N·m)].
        change: Change of C over the interval (n,) [rad/(N·m)].
        mean: Mean of C - C0 (n,) [rad/(N·m)].
        moment: Mean of (1 - x) (C - C0) (n,) [rad/(N·m)].
        steps: Steps in each of the n intervals.
    """
    most = max((one.place.size for one in steps), default=0)
    place, jump = np.zeros((c0.size, most)), np.zeros((c0.size, most))
    for k, one in enumerate(steps):
        place[k, : one.place.size], jump[k, : one.jump.size] = one.place, one.jump
    after = 1.0 - place
    cubic = fit_cubic(
        c0,
        change - jump.sum(axis=1),
        mean - (jump * after).sum(axis=1),
        moment - 0.5 * (jump * after**2).sum(axis=1),
    )
    return replace(cubic, place=place, jump=jump)


def fit_cubic(c0: Array, change: Array, mean: Array, moment: Array) -> Curves:
    """Curves C0 + Delta x + x (1 - x) (a + b x) with given mean and moment.

    They correspond to quintic Hermite interpolation of the complementary potential.

    Args:
        c0: Compliance C0 at the start of each interval (n,) [rad/(N·m)].
        change: Change Delta of C over the interval (n,) [rad/(N·m)].
        mean: Mean of C - C0 (n,) [rad/(N·m)].
        moment: Mean of (1 - x) (C - C0) (n,) [rad/(N·m)].
    """
    mean, moment = mean - 0.5 * change, moment - change / 6.0
    b = 60.0 * mean - 120.0 * moment
    a = 6.0 * mean - 0.5 * b
    return Curves(
        power=np.stack([c0, change + a, b - a, -b], axis=1),
        place=np.zeros((c0.size, 1)),
        jump=np.zeros((c0.size, 1)),
        feasible=np.ones(c0.size, dtype=bool),
    )
