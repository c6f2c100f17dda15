"""What a tuning run needs of a controller: parameters with bounds, and its torques."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from swgjoint.sim.controller import KnownJoints, KnownLoop, Measured, Task
from swgjoint.typing import Array

Act = Callable[[int, Measured, NDArray[np.bool_]], Array]
"""Maps instant, readings and whether each episode continues to torques [N·m], shape
(n_episodes, n_joints)."""


@dataclass(frozen=True, kw_only=True)
class GainParameter:
    """One tuned number between two bounds, on a logarithmic scale if both are > 0."""

    key: str
    """Name that ends with the unit; without a unit the parameter is dimensionless."""
    low: float
    """Lower bound, in the unit of the key."""
    high: float
    """Upper bound, in the unit of the key."""
    neutral: float
    """Value before tuning, in the unit of the key."""

    def value(self, place: Array) -> Array:
        """Values at relative positions between the bounds, 0 to 1."""
        if self.low > 0.0:
            return np.asarray(self.low * (self.high / self.low) ** place)
        return np.asarray(self.low + (self.high - self.low) * place)

    def place(self, value: float) -> float:
        """Relative position of a value between the bounds, 0 to 1."""
        if self.low > 0.0:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return (value - self.low) / (self.high - self.low)

    @property
    def start(self) -> float:
        """Relative position of the neutral value, 0 to 1; clipped to the bounds."""
        return self.place(min(max(self.neutral, self.low), self.high))


class Tunable(Protocol):
    """A controller with named parameters."""

    @property
    def name(self) -> str:
        """Name in results."""

    @property
    def untuned(self) -> str:
        """Word for the controller with its values before tuning."""

    @property
    def content(self) -> str:
        """Text that differs between controllers of the same name, empty for none."""

    @property
    def needs(self) -> Mapping[str, Any]:
        """Arguments that the environment must have."""

    def parameters(
        self, joints: KnownJoints, loop: KnownLoop | None
    ) -> tuple[GainParameter, ...]:
        """Parameters with bounds.

        Args:
            joints: Joints with their drives and inertias.
            loop: Motor loop to which torques are added, if there is one.
        """

    def gains(
        self, values: Mapping[str, Array], joints: KnownJoints
    ) -> dict[str, Array]:
        """Gains at the motor of the first joint in SI units, if there are any.

        Args:
            values: Values of the parameters by key.
            joints: Joints with their inertias and ratios.
        """

    def begin(
        self, values: Mapping[str, Array], task: Task, kept: dict[str, Any]
    ) -> Act:
        """Begin the episodes of all candidates.

        Args:
            values: Values of the candidates by key. Shape (n_candidates,) each.
            task: Motions of all episodes; those of one candidate follow each other, and
                all candidates have the same ones.
            kept: Results that all candidates on these episodes share.

        Returns:
            Function for the torques of all episodes.
        """


class WithoutGains:
    """A controller without gains at the motor."""

    def gains(
        self, values: Mapping[str, Array], joints: KnownJoints
    ) -> dict[str, Array]:
        """No gains.

        Args:
            values: Unused.
            joints: Unused.
        """
        return {}
