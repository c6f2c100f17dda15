"""Input of a map fit: simulated equilibria at several torques and angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.arrays import frozen_array
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.fields import DriveFields
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class FullSolves:
    """Equilibria that validate a map and are not used to fit it. Shapes (n,)."""

    input_angle: Array
    """Input angle theta [rad]."""
    torque: Array
    """Output torque T [N·m]."""
    output_error: Array
    """Output error psi - theta/i [rad]."""
    input_torque: Array
    """External torque on the input [N·m]."""

    @classmethod
    def from_rows(cls, rows: Sequence[tuple[float, float, float, float]]) -> FullSolves:
        """Equilibria from rows.

        Args:
            rows: Input angle [rad], output torque [N·m], output error [rad] and input
                torque [N·m] of each equilibrium.
        """
        angle, torque, error, moment = np.array(rows).T
        return cls(
            input_angle=angle, torque=torque, output_error=error, input_torque=moment
        )

    def in_series(self, compliance: float) -> FullSolves:
        """The equilibria of the drive in series with an output spring.

        Args:
            compliance: Compliance of the spring [rad/(N·m)].
        """
        return replace(self, output_error=self.output_error - self.torque * compliance)

    def together_with(self, other: FullSolves | None) -> FullSolves:
        """These equilibria followed by other ones, if there are any."""
        if other is None:
            return self
        pairs = {
            key.name: np.concatenate(
                [getattr(self, key.name), getattr(other, key.name)]
            )
            for key in fields(self)
        }
        return FullSolves(**pairs)


@dataclass(frozen=True, kw_only=True, eq=False)
class ToleranceSamples:
    """Equilibria of a drive with tooth errors over a whole cycle of its teeth.

    After one cycle the same teeth mesh again; a drive with perfect teeth repeats after
    every pitch. The first axis of a table selects the quantity: output error
    psi - theta/i [rad], strain energy [J], compliance [rad/(N·m)].
    """

    pitches: int
    """Number of pitches of the cycle."""
    phases: int
    """Number of positions per pitch."""
    torque: Array
    """Output torques T, increasing, zero included [N·m]. Shape (n_torques,)."""
    table: Array
    """Quantities at equal steps of theta over the cycle, its end excluded. Shape (3,
    n_torques, pitches * phases)."""
    perfect: Array
    """The same quantities without tooth errors. Shape (3, n_torques, phases)."""
    order: tuple[int, int] | None = None
    """(p, q) of the passage of teeth; None if it is the pattern of the samples."""
    waves: Index | None = None
    """Numbers of waves in the cycle that the map is to have; None lets the fit choose
    them. Shape (n,)."""
    dropped: float = 0.0
    """Largest rms over the torques of the output error that all other waves add [rad].
    """
    onsets: bool = False
    """Whether the torques next to zero are those at the ends of a clearance, see
    :func:`swgjoint.fe.common.clearance.across_clearance`."""
    free: int = 0
    """Number of positions where the unloaded output has clearance; they are sampled in
    the middle of the clearance."""
    solved: FullSolves | None = None
    """Full solves of the same drive and errors, without linearisation."""

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

    @property
    def zero(self) -> int:
        """Row of zero torque."""
        return int(np.flatnonzero(self.torque == 0.0)[0])

    def in_series(self, compliance: float) -> ToleranceSamples:
        """The samples of the drive in series with an output spring.

        Args:
            compliance: Compliance of the spring [rad/(N·m)].
        """
        t = self.torque[:, None]
        spring = np.stack([-t, 0.5 * t**2, np.ones_like(t)]) * compliance
        solved = self.solved
        return replace(
            self,
            table=self.table + spring,
            perfect=self.perfect + spring,
            solved=None if solved is None else solved.in_series(compliance),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class MapSamples:
    """Equilibria of a drive with perfect teeth over one period of its pattern.

    Tables have the shape (n_torques, n_angles).
    """

    name: str
    level: str
    """Finite-element model: ``ring``, ``2d`` or ``3d``."""
    layout: str
    """Which member is fixed, one of :data:`~swgjoint.gear.kinematics.LAYOUTS`."""
    teeth_flexspline: int
    teeth_circular_spline: int
    ratings: Ratings
    damping_ratio: float
    """Damping ratio of the map [-]."""
    order: tuple[int, int]
    """(p, q): the pattern is a function of p alpha + q beta with period 2 pi."""
    input_angle: Array
    """Input angles theta, equally spaced over one period, its end excluded [rad]."""
    torque: Array
    """Output torques T, increasing, zero included [N·m]."""
    output_error: Array
    """Output error psi - theta/i [rad]."""
    energy: Array
    """Strain energy [J]."""
    compliance: Array
    """Tangent compliance d(torsion)/dT at a fixed input [rad/(N·m)]."""
    input_torque: Array
    """External torque on the input [N·m]; it checks the fit and does not enter it."""
    tolerances: ToleranceSamples | None = None
    """Samples of the drive with tooth errors; None if its teeth are perfect."""
    free: bool = False
    """Whether the unloaded output has clearance. The entries at the torques next to
    zero are then the ends of the clearance instead of equilibria."""
    solved: NDArray[np.bool_] | None = None
    """Whether each torque was solved at every angle; None if all were. At the other
    torques the tables are interpolated along the load paths, the input torque linearly.
    Shape (n_torques,)."""
    solved_angles: NDArray[np.bool_] | None = None
    """Whether each angle was solved; None if all were. At the other angles the tables
    are interpolated over the angle. Shape (n_angles,)."""
    unseen: FullSolves | None = None
    """Equilibria at other angles and torques, zero included; None without any."""
    worst: FullSolves | None = None
    """Equilibria where the map is likely to be least accurate, see
    :func:`swgjoint.maps.fit.worst_positions.worst_positions`; None without any."""
    shortfall: str = ""
    """Sampling goals that were not reached, with the reason; empty if all were."""
    fields: DriveFields | None = None
    """Fields of the flexspline with perfect teeth, for display."""
    info: dict[str, Any] = field(default_factory=dict)
    """Provenance of the samples, JSON values; part of the record of the map."""

    def __post_init__(self) -> None:
        angle = frozen_array(self.input_angle, "input angle [rad]", ndim=1)
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        if (np.diff(torque) <= 0).any() or not (torque == 0.0).any():
            raise ValueError("torque [N·m] must increase and contain zero")
        for key, axis in (("solved", torque), ("solved_angles", angle)):
            given = getattr(self, key)
            solved = np.array(np.ones(axis.size) if given is None else given, bool)
            if solved.shape != axis.shape:
                raise ValueError(f"{key} has shape {solved.shape}, needs {axis.shape}")
            solved.flags.writeable = False
            object.__setattr__(self, key, solved)
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
