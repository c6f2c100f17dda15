r"""What steps do to a torsional vibration, and native springs damped as asked.

Under ``discrete`` a native spring of tangent k gets a force -k h v beside its own and
the metric h² k: that is the backward rule, which damps by about h w/2 of critical. A
damper of -h k takes the force out again. With x~ = q - h v/2, 1/w the inertia of the
pair along the torsion and c the drive's own damping,

.. math:: (1/w + \tfrac34 h^2 k - \tfrac12 h c)(v^+ - v)
    = -h\,[k\,(\tilde x + \tilde x^+)/2 + c\,(v + v^+)/2]

is left, the midpoint rule of a pair with more inertia. Its energy, that inertia
included, falls by the work of c alone at any step, as 0 <= c <= h k. The frequency is
lower than that of the pair, by 3 (h Omega)²/8 and a bit for a short step. Where the
step does not resolve the vibration, a share nu of the integrator's damping stays, the
one that level ``full`` has, too.

Only what is constant can be taken out: of tendons with dead bands, whose tangent is 0
inside, the integrator's damping stays. The negative damper belongs to one step, one
integrator and a solver that has the metric: at a shorter step it would give energy. So
:func:`~swgjoint.joint.attach.attach` leaves it out, and :func:`damp_as_asked` is called
last, when step and integrator are final. Scenes do that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.joint.drive import JointDrive

NUMERICAL_DAMPING = 0.1
"""nu1 of the scheme of level ``full``, see :mod:`swgjoint.joint.reference` [-]."""
OFF_ZERO = 1e-18
"""Rest length of a compensated spring [rad]: a length of exactly 0 would leave the
engine's metric, and no torque that a number could show comes of it."""


@dataclass(frozen=True, kw_only=True)
class StepMode:
    """Small torsional vibration of rotor against link, both else free."""

    damping_ratio: float
    """That results at the step [-]; 1 and more: no vibration."""
    frequency: float
    """That results at the step [rad/s]."""
    own_damping_ratio: float
    """Own damping ratio of the drive itself, without steps [-]."""
    own_frequency: float
    """Own frequency of the drive itself [rad/s]."""


def left_share(stiffness_step: float) -> float:
    """Share nu of the integrator's damping that is kept, by (h w)² [-]."""
    return NUMERICAL_DAMPING * stiffness_step**2 / (16.0 + stiffness_step**2)


def damp_as_asked(
    spec: mujoco.MjSpec, drives: Mapping[str, JointDrive]
) -> dict[str, JointDrive]:
    """Take the integrator's own damping out of native springs, see the module.

    Call it last: change neither step nor integrator nor solver of the model after it.
    Other levels are returned as they are.

    Args:
        spec: Model with the drives, its step and its integrator final.
        drives: What :func:`~swgjoint.joint.attach.attach_all` returned.

    Returns:
        The drives, with :attr:`~swgjoint.joint.drive.JointDrive.compensated`.

    Raises:
        InputError: If the integrator is not ``discrete`` or the solver is PGS; the spec
            is then unchanged.
    """
    found = dict(drives)
    native = {n: d for n, d in found.items() if d.level in ("linear", "native")}
    if not native:
        return found
    if not is_implicit(spec):
        integrator = mujoco.mjtIntegrator(spec.option.integrator).name
        solver = mujoco.mjtSolver(spec.option.solver).name
        raise InputError(
            f"integrator {integrator.removeprefix('mjINT_').lower()}, solver"
            f" {solver.removeprefix('mjSOL_')}: its steps do not damp native springs;"
            " accepted: discrete with Newton or CG"
        )
    h = float(spec.option.timestep)
    for name, drive in native.items():
        tendon = spec.tendon(drive.tendon)
        taken = compensation(drive, h)
        damping = np.array(tendon.damping, float)
        damping[0] = drive.damping - taken
        tendon.damping = damping
        tendon.springlength = np.full(2, OFF_ZERO)
        found[name] = replace(drive, compensated=taken, compensated_at=h)
    return found


def restore_damping(model: mujoco.MjModel, drives: Iterable[JointDrive]) -> None:
    """Undo :func:`damp_as_asked` in a model, e.g. for another step or integrator.

    Args:
        model: The compiled model, which is changed.
        drives: Its drives.
    """
    for drive in drives:
        if drive.compensated:
            model.tendon_damping[model.tendon(drive.tendon).id] = drive.damping


def is_implicit(spec: mujoco.MjSpec) -> bool:
    """Whether the engine's metric has the springs of tendons."""
    return (
        spec.option.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE
        and spec.option.solver != mujoco.mjtSolver.mjSOL_PGS
        and not spec.option.disableflags
        & int(mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER)
    )


def compensation(drive: JointDrive, timestep: float) -> float:
    """Damping that is taken out of the base spring at a step [N·m·s/rad].

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
    """Damping ratio and frequency of the torsion at a step under ``discrete``.

    Args:
        drive: With the inertia of its link at qpos0, the other joints held.
        timestep: Step h [s].
        torque: About which the joint vibrates [N·m]; hysteresis sticks.

    Returns:
        None without a rotor.
    """
    if drive.rotor is None:
        return None
    h, w, c = timestep, drive.mobility, drive.damping
    sticking = sum(element.stiffness for element in drive.elements)
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
    if not 0.0 < size < np.inf:  # too soft to vibrate in numbers
        return None
    return StepMode(
        damping_ratio=float(np.real(s[0] + s[1])) / (2.0 * size),
        frequency=size,
        own_damping_ratio=0.5 * c * w / own,
        own_frequency=own,
    )


def _native_slopes(drive: JointDrive, torque: float) -> tuple[float, float]:
    """Tangent of the spring at a torque, and the part of it that is implicit."""
    spring = drive.native
    if spring is None:
        return drive.stiffness, drive.stiffness
    torsion = spring.torsion(torque)
    return spring.slope(torsion), spring.implicit(torsion)
