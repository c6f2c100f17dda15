r"""Friction in one step of the discrete scheme; equivalent of ``plugin/friction.cc``.

The bristle starts at the stretch :math:`z_0` and undergoes a relative rotation dx. It
sticks over the rotation a until it reaches its limit R, and then slips. For forward
motion, the stiffness :math:`\sigma`, the damping :math:`\sigma_1` and the yield torque
:math:`f = \sigma R`, its mean torque over the step is

.. math::
    \bar q = \begin{cases} \sigma (z_0 + dx/2) + \sigma_1 dx/h & dx \le a\\
        f - \sigma a^2/(2\,dx) + \sigma_1 a/h & dx > a = R - z_0, \end{cases}

which is continuous and increasing, and its work :math:`\bar q\,dx` is exact. The
predicted pair responds to a torque F with :math:`dx = d - \tfrac12 h c F`, where c is
the reduction of the relative speed per torque. With the viscous coefficient eta,
:math:`F = \bar q(dx) + \eta\,dx/h` is thus a linear or quadratic equation, which needs
no iteration.

The engine receives a torque that is linear in the true dx: offset + rate dx. Either
\|offset\| is at most :math:`\sigma|z_0|` (equal while the bristle sticks) and rate is
at least :math:`\sigma/2`, or offset is 0. In both cases the work of this torque is
never below :math:`-\sigma z_0^2/2`, whatever the other forces do in the step. The
bristle ends with at most its initial energy plus that work. The friction of a step
therefore dissipates energy or returns only stored energy, even if the prediction is
wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, sqrt

from swgjoint.maps.friction import Friction


@dataclass(frozen=True, kw_only=True)
class FrictionStep:
    """Friction torque of one step, linear in the change of the relative speed."""

    stretch: float
    """Bristle stretch z at the beginning of the step [rad]."""
    reach: float
    """Largest stretch R in this step [rad]."""
    force: float
    """Torque if the relative speed does not change in the step [N·m]."""
    metric: float
    """Torque per change of the relative speed, divided by h [N·m/rad]."""
    offset: float
    """Torque of the bristle alone at zero rotation [N·m]."""
    rate: float
    """Change of that torque per rotation [N·m/rad]."""
    predicted: float
    """Torque for the predicted rotation [N·m]."""


def friction_step(
    friction: Friction,
    *,
    stretch: float,
    yield_torque: float,
    speed: float,
    free: float,
    response: float,
    timestep: float,
) -> FrictionStep:
    """Solve the friction torque of the predicted step of a rotor-link pair.

    Args:
        friction: Parameters of the friction law.
        stretch: Bristle stretch z before the step; limited to the reach [rad].
        yield_torque: Yield torque f in this step [N·m].
        speed: Relative speed nu at the beginning of the step [rad/s].
        free: Change of nu in the step without friction [rad/s].
        response: Reduction of nu per friction torque, > 0 [rad/s per N·m].
        timestep: Step h [s].

    Returns:
        The torque as a linear function of the change of speed.
    """
    h, sigma = timestep, friction.stiffness
    reach = yield_torque / sigma
    z = min(max(stretch, -reach), reach)
    d, k = h * (speed + 0.5 * free), 0.5 * h * response
    m = 1.0 + 0.5 * response * friction.viscous
    offset, rate = sigma * z, 0.5 * sigma + friction.damping / h
    dx = (d - k * offset) / (m + k * rate)
    if abs(z + dx) > reach:
        sign = copysign(1.0, dx)
        a = reach - sign * z
        creep = friction.damping * a / h
        # m dx² - b dx - k sigma a²/2 = 0 for dx > 0
        b = sign * d - k * (yield_torque + creep)
        root = sqrt(b * b + 2.0 * m * k * sigma * a * a)
        way = 0.5 * (b + root) / m if b > 0.0 else k * sigma * a * a / (root - b)
        mean = sign * (yield_torque - 0.5 * sigma * a * a / way + creep)
        dx = sign * way
        rate = 0.5 * sigma
        offset = mean - rate * dx
        if abs(offset) > sigma * abs(z):
            offset, rate = 0.0, mean / dx
    slope = rate + friction.viscous / h
    return FrictionStep(
        stretch=z,
        reach=reach,
        force=offset + slope * h * speed,
        metric=0.5 * slope,
        offset=offset,
        rate=rate,
        predicted=offset + slope * dx,
    )


def stretch_after(friction: Friction, step: FrictionStep, rotation: float) -> float:
    """Bristle stretch z after the actual rotation of the step [rad].

    Args:
        friction: Parameters of the friction law.
        step: Linearised friction of the step.
        rotation: Actual relative rotation in the step [rad].
    """
    end = min(max(step.stretch + rotation, -step.reach), step.reach)
    work = (step.offset + step.rate * rotation) * rotation
    most = sqrt(max(0.0, step.stretch**2 + 2.0 * work / friction.stiffness))
    return min(max(end, -most), most)
