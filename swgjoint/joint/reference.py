r"""The law of the engine plugin in numpy, an independent implementation for the tests.

The law has two modes. Both act on the positions q = (theta, psi) and speeds v of rotor
and link, with :math:`g = (\partial_\theta\Delta, \partial_\psi\Delta)`.

*Gradient* (all integrators except ``discrete``): the force is
:math:`-\nabla V - C\,(g\cdot v)\,g`.

*Scheme* (``discrete``, step h): with :math:`\tilde x = q - h v/2` the engine's step is
a midpoint rule in :math:`(\tilde x, v)`. The force is minus the discrete gradient of V
from :math:`\tilde x` to :math:`\tilde x + h\,\bar v`,

.. math::
    V^+ - V = L\,(\Delta^+ - \Delta) + e\cdot(\tilde x^+ - \tilde x),

split symmetrically: L is the secant of V by the torsion with every harmonic at the mean
of its two end values, e is the secant by the angles with every coefficient at the mean
of its two end values, and g is the secant of the torsion. The scheme predicts the step
of the pair. The rest of the force, which is linear in the velocity step, is passed to
the engine as the metric :math:`M + h^2 p\,g g^T`.

Hysteresis adds its mean torque over the step to L and the rate of that torque to the
slope of L, which enters p; see :mod:`swgjoint.joint.hysteresis_step`.

Friction acts along beta, the rotation of the wave generator relative to the flexspline,
with b its gradient and its own metric :math:`h^2 p_b\,b b^T`; see
:mod:`swgjoint.joint.friction_step`.

Source:
    Gonzalez (1996), "Time integration and discrete Hamiltonian systems", J. Nonlinear
    Sci. 6, for discrete gradients; prediction and metric were derived for this scheme.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from swgjoint.joint.friction_step import FrictionStep, friction_step, stretch_after
from swgjoint.joint.hysteresis_step import (
    ElementStep,
    element_steps,
    move_rests,
    rests_after,
    yield_torsions,
)
from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class TwinMotion:
    """State of one rotor-link pair before a step; angles in rad and rates in rad/s."""

    theta: float
    psi: float
    theta_rate: float
    psi_rate: float
    rotor_weight: float = 0.0
    """Diagonal element of the rotor dof in the inverse mass matrix, see
    :mod:`swgjoint.joint.response`; ``link_weight`` likewise [1/(kg·m²)]."""
    link_weight: float = 0.0
    rotor_acceleration: float = 0.0
    """Rotor acceleration by all other forces in the last step, a plugin state like
    ``link_acceleration`` [rad/s²]."""
    link_acceleration: float = 0.0
    rest: tuple[float, ...] = ()
    """Torsion at which each hysteresis element is relaxed [rad]."""
    limit: tuple[float, ...] = ()
    """Yield torsion of each hysteresis element in the last step [rad]; empty if there
    was none."""
    relaxed: float | None = None
    """Angle beta at which the friction bristle is relaxed [rad]; None: at the current
    state."""


@dataclass(frozen=True, kw_only=True)
class SchemeForce:
    """Force and metric that the scheme passes to the engine for one step."""

    theta: float
    """Torque on the rotor before the metric acts, ``psi``: on the link [N·m]."""
    psi: float
    g_theta: float
    g_psi: float
    """Secants g of the torsion by theta and by psi [-]."""
    along: float
    """Torque along g, subtracted from the other torques [N·m]."""
    metric: float
    """Stiffness p of the rank-one metric [N·m/rad]."""
    e_theta: float
    e_psi: float
    """Secants of V by theta and by psi at fixed torsion [N·m]."""
    elements: tuple[ElementStep, ...] = ()
    """Hysteresis elements; their torques are part of ``along`` and ``metric``."""
    friction: FrictionStep | None = None
    """Friction along beta; ``theta`` and ``psi`` include its torque, but ``metric``
    excludes its metric."""

    @property
    def reach(self) -> tuple[float, ...]:
        """Yield torsion of each hysteresis element in this step [rad]."""
        return tuple(element.reach for element in self.elements)


@dataclass(frozen=True, kw_only=True)
class _Secant:
    """Direction g, mean torque, its slope, tangents at both ends, and e, as above."""

    g: Array
    torque: float
    slope: float
    k0: float
    k1: float
    e: Array


def gradient_force(
    drive: DriveMap, motion: TwinMotion, *, damping: float
) -> tuple[float, float]:
    """Torques on rotor and link: -grad V, damping, hysteresis and friction [N·m].

    Args:
        drive: The map.
        motion: State of the pair.
        damping: Damping of the torsion [N·m·s/rad].
    """
    theta, psi = drive.forces(motion.theta, motion.psi)
    _, e_theta, e_psi = drive.error_at(drive.phases(motion.theta, motion.psi))
    g_theta, g_psi = 1.0 / drive.ratio + float(e_theta), -1.0 + float(e_psi)
    friction = damping * (g_theta * motion.theta_rate + g_psi * motion.psi_rate)
    torsion = float(drive.torsion(motion.theta, motion.psi))
    elastic = float(drive.torque(torsion, motion.theta, motion.psi))
    reach = yield_torsions(drive.hysteresis, elastic)
    elements = element_steps(drive.hysteresis, motion.rest, reach, torsion)
    slipping = sum(element.mean for element in elements)
    friction += slipping
    on_theta, on_psi = float(theta) - friction * g_theta, float(psi) - friction * g_psi
    if drive.friction is not None:
        law, b = drive.friction, np.array(drive.friction_direction, float)
        speed = float(b @ [motion.theta_rate, motion.psi_rate])
        beta = float(b @ [motion.theta, motion.psi])
        turned = 0.0 if motion.relaxed is None else beta - motion.relaxed
        rubs = law.torque(turned, speed, (elastic + slipping) / drive.ratio)
        on_theta, on_psi = on_theta - b[0] * rubs, on_psi - b[1] * rubs
    return on_theta, on_psi


def scheme_force(
    drive: DriveMap,
    motion: TwinMotion,
    *,
    timestep: float,
    damping: float,
    numerical_damping: float = 0.1,
    passes: int = 2,
) -> SchemeForce:
    """Force and metric of one discrete step.

    Args:
        drive: The map.
        motion: State of the pair at the beginning of the step.
        timestep: Step h [s].
        damping: Damping C, torque per torsion rate [N·m·s/rad]. While a contact or a
            limit acts, the caller has to pass at least the drive's ``contact_damping``.
        numerical_damping: Coefficient nu1 of the scheme [-].
        passes: Number of evaluations of the map.
    """
    h = timestep
    v = np.array([motion.theta_rate, motion.psi_rate])
    weight = np.array([motion.rotor_weight, motion.link_weight])
    other = np.array([motion.rotor_acceleration, motion.link_acceleration])
    x = np.array([motion.theta, motion.psi]) - 0.5 * h * v
    start = float(drive.torsion(*x))
    rest = move_rests(motion.rest, motion.limit, start)
    b = np.array(drive.friction_direction, float)
    beta, speed = float(b @ x), float(b @ v)
    rubs: FrictionStep | None = None
    dv: Array = np.zeros(2)
    for _ in range(passes):
        dx = h * (v + 0.5 * dv)
        s = _secant(drive, x, dx)
        reach = yield_torsions(drive.hysteresis, s.torque)
        change = float(s.g @ dx)
        elements = element_steps(drive.hysteresis, rest, reach, start, change)
        sticking = sum(element.part * element.stiffness for element in elements)
        s = replace(
            s,
            torque=s.torque + sum(element.mean for element in elements),
            slope=s.slope + sum(element.rate for element in elements),
            k0=s.k0 + sticking,
            k1=s.k1 + sticking,
        )
        k = max(0.0, 0.5 * (s.k0 + s.k1))
        w = float(np.sum(weight * s.g**2))
        ka = h**2 * k * w
        nu = numerical_damping * ka**2 / (16.0 + ka**2)
        lam = s.torque + (nu * k * h + damping) * float(s.g @ v)
        lam -= 0.5 * h * s.slope * float(s.g @ dv)
        p = 0.5 * s.slope + 0.75 * nu * k + 0.5 * damping / h
        # (M + h² p g g') dv = h (M other - lam g - e), M diagonal
        free = h * (other - weight * (lam * s.g + s.e))
        metric = np.eye(2) + h**2 * p * np.outer(weight * s.g, s.g)
        middle = speed + 0.5 * float(b @ dv)
        dv = np.asarray(np.linalg.solve(metric, free), float)
        if drive.friction is not None:
            answer = h * np.linalg.solve(metric, weight * b)
            rubs = friction_step(
                drive.friction,
                stretch=0.0 if motion.relaxed is None else beta - motion.relaxed,
                yield_torque=float(
                    drive.friction.yield_torque(middle, s.torque / drive.ratio)
                ),
                speed=speed,
                free=float(b @ dv),
                response=float(b @ answer),
                timestep=h,
            )
            dv = dv - answer * rubs.predicted
    p = max(p, 1e-9)
    force = -lam * s.g - s.e
    if rubs is not None:
        force = force - rubs.force * b
    return SchemeForce(
        theta=float(force[0]),
        psi=float(force[1]),
        g_theta=float(s.g[0]),
        g_psi=float(s.g[1]),
        along=lam,
        metric=p,
        e_theta=float(s.e[0]),
        e_psi=float(s.e[1]),
        elements=elements,
        friction=rubs,
    )


def metric_of(drive: DriveMap, force: SchemeForce, *, timestep: float) -> Array:
    """Inertia that the step adds to the pair, h² (p g g' + p_b b b') [kg·m²].

    Args:
        drive: The map.
        force: Linearised force of the step.
        timestep: Step h [s].

    Returns:
        Matrix in the order rotor, link. Shape (2, 2).
    """
    g = np.array([force.g_theta, force.g_psi])
    metric = force.metric * np.outer(g, g)
    if force.friction is not None:
        b = np.array(drive.friction_direction, float)
        metric = metric + force.friction.metric * np.outer(b, b)
    return np.asarray(timestep**2 * metric)


def other_acceleration(
    drive: DriveMap,
    motion: TwinMotion,
    force: SchemeForce,
    *,
    timestep: float,
    theta_rate: float,
    psi_rate: float,
) -> tuple[float, float]:
    """Plugin state after a step: accelerations by all other forces [rad/s²].

    Args:
        drive: The map.
        motion: State of the pair at the beginning of the step.
        force: Linearised force of the step.
        timestep: Step h [s].
        theta_rate: Rotor speed at the end of the step [rad/s].
        psi_rate: Link speed at the end of the step [rad/s].

    Returns:
        Accelerations of rotor and link [rad/s²].
    """
    dm, dl = theta_rate - motion.theta_rate, psi_rate - motion.psi_rate
    along = force.along + timestep * force.metric * (
        force.g_theta * dm + force.g_psi * dl
    )
    on_theta = force.g_theta * along + force.e_theta
    on_psi = force.g_psi * along + force.e_psi
    if force.friction is not None:
        b = drive.friction_direction
        step = force.friction
        rubs = step.force + timestep * step.metric * (b[0] * dm + b[1] * dl)
        on_theta, on_psi = on_theta + b[0] * rubs, on_psi + b[1] * rubs
    return (
        dm / timestep + motion.rotor_weight * on_theta,
        dl / timestep + motion.link_weight * on_psi,
    )


def rest_after(
    drive: DriveMap,
    motion: TwinMotion,
    force: SchemeForce,
    *,
    timestep: float,
    theta_rate: float,
    psi_rate: float,
) -> tuple[float, ...]:
    """Plugin state after a step: torsion at which each element is relaxed [rad].

    Args:
        drive: The map.
        motion: State of the pair at the beginning of the step.
        force: Linearised force of the step.
        timestep: Step h [s].
        theta_rate: Rotor speed at the end of the step [rad/s].
        psi_rate: Link speed at the end of the step [rad/s].
    """
    half, v = 0.5 * timestep, (motion.theta_rate, motion.psi_rate)
    torsion = drive.torsion(motion.theta - half * v[0], motion.psi - half * v[1])
    change = half * force.g_theta * (v[0] + theta_rate)
    change += half * force.g_psi * (v[1] + psi_rate)
    rest = move_rests(motion.rest, motion.limit, float(torsion))
    return rests_after(force.elements, rest, float(torsion), change)


def relax_state(
    drive: DriveMap,
    motion: TwinMotion,
    force: SchemeForce,
    *,
    timestep: float,
    theta_rate: float,
    psi_rate: float,
) -> float:
    """Plugin state after a step: beta at which the bristle is relaxed [rad].

    Args:
        drive: The map.
        motion: State of the pair at the beginning of the step.
        force: Linearised force of the step.
        timestep: Step h [s].
        theta_rate: Rotor speed at the end of the step [rad/s].
        psi_rate: Link speed at the end of the step [rad/s].
    """
    assert drive.friction is not None and force.friction is not None
    b = np.array(drive.friction_direction, float)
    v = np.array([motion.theta_rate, motion.psi_rate])
    turned = 0.5 * timestep * float(b @ (v + np.array([theta_rate, psi_rate])))
    beta = float(b @ [motion.theta, motion.psi]) - 0.5 * timestep * float(b @ v)
    end = stretch_after(drive.friction, force.friction, turned)
    return beta + turned - end


def _secant(drive: DriveMap, x: Array, dx: Array) -> _Secant:
    """Discrete gradient of V from x to x + dx, x = (theta, psi)."""
    n = drive.angle_orders.astype(float)  # (n_harmonics, 2)
    start, end = n @ x, n @ (x + dx)
    middle, eta = n @ (x + 0.5 * dx), 0.5 * (n @ dx)
    sinc = np.sinc(eta / np.pi)[:, None]
    d_cos, d_sin = (
        -np.sin(middle)[:, None] * sinc * n,
        np.cos(middle)[:, None] * sinc * n,
    )
    a, b = drive.kinematic_error.T
    g = np.array([1.0 / drive.ratio, -1.0]) + a @ d_cos + b @ d_sin
    mean_cos = 0.5 * (np.cos(start) + np.cos(end))
    mean_sin = 0.5 * (np.sin(start) + np.sin(end))

    def along(torsion: float, derivative: int) -> float:
        ab = drive.coefficients(torsion, derivative)
        return float(ab[:, 0] @ mean_cos + ab[:, 1] @ mean_sin)

    s0 = float(drive.torsion(*x))
    ds = float(g @ dx)
    s1 = s0 + ds
    t0, t1, k0, k1 = along(s0, 1), along(s1, 1), along(s0, 2), along(s1, 2)
    if s0 == s1:
        torque, slope = 0.5 * (t0 + t1), 0.5 * k1
    else:
        # the torque is cubic between knots, so Simpson's rule is exact on each piece
        inner = [t for t in drive.torsion_knots if min(s0, s1) < t < max(s0, s1)]
        points = np.array([s0, *(inner if s1 > s0 else inner[::-1]), s1])
        work = sum(
            (q - p) / 6.0 * (along(p, 1) + 4.0 * along(0.5 * (p + q), 1) + along(q, 1))
            for p, q in pairwise(points)
        )
        torque = work / (s1 - s0)
        slope = (t1 - torque) / (s1 - s0)
    slope = float(np.clip(slope, 0.5 * min(k0, k1), 0.5 * max(k0, k1)))
    ab = 0.5 * (drive.coefficients(s0) + drive.coefficients(s1))
    return _Secant(
        g=g,
        torque=torque,
        slope=slope,
        k0=k0,
        k1=k1,
        e=ab[:, 0] @ d_cos + ab[:, 1] @ d_sin,
    )
