r"""Numerical damping of torsional vibrations, and its compensation for native springs.

Under ``discrete`` a native spring of tangent k gets an additional force -k h v and the
metric h² k. This is the backward rule, which damps a vibration of frequency Omega with
a damping ratio of about h Omega/2. A damper of -h k cancels the force. Let q be the
torsion, v its rate, x~ = q - h v/2, 1/w the inertia of the pair along the torsion and c
the drive's own damping. The remaining equation is

.. math:: (1/w + \tfrac34 h^2 k - \tfrac12 h c)(v^+ - v)
    = -h\,[k\,(\tilde x + \tilde x^+)/2 + c\,(v + v^+)/2],

the midpoint rule of a pair with more inertia. Its energy, including that of the added
inertia, decreases only by the work of c, for any step size with 0 <= c <= h k. The
frequency is lower than that of the pair, for a short step by a fraction of slightly
more than 3 (h Omega)²/8. If the step does not resolve the vibration, a fraction nu of
the integrator's damping remains, as at level ``full``.

Only a constant stiffness can be compensated: tendons with dead bands, whose tangent is
zero inside, keep the integrator's damping. The negative damper is valid for one step
size, one integrator and a solver that includes the metric; at a shorter step it would
feed energy into the vibration. Therefore :func:`~swgjoint.joint.attach.attach` does not
add it. Call :func:`damp_as_asked` last, when step and integrator are final; scenes do.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.joint.drive import JointDrive
from swgjoint.maps.hysteresis import sticking_stiffness

NUMERICAL_DAMPING = 0.1
"""Coefficient nu1 of the scheme of level ``full``, see
:data:`swgjoint.joint.plugin.NUMERICAL_DAMPING` [-]."""
OFF_ZERO = 1e-18
"""Rest length of a compensated spring [rad]. The engine would omit a spring of length
exactly zero from its metric; the torque of this length is below round-off."""


@dataclass(frozen=True, kw_only=True)
class StepMode:
    """Small torsional vibration of rotor against link, with no other joint moving."""

    damping_ratio: float
    """Damping ratio at the step [-]; at 1 and above there is no vibration."""
    frequency: float
    """Frequency at the step [rad/s]."""
    own_damping_ratio: float
    """Damping ratio of the drive in continuous time [-]."""
    own_frequency: float
    """Frequency of the drive in continuous time [rad/s]."""


def left_share(stiffness_step: float) -> float:
    """Fraction nu of the integrator's damping that remains, from (h Omega)² [-]."""
    return NUMERICAL_DAMPING * stiffness_step**2 / (16.0 + stiffness_step**2)


def damp_as_asked(
    spec: mujoco.MjSpec, drives: Mapping[str, JointDrive]
) -> dict[str, JointDrive]:
    """Compensate the integrator's damping of native springs, see the module.

    Call this function last, and do not change step, integrator or solver of the model
    afterwards. Drives of other levels are returned unchanged.

    Args:
        spec: Model with the drives; its step and integrator are final.
        drives: Drives that :func:`~swgjoint.joint.attach.attach_all` returned.

    Returns:
        The drives, with :attr:`~swgjoint.joint.drive.JointDrive.compensated` set.

    Raises:
        InputError: If the integrator is not ``discrete`` or the solver is PGS; the spec
            is then unchanged.
    """
    damped = dict(drives)
    native = {n: d for n, d in damped.items() if d.level in ("linear", "native")}
    if not native:
        return damped
    if not is_implicit(spec):
        integrator = mujoco.mjtIntegrator(spec.option.integrator).name
        solver = mujoco.mjtSolver(spec.option.solver).name
        raise InputError(
            f"integrator {integrator.removeprefix('mjINT_').lower()}, solver"
            f" {solver.removeprefix('mjSOL_')}: no numerical damping of native springs"
            " to compensate; accepted: discrete with Newton or CG"
        )
    h = float(spec.option.timestep)
    for name, drive in native.items():
        tendon = spec.tendon(drive.tendon)
        taken = compensation(drive, h)
        damping = np.array(tendon.damping, float)
        damping[0] = drive.damping - taken
        tendon.damping = damping
        tendon.springlength = np.full(2, OFF_ZERO)
        damped[name] = replace(drive, compensated=taken, compensated_at=h)
    return damped


def restore_damping(model: mujoco.MjModel, drives: Iterable[JointDrive]) -> None:
    """Undo :func:`damp_as_asked` in a model, e.g. for another step or integrator.

    Args:
        model: The compiled model, which is changed.
        drives: Drives of the model.
    """
    for drive in drives:
        if drive.compensated:
            model.tendon_damping[model.tendon(drive.tendon).id] = drive.damping


def is_implicit(spec: mujoco.MjSpec) -> bool:
    """Whether the engine's metric includes the springs of tendons."""
    return (
        spec.option.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE
        and spec.option.solver != mujoco.mjtSolver.mjSOL_PGS
        and not spec.option.disableflags
        & int(mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER)
    )


def compensation(drive: JointDrive, timestep: float) -> float:
    """Damping of the integrator to be removed from the main spring [N·m·s/rad].

    Args:
        drive: A drive at level ``linear`` or ``native``.
        timestep: Step h [s].
    """
    base = drive.stiffness if drive.native is None else drive.native.linear
    share = left_share(timestep**2 * base * drive.mobility)
    return timestep * base * (1.0 - share)


def step_mode(
    drive: JointDrive, *, timestep: float, torque: float = 0.0
) -> StepMode | None:
    """Damping ratio and frequency of the torsional vibration under ``discrete``.

    Args:
        drive: Drive; the link has its inertia at qpos0 and other joints are locked.
        timestep: Step h [s].
        torque: Mean torque about which the joint vibrates [N·m]; hysteresis elements
            stick.

    Returns:
        The vibration; None if the drive has no rotor or no stiffness at that torque.
    """
    if drive.rotor is None:
        return None
    h, w, c = timestep, drive.mobility, drive.damping
    sticking = sticking_stiffness(drive.elements, torque)
    if drive.level == "full":
        torsion = drive.drive.mean_torsion(torque)
        k = float(drive.drive.coefficients(np.array([torsion]), 2)[0, 0, 0])
        k = max(k, 0.0) + sticking
        nu = left_share(h**2 * k * w)
        damper, metric = c + nu * k * h, h**2 * (0.25 + 0.75 * nu) * k + 0.5 * h * c
    else:
        k, implicit = _native_slopes(drive, torque)
        k, implicit = k + sticking, implicit + sticking
        damper = c - drive.compensated + h * implicit
        metric = h**2 * implicit + h * max(c - drive.compensated, 0.0)
    own = float(np.sqrt(k * w))
    if not own:
        return None
    gain = h * w / (1.0 + metric * w)
    matrix = np.array([[1.0, h], [0.0, 1.0]]) @ np.array(
        [[1.0, 0.0], [-gain * k, 1.0 - gain * damper]]
    )
    s = -np.log(np.linalg.eigvals(matrix).astype(complex)) / h
    size = float(np.sqrt(np.abs(s[0] * s[1])))
    if not 0.0 < size < np.inf:  # the stiffness is below round-off
        return None
    return StepMode(
        damping_ratio=float(np.real(s[0] + s[1])) / (2.0 * size),
        frequency=size,
        own_damping_ratio=0.5 * c * w / own,
        own_frequency=own,
    )


def _native_slopes(drive: JointDrive, torque: float) -> tuple[float, float]:
    """Tangent stiffness at a torque, and its implicitly integrated part [N·m/rad]."""
    spring = drive.native
    if spring is None:
        return drive.stiffness, drive.stiffness
    torsion = spring.torsion(torque)
    return spring.slope(torsion), spring.implicit(torsion)
