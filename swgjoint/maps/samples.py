"""What a simulation hands to the map: equilibria over torque and angle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.arrays import frozen_array
from swgjoint.maps.drive_map import Ratings

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class MapSamples:
    """Equilibria of a perfect drive over one period of its pattern.

    Tables have the shape (n_torques, n_angles).
    """

    name: str
    level: str
    layout: str
    teeth_flexspline: int
    teeth_circular_spline: int
    ratings: Ratings
    damping_ratio: float
    order: tuple[int, int]
    """(p, q): the pattern is a function of p alpha + q beta, with period 2 pi."""
    input_angle: Array
    """theta, equally spaced over one period, its end excluded [rad]."""
    torque: Array
    """T, increasing, zero included [N·m]."""
    output_error: Array
    """psi - theta/i [rad]."""
    energy: Array
    """Strain energy [J]."""
    compliance: Array
    """Tangent d(torsion)/dT at fixed input [rad/(N·m)]."""
    input_torque: Array
    """External torque on the input; not used by the fit, only to judge it [N·m]."""
    info: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        angle = frozen_array(self.input_angle, "input angle [rad]", ndim=1)
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        if (np.diff(torque) <= 0).any() or not (torque == 0.0).any():
            raise ValueError("torque [N·m] must increase and contain zero")
        object.__setattr__(self, "input_angle", angle)
        object.__setattr__(self, "torque", torque)
        for key, unit in (
            ("output_error", "rad"),
            ("energy", "J"),
            ("compliance", "rad/(N·m)"),
            ("input_torque", "N·m"),
        ):
            table = frozen_array(
                getattr(self, key), f"{key} [{unit}]", shape=(torque.size, angle.size)
            )
            object.__setattr__(self, key, table)
