r"""Loss of the thin rings that the turning wave generator bends cyclically.

Every section of rim and race passes through the shape of the rings once per turn of the
wave generator. Its curvature and its stretch over that turn are those around the ring,

.. math:: \kappa - \kappa_0 = \sum_n a_n\cos(n\varphi - \varphi_n), \qquad
    U_n = \tfrac12\pi r EI\,a_n^2,

and each harmonic goes through n cycles, of which each dissipates :math:`2\pi\eta` times
its peak energy. The sections of a ring store :math:`2U_n` at their peaks, hence the
torque at any speed

.. math:: \frac{\tau}{\eta} = 2\sum_n n\,U_n,

with the loss factor eta; stretch contributes in the same way, with EA instead of EI.
For one harmonic this is the closed form of :mod:`swgjoint.maps.fit.friction_bending`.
The uniform part n = 0 does not change and loses nothing. The parts of the shape that
follow the balls move with the cage; they are taken as if they moved with the wave
generator.
"""

from __future__ import annotations

from math import pi

import numpy as np

from swgjoint.fe.rings.hermite_ring import HermiteRing
from swgjoint.fe.rings.model import ThinRing
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.typing import Array


def bending_torque_per_loss_factor(model: ThinRing, state: ThinRingState) -> float:
    """Input torque that bending of rim and race takes, per loss factor [N·m].

    Args:
        model: The rings.
        state: Their equilibrium.
    """
    rim, race = np.split(state.q, [model.rim.size])
    total = 0.0
    for ring, q in ((model.rim, rim), (model.race, race)):
        energy = harmonic_energies(ring, q)
        total += 2.0 * float(np.arange(energy.size) @ energy)
    return total


def harmonic_energies(ring: HermiteRing, q: Array) -> Array:
    """Strain energies U_n by the harmonic n of curvature and stretch, n >= 0 [J].

    The last harmonic is half the number of elements; they add up to the energy of the
    ring.

    Args:
        ring: The ring.
        q: Its coordinates (ring.size,) [m].
    """
    total = np.zeros(ring.elements // 2 + 1)
    stretch, curvature = ring.strains(q)
    for strain, stiffness in (
        (stretch, ring.stretching),
        (curvature, ring.bending),
    ):
        power = np.abs(np.fft.rfft(strain) / ring.elements) ** 2
        power[1:] *= 2.0
        if ring.elements % 2 == 0:
            power[-1] *= 0.5
        total += pi * ring.radius * stiffness * power
    return total
