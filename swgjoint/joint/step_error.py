r"""Error of a spectral line of the output torque due to the step, in closed form.

For small vibrations about a mean torque T0 the scheme is the equation of motion of
rotor and link with time derivatives at a shifted frequency: a line of frequency Omega
responds as if its frequency were

.. math:: \Omega_h = \frac{2}{h} \tan\beta, \quad \beta = \frac{h\,\Omega}{2},

and its angle orders in the forces on rotor and link are larger by the factor
Omega_h/Omega. A line below the torsional resonance is thus shifted towards it. With A,
T = dA/dDelta and e the complex amplitudes of potential, torque and kinematic error of
one harmonic (n, m), and the amplitudes of rotor and link as unknowns,

.. math:: \Delta = \theta/i - \psi + e, \quad F = T + (K + j \Omega_h C)\,\Delta

    (-J\,\Omega_h^2 + S)\,\theta = -F/i - j n \frac{\Omega_h}{\Omega} (T_0 e + A),
    \quad -J_l\,\Omega_h^2\,\psi = F - j m \frac{\Omega_h}{\Omega} (T_0 e + A).

S is the motor loop with position gain k and speed gain d. The engine evaluates its own
actuators at the end of the step, which increases the effective rotor inertia by about
h d/2; a sampled controller acts one step late. With t = tan beta,

.. math:: S = (1 \pm j t)\,[j \Omega_h d + k (1 + j t)],

with + for the engine's actuators and - for a sampled controller. The torque on the link
is F - j m (T_0 e + A). The error is its magnitude divided by that in the limit of short
steps, minus 1. The other joints of an arm are assumed not to move; if they do, the
error changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swgjoint.joint.drive import JointDrive, input_orders
from swgjoint.joint.step_damping import left_share
from swgjoint.maps.hysteresis import sticking_stiffness

SAME = 1e-6
"""Relative difference below which two orders belong to the same line [-]."""


@dataclass(frozen=True, kw_only=True)
class LinearMotorLoop:
    """Gains of a motor control loop that feeds back angle and speed of the rotor."""

    stiffness: float = 0.0
    """Position gain [N·m/rad]."""
    damping: float = 0.0
    """Speed gain [N·m·s/rad]."""
    sampled: bool = False
    """True for a sampled controller, which uses the state before the step; False for an
    actuator of the engine."""


def step_error(
    drive: JointDrive,
    *,
    order: float,
    speed: float,
    torque: float,
    timestep: float,
    link_inertia: float | None = None,
    loop: LinearMotorLoop | None = None,
) -> float | None:
    """Relative amplitude error of a spectral line of the output torque [-].

    The error is that of the torque at positions half a step back, where the scheme
    evaluates them.

    Args:
        drive: Drive at level ``full``.
        order: Order per input turn [-], one of the drive's
            :attr:`~swgjoint.joint.drive.JointDrive.kept_orders`.
        speed: Input speed [rad/s].
        torque: Mean output torque [N·m].
        timestep: Step h of the engine under ``discrete`` [s].
        link_inertia: Link inertia about the joint [kg·m²]; that at qpos0 if None.
        loop: Control loop of the motor; a free rotor if None.

    Returns:
        Relative error, e.g. 0.01 if the line is 1 % too large. None if the level is not
        ``full``, if the drive does not have this order, if the input is at rest, if the
        phase of the line advances by half a turn or more in one step, or if the line
        has zero amplitude.
    """
    if drive.level != "full" or not speed:
        return None
    law = drive.drive
    orders = input_orders(law)
    chosen = np.abs(orders - order) <= SAME * max(order, 1.0)
    chosen[0] = False
    frequency = abs(order * speed)
    if not chosen.any() or timestep * frequency >= np.pi:
        return None
    link = drive.link_inertia if link_inertia is None else link_inertia
    motor = loop or LinearMotorLoop()
    ends = [
        abs(_line(drive, chosen, speed, torque, step, link, motor))
        for step in (0.0, timestep)
    ]
    return float(ends[1] / ends[0] - 1.0) if ends[0] > 0.0 else None


def _line(
    drive: JointDrive,
    chosen: NDArray[np.bool_],
    speed: float,
    torque: float,
    h: float,
    link: float,
    loop: LinearMotorLoop,
) -> complex:
    """Complex amplitude of the output torque at the chosen harmonics [N·m]."""
    law, ratio, rotor = drive.drive, drive.ratio, drive.rotor_inertia
    torsion = np.array([law.mean_torsion(torque)])
    k = max(float(law.coefficients(torsion, 2)[0, 0, 0]), 0.0)
    k += sticking_stiffness(drive.elements, torque)
    nu = left_share(h**2 * k * (1.0 / (ratio**2 * rotor) + 1.0 / link))
    total = 0.0 + 0.0j
    amplitudes = [
        (p[..., 0] - 1j * p[..., 1])[chosen]  # of exp(j Omega t), for a cos + b sin
        for p in (
            law.coefficients(torsion, 0)[0],
            law.coefficients(torsion, 1)[0],
            law.kinematic_error,
        )
    ]
    orders = law.angle_orders[chosen].astype(float)
    for (n, m), energy, force, error in zip(orders, *amplitudes, strict=True):
        omega = (n + m / ratio) * speed
        tangent = np.tan(0.5 * h * omega)
        seen = omega if h == 0.0 else 2.0 / h * tangent
        by_angle = torque * error + energy
        push = 1j * seen / omega * by_angle
        # the damping fraction nu acts a quarter of a step late, on the speeds alone
        z_error = k + 1j * seen * (drive.damping + nu * k * h)
        z = z_error - 0.5 * seen * nu * k * h * tangent
        at = 1.0 - 1j * tangent if loop.sampled else 1.0 + 1j * tangent
        held = 1j * seen * loop.damping + loop.stiffness * (1.0 + 1j * tangent)
        matrix = np.array(
            [
                [-rotor * seen**2 + at * held + z / ratio**2, -z / ratio],
                [-z / ratio, -link * seen**2 + z],
            ]
        )
        known = force + z_error * error
        theta, psi = np.linalg.solve(
            matrix, [-known / ratio - n * push, known - m * push]
        )
        # the torque as recorded, without the numerical damping
        twist = theta / ratio - psi
        line = force + k * (twist + error) - 1j * m * by_angle
        line += 1j * drive.damping * (seen * twist + omega * error)
        # lines of positive and negative frequency coincide
        total += line.conjugate() if omega < 0.0 else line
    return complex(total)
