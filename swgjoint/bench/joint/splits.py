r"""Two implicit-explicit splits, for comparison with the scheme of the joint.

In the ``plain split``, the ``discrete`` integrator treats a native tendon of stiffness
:math:`K_0` between rotor and link implicitly. The rest of the drive is an explicit
force. The ``corrected split`` also removes the integrator's own term
:math:`-h K_0\,\dot l` along the tendon of length l and adds
:math:`-\mu h K_0\,\dot\Delta` along the gradient of the torsion, with
:math:`\mu = 0.2`.

The force is computed in Python through ``mjcb_passive``, which is global and slow. Only
this benchmark uses it, and the cost of the splits is not compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import mujoco
import numpy as np

from swgjoint.joint.step_damping import restore_damping
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.accuracy import Setting, assemble_setting
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.scene.scene import Scene

SPLITS = {"plain split": None, "corrected split": 0.2}
"""Coefficient mu of each split [-]; None for no correction."""


@contextmanager
def split(
    scene: Scene, setting: Setting, drives: Mapping[str, DriveMap]
) -> Iterator[Assembly]:
    """Assemble a scene at level ``full`` with a split, for the duration of the context.

    Args:
        scene: Scene whose drives have neither hysteresis nor friction.
        setting: Setting whose integrator names the split.
        drives: Maps by drive reference.

    Yields:
        The compiled scene.
    """
    full, linear = (
        assemble_setting(
            scene,
            Setting(level=level, integrator="discrete", step=setting.step),
            drives,
        )
        for level in ("full", "linear")
    )
    # the forces come from the map of level full, the tendons from level linear
    whole = replace(
        linear,
        transmissions=tuple(
            replace(t, attached=replace(t.attached, plugin=None))
            for t in full.transmissions
        ),
    )
    # a split keeps the integrator's own damping of its tendon
    restore_damping(whole.model, [t.attached for t in linear.transmissions])
    joints = []
    for j, t in enumerate(linear.transmissions):
        tendon = whole.model.tendon(t.attached.tendon).id
        law = full.transmissions[j].attached.drive
        # a split needs a tendon of at least half the largest stiffness to be stable
        stiffness = max(t.attached.stiffness, 0.5 * law.max_stiffness)
        whole.model.tendon_stiffness[tendon] = stiffness
        joints.append((j, law, stiffness))
    mu = SPLITS[setting.integrator]

    def rest(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if model.nq != whole.model.nq:
            return  # the rigid arm, which only provides the torques of the motion
        discrete = model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE
        h = float(model.opt.timestep) if discrete and mu is not None else 0.0
        for j, law, k in joints:
            rotor, link = whole.motor_velocity[j], whole.link_velocity[j]
            theta = float(data.qpos[whole.motor_position[j]])
            psi = float(data.qpos[whole.link_position[j]])
            along = np.array([1.0 / law.ratio, -1.0])
            rate = np.array([data.qvel[rotor], data.qvel[link]])
            length = along @ np.array([theta, psi]) + h * (along @ rate)
            force = np.array(law.forces(theta, psi)) + k * length * along
            if h:
                _, by_theta, by_psi = law.error_at(law.phases(theta, psi))
                gradient = along + np.array([float(by_theta), float(by_psi)])
                force -= (mu or 0.0) * h * k * (gradient @ rate) * gradient
            data.qfrc_passive[rotor] += force[0]
            data.qfrc_passive[link] += force[1]

    mujoco.set_mjcb_passive(rest)
    try:
        yield whole
    finally:
        mujoco.set_mjcb_passive(None)
