r"""Lowest natural frequency of an arm on its drives while the motors are held.

With the inertia matrix M of the arm at a pose and the stiffness K of its drives, the
frequencies solve :math:`K v = \omega^2 M v`. The rotors do not move.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

POSES = 20
"""Smallest number of poses of a motion, if it has as many samples."""
LOCKED = ("rigid", "kinematic")
"""Levels of a joint without compliance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class InertiaFactors:
    """Inertia of an arm at several poses, reduced to its compliant joints."""

    inverse: Array
    """Inverse of the Cholesky factor of the inertia matrix [(kg·m²)^(-1/2)]. Shape
    (n_poses, n_compliant, n_compliant)."""

    def lowest(self, stiffness: Array) -> tuple[float, Array]:
        """Lowest natural frequency of all poses, and its mode.

        Args:
            stiffness: Stiffness of the compliant joints [N·m/rad].

        Returns:
            Frequency [Hz], and the share of each of these joints in the elastic energy.
        """
        scaled = self.inverse * stiffness @ self.inverse.transpose(0, 2, 1)
        values, vectors = np.linalg.eigh(scaled)
        pose = int(values[:, 0].argmin())
        mode = self.inverse[pose].T @ vectors[pose, :, 0]
        energy = stiffness * mode**2
        return float(np.sqrt(values[pose, 0]) / (2.0 * pi)), energy / energy.sum()


def inertia_factors(arm: RigidArm, position: Array, compliant: Array) -> InertiaFactors:
    """Inertia of an arm with its payload at some poses of a motion.

    Args:
        arm: The arm.
        position: Joint angles of the motion [rad]. Shape (n, n_joints).
        compliant: Which joints are compliant; the others are locked. Shape (n_joints,).
    """
    model, data = arm.model, mujoco.MjData(arm.model)
    full, found = np.zeros((model.nv, model.nv)), []
    for q in position[:: max(1, len(position) // POSES)]:
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        own = full[np.ix_(compliant, compliant)]
        found.append(np.linalg.inv(np.linalg.cholesky(own)))
    return InertiaFactors(inverse=np.array(found))


def lowest_resonance(run: Run) -> tuple[float, dict[str, float]] | None:
    """Lowest natural frequency of the arm on the motion of a run.

    Args:
        run: The run.

    Returns:
        Frequency [Hz] with the mean stiffness of the drives, and the share of each
        compliant joint in the elastic energy of its mode; None if no joint is
        compliant.
    """
    transmissions = run.assembly.transmissions
    soft = np.array([t.level not in LOCKED for t in transmissions])
    if not soft.any():
        return None
    factors = inertia_factors(run.assembly.arm, run.assembly.trajectory.position, soft)
    stiffness = np.array([t.drive.mean_stiffness for t in transmissions])[soft]
    frequency, shares = factors.lowest(stiffness)
    names = [t.joint for t, own in zip(transmissions, soft, strict=True) if own]
    return frequency, dict(zip(names, shares.tolist(), strict=True))
