r"""What friction of teeth and race asks of the input of a thin-ring drive that turns.

The wave generator turns slowly by :math:`d\theta` under a torque T that the output
exerts; contacts of normal force N slide by :math:`d\sigma` against each other. Without
friction the input torque is that of the potential, whose mean over the passage of balls
and teeth is T/i. With it, to first order in mu,

.. math:: \tau(\theta) = \partial_\theta \Pi + \mu \sum N \Bigl|
    \frac{d\sigma}{d\theta}\Bigr|, \qquad \bar\tau = \frac Ti + \frac{W}{2\pi},

W the work of friction in one turn of the input: at every angle, not only in the mean,
for the forces of friction shift the rings by as much as takes that power. It is against
the motion whichever way the input turns. N and the sliding are those without friction,
and every contact slides. Where play leaves the output free, friction drags it to the
next flank; what that flank then rubs is of second order.

Rim on race and flank on flank rub, with one mu, as in
:mod:`swgjoint.fe.rings.friction`; nothing holds the race but friction, so that it
creeps in the bore. Balls roll without loss, and there are no seals and no grease: a
lower bound of what a drive takes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import ComputationError
from swgjoint.fe.rings.loading import positions, solve_loaded, without_torque
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.sliding import sliding_sums
from swgjoint.fe.rings.state import RingState
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array

POSITIONS = 8
"""Wave-generator angles of a mean."""
STEP = 1e-3
"""Turn of the input over which sliding is a difference, half of it either way [rad]."""
COEFFICIENT = "friction.tooth_coefficient"
LEFT_OUT = "churning of grease, seals, balls and their cage, bending loss of the rim"
"""What a drive takes besides."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RunningFriction:
    """Torque on the input without friction, and what friction adds per mu."""

    input_angle: Array
    """theta [rad]. Shape (n,)."""
    elastic: Array
    """Torque without friction [N·m]. Shape (n,)."""
    teeth: Array
    """Torque per mu that the teeth take [N·m]. Shape (n,)."""
    race: Array
    """The same of rim on race [N·m]. Shape (n,)."""
    tooth_pairs: Array
    """Tooth contacts that carry load. Shape (n,)."""

    @property
    def per_mu(self) -> Array:
        """Torque per mu of both [N·m]. Shape (n,)."""
        return np.asarray(self.teeth + self.race)

    @property
    def teeth_share(self) -> float:
        """Part of the teeth in the work of friction; 0 where nothing rubs [-]."""
        total = float(self.per_mu.sum())
        return float(self.teeth.sum()) / total if total > 0.0 else 0.0

    def running_torque(self, mu: float) -> float:
        """Mean torque that friction takes from the input [N·m]."""
        return mu * float(self.per_mu.mean())

    def starting_torque(self, mu: float) -> float:
        """Torque on the input from which it keeps turning [N·m].

        That of the worst angle, the elastic part included: it must not stop anywhere.
        """
        return float((self.elastic + mu * self.per_mu).max())

    def as_dict(self, mu: float) -> dict[str, Any]:
        """Both torques, their parts and what is not in them: plain values."""
        return {
            "coefficient": mu,
            "running_torque_Nm": self.running_torque(mu),
            "starting_torque_Nm": self.starting_torque(mu),
            "teeth_Nm": mu * float(self.teeth.mean()),
            "race_Nm": mu * float(self.race.mean()),
            "teeth_share": self.teeth_share,
            "tooth_pairs": float(self.tooth_pairs.mean()),
            "bound": "lower",
            "left_out": LEFT_OUT,
        }


def running_friction(
    design: Design, *, torque: float = 0.0, angles: ArrayLike | None = None
) -> RunningFriction:
    """Turn the input of a drive slowly and look at what slides.

    Args:
        design: The drive, with the bearing of its wave generator; its coefficient of
            friction is not looked at.
        torque: T at the output [N·m].
        angles: Input angles [rad]; by default :data:`POSITIONS`, spread over the
            passage of balls and teeth.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
        ComputationError: If an equilibrium cannot be solved.
    """
    model = thin_ring(design.with_changes({COEFFICIENT: 0.0}))
    theta = positions(model, POSITIONS) if angles is None else np.asarray(angles, float)
    theta = theta.ravel()
    rows = []
    for angle in theta.tolist():
        first, last = (
            _standing(design, model, angle + part * STEP, torque)
            for part in (-0.5, 0.5)
        )
        teeth, race = sliding_sums(model, first, last)
        rows.append(
            [
                0.5 * (first.wave_generator_torque + last.wave_generator_torque),
                teeth / STEP,
                race / STEP,
                0.5 * (first.loaded_teeth + last.loaded_teeth),
            ]
        )
    elastic, teeth_torque, race_torque, pairs = np.array(rows).T
    return RunningFriction(
        input_angle=theta,
        elastic=elastic,
        teeth=teeth_torque,
        race=race_torque,
        tooth_pairs=pairs,
    )


def _standing(
    design: Design, model: ThinRing, theta: float, torque: float
) -> RingState:
    """Equilibrium under a torque at an input angle."""
    state = without_torque(model, theta)
    if state.outcome.ok and torque:
        state = solve_loaded(model, state, torque)
    if not state.outcome.ok:
        raise ComputationError(
            f"{design.drive.name}: no equilibrium at {torque:.4g} N·m and input angle"
            f" {theta:.4g} rad: {state.outcome.value}"
        )
    return state
