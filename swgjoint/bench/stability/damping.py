r"""Numerical damping of the torsional vibration, measured on one step of the engine.

A small linear vibration of rotor against link goes from (torsion, rate) to the next
step by a matrix of two columns, one step each. With its eigenvalue
:math:`\lambda = |\lambda| e^{j\varphi}`,

.. math:: \zeta = -\ln|\lambda| / \sqrt{\varphi^2 + \ln^2|\lambda|}

is to be read beside the damping ratio of the drive itself. Negative: the step pumps.
"""

from __future__ import annotations

from math import sqrt

import mujoco
import numpy as np

from swgjoint.bench.stability.joint import RATIO, REACH, Joint
from swgjoint.typing import Array

SMALL = 1e-5
"""Torsion of the vibration over that at full torque [-]."""


def numerical_damping(joint: Joint, sub_steps: int) -> float | None:
    """Damping ratio that the steps give to a joint that has none, None if no number.

    Args:
        joint: Without kinematic error and damping.
        sub_steps: Parts of a step.
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
        """Torsion and rate over the frequency, one step later."""
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
        # a native tendon of no length at all is left out of the engine's metric
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
