r"""Load curve of a drive over its torque at a fixed input angle, from few equilibria.

Tooth pairs come into contact one by one. Over the torque T the tangent compliance C is
therefore nearly constant between such events and jumps at them. An equilibrium gives
the output error e, the strain energy U and C. With the complementary potential

.. math:: G = U + T e, \quad \frac{dG}{dT} = e, \quad \frac{de}{dT} = -C

two equilibria give four values for the interval between them: C at both ends, the mean
of C (from e) and its first moment (from G). If both equilibria predict which contacts
change between them (see :mod:`swgjoint.fe.plane.contact_prediction`), the curve has
those jumps plus a cubic that meets the four values. Otherwise the four values determine
two candidate curves: one jump on a common slope, and two equal jumps. The difference
between the predictions of both ends, or between the two candidates, estimates the error
of the curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.arrays import frozen_array
from swgjoint.fe.common.contact_changes import ContactChanges, Steps
from swgjoint.fe.common.load_curves import (
    Curves,
    fit_cubic,
    one_jump,
    steps_on_cubic,
    two_jumps,
)
from swgjoint.typing import Array, Index, Mask

CHANCE = 0.01
"""Error that is always assumed for an interval without predicted changes, as a fraction
of its length times the change of its compliance [-]. It allows for several jumps that
look like one."""
AGREED = 0.5
"""Estimated error of the merged prediction, as a fraction of the difference between the
predictions of both ends [-]. In five designs the true errors are 0.5 to 1.6 times this
estimate."""
BENT = 0.1
"""Estimated error of the cubic correction, as a fraction of its deviation from a
straight line [-]."""
SMOOTH = 0.4
"""Typical smooth variation of the compliance between two steps, as a fraction of the
compliance [-]."""
PLACES = 4
"""Number of angles in each interval at which load curves may be least certain."""
_GRID = np.linspace(0.0, 1.0, 17)
"""Points of an interval at which candidate curves are compared [-]."""
_NEAR_END = 0.1
"""Smallest distance of a division from the ends of an interval, relative to its length
[-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadPath:
    """Equilibria of a drive over its torque at one angle, and their load curve."""

    torque: Array
    """Torque T, increasing (n,) [N·m]."""
    output_error: Array
    """Output error e = psi - theta/i (n,) [rad]."""
    energy: Array
    """Strain energy U (n,) [J]."""
    compliance: Array
    """Tangent compliance C = -de/dT (n,) [rad/(N·m)]."""
    changes: tuple[ContactChanges | None, ...] = ()
    """Contact changes that each equilibrium predicts, None without a prediction (n
    entries); empty without any predictions."""

    def __post_init__(self) -> None:
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        if torque.size < 2 or (np.diff(torque) <= 0).any():
            raise ValueError("torque [N·m]: expected two or more values that increase")
        object.__setattr__(self, "torque", torque)
        for key, unit in (
            ("output_error", "rad"),
            ("energy", "J"),
            ("compliance", "rad/(N·m)"),
        ):
            values = getattr(self, key)
            values = frozen_array(values, f"{key} [{unit}]", shape=torque.shape)
            object.__setattr__(self, key, values)

    @property
    def length(self) -> Array:
        """Lengths of the torque intervals (n - 1,) [N·m]."""
        return np.diff(self.torque)

    def evaluate_at(self, torque: ArrayLike) -> Array:
        """Output error, strain energy and compliance on the curve.

        Args:
            torque: Torques inside the range of the equilibria (m,) [N·m].

        Returns:
            Output error [rad], strain energy [J] and compliance [rad/(N·m)] (3, m).

        Raises:
            ValueError: If a torque is outside the range.
        """
        wanted = np.asarray(torque, float)
        if wanted.min() < self.torque[0] or wanted.max() > self.torque[-1]:
            raise ValueError(
                f"torque = {wanted.min():g} to {wanted.max():g} N·m: expected"
                f" {self.torque[0]:g} to {self.torque[-1]:g} N·m"
            )
        last = self.torque.size - 2
        k = np.clip(np.searchsorted(self.torque, wanted, side="right") - 1, 0, last)
        h = self.length[k]
        x = (wanted - self.torque[k]) / h
        compliance, once, twice = self._curves.select(k).integrals(x)
        e0, e = self.output_error[k], self.output_error[k] - h * once
        potential = self._potential[k] + h * (x * e0 - h * twice)
        values = np.stack([e, potential - wanted * e, compliance])
        # at an equilibrium return its exact values, without round-off of the curve
        exact = np.searchsorted(self.torque, wanted)
        hit = self.torque[exact] == wanted
        solved = np.stack([self.output_error, self.energy, self.compliance])
        values[:, hit] = solved[:, exact[hit]]
        return values

    @property
    def doubt(self) -> tuple[Array, Array]:
        """Estimates of the error of e [rad] and of G [J] in each interval (n - 1,)."""
        once, twice = self._differences
        h, known = self.length, self._predicted[0]
        chance = np.where(known, 0.0, CHANCE * h * np.abs(self._jump))
        return h * once.max(axis=1) + chance, h**2 * twice.max(axis=1)

    @property
    def division(self) -> Array:
        """Torque at which an additional equilibrium helps most, by interval [N·m].

        There the candidate curves or the predictions of both ends differ most; if they
        agree, it is the middle of the interval. Shape (n - 1,).
        """
        once, _ = self._differences
        worst = _GRID[once.argmax(axis=1)]
        agree = once.max(axis=1) <= CHANCE * np.abs(self._jump)
        x = np.where(agree, 0.5, np.clip(worst, _NEAR_END, 1.0 - _NEAR_END))
        return np.asarray(self.torque[:-1] + x * self.length)

    @property
    def jumps(self) -> tuple[Array, Array]:
        """Torques at which the compliance of the curve jumps [N·m], and by how much.

        Single jumps on a slope count where they are steeper than the slope. Increasing
        torques and magnitudes of the jumps [rad/(N·m)], each (m,).
        """
        one, (known, _, _, both) = self._explained[0], self._predicted
        strong = one.feasible & (np.abs(one.jump[:, 0]) > 0.5 * np.abs(self._jump))
        there = np.concatenate(
            [(strong & ~known)[:, None], known[:, None] & (both.jump != 0.0)], axis=1
        )
        place = np.concatenate([one.place[:, :1], both.place], axis=1)
        size = np.abs(np.concatenate([one.jump[:, :1], both.jump], axis=1))[there]
        torque = (self.torque[:-1, None] + place * self.length[:, None])[there]
        order = np.argsort(torque)
        return torque[order], size[order]

    @property
    def contact_changes(self) -> tuple[Array, Array, Index]:
        """Contact changes that the equilibria predict, where the curve has its jumps.

        Returns:
            Torques [N·m], jumps of the compliance [rad/(N·m)] and numbers of the
            contacts, each (m,).
        """
        merged = [three[2] for three in self._steps[1]]
        place = [
            low + one.place * h
            for low, h, one in zip(self.torque, self.length, merged, strict=False)
        ]
        return (
            np.concatenate(place),
            np.concatenate([one.jump for one in merged]),
            np.concatenate([one.contact for one in merged]),
        )

    @property
    def _jump(self) -> Array:
        """Change of the compliance over each interval (n - 1,) [rad/(N·m)]."""
        return np.diff(self.compliance)

    @cached_property
    def _potential(self) -> Array:
        """Complementary potential G (n,) [J]."""
        return self.energy + self.torque * self.output_error

    @cached_property
    def _known(self) -> tuple[Array, Array, Array, Array]:
        """The four values that the equilibria give for C in each interval.

        The interval is scaled to length 1.

        Returns:
            C0 at its start, change of C, mean of C - C0 and mean of (1 - x) (C - C0),
            each (n - 1,) [rad/(N·m)].
        """
        h, e = self.length, self.output_error
        c0 = self.compliance[:-1]
        mean = -np.diff(e) / h - c0
        moment = (h * e[:-1] - np.diff(self._potential)) / h**2 - 0.5 * c0
        return c0, self._jump, mean, moment

    @cached_property
    def _explained(self) -> tuple[Curves, Curves, Curves]:
        """Candidate curves: one jump on a slope, two equal jumps, a cubic."""
        c0, change, mean, moment = self._known
        return (
            one_jump(c0, change, mean, moment),
            two_jumps(c0, change, mean, moment),
            fit_cubic(c0, change, mean, moment),
        )

    @cached_property
    def _steps(self) -> tuple[Mask, list[list[Steps]]]:
        """Steps of the compliance that the ends of an interval predict.

        Returns:
            Whether both ends predict changes (n - 1,), and for each interval the steps
            according to the first end, to the last end and to both.
        """
        n = self.torque.size - 1
        empty = np.zeros(0)
        none = Steps(place=empty, jump=empty, contact=empty.astype(int), doubt=empty)
        known, steps = np.zeros(n, bool), [[none] * 3 for _ in range(n)]
        for j, (one, two) in enumerate(pairwise(self.changes)):
            if one is not None and two is not None:
                low, high = self.torque[j : j + 2]
                first, last = one.steps_between(low, high), two.steps_between(low, high)
                known[j] = True
                steps[j] = [first, last, Steps.merge(first, last)]
        c0, change, mean, moment = self._known
        for k in np.flatnonzero(known).tolist():
            smooth = SMOOTH * max(c0[k], c0[k] + change[k])
            steps[k][2] = steps[k][2].fit_moments(
                mean[k] - change[k] / 2.0, moment[k] - change[k] / 6.0, smooth
            )
        return known, steps

    @cached_property
    def _predicted(self) -> tuple[Mask, Curves, Curves, Curves]:
        """Curves from the contact changes that the ends of an interval predict.

        Returns:
            Whether both ends predict changes (n - 1,), and the curves according to the
            first end, to the last end and to both.
        """
        known, steps = self._steps
        c0, change, mean, moment = self._known
        curves = [
            steps_on_cubic(c0, change, mean, moment, [three[which] for three in steps])
            for which in range(3)
        ]
        return known, curves[0], curves[1], curves[2]

    @cached_property
    def _curves(self) -> Curves:
        """Curves from the merged predictions, or from the candidates without them."""
        known, _, _, predicted = self._predicted
        return Curves.where(known, predicted, self._by_jumps)

    @cached_property
    def _by_jumps(self) -> Curves:
        """Mean of the feasible candidates with jumps, or the cubic without any."""
        one, two, cubic = self._explained
        # a single jump without slope is exact; two jumps approach it only to the square
        # root of the round-off
        sharp = one.feasible & (np.abs(one.power[:, 1]) <= 1e-6 * np.abs(self._jump))
        weight = np.stack([one.feasible, two.feasible & ~sharp], axis=1).astype(float)
        total = weight.sum(axis=1, keepdims=True)
        weight = weight / np.maximum(total, 1.0)
        none = total[:, 0] == 0.0
        first, second = weight[:, :1], weight[:, 1:]
        return Curves(
            power=np.where(
                none[:, None], cubic.power, first * one.power + second * two.power
            ),
            place=np.concatenate([one.place, two.place], axis=1),
            jump=np.concatenate([first * one.jump, second * two.jump], axis=1),
            feasible=np.ones_like(none),
        )

    @cached_property
    def _differences(self) -> tuple[Array, Array]:
        """Differences between candidates, integrated once and twice (n - 1, n_grid)."""
        one, two, cubic = self._explained
        grid = np.broadcast_to(_GRID, (self.length.size, _GRID.size))
        values = [curves.integrals_on(grid) for curves in (one, two, cubic)]
        both = one.feasible & two.feasible
        neither = ~one.feasible & ~two.feasible
        # without a feasible jump: deviation of the cubic from a straight line
        h, c0 = self.length[:, None], self.compliance[:-1, None]
        mean = -np.diff(self.output_error)[:, None] / h
        straight = (grid * mean, c0 * 0.5 * grid**2 + (mean - c0) * grid**3 / 6.0)
        differences = []
        for a, b, c, line in zip(*values, straight, strict=True):
            apart = np.where(one.feasible[:, None], a - c, b - c)
            apart = np.where(both[:, None], a - b, apart)
            differences.append(np.abs(np.where(neither[:, None], c - line, apart)))
        known, first, last, merged = self._predicted
        predictions = (
            curves.integrals_on(grid) for curves in (first, last, merged.bend)
        )
        for difference, a, b, bend in zip(differences, *predictions, strict=True):
            apart = AGREED * np.abs(a - b) + BENT * np.abs(bend)
            difference[known] = apart[known]
        return differences[0], differences[1]


def least_certain(paths: Sequence[LoadPath]) -> Array:
    """Where the load curves of several angles are likely to be least accurate.

    Args:
        paths: Load paths with the same number of intervals, of n angles.

    Returns:
        For each interval between two torques, :data:`PLACES` angles with the largest
        estimated errors of the output error that are not neighbours: the number of the
        angle, the torque at which this curve should be divided [N·m], and the estimate
        [rad] (PLACES n_intervals, 3).
    """
    error = np.array([path.doubt[0] for path in paths])  # (n, n_intervals)
    division = np.array([path.division for path in paths])
    count, interval = error.shape[0], np.arange(error.shape[1])
    number, rows = np.arange(count)[:, None], []
    for _ in range(PLACES):
        worst = error.argmax(axis=0)
        rows.append([worst, division[worst, interval], error[worst, interval]])
        apart = np.abs((number - worst + count // 2) % count - count // 2)
        error = np.where(apart > count / (2 * PLACES), error, 0.0)
    return np.concatenate(rows, axis=1).T
