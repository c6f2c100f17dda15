r"""Input torque that friction of teeth and race requires of a turning thin-ring drive.

The wave generator turns slowly by :math:`d\theta` while the output exerts the torque T.
Surfaces in contact under the normal force N slide by :math:`d\sigma` on each other.
Without friction the input torque derives from the potential, and its mean over the
passage of balls and teeth is T/i. With friction, to first order in mu,

.. math:: \tau(\theta) = \partial_\theta \Pi + \mu \sum N \Bigl|
    \frac{d\sigma}{d\theta}\Bigr|, \qquad \bar\tau = \frac Ti + \frac{W}{2\pi},

where W is the work of friction in one turn of the input. The first equation applies at
every angle, not only to the mean, because the friction forces shift the rings until the
input supplies this power. The friction torque opposes the motion in both directions. N
and the sliding are those of the frictionless drive, and every contact is assumed to
slide. Where clearance leaves the output free, friction drags the output to the next
flank; the friction at that flank is of second order.

The coefficient mu is the same between tooth flanks and between rim and race, as in
:mod:`swgjoint.fe.rings.friction`. Only friction holds the race, which therefore creeps
in the bore. The loss of the rolling balls follows from the forces at the lobes, see
:mod:`swgjoint.gear.bearing.rolling_friction`, and that of bending steel from the shape
of the rings, see :mod:`swgjoint.fe.rings.bending`. Without the drag of churning grease
and without seals the result is a lower bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import ComputationError
from swgjoint.fe.rings.bending import bending_torque_per_loss_factor
from swgjoint.fe.rings.loading import positions, solve_loaded, without_torque
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.sliding import sliding_sums
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.bearing.rolling_friction import BASE_OILS, GreasedBearing
from swgjoint.gear.design.design import Design
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import mm, rpm

POSITIONS = 8
"""Number of wave-generator angles in a mean."""
STEP = 1e-3
"""Step of the input angle over which the sliding is evaluated [rad]."""
COEFFICIENT = "friction.tooth_coefficient"
"""Key of the coefficient of friction in the design file."""
LEFT_OUT = "churning of grease, seals, cage, bending loss of the rim"
"""Losses of a real drive that the model omits."""


_KEYS = {
    "input_angle": "input_angles_rad",
    "elastic": "elastic_Nm",
    "teeth": "teeth_per_mu_Nm",
    "race": "race_per_mu_Nm",
    "tooth_pairs": "tooth_pairs",
    "lobe_force": "lobe_forces_N",
    "bending": "bending_per_loss_factor_Nm",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class RunningFriction:
    """Frictionless input torque, and friction torque at the input per mu."""

    input_angle: Array
    """Input angles theta (n,) [rad]."""
    elastic: Array
    """Input torque without friction (n,) [N·m]."""
    teeth: Array
    """Friction torque at the input due to the teeth, per mu (n,) [N·m]."""
    race: Array
    """Friction torque at the input due to the rim on the race, per mu (n,) [N·m]."""
    tooth_pairs: Array
    """Number of loaded tooth contacts, mean over the step (n,)."""
    lobe_force: Array
    """Resultant force of the balls at each lobe (n, lobes) [N]."""
    bending: Array
    """Torque at the input that bending of rim and race takes, per loss factor (n,)
    [N·m]."""
    bearing: BallBearing
    """Bearing of the wave generator."""

    @classmethod
    def from_json(cls, data: dict[str, Any], bearing: BallBearing) -> RunningFriction:
        """Friction from stored values.

        Args:
            data: Values of :meth:`to_json`.
            bearing: Bearing of the wave generator.
        """
        return cls(
            **{field: np.array(data[key]) for field, key in _KEYS.items()},
            bearing=bearing,
        )

    def to_json(self) -> dict[str, Any]:
        """All arrays as lists; the keys contain the units."""
        return {key: getattr(self, field).tolist() for field, key in _KEYS.items()}

    @property
    def per_mu(self) -> Array:
        """Friction torque of teeth and race per mu (n,) [N·m]."""
        return np.asarray(self.teeth + self.race)

    @property
    def teeth_share(self) -> float:
        """Share of the teeth in the friction work [-]; zero if there is none."""
        total = float(self.per_mu.sum())
        return float(self.teeth.sum()) / total if total > 0.0 else 0.0

    def ball_torque(self, speed: float, viscosity: float) -> Array:
        """Torque that the rolling balls of all lobes require (n,) [N·m].

        Args:
            speed: Speed of the input, of either sign [rad/s].
            viscosity: Kinematic viscosity of the base oil [m2/s].
        """
        greased = GreasedBearing.from_bearing(self.bearing, viscosity)
        return np.array(
            [
                sum(greased.friction_torque(force, speed) for force in lobes)
                for lobes in self.lobe_force.tolist()
            ]
        )

    def drag_torque(self, speed: float, viscosity: float) -> float:
        """Torque of balls that drag through the oil of a flooded bearing [N·m].

        Args:
            speed: Speed of the input, of either sign [rad/s].
            viscosity: Kinematic viscosity of the base oil [m2/s].
        """
        return GreasedBearing.from_bearing(self.bearing, viscosity).drag_torque(speed)

    def running_torque(
        self,
        mu: float,
        speed: float,
        viscosity: float,
        *,
        flooded: bool = False,
        loss_factor: float = 0.0,
    ) -> float:
        """Mean friction torque at the input [N·m].

        Args:
            mu: Coefficient of friction [-].
            speed: Speed of the input [rad/s].
            viscosity: Kinematic viscosity of the base oil [m2/s].
            flooded: Whether the balls drag through the lubricant.
            loss_factor: Loss factor of the bending rings [-].
        """
        torque = mu * self.per_mu + self.ball_torque(speed, viscosity)
        drag = self.drag_torque(speed, viscosity) if flooded else 0.0
        return float((torque + loss_factor * self.bending).mean()) + drag

    def starting_torque(self, mu: float, *, loss_factor: float = 0.0) -> float:
        """Smallest input torque that keeps the drive turning at all angles [N·m].

        It is the torque at the worst angle and includes the frictionless torque.

        Args:
            mu: Coefficient of friction [-].
            loss_factor: Loss factor of the bending rings [-].
        """
        torque = self.elastic + mu * self.per_mu + self.ball_torque(0.0, BASE_OILS[0])
        return float((torque + loss_factor * self.bending).max())

    def as_dict(self, mu: float) -> dict[str, Any]:
        """Running and starting torque, their parts and the omitted losses, for JSON.

        The running torque is the smaller one of those with both base oils.

        Args:
            mu: Coefficient of friction [-].
        """
        speed = RUNNING_SPEED
        balls = [float(self.ball_torque(speed, oil).mean()) for oil in BASE_OILS]
        return {
            "coefficient": mu,
            "running_speed_rpm": speed / rpm,
            "base_oil_mm2_s": [round(oil / mm**2, 9) for oil in BASE_OILS],
            "running_torque_Nm": mu * float(self.per_mu.mean()) + min(balls),
            "starting_torque_Nm": self.starting_torque(mu),
            "balls_Nm": balls,
            "lobe_force_N": float(self.lobe_force.mean()),
            "teeth_Nm": mu * float(self.teeth.mean()),
            "race_Nm": mu * float(self.race.mean()),
            "bending_per_loss_factor_Nm": float(self.bending.mean()),
            "flooded_drag_Nm": [self.drag_torque(speed, oil) for oil in BASE_OILS],
            "teeth_share": self.teeth_share,
            "tooth_pairs": float(self.tooth_pairs.mean()),
            "bound": "lower",
            "left_out": LEFT_OUT,
        }


def running_friction(
    design: Design, *, torque: float = 0.0, angles: ArrayLike | None = None
) -> RunningFriction:
    """Input torque and friction of a drive whose input turns slowly.

    Args:
        design: The drive. Its wave generator must have a ball bearing; its coefficient
            of friction is ignored.
        torque: Torque T at the output [N·m].
        angles: Input angles [rad]; None chooses :data:`POSITIONS` angles, spread over
            the passage of balls and teeth.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks.
        ComputationError: If an equilibrium cannot be solved.
    """
    return running_over_load(design, (torque,), angles=angles)[0]


def running_over_load(
    design: Design,
    torques: Sequence[float],
    *,
    angles: ArrayLike | None = None,
    progress: Progress = silent,
) -> tuple[RunningFriction, ...]:
    """Input torque and friction under several loads, one result per load.

    At every angle, the equilibrium under one load is the start of the next.

    Args:
        design: See :func:`running_friction`.
        torques: Torques T at the output, in an order without large jumps [N·m].
        angles: See :func:`running_friction`.
        progress: Called after every angle.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks.
        ComputationError: If an equilibrium cannot be solved.
    """
    model = thin_ring(design.with_changes({COEFFICIENT: 0.0}))
    theta = positions(model, POSITIONS) if angles is None else np.asarray(angles, float)
    theta = theta.ravel()
    table = np.empty((theta.size, len(torques), 5 + model.cam.lobes))
    for k, angle in enumerate(theta.tolist()):
        paths = [
            _standing(design, model, angle + part * STEP, torques)
            for part in (-0.5, 0.5)
        ]
        for j, (first, last) in enumerate(zip(*paths, strict=True)):
            teeth, race = sliding_sums(model, first, last)
            table[k, j] = [
                0.5 * (first.wave_generator_torque + last.wave_generator_torque),
                teeth / STEP,
                race / STEP,
                0.5 * (first.loaded_teeth + last.loaded_teeth),
                bending_torque_per_loss_factor(model, first),
                *lobe_forces(model, first),
            ]
        progress("running friction", k + 1, theta.size)
    return tuple(
        RunningFriction(
            input_angle=theta,
            elastic=one[:, 0],
            teeth=one[:, 1],
            race=one[:, 2],
            tooth_pairs=one[:, 3],
            bending=one[:, 4],
            lobe_force=one[:, 5:],
            bearing=model.bearing,
        )
        for one in table.transpose(1, 0, 2)
    )


def lobe_forces(model: ThinRing, state: ThinRingState) -> Array:
    """Resultant force of the balls at each lobe of the wave generator (lobes,) [N].

    Each ball counts to the nearest lobe.

    Args:
        model: The rings.
        state: Their equilibrium.
    """
    assert state.ball_force is not None
    alpha = state.alpha
    centres = model.balls(alpha, state.phase)[0]
    direction = centres / np.hypot(*centres.T)[:, None]
    around = np.arctan2(-centres[:, 0], centres[:, 1]) - alpha
    count = model.cam.lobes
    lobe = np.round(around * count / (2.0 * np.pi)).astype(int) % count
    pushed = state.ball_force[:, None] * direction
    return np.array([np.hypot(*pushed[lobe == k].sum(axis=0)) for k in range(count)])


def _standing(
    design: Design, model: ThinRing, theta: float, torques: Sequence[float]
) -> list[ThinRingState]:
    """Frictionless equilibria under torques [N·m] at an input angle [rad]."""
    free = state = without_torque(model, theta)
    states = []
    for torque in torques:
        if not torque:
            state = free
        elif state.outcome.ok:
            state = solve_loaded(model, state, torque)
        if not state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: no equilibrium at {torque:.4g} N·m and input"
                f" angle {theta:.4g} rad: {state.outcome.value}"
            )
        states.append(state)
    return states
