r"""Numerical damping of the torsional vibration, measured on one step of the engine.

For a small vibration of rotor against link, one step multiplies torsion and its rate by
a 2 x 2 matrix, each column of which is measured with one step. From its eigenvalue of
largest magnitude, :math:`\lambda = |\lambda| e^{j\varphi}`, follows the damping ratio

.. math:: \zeta = -\ln|\lambda| / \sqrt{\varphi^2 + \ln^2|\lambda|},

which can be compared with the damping ratio of the drive itself. If it is negative, the
integrator adds energy.
"""

from __future__ import annotations

from math import sqrt

import mujoco
import numpy as np

from swgjoint.bench.stability.joint import RATIO, REACH, Joint
from swgjoint.typing import Array

SMALL = 1e-5
"""Amplitude of the torsion relative to the torsion at full torque [-]."""


def numerical_damping(joint: Joint, sub_steps: int) -> float | None:
    """Damping ratio that the integrator adds to an undamped joint.

    Args:
        joint: Joint without kinematic error and damping.
        sub_steps: Number of equal parts of a time step.

    Returns:
        Damping ratio [-]; None if the step gives values that are not finite.
    """
    model, attached = joint.model, joint.attached
    whole = float(model.opt.timestep)
    reflected = RATIO**2 * attached.rotor_inertia
    frequency = sqrt(
        attached.stiffness * (1.0 / reflected + 1.0 / attached.link_inertia)
    )
    ratio = attached.ratio
    h = whole / sub_steps
    behind = 0.5 * h if joint.midpoint else 0.0
    data = mujoco.MjData(model)

    def after(torsion: float, speed: float) -> Array:
        """Torsion and its rate divided by the frequency [rad], one step later."""
        mujoco.mj_resetData(model, data)
        rate = np.array([ratio * speed * frequency, 0.0])
        data.qpos[joint.q] = np.array([ratio * torsion, 0.0]) + behind * rate
        data.qvel[joint.v] = rate
        mujoco.mj_step(model, data)
        v = data.qvel[joint.v]
        x = data.qpos[joint.q] - behind * v
        return np.array([x[0] / ratio - x[1], (v[0] / ratio - v[1]) / frequency])

    small = SMALL * REACH
    try:
        model.opt.timestep = h
        # both states have torsion, because the engine's metric omits a tendon of zero
        # length
        first = after(small, 0.0)
        second = after(small, small) - first
    finally:
        model.opt.timestep = whole
    matrix = np.column_stack([first, second]) / small
    if not np.isfinite(matrix).all():
        return None
    value = max(np.linalg.eigvals(matrix), key=abs)
    decay, phase = -np.log(max(abs(value), 1e-300)), np.angle(value)
    return float(decay / np.hypot(decay, phase)) if decay or phase else 0.0
