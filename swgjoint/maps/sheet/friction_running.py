r"""Running tests of a catalogue: torques that friction demands of motor and load.

At constant speed the potential returns the work that it takes, so over one period of
the pattern the mean input torque is due to load and friction alone. In slow motion at
the input angle theta and the output torque T,

.. math::
    \tau(\theta) = \partial_\theta V + b_\theta F, \qquad
    -\partial_\psi V = T + b_\psi F,

with the slipping friction F, the direction b of the relative rotation and the total
derivatives :math:`\partial_\theta, \partial_\psi` of the potential.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import ComputationError
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.turn import period_of
from swgjoint.typing import Array
from swgjoint.units import rpm

RUNNING_SPEED = 2000.0 * rpm
"""Input speed at which catalogues state running torque and efficiency [rad/s]."""
_ROUNDS = 4
"""Iterations between friction and the torque that it adds at the output; each one
reduces the error by about a factor of the ratio."""
_BALANCES = 30
_SETTLED = 1e-9


def _period(drive: Potential, at_most: int | None = None) -> Array:
    """Input angles over one period of the pattern [rad]."""
    period, samples = period_of(drive)
    samples = min(samples, at_most or samples)
    return 2.0 * np.pi * float(period) * np.arange(samples) / samples


def running_torque(
    drive: Potential, theta: Array, torque: ArrayLike, speed: float
) -> Array:
    """Torque on the input that keeps it turning forwards [N·m]. Shape (n,).

    Args:
        drive: A map with friction.
        theta: Input angles [rad]. Shape (n,).
        torque: T that the drive exerts on the output [N·m], broadcast with them.
        speed: Input speed, >= 0 [rad/s]; at zero, static friction acts as the input is
            about to move.

    Raises:
        ValueError: If the map has no friction.
    """
    law = drive.friction
    if law is None:
        raise ValueError(f"map {drive.name!r} has no friction")
    by_theta, by_psi = drive.friction_direction
    along = by_theta + by_psi / drive.ratio  # relative rotation per input rotation
    elastic = np.broadcast_to(np.asarray(torque, float), theta.shape)
    friction = np.zeros_like(theta)
    for _ in range(_ROUNDS):
        psi = output_angle(drive, theta, elastic + by_psi * friction)
        along_torsion = drive.torque(drive.torsion(theta, psi), theta, psi)
        slip = law.yield_torque(along * speed, along_torsion / drive.ratio)
        friction = np.copysign(slip, along) + law.viscous * along * speed
    return np.asarray(by_theta * friction - drive.forces(theta, psi)[0])


def no_load_running_torque(drive: Potential, speed: float = RUNNING_SPEED) -> float:
    """Mean torque on the input at constant speed with a free output [N·m].

    Args:
        drive: A map with friction.
        speed: Input speed [rad/s].
    """
    return float(running_torque(drive, _period(drive), 0.0, speed).mean())


def starting_torque(drive: Potential) -> float:
    """Torque on the input above which it keeps turning with a free output [N·m].

    A slowly rising torque moves the input through positions of equilibrium. It turns
    continuously once the torque exceeds the largest one of a period.
    """
    return float(running_torque(drive, _period(drive), 0.0, 0.0).max())


def back_driving_torque(drive: Potential) -> float | None:
    """Torque on the output that turns the free input [N·m].

    It is the largest load over one period at which the input needs no torque. None if
    even the momentary peak torque does not turn the input.

    Raises:
        ComputationError: If the iteration for this load does not converge.
    """
    theta, most = _period(drive), drive.ratings.momentary_peak
    sign = -np.sign(drive.ratio)  # the load drives an input that turns forwards
    keeps = drive.friction.load if drive.friction else 0.0  # friction per |T/i|
    if keeps >= 1.0:
        return None
    load = np.zeros_like(theta)
    for _ in range(_BALANCES):
        needed = running_torque(drive, theta, sign * load, 0.0)
        change = needed * abs(drive.ratio) / (1.0 - keeps)
        load = np.maximum(load + change, 0.0)
        if load.min() > most:
            return None
        moved = np.abs(np.where(load > 0.0, change, 0.0)).max()
        if moved <= _SETTLED * max(load.max(), _SETTLED):
            worst = float(load.max())
            return worst if worst <= most else None
    raise ComputationError(
        f"map {drive.name!r}: found no load that back-drives its input; remove the"
        " strongest harmonics"
    )


def efficiency(
    drive: Potential,
    torque: float,
    speed: float = RUNNING_SPEED,
    *,
    at_most: int | None = None,
) -> float:
    """Output work over input work during one period at constant speed [-].

    Args:
        drive: A map with friction.
        torque: Load torque that opposes the motion of the output [N·m], > 0.
        speed: Input speed [rad/s].
        at_most: Largest number of samples of the period, for a rough value.
    """
    load = np.sign(drive.ratio) * torque
    taken = running_torque(drive, _period(drive, at_most), load, speed).mean()
    return float(load / drive.ratio / taken)
