r"""Friction of a catalogue drive from its stated losses.

Three figures determine three parameters in closed form: the starting torque gives the
friction at rest, the no-load running torque at 2000 rpm its rise with the speed, and
the efficiency at rated torque its rise with the load. With the ratio i and the friction
F on the relative rotation, a load T at the output requires the input torque

.. math:: \tau = |T/i| + F (1 + 1/|i|), \qquad F = F_0 + c\,(|T| + F)/|i|

with the circular spline fixed (the flexspline also carries the friction). The
back-driving torque is not used, so the map predicts it.

The tables state neither the difference between static and slipping friction nor the
friction between rest and 2000 rpm. The model therefore has no Stribeck part and a
straight line.
"""

from __future__ import annotations

from swgjoint.gear.catalogue_stated import StatedLosses
from swgjoint.maps.friction import Friction
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED

PRESLIDING = 1e-3
"""Rotation before the bearing slips [rad], a few tens of micrometres at a race of a few
centimetres. Assumed."""
RELAXATION = 1e-3
"""Relaxation time of the bristle, sigma_1/sigma [s]. Assumed."""


def friction_of_losses(losses: StatedLosses, ratio: float, *, source: str) -> Friction:
    """Friction with the stated starting torque, running torque and efficiency.

    Args:
        losses: Stated losses; the back-driving torque is not used.
        ratio: Ratio i, negative because the circular spline is fixed.
        source: Source of the figures.

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
        source=f"{source}; assumed: slip after {PRESLIDING:g} rad, no Stribeck part, a"
        " straight line from rest to 2000 rpm",
    )
