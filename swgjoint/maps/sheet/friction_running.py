r"""Running tests of a catalogue: the torques that friction requires of motor and load.

At constant speed the potential returns the work that it takes up, so the mean input
torque over one period of the pattern is due to load and friction alone. In slow motion,
at the input angle theta and with the torque T on the output,

.. math::
    \tau(\theta) = \partial_\theta V + b_\theta F, \qquad
    -\partial_\psi V = T + b_\psi F,

where F is the friction while the bristle slips, b the derivatives of the relative
rotation, and :math:`\partial_\theta, \partial_\psi` are the total derivatives of the
potential.
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
divides the error by about the ratio."""
_BALANCES = 30  # largest number of iterations for the back-driving torque
_SETTLED = 1e-9


def _period(drive: Potential, at_most: int | None = None) -> Array:
    """Input angles over one period of the pattern [rad]. Shape (n,)."""
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
        torque: Torque T that the drive exerts on the output [N·m], of a shape that
            broadcasts to (n,).
        speed: Input speed, >= 0 [rad/s]. At zero the input is about to move, and static
            friction acts.

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
        speed: Input speed, >= 0 [rad/s].
    """
    return float(running_torque(drive, _period(drive), 0.0, speed).mean())


def starting_torque(drive: Potential) -> float:
    """Torque on the input above which it keeps turning with a free output [N·m].

    A slowly increasing torque moves the input through equilibrium positions. The input
    turns continuously once the torque exceeds the largest value over one period.
    """
    return float(running_torque(drive, _period(drive), 0.0, 0.0).max())


def back_driving_torque(drive: Potential) -> float | None:
    """Torque on the output that turns the free input [N·m].

    At every position of a period, a load exists under which the input requires no
    torque to turn. The back-driving torque is the largest of these loads. None if it
    exceeds the momentary peak torque.

    Raises:
        ComputationError: If the iteration for these loads does not converge.
        ValueError: If the map has no friction.
    """
    theta, most = _period(drive), drive.ratings.momentary_peak
    sign = -np.sign(drive.ratio)  # the load turns the input forwards
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
        f"map {drive.name!r}: found no load that back-drives the input; remove the"
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
        speed: Input speed, > 0 [rad/s].
        at_most: Largest number of samples of the period, for an approximate value.
    """
    load = np.sign(drive.ratio) * torque
    taken = running_torque(drive, _period(drive, at_most), load, speed).mean()
    return float(load / drive.ratio / taken)
