r"""Modes of an arm in discrete time, and the damping that the integrator adds.

The motors apply only the constant torque that holds the initial pose of the scene,
because their control loops would also damp the modes. One step of the engine about that
pose is linearised in positions, velocities, actuator states and the memory of the
plugin. The eigenvalues :math:`\lambda` of the resulting matrix are :math:`e^{sh}`,
where h is the time step. Frequency and damping ratio of a mode are

.. math:: f = |s|/2\pi, \qquad \zeta = -\operatorname{Re} s/|s|.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.joint.drive import ACCELERATIONS
from swgjoint.joint.step_damping import restore_damping
from swgjoint.sim.actuators import control_inputs
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.equilibrium import set_start
from swgjoint.typing import Array, Complex

EXACT_STEP = 1e-5
"""Time step at which RK4 gives the modes of the model without numerical damping [s].
"""
LOWEST, HIGHEST = 5.0, 60.0
"""Frequency range of the modes [Hz]."""
LIGHT = 0.3
"""Damping ratio below which a mode counts as a vibration of the drives and not of a
control loop [-]."""
ALIKE = 0.7
"""Absolute scalar product of two unit mode shapes above which they match [-]."""
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
# increments of the differences: positions [rad], velocities [rad/s], other states
_CHANGE = {"q": 1e-6, "v": 1e-4, "act": 1e-6, "plugin": 1e-1}
"""Increments of the central differences, in SI units."""


def release_motors(whole: Assembly) -> Assembly:
    """Replace the motor loops of an assembly with their constant torque at the start.

    Loops with an integral or a torque-speed line are kept.
    """
    model = copy.copy(whole.model)
    data = mujoco.MjData(model)
    set_start(whole, data)
    data.ctrl[:] = control_inputs(whole)[0]
    mujoco.mj_forward(model, data)
    affine = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
    model.actuator_biasprm[affine, :3] = 0.0
    model.actuator_biasprm[affine, 0] = (data.actuator_force - data.ctrl)[affine]
    return replace(whole, model=model)


@dataclass(frozen=True, kw_only=True, eq=False)
class Modes:
    """Oscillating modes, each with a positive frequency."""

    s: Complex
    """Complex eigenvalues [1/s], shape (n,)."""
    shape: Complex
    """Mode shapes of unit length, with rotor angles referred to the output, shape
    (nq, n)."""

    def where(self, chosen: NDArray[Any]) -> Modes:
        """Select modes by mask or index."""
        return Modes(s=self.s[chosen], shape=self.shape[:, chosen])


def modes(whole: Assembly) -> Modes:
    """All oscillating modes at the time step of an assembly.

    There are none if a step results in values that are not finite.
    """
    matrix, nq = step_matrix(whole), whole.model.nq
    if not np.isfinite(matrix).all():
        return Modes(s=np.zeros(0, complex), shape=np.zeros((nq, 0), complex))
    value, vector = np.linalg.eig(matrix)
    kept = np.abs(value) > 1e-12
    value, shape = value[kept].astype(complex), vector[:nq, kept].astype(complex)
    flexible = whole.motor_position >= 0
    shape[whole.motor_position[flexible]] /= whole.ratio[flexible, None]
    shape /= np.maximum(np.linalg.norm(shape, axis=0), 1e-300)
    s = np.log(value) / float(whole.model.opt.timestep)
    return Modes(s=s, shape=shape).where(s.imag > 0.0)


def step_matrix(whole: Assembly) -> Array:
    """Linearise one step about the start by central differences, shape (n, n)."""
    model = whole.model
    data = mujoco.MjData(model)
    set_start(whole, data)
    if model.nu:
        data.ctrl[:] = control_inputs(whole)[0]
    begin = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, begin, _STATE)
    entries, sizes = _entries(whole)
    warm = data.qacc_warmstart.copy()

    def after(k: int, change: float) -> Array:
        state = begin.copy()
        state[entries[k]] += change
        mujoco.mj_setState(model, data, state, _STATE)
        data.qacc_warmstart[:] = warm
        mujoco.mj_step(model, data)
        mujoco.mj_getState(model, data, state, _STATE)
        return np.asarray(state[entries])

    columns = [
        (after(k, size) - after(k, -size)) / (2.0 * size)
        for k, size in enumerate(sizes)
    ]
    return np.column_stack(columns)


def _entries(whole: Assembly) -> tuple[NDArray[np.intp], Array]:
    """Indices of the entries of the engine's state to vary, and their increments.

    Time is excluded. The states of hysteresis and bristles are also excluded, because
    they stick in a small vibration.
    """
    model = whole.model
    flexible = whole.motor_position[whole.motor_position >= 0]
    turn = np.full(model.nq, _CHANGE["q"])
    rate = np.full(model.nv, _CHANGE["v"])
    turn[flexible] *= 100.0  # a rotor turns about 100 times as far as its link
    rate[whole.motor_velocity[whole.motor_velocity >= 0]] *= 100.0
    first = 1 + model.nq + model.nv + model.na
    remembered = [
        first + int(model.plugin_stateadr[k]) + n
        for k in range(model.nplugin)
        for n in range(ACCELERATIONS)
    ]
    entries = [*range(1, first), *remembered]
    sizes = [
        *turn,
        *rate,
        *[_CHANGE["act"]] * int(model.na),
        *[_CHANGE["plugin"]] * len(remembered),
    ]
    return np.array(entries, dtype=np.intp), np.array(sizes)


def own_modes(whole: Assembly) -> Modes:
    """Lightly damped modes without numerical damping, the lowest first.

    They are between :data:`LOWEST` and :data:`HIGHEST`, with a damping ratio below
    :data:`LIGHT`.
    """
    exact = replace(whole, model=copy.copy(whole.model))
    exact.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    exact.model.opt.timestep = EXACT_STEP
    restore_damping(exact.model, [t.attached for t in exact.transmissions])
    found = modes(exact)
    low, high = 2.0 * np.pi * LOWEST, 2.0 * np.pi * HIGHEST
    size = np.abs(found.s)
    light = -found.s.real / size < LIGHT
    found = found.where((size >= low) & (size <= high) & light)
    return found.where(np.argsort(np.abs(found.s)))


def numerical_damping(whole: Assembly) -> list[tuple[float, float, float]]:
    """Numerical damping of the modes, the lowest first.

    Each mode is compared with the mode of the closest shape at the time step of the
    scene. If no mode matches, the time step suppresses the oscillation, and the damping
    ratio at this step is one.

    Returns:
        Frequency [Hz], physical damping ratio [-] and added damping ratio [-] of each
        mode.
    """
    free = release_motors(whole)
    stepped = modes(free)
    own = own_modes(free)
    alike = np.abs(own.shape.conj().T @ stepped.shape)
    rows = []
    for k, s in enumerate(own.s):
        ratio, stepped_ratio = float(-s.real / abs(s)), 1.0
        if alike[k].max(initial=0.0) > ALIKE:
            near = stepped.s[np.argmax(alike[k])]
            stepped_ratio = float(-near.real / abs(near))
        rows.append((float(abs(s) / (2.0 * np.pi)), ratio, stepped_ratio - ratio))
    return rows
