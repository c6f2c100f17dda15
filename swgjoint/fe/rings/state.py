"""What is known of the thin rings at one equilibrium."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.rings.model import ThinRing
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class RingState:
    """One equilibrium, or the start of the search for one."""

    q: Array
    """Coordinates of rim and race (size,) [m]."""
    ball_feet: Array
    """Places of the balls on the race."""
    bore_feet: Array
    """Places of the bore's points on the race."""
    alpha: float
    """Wave-generator angle [rad]."""
    phase: float = 0.0
    """Angle of ball 0 from the major axis at alpha = 0 [rad]."""
    torque: float = 0.0
    """T that the flexspline exerts on its load [N·m]."""
    rotation: float = 0.0
    """psi, of the rim, of any number of turns [rad]."""
    ball_force: Array | None = None
    """[N]. Shape (balls,)."""
    tooth_force: Array | None = None
    """Tooth force of every tooth contact [N]."""
    contacts: Contacts | None = None
    tooth_moment: float = 0.0
    """Moment of the tooth forces on the flexspline: with that of the balls it must
    balance T [N·m]."""
    wave_generator_torque: float = 0.0
    """External torque on the wave generator, what drives the cage included: without
    friction its mean over ball passage must be T/i [N·m]."""
    energy: float = 0.0
    """Strain energy, contacts included [J]."""
    compliance: float = 0.0
    """-d psi / dT [rad/(N·m)]."""
    shares: Mapping[str, float] = field(default_factory=dict)
    """Parts of the compliance: rim and race, balls, bore (pressed by the race), teeth.

    Of the energy of a small twist, as a share of the whole; a contact that bends over
    under its force may have a negative one."""
    outcome: Outcome = Outcome.CONVERGED
    history: tuple[float, ...] = ()
    """Largest displacement increment of every iteration [m]."""

    @property
    def loaded_teeth(self) -> int:
        """Tooth contacts that carry load."""
        return 0 if self.tooth_force is None else len(self.tooth_force)


def initial_state(model: ThinRing, alpha: float, phase: float = 0.0) -> RingState:
    """Start of a search: both rings deflected by the lobes, not stretched.

    They have turned with the flexspline, however far: at the ideal ratio.
    """
    psi = alpha / model.ratio
    parts = []
    for ring in (model.rim, model.race):
        phi = 2.0 * np.pi / ring.elements * np.arange(ring.elements)
        parts.append(ring.two_lobes(model.lobe_height, phi + psi, alpha).ravel())
    centres, _, _ = model.balls(alpha, phase)
    share = model.race.elements / (2.0 * np.pi)
    angle = np.arctan2(-centres[:, 0], centres[:, 1]) - psi
    return RingState(
        q=np.concatenate(parts),
        ball_feet=np.mod(angle, 2.0 * np.pi) * share,
        bore_feet=model.bore.place.copy(),
        alpha=alpha,
        phase=phase,
        rotation=psi,
    )
