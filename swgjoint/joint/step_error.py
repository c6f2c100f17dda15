r"""Error that the step leaves in a line of the output torque, in closed form.

For small vibrations about a mean torque T0 the scheme is the equation of rotor and link
with the rate of change taken at another frequency: a line of frequency Omega moves as
if it had

.. math:: \Omega_h = \frac{2}{h} \tan\beta, \quad \beta = \frac{h\,\Omega}{2}

and its angle orders in the forces on rotor and link were larger by Omega_h/Omega. What
the step changes is how close a line is to the torsion's resonance: it moves towards it
from below. With A, T = dA/dDelta and e the complex amplitudes of potential, torque and
kinematic error of one harmonic (n, m), and those of rotor and link unknown,

.. math:: \Delta = \theta/i - \psi + e, \quad F = T + (K + j \Omega_h C)\,\Delta

    (-J\,\Omega_h^2 + S)\,\theta = -F/i - j n \frac{\Omega_h}{\Omega} (T_0 e + A),
    \quad -J_l\,\Omega_h^2\,\psi = F - j m \frac{\Omega_h}{\Omega} (T_0 e + A).

S is the loop of the motor, a stiffness k and a damping d. The engine takes its own
actuators at the end of the step, which makes the rotor heavier by about h d/2; a
sampled controller acts late by a step. With t = tan beta,

.. math:: S = (1 \pm j t)\,[j \Omega_h d + k (1 + j t)].

The torque on the link is F - j m (T_0 e + A). The error is its magnitude over that of
the limit of short steps, less 1. Other joints of an arm, which move along, change it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swgjoint.joint.drive import JointDrive, input_orders
from swgjoint.joint.step_damping import left_share

SAME = 1e-6
"""Orders that differ by less, relatively, are one line."""


@dataclass(frozen=True, kw_only=True)
class LinearMotorLoop:
    """Gains of a motor's loop on angle and speed of the rotor."""

    stiffness: float = 0.0
    """[N·m/rad]."""
    damping: float = 0.0
    """[N·m·s/rad]."""
    sampled: bool = False
    """Whether it acts on the state before the step; else the engine's actuator."""


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
    """Relative error of the amplitude of a line of the output torque.

    For positions that are read half a step back, where the scheme has them.

    Args:
        drive: At level ``full``.
        order: Of the drive, per turn of the input, one of its
            :attr:`~swgjoint.joint.drive.JointDrive.kept_orders`.
        speed: Of the input [rad/s].
        torque: Mean at the output [N·m].
        timestep: Step h of the engine [s], under ``discrete``.
        link_inertia: About the joint [kg·m²]; that at qpos0 if None.
        loop: Of the motor; a free rotor if None.

    Returns:
        0.01: the line is 1 % too large. None where the level has no harmonics, the
        order is none of the drive, the input rests, or a step turns the line by half a
        turn and more.
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
    k += sum(element.stiffness for element in drive.elements)
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
        # the share nu is taken a quarter of a step late, of the speeds alone
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
        # as it is read: without the share of damping that steps add
        twist = theta / ratio - psi
        found = force + k * (twist + error) - 1j * m * by_angle
        found += 1j * drive.damping * (seen * twist + omega * error)
        # both signs of a frequency are one line
        total += found.conjugate() if omega < 0.0 else found
    return complex(total)
