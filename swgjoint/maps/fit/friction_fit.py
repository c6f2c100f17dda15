r"""Friction of a catalogue drive, from the losses that a table states.

Three figures give three parameters, in closed form: starting torque the friction at
rest, no-load running torque at 2000 rpm the rise with the speed, efficiency at rated
torque the part that grows with the load. A load at the output asks, with i the ratio
and F the friction on the relative rotation, for

.. math:: \tau = |T/i| + F (1 + 1/|i|), \qquad F = F_0 + c\,(|T| + F)/|i|

with the circular spline fixed (the flexspline carries the friction, too). The
back-driving torque is not used: what the map makes of it is a prediction.

Where static and slipping friction part is not stated, nor how friction rises between
rest and 2000 rpm: no Stribeck part, and a straight line.
"""

from __future__ import annotations

from swgjoint.gear.catalogue_stated import StatedLosses
from swgjoint.maps.friction import Friction
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED

PRESLIDING = 1e-3
"""Rotation before the bearing slips [rad]: some ten micrometres at a race of a few
centimetres. Assumed."""
RELAXATION = 1e-3
"""sigma_1/sigma, the time in which the bristle comes to rest [s]. Assumed."""


def friction_of_losses(losses: StatedLosses, ratio: float, *, source: str) -> Friction:
    """Friction with the stated starting torque, running torque and efficiency.

    Args:
        losses: The stated figures; the back-driving torque is not used.
        ratio: i, circular spline fixed: negative.
        source: Where they come from.

    Raises:
        InputError: If the figures contradict each other.
    """
    i = abs(ratio)
    along = 1.0 + 1.0 / i
    T = losses.rated_torque
    running = losses.no_load_running / along
    loaded = T / i * (1.0 / losses.efficiency - 1.0) / along
    load = i * (loaded - running) / (T + loaded - running)
    # without load the friction itself pulls the torsion: c F/i of it
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
