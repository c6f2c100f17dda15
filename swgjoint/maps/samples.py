"""What a simulation hands to the map: equilibria over torque and angle."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.arrays import frozen_array
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.fields import DriveFields
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class FullSolves:
    """Single equilibria that judge a map and take no part in its fit. Shapes (n,)."""

    input_angle: Array
    """theta [rad]."""
    torque: Array
    """T [N·m]."""
    output_error: Array
    """psi - theta/i [rad]."""
    input_torque: Array
    """External torque on the input [N·m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ToleranceSamples:
    """Equilibria of a drive with errors of its teeth over a whole cycle of them.

    The cycle has so many pitches that the teeth that mesh return; after each of them
    the perfect drive would be the same. Quantities of a table, its first axis: output
    error psi - theta/i [rad], strain energy [J], compliance [rad/(N·m)].
    """

    pitches: int
    """Number of pitches of the cycle."""
    phases: int
    """Positions in a pitch."""
    torque: Array
    """T, increasing, zero included [N·m]. Shape (n_torques,)."""
    table: Array
    """At equal steps of theta over the cycle, its end excluded. Shape (3, n_torques,
    pitches * phases)."""
    perfect: Array
    """The same without the errors, by the same means. Shape (3, n_torques, phases)."""
    free: int = 0
    """Positions at which the unloaded output is free; it stands in the middle."""
    solved: FullSolves | None = None
    """Solves of the same drive without linearisation, errors as in the table."""

    def __post_init__(self) -> None:
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        if (np.diff(torque) <= 0).any() or not (torque == 0.0).any():
            raise ValueError("torque [N·m] must increase and contain zero")
        object.__setattr__(self, "torque", torque)
        for key, count in (
            ("table", self.pitches * self.phases),
            ("perfect", self.phases),
        ):
            shape = (3, torque.size, count)
            table = frozen_array(getattr(self, key), key, shape=shape)
            object.__setattr__(self, key, table)

    def in_series(self, compliance: float) -> ToleranceSamples:
        """The same drive behind a spring at its output [rad/(N·m)]."""
        t = self.torque[:, None]
        spring = np.stack([-t, 0.5 * t**2, np.ones_like(t)]) * compliance
        solved = self.solved
        if solved is not None:
            twisted = solved.output_error - solved.torque * compliance
            solved = replace(solved, output_error=twisted)
        return replace(
            self,
            table=self.table + spring,
            perfect=self.perfect + spring,
            solved=solved,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class MapSamples:
    """Equilibria of a drive with perfect teeth over one period of its pattern.

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
    tolerances: ToleranceSamples | None = None
    """The drive with errors of its teeth; None without."""
    free: bool = False
    """Whether clearance leaves the output free without torque. The torques next to zero
    are then no equilibria: they stand at the ends of the clearance."""
    solved: NDArray[np.bool_] | None = None
    """Torques at which all angles were solved; between them the tables follow the load
    paths, and the input torque a straight line. None: all. Shape (n_torques,)."""
    unseen: FullSolves | None = None
    """Equilibria at other angles and torques, those without torque included."""
    shortfall: str = ""
    """What the solves did not suffice for; empty if they did."""
    fields: DriveFields | None = None
    """Fields of the flexspline with perfect teeth, to be shown."""
    info: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        angle = frozen_array(self.input_angle, "input angle [rad]", ndim=1)
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        if (np.diff(torque) <= 0).any() or not (torque == 0.0).any():
            raise ValueError("torque [N·m] must increase and contain zero")
        solved = np.ones(torque.size) if self.solved is None else self.solved
        solved = np.array(solved, dtype=bool)
        if solved.shape != torque.shape:
            raise ValueError(f"solved has shape {solved.shape}, needs {torque.shape}")
        solved.flags.writeable = False
        object.__setattr__(self, "solved", solved)
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
