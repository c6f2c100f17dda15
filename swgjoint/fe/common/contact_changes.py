"""Changes of contact over the torque, as a drive linearised at one state predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.arrays import frozen_array
from swgjoint.typing import Array, Index

LONE = 0.3
"""Uncertainty of the place of a step that only one end predicts, as part of the
interval."""
FITS = 3
"""Linearisations of a fit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactChanges:
    """Torques at which contacts open or close, and the compliance between them."""

    torque: Array
    """Increasing [N·m]. Shape (k,)."""
    contact: Index
    """Number of the contact that changes, the same in predictions at other states."""
    compliance: Array
    """Before, between and after the changes [rad/(N·m)]. Shape (k + 1,)."""

    def __post_init__(self) -> None:
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        shape = (torque.size + 1,)
        compliance = frozen_array(
            self.compliance, "compliance [rad/(N·m)]", shape=shape
        )
        object.__setattr__(self, "torque", torque)
        object.__setattr__(self, "compliance", compliance)

    def mirror(self) -> ContactChanges:
        """Those of the mirrored drive, under the opposite torque."""
        return ContactChanges(
            torque=-self.torque[::-1],
            contact=self.contact[::-1],
            compliance=self.compliance[::-1],
        )

    def steps_between(self, low: float, high: float) -> Steps:
        """Steps of the compliance in a range of the torque, as parts of its length."""
        inside = (self.torque > low) & (self.torque < high)
        return Steps(
            place=(self.torque[inside] - low) / (high - low),
            jump=np.diff(self.compliance)[inside],
            contact=self.contact[inside],
            doubt=np.zeros(int(inside.sum())),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Steps:
    """Steps of the compliance in an interval of length 1."""

    place: Array
    jump: Array
    """[rad/(N·m)]."""
    contact: Index
    doubt: Array
    """Uncertainty of the places."""

    @classmethod
    def merge(cls, first: Steps, last: Steps) -> Steps:
        """From predictions at both ends, which err by the square of the distance.

        A change that both predict is one step between the two; one that an end predicts
        alone is a part of a step.
        """
        here, there = _pairs(first.contact, last.contact)
        a, b = first.place[here], last.place[there]
        x = 0.5 * (a + b)
        weight = x**2 / (x**2 + (1.0 - x) ** 2)
        lone = np.setdiff1d(np.arange(first.place.size), here)
        other = np.setdiff1d(np.arange(last.place.size), there)
        only = np.concatenate([first.place[lone], last.place[other]])
        part = only**2 / (only**2 + (1.0 - only) ** 2)
        part[: lone.size] = 1.0 - part[: lone.size]
        jump = np.concatenate([first.jump[lone], last.jump[other]])
        return cls(
            place=np.concatenate([a + weight * (b - a), only]),
            jump=np.concatenate(
                [
                    (1.0 - weight) * first.jump[here] + weight * last.jump[there],
                    part * jump,
                ]
            ),
            contact=np.concatenate(
                [first.contact[here], first.contact[lone], last.contact[other]]
            ),
            doubt=np.concatenate([np.abs(b - a), np.full(only.size, LONE)]),
        )

    def fit_moments(self, mean: float, moment: float, smooth: float) -> Steps:
        """Moved so that C has a given mean and first moment.

        Both are linear in small shifts of the steps and in the coefficients of a cubic.
        Of all that meet them, the least squares of the shifts in their doubts and of
        the cubic in its usual size.

        Args:
            mean: Of C above the begin of the interval, a linear change taken out.
            moment: Of (1 - x) C, the same.
            smooth: Usual deviation of C from such a change [rad/(N·m)].
        """
        if not self.place.size:
            return self
        place = self.place
        for _ in range(FITS):
            after = 1.0 - place
            lack = np.array(
                [
                    mean - self.jump @ after + 0.5 * self.jump.sum(),
                    moment - 0.5 * self.jump @ after**2 + self.jump.sum() / 6.0,
                ]
            )
            rows = np.stack([-self.jump, -self.jump * after])
            size = self.doubt + 1e-3
            # means and moments of x (1 - x) and x^2 (1 - x)
            cubic = smooth * np.array([[1 / 6, 1 / 12], [1 / 12, 1 / 30]])
            scaled = np.concatenate([rows * size, cubic], axis=1)
            wanted = lack + rows @ (place - self.place)
            found = scaled.T @ np.linalg.solve(scaled @ scaled.T, wanted)
            shift = np.clip(size * found[: place.size], -size, size)
            place = np.clip(self.place + shift, 0.0, 1.0)
        return replace(self, place=place)


def _pairs(first: Index, last: Index) -> tuple[Index, Index]:
    """Where equal numbers are, the k-th of the one with the k-th of the other."""
    here, there = list[int](), list[int]()
    for number in np.unique(first):
        one, two = np.flatnonzero(first == number), np.flatnonzero(last == number)
        count = min(one.size, two.size)
        here.extend(one[:count])
        there.extend(two[:count])
    return np.array(here, dtype=np.int64), np.array(there, dtype=np.int64)
