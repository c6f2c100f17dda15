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
friction between rest and 2000 rpm. The model therefore has no Stribeck effect, and its
friction increases linearly with speed.
"""

from __future__ import annotations

from swgjoint.gear.catalogue_stated import StatedLosses
from swgjoint.maps.friction import Friction
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED

PRESLIDING = 1e-3
"""Assumed rotation before the bearing slips [rad]. It corresponds to a few tens of
micrometres at a race with a radius of a few centimetres."""
RELAXATION = 1e-3
"""Assumed relaxation time of the bristle, sigma_1/sigma [s]."""


def friction_of_losses(losses: StatedLosses, ratio: float, *, source: str) -> Friction:
    """Friction that reproduces stated starting torque, running torque and efficiency.

    Args:
        losses: Stated losses; the back-driving torque is not used.
        ratio: Ratio i [-], negative because the circular spline is fixed.
        source: Source of the figures, to which the assumptions are added.

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
    return Friction(
        stiffness=rest / PRESLIDING,
        damping=RELAXATION * rest / PRESLIDING,
        coulomb=rest,
        static=rest,
        viscous=(running - rest) / (RUNNING_SPEED * along),
        load=load,
        source=f"{source}; assumed: slip after {PRESLIDING:g} rad, no Stribeck effect,"
        " linear increase from rest to 2000 rpm",
    )
