r"""What friction asks of the motor and of the load: the running tests of a catalogue.

At constant speed the potential gives back what it takes, so over one period of the
pattern the mean torque at the input is that of load and friction. In slow motion
through the input angle theta, output torque T,

.. math::
    \tau(\theta) = \partial_\theta V + b_\theta F, \qquad
    -\partial_\psi V = T + b_\psi F,

with F the friction that slips, b the direction of the relative rotation and
:math:`\partial_\theta, \partial_\psi` total derivatives of the potential.
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
"""Friction and the torque that it adds at the output: each round gains the ratio."""
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
    """Torque on the input that keeps it turning forward [N·m]. Shape (n,).

    Args:
        drive: A map with friction.
        theta: Input angles [rad]. Shape (n,).
        torque: T that the drive exerts on the output [N·m], broadcast with them.
        speed: Of the input, >= 0 [rad/s]; at 0 it is about to move: static friction.
    """
    law = drive.friction
    if law is None:
        raise ValueError(f"map {drive.name!r} has no friction")
    by_theta, by_psi = drive.friction_direction
    along = by_theta + by_psi / drive.ratio  # relative rotation per input rotation
    elastic = np.broadcast_to(np.asarray(torque, float), theta.shape)
    rubs = np.zeros_like(theta)
    for _ in range(_ROUNDS):
        psi = output_angle(drive, theta, elastic + by_psi * rubs)
        along_torsion = drive.torque(drive.torsion(theta, psi), theta, psi)
        slip = law.yield_torque(along * speed, along_torsion / drive.ratio)
        rubs = np.copysign(slip, along) + law.viscous * along * speed
    return np.asarray(by_theta * rubs - drive.forces(theta, psi)[0])


def no_load_running_torque(drive: Potential, speed: float = RUNNING_SPEED) -> float:
    """Mean torque on the input at constant speed, output free [N·m]."""
    return float(running_torque(drive, _period(drive), 0.0, speed).mean())


def starting_torque(drive: Potential) -> float:
    """Torque on the input from which it keeps turning, output free [N·m].

    A torque that rises slowly turns the input along its positions of balance; it stands
    until the torque is above that of every position to come. The worst of a period.
    """
    return float(running_torque(drive, _period(drive), 0.0, 0.0).max())


def back_driving_torque(drive: Potential) -> float | None:
    """Torque on the output from which it turns the free input [N·m].

    At every position of a period the load at which the input needs no torque; the worst
    counts. None where even the momentary peak torque does not turn it.

    Raises:
        ComputationError: If no balance is found.
    """
    theta, most = _period(drive), drive.ratings.momentary_peak
    sign = -np.sign(drive.ratio)  # the load drives an input that turns forward
    keeps = drive.friction.load if drive.friction else 0.0  # part of |T/i| that rubs
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
        f"map {drive.name!r}: no load found at which its input turns by itself; leave"
        " out the strongest harmonics"
    )


def efficiency(
    drive: Potential,
    torque: float,
    speed: float = RUNNING_SPEED,
    *,
    at_most: int | None = None,
) -> float:
    """Work at the output over work at the input, of one period at constant speed [-].

    Args:
        drive: A map with friction.
        torque: At the output, against its motion [N·m], > 0.
        speed: Of the input [rad/s].
        at_most: Samples of the period, for a rough figure.
    """
    load = np.sign(drive.ratio) * torque
    taken = running_torque(drive, _period(drive, at_most), load, speed).mean()
    return float(load / drive.ratio / taken)
