r"""Friction of a catalogue drive from its stated losses.

Three figures determine three parameters in closed form: the starting torque gives the
friction at rest, the no-load running torque at 2000 rpm its increase with speed, and
the efficiency at rated torque its increase with load. With the ratio i and the torque F
of friction on the relative rotation, a load T at the output requires the input torque

.. math:: \tau = |T/i| + F (1 + 1/|i|), \qquad F = F_0 + c\,(|T| + F)/|i|

with the circular spline fixed, where the flexspline carries the load and the friction.
F_0 is the friction at zero torsion, and c the load factor. The back-driving torque is
not used, so the map predicts it.

The tables state neither the difference between static and slipping friction nor the
friction between rest and 2000 rpm. Without further data the model therefore has no
Stribeck effect, and its friction increases linearly with speed. A model of the bearing
adds two figures: the friction at rest with a full film, which is the Coulomb friction,
and the speed at which the film separates the surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp

from swgjoint.gear.catalogue_stated import StatedLosses
from swgjoint.maps.friction import Friction
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED

PRESLIDING = 1e-3
"""Assumed rotation before the bearing slips [rad]. It corresponds to a few tens of
micrometres at a race with a radius of a few centimetres."""
RELAXATION = 1e-3
"""Assumed relaxation time of the bristle, sigma_1/sigma [s]."""


@dataclass(frozen=True, kw_only=True)
class FilmFriction:
    """Friction between rest and a full film of lubricant."""

    starting: float
    """Starting torque at the input if a film separated all surfaces [N·m]."""
    speed: float
    """Input speed at which the excess of the starting torque has fallen to 1/e
    [rad/s]."""


def friction_of_losses(
    losses: StatedLosses, ratio: float, *, source: str, film: FilmFriction | None = None
) -> Friction:
    """Friction that reproduces stated starting torque, running torque and efficiency.

    Args:
        losses: Stated losses; the back-driving torque is not used.
        ratio: Ratio i [-], negative because the circular spline is fixed.
        source: Source of the figures, to which the assumptions are added.
        film: Friction with a film; None if there is no Stribeck effect.

    Raises:
        InputError: If the figures contradict each other.
    """
    i = abs(ratio)
    along = 1.0 + 1.0 / i
    T = losses.rated_torque
    running = losses.no_load_running / along
    loaded = T / i * (1.0 / losses.efficiency - 1.0) / along
    load = i * (loaded - running) / (T + loaded - running)
    # without load the friction itself causes torsion, which adds c F/i
    rest = losses.starting / along * (1.0 - load / i)
    running *= 1.0 - load / i
    speed = RUNNING_SPEED * along
    coulomb, left, effect = rest, 0.0, "no Stribeck effect, "
    if film is not None:
        left, effect = exp(-((RUNNING_SPEED / film.speed) ** 2)), ""
        coulomb = film.starting / along * (1.0 - load / i)
        # without rolling resistance the film alone gives the running torque
        coulomb = min(coulomb, (running - rest * left) / (1.0 - left))
    return Friction(
        stiffness=rest / PRESLIDING,
        damping=RELAXATION * rest / PRESLIDING,
        coulomb=coulomb,
        static=rest,
        stribeck_speed=1.0 if film is None else film.speed * along,
        viscous=(running - coulomb - (rest - coulomb) * left) / speed,
        load=load,
        source=f"{source}; assumed: slip after {PRESLIDING:g} rad, {effect}linear"
        " increase from rest to 2000 rpm",
    )
