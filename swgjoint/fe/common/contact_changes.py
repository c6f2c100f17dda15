"""Contact changes over the torque, predicted by a drive linearised at one state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.arrays import frozen_array
from swgjoint.maps.fit.contact_corners import pair_changes
from swgjoint.typing import Array, Index

LONE = 0.3
"""Uncertainty of the position of a step that only one end predicts, as a fraction of
the interval [-]."""
FITS = 3
"""Number of linearised corrections in a fit of the step positions."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactChanges:
    """Torques at which contacts open or close, and the compliance between them."""

    torque: Array
    """Torques of the changes, increasing (k,) [N·m]."""
    contact: Index
    """Number of the contact that changes (k,). It identifies the contact in the
    predictions at all states."""
    compliance: Array
    """Compliance before, between and after the changes (k + 1,) [rad/(N·m)]."""

    def __post_init__(self) -> None:
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        shape = (torque.size + 1,)
        compliance = frozen_array(
            self.compliance, "compliance [rad/(N·m)]", shape=shape
        )
        object.__setattr__(self, "torque", torque)
        object.__setattr__(self, "compliance", compliance)

    def mirror(self) -> ContactChanges:
        """Changes of the mirrored drive, which occur under the opposite torques."""
        return ContactChanges(
            torque=-self.torque[::-1],
            contact=self.contact[::-1],
            compliance=self.compliance[::-1],
        )

    def steps_between(self, low: float, high: float) -> Steps:
        """Steps of the compliance within a torque range, scaled to length 1.

        Args:
            low: Lower end of the range [N·m].
            high: Upper end of the range [N·m].
        """
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
    """Positions of the steps in the interval, from 0 to 1 (n,)."""
    jump: Array
    """Jumps of the compliance (n,) [rad/(N·m)]."""
    contact: Index
    """Number of the contact that changes (n,)."""
    doubt: Array
    """Uncertainties of the positions, as fractions of the interval (n,)."""

    @classmethod
    def merge(cls, first: Steps, last: Steps) -> Steps:
        """Steps that combine the predictions of both ends of an interval.

        The error of a prediction is assumed to grow with the square of the distance
        from its end. A change that both ends predict becomes one step between the two
        predicted positions. A change that only one end predicts keeps its position, and
        its height is reduced to the weight of that end.

        Args:
            first: Steps that the equilibrium at the start of the interval predicts.
            last: Steps that the equilibrium at its end predicts.
        """
        here, there = pair_changes(
            (first.place, first.jump, first.contact),
            (last.place, last.jump, last.contact),
        )
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
        """Steps moved so that the compliance C has a given mean and first moment.

        Both are linear in small shifts of the steps and in the coefficients of a cubic
        correction. Of all solutions, the one is chosen that has the least sum of
        squares of the shifts, relative to their uncertainties, and of the cubic's
        coefficients, relative to their usual size.

        Args:
            mean: Mean of C - L, where L is the straight line between the values of C at
                both ends of the interval [rad/(N·m)].
            moment: Mean of (1 - x) (C - L) [rad/(N·m)].
            smooth: Usual size of the coefficients of the cubic [rad/(N·m)].
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
            scales = scaled.T @ np.linalg.solve(scaled @ scaled.T, wanted)
            shift = np.clip(size * scales[: place.size], -size, size)
            place = np.clip(self.place + shift, 0.0, 1.0)
        return replace(self, place=place)
