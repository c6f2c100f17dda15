r"""Joint with its drive map as CasADi expressions, for optimal control.

Only the potential V is written as an expression. CasADi differentiates it, so that the
forces, their tangents and the Hessians of Newton-type solvers derive from V:

.. math:: F = -\nabla_{(\theta,\psi)} V(\Delta, \alpha, \beta) - C\,(g\cdot v)\,g

with the gradient g of the torsion :math:`\Delta` and the rates v of :math:`(\theta,
\psi)`.

Each coefficient of V is a polynomial of degree four on each torsion interval and a
parabola beyond the knots. Comparisons, whose derivative is zero, select the interval. V
is therefore twice continuously differentiable wherever the map is, and its derivatives
are those of the selected polynomial.

Hysteresis and friction have the same states as in the plugin: the torsion at which each
hysteresis element is relaxed, and the rotation of the wave generator relative to the
flexspline at which the friction bristle is relaxed. These states are the history of the
joint. :func:`joint_forces` takes them as input, and :func:`joint_history` updates them
after a step. Both functions have kinks where an element begins to slip.

:func:`smooth_forces` has neither kinks nor states. Its friction depends smoothly on the
speed; it omits the presliding of the bristle and the hysteresis, whose torque is at
most the sum of the yield torques. None of these functions includes ratcheting.

Source:
    Andersson et al. (2019), "CasADi: a software framework for nonlinear optimization
    and optimal control", Math. Prog. Comp. 11, 1-36. The law is that of
    :func:`swgjoint.joint.reference.gradient_force`.
"""

from __future__ import annotations

from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from swgjoint.errors import MissingExtraError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.typing import Array

LARGE = 20_000
"""Number of map coefficients above which expressions use matrices instead of
scalars."""
_SLIPS = 1.0 - 1e-9  # fraction of the largest stretch, as in swgjoint.maps.friction
_NO_LOAD = 1e-3  # fraction of rated torque below which the smooth law rounds |T|


def casadi() -> Any:
    """Import the CasADi module.

    Raises:
        MissingExtraError: If CasADi is not installed.
    """
    try:
        return import_module("casadi")
    except ImportError as error:
        raise MissingExtraError(
            "a symbolic joint needs casadi: pip install 'swgjoint[control]'"
        ) from error


def torsion(drive: DriveMap, theta: Any, psi: Any) -> Any:
    """Torsion theta/i + e0 - psi as a CasADi expression [rad].

    Args:
        drive: Drive map.
        theta: CasADi expression of the input angle [rad].
        psi: CasADi expression of the output angle [rad].
    """
    ca = casadi()
    cos, sin = _waves(drive, theta, psi)
    a, b = drive.kinematic_error.T
    return theta / drive.ratio + ca.dot(a, cos) + ca.dot(b, sin) - psi


def potential(drive: DriveMap, x: Any, theta: Any, psi: Any) -> Any:
    """Potential V as a CasADi expression [J].

    Args:
        drive: Drive map.
        x: CasADi expression of the torsion [rad].
        theta: CasADi expression of the input angle [rad].
        psi: CasADi expression of the output angle [rad].
    """
    ca = casadi()
    waves = ca.vertcat(*_waves(drive, theta, psi))
    origins, table = _pieces(drive)
    above = [x >= knot for knot in drive.torsion_knots]
    # 1 for the interval that contains the torsion, 0 for all others
    here = ca.vertcat(1 - above[0], *(a - b for a, b in pairwise(above)), above[-1])
    d = x - ca.dot(origins, here)
    pieces = ca.reshape(ca.mtimes(ca.DM(table), waves), 5, len(origins))
    c = ca.mtimes(pieces, here)
    return c[0] + d * (c[1] + d * (c[2] + d * (c[3] + d * c[4])))


def joint_forces(drive: DriveMap, *, damping: float) -> Any:
    """Function for all drive torques, including those that depend on the history.

    Args:
        drive: Drive map.
        damping: Damping C along the torsion [N·m·s/rad].

    Returns:
        ``forces(q, v, history) -> (force, torsion)`` with q = (theta, psi) [rad], its
        rate v [rad/s], the torques ``force`` on rotor and link [N·m] and the torsion
        [rad]. The history contains the relaxed torsions of the hysteresis elements
        [rad] and, for a drive with friction, the rotation of the wave generator
        relative to the flexspline at which the bristle is relaxed [rad].
    """
    ca = casadi()
    q, v, past = _symbols(drive)
    rests, relaxed = past[: len(drive.hysteresis)], past[len(drive.hysteresis) :]
    x, slope, elastic, force = _conservative(drive, q)
    slipping = sum(
        e.stiffness * _clip(x - rests[k], _yield_torsion(e, elastic))
        for k, e in enumerate(drive.hysteresis)
    )
    force = force - slope.T * (slipping + damping * ca.mtimes(slope, v))
    law = drive.friction
    if law is not None:
        b = ca.DM(drive.friction_direction)
        speed, turned = ca.dot(b, v), ca.dot(b, q) - relaxed[0]
        reach = _reach(drive, speed, elastic + slipping)
        onward = (ca.fabs(turned) >= _SLIPS * reach) * (turned * speed > 0)
        rubs = law.stiffness * _clip(turned, reach) + law.viscous * speed
        force = force - b * (rubs + law.damping * speed * (1 - onward))
    return ca.Function(
        "forces", [q, v, past], [force, x], ["q", "v", "history"], ["force", "torsion"]
    )


def joint_history(drive: DriveMap) -> Any:
    """Function ``history(q, v, history) -> next`` that updates the history [rad].

    Its arguments are those of the function from :func:`joint_forces`.
    """
    ca = casadi()
    q, v, past = _symbols(drive)
    x, _, elastic, _ = _conservative(drive, q)
    slipping, after = 0.0, []
    for k, e in enumerate(drive.hysteresis):
        after.append(x - _clip(x - past[k], _yield_torsion(e, elastic)))
        slipping += e.stiffness * (x - after[-1])
    if drive.friction is not None:
        b = ca.DM(drive.friction_direction)
        reach = _reach(drive, ca.dot(b, v), elastic + slipping)
        beta = ca.dot(b, q)
        after.append(beta - _clip(beta - past[-1], reach))
    return ca.Function("history", [q, v, past], [ca.vertcat(*after)])


def relaxed_history(drive: DriveMap, theta: float, psi: float) -> Array:
    """Initial history: hysteresis relaxed at zero torsion, bristle at given angles.

    Args:
        drive: Drive map.
        theta: Input angle [rad].
        psi: Output angle [rad].

    Returns:
        History for :func:`joint_forces` [rad]. Shape (n_states,).
    """
    b = np.array(drive.friction_direction, float) @ [theta, psi]
    rests = [0.0] * len(drive.hysteresis)
    return np.array(rests if drive.friction is None else [*rests, b], dtype=float)


def joint_step(
    drive: DriveMap,
    *,
    damping: float,
    rotor_inertia: float,
    link_inertia: float,
    timestep: float,
) -> Any:
    """Function for one step of the classical Runge-Kutta method, like MuJoCo's RK4.

    The history is constant during the step and is updated at its end.

    Args:
        drive: Drive map.
        damping: Damping C along the torsion [N·m·s/rad].
        rotor_inertia: Inertia of rotor and wave generator about the motor axis [kg·m²].
        link_inertia: Link inertia about the joint [kg·m²].
        timestep: Step h [s].

    Returns:
        Function ``(q, v, history, applied) -> (q, v, history)``, where ``applied`` are
        the torques applied to rotor and link [N·m].
    """
    ca = casadi()
    forces, history = joint_forces(drive, damping=damping), joint_history(drive)
    q, v, past = _symbols(drive)
    applied = type(q).sym("applied", 2)
    inertia = ca.DM([rotor_inertia, link_inertia])

    def acceleration(q: Any, v: Any) -> Any:
        return (forces(q, v, past)[0] + applied) / inertia

    h = timestep
    a1 = acceleration(q, v)
    v2 = v + 0.5 * h * a1
    a2 = acceleration(q + 0.5 * h * v, v2)
    v3 = v + 0.5 * h * a2
    a3 = acceleration(q + 0.5 * h * v2, v3)
    v4 = v + h * a3
    a4 = acceleration(q + h * v3, v4)
    q_end = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
    v_end = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return ca.Function(
        "step", [q, v, past, applied], [q_end, v_end, history(q_end, v_end, past)]
    )


def smooth_forces(drive: DriveMap, *, damping: float, creep_speed: float = 0.1) -> Any:
    """Function ``forces(q, v) -> (force, torsion)`` without kinks or history.

    The friction torque is f tanh(nu/nu_0) + eta nu, with the yield torque f, the
    viscous coefficient eta and the speed nu of the wave generator relative to the
    flexspline. Under load, a joint that would stick creeps at a fraction of nu_0.

    Args:
        drive: Drive map; its hysteresis is omitted.
        damping: Damping C along the torsion [N·m·s/rad].
        creep_speed: Speed nu_0 over which the friction torque changes sign [rad/s].
    """
    ca = casadi()
    q, v, _ = _symbols(drive)
    x, slope, elastic, force = _conservative(drive, q)
    force = force - slope.T * (damping * ca.mtimes(slope, v))
    law = drive.friction
    if law is not None:
        b = ca.DM(drive.friction_direction)
        speed = ca.dot(b, v)
        load = ca.sqrt(elastic**2 + (_NO_LOAD * drive.ratings.rated_torque) ** 2)
        slip = law.stiffness * _reach(drive, speed, load)
        force = force - b * (slip * ca.tanh(speed / creep_speed) + law.viscous * speed)
    return ca.Function("forces", [q, v], [force, x], ["q", "v"], ["force", "torsion"])


def elastic_torque(drive: DriveMap) -> Any:
    """Function ``q -> T``, the elastic torque dV/d(torsion) at fixed angles [N·m]."""
    q, _, _ = _symbols(drive)
    return casadi().Function("elastic", [q], [_conservative(drive, q)[2]])


def _symbols(drive: DriveMap) -> tuple[Any, Any, Any]:
    """Symbols of angles, rates and history; scalar expressions if the map is small."""
    ca = casadi()
    kind = ca.MX if drive.potential.size > LARGE else ca.SX
    states = len(drive.hysteresis) + (drive.friction is not None)
    return kind.sym("q", 2), kind.sym("v", 2), kind.sym("history", states)


def _conservative(drive: DriveMap, q: Any) -> tuple[Any, Any, Any, Any]:
    """Torsion, its gradient (1, 2), torque along it at fixed angles, and -dV/dq (2, 1).

    The gradient and dV/dq are those with respect to q = (theta, psi).
    """
    ca = casadi()
    x, held = torsion(drive, q[0], q[1]), type(q).sym("x")
    energy = potential(drive, held, q[0], q[1])
    along, angles = ca.substitute(
        [ca.gradient(energy, held), ca.gradient(energy, q)], [held], [x]
    )
    slope = ca.jacobian(x, q)
    return x, slope, along, -(slope.T * along + angles)


def _reach(drive: DriveMap, speed: Any, along: Any) -> Any:
    """Largest stretch of the bristle [rad] at a speed and a torque ``along``."""
    law, ca = drive.friction, casadi()
    assert law is not None
    more = (law.static - law.coulomb) * ca.exp(-((speed / law.stribeck_speed) ** 2))
    load = law.load / abs(drive.ratio) * ca.fabs(along)
    return (law.bending + law.coulomb + more + load) / law.stiffness


def _yield_torsion(element: Jenkin, elastic: Any) -> Any:
    """Torsion from rest to slip of one element [rad] at an elastic torque [N·m]."""
    if not element.yield_curve:
        return element.yield_torsion
    ca = casadi()
    at, values = np.array([(0.0, element.yield_torque), *element.yield_curve]).T
    size, total = ca.fabs(elastic), values[0]
    slopes = np.diff(values) / np.diff(at)
    for left, right, slope in zip(at, at[1:], slopes, strict=False):
        total = total + slope * (ca.fmin(ca.fmax(size, left), right) - left)
    return total / element.stiffness


def _clip(value: Any, reach: Any) -> Any:
    """Value limited to +/-reach."""
    ca = casadi()
    return ca.fmin(ca.fmax(value, -reach), reach)


def _waves(drive: DriveMap, theta: Any, psi: Any) -> tuple[Any, Any]:
    """Cosine and sine of every phase. Shapes (n_harmonics, 1)."""
    ca = casadi()
    phases = ca.mtimes(ca.DM(drive.angle_orders.astype(float)), ca.vertcat(theta, psi))
    return ca.cos(phases), ca.sin(phases)


def _pieces(drive: DriveMap) -> tuple[Array, Array]:
    """Origins (n + 2,) and coefficients (5 (n + 2), 2 n_harmonics) of all polynomials.

    Their order is: parabola below the knots, n intervals, parabola above the knots.
    """
    knots = drive.torsion_knots
    origins = np.concatenate([knots[:1], knots])
    inner = np.moveaxis(drive.potential, 2, 0)  # (n, n_harmonics, 2, 5)
    ends = []
    for knot, stiffness in zip(
        knots[[0, -1]], np.moveaxis(drive.end_stiffness, 2, 0), strict=True
    ):
        end = np.zeros((*stiffness.shape, 5))
        end[..., 0] = drive.coefficients(knot)
        end[..., 1] = drive.coefficients(knot, 1)
        end[..., 2] = 0.5 * stiffness
        ends.append(end)
    table = np.concatenate([ends[:1], inner, ends[1:]])
    return origins, table.transpose(0, 3, 2, 1).reshape(5 * len(origins), -1)
