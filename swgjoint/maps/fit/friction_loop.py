"""A torque loop with friction, computed by finite elements."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from swgjoint.arrays import frozen_array
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class FrictionLoop:
    """Torque loop with locked input, from the first loading to a closed round.

    The last round of a large loop is T -> 0 -> -T -> 0 -> T. When it begins, the first
    loading no longer affects the drive. A small loop has a round of a smaller amplitude
    about a mean torque; its path begins with that of the large loop.
    """

    input_angle: float
    """Locked input angle theta [rad]."""
    quarter: int
    """Number n of steps in each quarter of the last round."""
    torque: Array
    """Torque T along the path, at least 4 n + 1 values [N·m]. Shape (n_points,)."""
    torsion: Array
    """Torsion theta/i - psi with friction [rad]. Shape (n_points,)."""
    elastic_torsion: Array
    """Torsion without friction at the same torques [rad]. Shape (n_points,)."""
    stiffness: Array
    """Tangent stiffness dT/dx without friction [N·m/rad]. Shape (n_points,)."""
    work: Array
    """Work of friction since the start [J]. Shape (n_points,)."""

    def __post_init__(self) -> None:
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        falling, rising = self.branches(torque)
        if rising.size != 2 * self.quarter + 1 or (falling != rising).any():
            raise ValueError(
                f"{torque.size} torques do not end with a round of equal branches, in"
                f" quarters of {self.quarter} steps"
            )
        object.__setattr__(self, "torque", torque)
        for key, unit in (
            ("torsion", "rad"),
            ("elastic_torsion", "rad"),
            ("stiffness", "N·m/rad"),
            ("work", "J"),
        ):
            values = frozen_array(
                getattr(self, key), f"{key} [{unit}]", shape=(torque.size,)
            )
            object.__setattr__(self, key, values)

    @property
    def mean_torque(self) -> float:
        """Torque in the middle of the round [N·m]."""
        return float(self.branches(self.torque)[1][self.quarter])

    @property
    def round(self) -> slice:
        """The last round, closed, from T to T."""
        return slice(-4 * self.quarter - 1, None)

    def branches(self, values: Array) -> tuple[Array, Array]:
        """Values of the falling and the rising branch, both from -T to T (2 n + 1,)."""
        n = self.quarter
        last = values[self.round]
        return last[: 2 * n + 1][::-1], last[2 * n :]

    @property
    def width(self) -> Array:
        """Torsion of the falling minus that of the rising branch (2 n + 1,) [rad]."""
        falling, rising = self.branches(self.torsion)
        return np.asarray(falling - rising)

    @property
    def shift(self) -> Array:
        """Mid-line minus the torsion without friction (2 n + 1,) [rad]."""
        falling, rising = self.branches(self.torsion - self.elastic_torsion)
        return np.asarray(0.5 * (falling + rising))

    @property
    def loss(self) -> float:
        """Full width at the mean torque, for a large loop at zero torque [rad]."""
        return float(self.width[self.quarter])

    @property
    def area(self) -> float:
        """Work of the round, the integral of T dx [J]."""
        return float(np.trapezoid(self.torque[self.round], self.torsion[self.round]))

    @property
    def friction_work(self) -> float:
        """Work of friction over the round [J]."""
        return float(np.ptp(self.work[self.round]))

    @property
    def gap(self) -> float:
        """Torsion at the end of the round minus that at its start [rad]."""
        return float(self.torsion[-1] - self.torsion[self.round][0])

    @property
    def elastic_torque(self) -> Array:
        """T_0(x), torque without friction at the same torsion (n_points,) [N·m]."""
        torque, place = np.unique(self.torque, return_index=True)
        # friction shifts x only slightly, so interpolation by value and slope suffices
        elastic = CubicHermiteSpline(
            self.elastic_torsion[place], torque, self.stiffness[place]
        )
        return np.asarray(elastic(self.torsion))

    @property
    def friction_torque(self) -> Array:
        """R = T - T_0(x) along the path (n_points,) [N·m]."""
        return np.asarray(self.torque - self.elastic_torque)

    def cut_path(self, end: int, quarter: int) -> FrictionLoop:
        """The loop whose path is the first part of this one.

        Args:
            end: Number of points of the path, which ends with a round.
            quarter: Number of steps in each quarter of that round.
        """
        return replace(
            self,
            quarter=quarter,
            torque=self.torque[:end],
            torsion=self.torsion[:end],
            elastic_torsion=self.elastic_torsion[:end],
            stiffness=self.stiffness[:end],
            work=self.work[:end],
        )
