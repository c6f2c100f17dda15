"""The rigid arm in Pinocchio: torques on a motion for feed-forward, and its inertia.

The tree is built from the compiled MuJoCo model number by number, since MuJoCo writes
MJCF with six digits; it holds hinges, one a body, and what is fixed to them.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError, MissingExtraError

Array = NDArray[np.float64]


class PinocchioArm:
    """Inverse dynamics of an arm of hinges; arrays end with its joints."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Take over tree, inertias, gravity and armature.

        Args:
            model: For instance :attr:`swgjoint.sim.rigid_arm.RigidArm.model`.

        Raises:
            InputError: If a joint is not a hinge or a body has several.
            MissingExtraError: If Pinocchio is not installed.
        """
        self._pin = _pinocchio()
        self.model: Any = _tree(self._pin, model)
        self._data = self.model.createData()

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Joint torques that the motion needs, gravity included [N·m].

        Args:
            position: [rad]. Shape (..., n_joints).
            velocity: [rad/s]. Same shape.
            acceleration: [rad/s²]. Same shape.
        """
        count = position.shape[-1]
        flat = [np.reshape(x, (-1, count)) for x in (position, velocity, acceleration)]
        out = np.empty_like(flat[0])
        rnea, model, data = self._pin.rnea, self.model, self._data
        for row, q, v, a in zip(out, *flat, strict=True):
            row[:] = rnea(model, data, q, v, a)
        return out.reshape(position.shape)

    def gravity(self, position: Array) -> Array:
        """Joint torques that carry the weight at rest [N·m]. (..., n_joints)."""
        zero = np.zeros_like(position)
        return self.torques(position, zero, zero)

    def inertia(self, position: Array) -> Array:
        """Mass matrix [kg·m²]. Shape (..., n_joints, n_joints)."""
        count = position.shape[-1]
        out = []
        for q in np.reshape(position, (-1, count)):
            upper = np.triu(self._pin.crba(self.model, self._data, q))
            out.append(upper + np.triu(upper, 1).T)
        return np.array(out).reshape(*position.shape, count)


def _tree(pin: Any, model: mujoco.MjModel) -> Any:
    """The joints and bodies of a compiled model."""
    if (model.jnt_type != mujoco.mjtJoint.mjJNT_HINGE).any():
        raise InputError("arm with joints that are no hinges; accepted: hinges alone")
    if (model.body_jntnum > 1).any():
        raise InputError("arm with two hinges on one body; accepted: one a body")
    other = pin.Model()
    other.gravity.linear = model.opt.gravity
    # joint that carries a body, and where the body's frame lies in that of the joint
    holder = {0: (0, pin.SE3.Identity())}
    for b in range(1, model.nbody):
        joint, place = holder[int(model.body_parentid[b])]
        place = place * _pose(pin, model.body_pos[b], model.body_quat[b])
        if model.body_jntnum[b]:
            j = int(model.body_jntadr[b])
            anchor = pin.SE3(np.eye(3), model.jnt_pos[j])
            hinge = pin.JointModelRevoluteUnaligned(model.jnt_axis[j])
            joint = other.addJoint(joint, hinge, place * anchor, model.joint(j).name)
            other.armature[other.joints[joint].idx_v] = model.dof_armature[j]
            place = anchor.inverse()
        holder[b] = joint, place
        inertia = pin.Inertia(
            float(model.body_mass[b]), np.zeros(3), np.diag(model.body_inertia[b])
        )
        centre = place * _pose(pin, model.body_ipos[b], model.body_iquat[b])
        other.appendBodyToJoint(joint, inertia, centre)
    return other


def _pose(pin: Any, position: Array, quaternion: Array) -> Any:
    w, x, y, z = quaternion
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), position)


def _pinocchio() -> Any:
    try:
        import pinocchio
    except ImportError:
        raise MissingExtraError(
            "the arm model of Pinocchio needs pin: pip install 'swgjoint[control]'"
        ) from None
    return pinocchio
