"""The rigid arm in Pinocchio: what a controller's feed-forward takes the arm for.

Given to :func:`swgjoint.run_scene` as ``known_arm`` it makes the torque of the
links, weight and inertia, that every plan starts from, in place of the engine's inverse
dynamics. From a compiled MuJoCo model the tree is built number by number, since MuJoCo
writes MJCF with six digits; an arm that is known to Pinocchio by a URDF, or from an
identification, comes as it is. Of its joints it has linear springs (of a MuJoCo model),
viscous damping and dry friction; damping and springs that are polynomials are refused.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from swgjoint.errors import InputError, MissingExtraError
from swgjoint.typing import Array


class PinocchioArm:
    """Inverse dynamics of an arm of hinges; arrays end with its joints.

    Attributes:
        model: The ``pinocchio.Model``.
        joints: Names of its joints, in the order of all arrays.
    """

    def __init__(self, model: Any) -> None:
        """Take over tree, inertias, gravity, armature, damping, friction and springs.

        Args:
            model: Of MuJoCo, for instance ``swgjoint.sim.arm.rigid_arm.RigidArm("ur5e")
                .model``, or of Pinocchio.

        Raises:
            InputError: If a joint is not a hinge, a body has several, or a spring or
                damper is not linear.
            MissingExtraError: If Pinocchio is not installed.
        """
        self._pin = _pinocchio()
        own = isinstance(model, mujoco.MjModel)
        self.model: Any = _tree(self._pin, model) if own else model
        self.joints: tuple[str, ...] = tuple(self.model.names)[1:]  # 0: the universe
        if self.model.nv != len(self.joints):
            raise InputError(
                "arm with joints that are no hinges; accepted: hinges alone"
            )
        self._data = self.model.createData()
        self._zero = self._pin.neutral(self.model)
        self._damping = np.array(self.model.damping)
        self._friction = (
            np.array(self.model.lowerDryFrictionLimit),
            np.array(self.model.upperDryFrictionLimit),
        )
        none = np.zeros(len(self.joints))
        self._spring = _springs(model, self.joints) if own else (none, none)

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Joint torques that the motion needs, gravity and joint losses included [N·m].

        Dry friction is that of a joint that slides; at rest it is zero.

        Args:
            position: [rad]. Shape (n, n_joints).
            velocity: [rad/s]. Same shape.
            acceleration: [rad/s²]. Same shape.
        """
        out = np.empty_like(position)
        rnea, model, data = self._pin.rnea, self.model, self._data
        for row, q, v, a in zip(out, position, velocity, acceleration, strict=True):
            row[:] = rnea(model, data, self._place(q), v, a)
        low, high = self._friction
        stiffness, centre = self._spring
        dry = np.where(velocity > 0.0, high, np.where(velocity < 0.0, low, 0.0))
        held = stiffness * (position - centre)
        return np.asarray(out + self._damping * velocity + dry + held)

    def inertia(self, position: Array) -> Array:
        """Inertia about every joint, the others locked [kg·m²]. Shape (n_joints,)."""
        full = self._pin.crba(self.model, self._data, self._place(position))
        return np.diag(full).copy()

    def _place(self, angles: Array) -> Array:
        """Configuration: joints without limits have cosine and sine there."""
        return np.asarray(self._pin.integrate(self.model, self._zero, angles))


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
            dof = other.joints[joint].idx_v
            other.armature[dof] = model.dof_armature[j]
            other.damping[dof] = model.dof_damping[j]
            other.lowerDryFrictionLimit[dof] = -model.dof_frictionloss[j]
            other.upperDryFrictionLimit[dof] = model.dof_frictionloss[j]
            place = anchor.inverse()
        holder[b] = joint, place
        inertia = pin.Inertia(
            float(model.body_mass[b]), np.zeros(3), np.diag(model.body_inertia[b])
        )
        centre = place * _pose(pin, model.body_ipos[b], model.body_iquat[b])
        other.appendBodyToJoint(joint, inertia, centre)
    return other


def _springs(model: mujoco.MjModel, joints: tuple[str, ...]) -> tuple[Array, Array]:
    """Stiffness [N·m/rad] of the joints and where their springs rest [rad]."""
    for what, higher in (
        ("spring", model.jnt_stiffnesspoly),
        ("damping", model.dof_dampingpoly),
    ):
        bent = [model.joint(k).name for k in np.flatnonzero(higher.any(axis=1))]
        if bent:
            raise InputError(
                f"arm with a {what} that is a polynomial in joint"
                f" {', '.join(bent)}; accepted: a linear one"
            )
    order = [int(model.joint(name).id) for name in joints]
    return model.jnt_stiffness[order].copy(), model.qpos_spring[order].copy()


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
