r"""The curve of a drive over its torque at a fixed angle, from few equilibria.

Tooth pairs come into contact one by one: the tangent compliance C over the torque T is
nearly constant between such events and jumps at them. An equilibrium gives output error
e, strain energy U and C, and with the complementary potential

.. math:: G = U + T e, \quad \frac{dG}{dT} = e, \quad \frac{de}{dT} = -C

two of them give for the interval between them C at both ends, its mean (from e) and its
first moment (from G). Where both equilibria predict which contacts change between them,
see :mod:`swgjoint.fe.plane.contact_prediction`, the curve has those jumps and a cubic
that meets the four figures. Elsewhere these determine one jump on a common slope, and
two equal jumps. Where the predictions of both ends, or both explanations, agree the
curve is known; where they differ the difference estimates what is not known.
"""

from __future__ import annotations

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
from swgjoint.typing import Array, Mask

CHANCE = 0.01
"""Part of the length of an interval times the change of its compliance that counts as
unknown: several jumps may happen to look like one."""
AGREED = 0.5
"""Estimated error of the merged prediction, as part of the difference between the
predictions of both ends. Measured on five designs: true errors are 0.5 to 1.6 of it."""
BENT = 0.1
"""Estimated error of the cubic correction, as part of its deviation from a line."""
SMOOTH = 0.4
"""Typical smooth variation of the compliance between two steps, as part of its size."""
STRONG = 0.02
"""Smallest step of the compliance that the torques of a table follow, as part of the
largest compliance."""
_GRID = np.linspace(0.0, 1.0, 17)
"""Where explanations are compared in an interval."""
_NEAR_END = 0.1
"""Intervals are not divided closer to an end than this part of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadPath:
    """Equilibria of a drive at one angle over its torque, and their curve."""

    torque: Array
    """T, increasing [N·m]. Shape (n,)."""
    output_error: Array
    """psi - theta/i [rad]. Shape (n,)."""
    energy: Array
    """Strain energy [J]. Shape (n,)."""
    compliance: Array
    """Tangent -de/dT [rad/(N·m)]. Shape (n,)."""
    changes: tuple[ContactChanges | None, ...] = ()
    """Changes of contact that each equilibrium predicts, n of them or none at all."""

    def __post_init__(self) -> None:
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        if torque.size < 2 or (np.diff(torque) <= 0).any():
            raise ValueError("torque [N·m] must increase, two of them at least")
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
        """Length of the intervals [N·m]. Shape (n - 1,)."""
        return np.diff(self.torque)

    def evaluate_at(self, torque: ArrayLike) -> Array:
        """Output error [rad], strain energy [J], compliance [rad/(N·m)] on the curve.

        Args:
            torque: Inside the range of the equilibria [N·m]. Shape (m,).

        Returns:
            Shape (3, m).
        """
        wanted = np.asarray(torque, float)
        if wanted.min() < self.torque[0] or wanted.max() > self.torque[-1]:
            raise ValueError(
                f"torques {wanted.min():g} to {wanted.max():g} N·m; accepted:"
                f" {self.torque[0]:g} to {self.torque[-1]:g} N·m"
            )
        last = self.torque.size - 2
        k = np.clip(np.searchsorted(self.torque, wanted, side="right") - 1, 0, last)
        h = self.length[k]
        x = (wanted - self.torque[k]) / h
        compliance, once, twice = self._curves.select(k).integrals(x)
        e0, e = self.output_error[k], self.output_error[k] - h * once
        potential = self._potential[k] + h * (x * e0 - h * twice)
        found = np.stack([e, potential - wanted * e, compliance])
        # an equilibrium itself, not the end of its interval with its round-off
        exact = np.searchsorted(self.torque, wanted)
        hit = self.torque[exact] == wanted
        own = np.stack([self.output_error, self.energy, self.compliance])
        found[:, hit] = own[:, exact[hit]]
        return found

    @property
    def doubt(self) -> tuple[Array, Array]:
        """Estimates of the error of e [rad] and of G [J] in each interval (n - 1,)."""
        once, twice = self._differences
        h, known = self.length, self._predicted[0]
        chance = np.where(known, 0.0, CHANCE * h * np.abs(self._jump))
        return h * once.max(axis=1) + chance, h**2 * twice.max(axis=1)

    @property
    def division(self) -> Array:
        """Where one more equilibrium tells most in each interval [N·m] (n - 1,).

        Where the explanations differ most, in the middle if they agree.
        """
        once, _ = self._differences
        worst = _GRID[once.argmax(axis=1)]
        agree = once.max(axis=1) <= CHANCE * np.abs(self._jump)
        x = np.where(agree, 0.5, np.clip(worst, _NEAR_END, 1.0 - _NEAR_END))
        return np.asarray(self.torque[:-1] + x * self.length)

    @property
    def events(self) -> Array:
        """Torques at which the compliance jumps as the curve has it [N·m]. (m,)."""
        one, (known, _, _, both) = self._explained[0], self._predicted
        strong = one.feasible & (np.abs(one.jump[:, 0]) > 0.5 * np.abs(self._jump))
        found = (self.torque[:-1] + one.place[:, 0] * self.length)[strong & ~known]
        # steps that matter; a cubic has none
        size = np.abs(both.jump) > STRONG * self.compliance.max()
        places = self.torque[:-1, None] + both.place * self.length[:, None]
        return np.sort(np.concatenate([found, places[known[:, None] & size]]))

    @property
    def _jump(self) -> Array:
        """Change of the compliance over each interval [rad/(N·m)] (n - 1,)."""
        return np.diff(self.compliance)

    @cached_property
    def _potential(self) -> Array:
        """G [J] (n,)."""
        return self.energy + self.torque * self.output_error

    @cached_property
    def _known(self) -> tuple[Array, Array, Array, Array]:
        """What the equilibria tell of every interval, its length 1.

        Returns:
            C at its begin and its change; mean of C, and of (1 - x) C, less those of C
            at the begin (n - 1,).
        """
        h, e = self.length, self.output_error
        c0 = self.compliance[:-1]
        mean = -np.diff(e) / h - c0
        moment = (h * e[:-1] - np.diff(self._potential)) / h**2 - 0.5 * c0
        return c0, self._jump, mean, moment

    @cached_property
    def _explained(self) -> tuple[Curves, Curves, Curves]:
        """One jump on a slope, two equal jumps, a cubic."""
        c0, change, mean, moment = self._known
        return (
            one_jump(c0, change, mean, moment),
            two_jumps(c0, change, mean, moment),
            fit_cubic(c0, change, mean, moment),
        )

    @cached_property
    def _predicted(self) -> tuple[Mask, Curves, Curves, Curves]:
        """Curves by the changes of contact that the ends of an interval predict.

        Returns:
            Where both ends do (n - 1,); curves by the first end, by the last one and by
            both.
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
        curves = [
            steps_on_cubic(c0, change, mean, moment, [own[which] for own in steps])
            for which in range(3)
        ]
        return known, curves[0], curves[1], curves[2]

    @cached_property
    def _curves(self) -> Curves:
        """By predictions of both ends, elsewhere by what explains the equilibria."""
        known, _, _, predicted = self._predicted
        return Curves.where(known, predicted, self._by_jumps)

    @cached_property
    def _by_jumps(self) -> Curves:
        """The mean of both explanations by jumps, one of them, or the cubic."""
        one, two, cubic = self._explained
        # one jump without a slope is exact, and two at its place up to a square root
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
        """Differences of the explanations, integrated once and twice (n - 1, grid)."""
        one, two, cubic = self._explained
        grid = np.broadcast_to(_GRID, (self.length.size, _GRID.size))
        values = [curves.integrals_on(grid) for curves in (one, two, cubic)]
        both = one.feasible & two.feasible
        neither = ~one.feasible & ~two.feasible
        # without a jump that explains them: what bends the curve at all
        h, c0 = self.length[:, None], self.compliance[:-1, None]
        mean = -np.diff(self.output_error)[:, None] / h
        straight = (grid * mean, c0 * 0.5 * grid**2 + (mean - c0) * grid**3 / 6.0)
        found = []
        for a, b, c, line in zip(*values, straight, strict=True):
            apart = np.where(one.feasible[:, None], a - c, b - c)
            apart = np.where(both[:, None], a - b, apart)
            found.append(np.abs(np.where(neither[:, None], c - line, apart)))
        known, first, last, merged = self._predicted
        predictions = (
            curves.integrals_on(grid) for curves in (first, last, merged.bend)
        )
        for own, a, b, bend in zip(found, *predictions, strict=True):
            apart = AGREED * np.abs(a - b) + BENT * np.abs(bend)
            own[known] = apart[known]
        return found[0], found[1]
