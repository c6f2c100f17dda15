"""State of the thin rings at one equilibrium."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.rings.model import ThinRing
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ThinRingState:
    """One equilibrium, or the start of the search for one."""

    q: Array
    """Coordinates of rim and race (size,) [m]."""
    ball_feet: Array
    """Feet of the balls on the race, element number plus parameter (balls,)."""
    bore_feet: Array
    """Feet of the bore's contact points on the race, element number plus parameter
    (n_points,)."""
    alpha: float
    """Wave-generator angle [rad]."""
    phase: float = 0.0
    """Angle of ball 0 from the major axis at alpha = 0 [rad]."""
    torque: float = 0.0
    """Torque T that the flexspline exerts on its load [N·m]."""
    rotation: float = 0.0
    """Rotation psi of the rim, any number of turns [rad]."""
    ball_force: Array | None = None
    """Force of every ball (balls,) [N]."""
    tooth_force: Array | None = None
    """Normal force of every tooth contact (n,) [N]."""
    contacts: Contacts | None = None
    """Tooth contacts that carry load; None if the teeth cannot touch."""
    tooth_moment: float = 0.0
    """Moment of the tooth forces on the flexspline [N·m]; together with the moment of
    the ball forces it must balance T."""
    wave_generator_torque: float = 0.0
    """External torque on the wave generator, including the torque that drives the cage
    [N·m]. Without friction its mean over the ball passage must be T/i."""
    energy: float = 0.0
    """Strain energy including that of the contacts [J]."""
    compliance: float = 0.0
    """Compliance -d psi / dT of the output [rad/(N·m)]."""
    shares: Mapping[str, float] = field(default_factory=dict)
    """Shares of rim, race, balls, bore (contact of rim and race) and teeth in the
    compliance [-].

    They are the shares in the strain energy of a small twist. The share of a contact
    may be negative because its force adds a geometric stiffness."""
    outcome: Outcome = Outcome.CONVERGED
    """Outcome of the solve."""
    history: tuple[float, ...] = ()
    """Largest displacement increment of every iteration [m]."""

    @property
    def loaded_teeth(self) -> int:
        """Number of tooth contacts that carry load."""
        return 0 if self.tooth_force is None else len(self.tooth_force)


def initial_state(model: ThinRing, alpha: float, phase: float = 0.0) -> ThinRingState:
    """Initial state of a search: both rings deflected by two lobes without stretch.

    Both rings have rotated by the ideal output angle alpha/i, any number of turns.

    Args:
        model: The rings.
        alpha: Wave-generator angle [rad].
        phase: Angle of ball 0 from the major axis at alpha = 0 [rad].
    """
    psi = alpha / model.ratio
    parts = []
    for ring in (model.rim, model.race):
        phi = 2.0 * np.pi / ring.elements * np.arange(ring.elements)
        parts.append(ring.two_lobes(model.lobe_height, phi + psi, alpha).ravel())
    centres, _, _ = model.balls(alpha, phase)
    share = model.race.elements / (2.0 * np.pi)
    angle = np.arctan2(-centres[:, 0], centres[:, 1]) - psi
    return ThinRingState(
        q=np.concatenate(parts),
        ball_feet=np.mod(angle, 2.0 * np.pi) * share,
        bore_feet=model.bore.place.copy(),
        alpha=alpha,
        phase=phase,
        rotation=psi,
    )
