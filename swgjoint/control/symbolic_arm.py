r"""Dynamics of a tree of hinges as CasADi expressions, with parameters of an MjModel.

The recursive Newton-Euler algorithm in the world frame computes the motion of every
body from the base outwards, and then the joint torques from the tips inwards,

.. math::
    \tau_j = z_j \cdot \sum_{b \succeq j} \left[ I_b\dot\omega_b
        + \omega_b \times I_b\omega_b + (c_b - p_j) \times m_b (\ddot c_b - g) \right]
        + a_j\,\ddot q_j,

where :math:`z_j`, :math:`p_j` and :math:`a_j` are axis, anchor and armature of joint j,
the sum is over all bodies b that the joint moves, and :math:`m_b`, :math:`c_b`,
:math:`I_b` and :math:`\omega_b` are mass, centre of mass, inertia tensor and angular
velocity of a body. Rotors of attached drives are ordinary bodies of the tree. Joint
damping is included. Contacts, joint limits, friction loss, springs and tendons are
omitted; the symbolic law replaces the tendons of the drives.

Source:
    Luh, Walker, Paul (1980), "On-line computational scheme for mechanical
    manipulators", J. Dyn. Sys. Meas. Control 102, 69-76.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.control.symbolic import casadi, elastic_torque, smooth_forces
from swgjoint.errors import InputError
from swgjoint.joint.drive import JointDrive

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)


@dataclass(frozen=True, kw_only=True, eq=False)
class SymbolicArm:
    """CasADi functions of an arm with drives.

    Angles q [rad], speeds v [rad/s] and accelerations a [rad/s²] are in the order of
    the model.
    """

    inverse_dynamics: Any
    """``(q, v, a) -> tau``: torques [N·m] that inertia, gyroscopic effects, weight and
    joint damping require."""
    drive_forces: Any
    """``(q, v) -> (tau, torsion)``: torques of all drives on the joints of the model
    [N·m] and torsions [rad], without kinks or history."""
    elastic: Any
    """``q -> T``: elastic torques along the torsions [N·m]."""
    rotors: NDArray[np.intp]
    """Indices of the rotors in q. Shape (n_joints,)."""
    links: NDArray[np.intp]
    """Indices of the links in q. Shape (n_joints,)."""

    @property
    def forward_dynamics(self) -> Any:
        """Function ``(q, v, motor_torque) -> a`` of the arm with drives [rad/s²]."""
        ca = casadi()
        n = self.inverse_dynamics.size1_in(0)
        q, v, motor = (
            ca.SX.sym("q", n),
            ca.SX.sym("v", n),
            ca.SX.sym("u", len(self.links)),
        )
        inertia = inertia_of(self.inverse_dynamics)(q)
        force, _ = self.drive_forces(q, v)
        force[self.rotors.tolist()] += motor
        a = ca.solve(inertia, force - self.inverse_dynamics(q, v, ca.SX(n, 1)))
        return ca.Function("forward_dynamics", [q, v, motor], [a])


def symbolic_arm(
    model: mujoco.MjModel, drives: Sequence[JointDrive], *, creep_speed: float = 0.1
) -> SymbolicArm:
    """Build the CasADi functions of an arm with drives of level ``full``.

    Args:
        model: Compiled model with hinge joints only.
        drives: Drives that :func:`~swgjoint.joint.attach.attach` returned.
        creep_speed: Speed nu_0 of the friction law, see
            :func:`~swgjoint.control.symbolic.smooth_forces` [rad/s].

    Raises:
        InputError: If a joint is not a hinge, or if the level of a drive is not
            ``full``.
    """
    ca = casadi()
    for drive in drives:
        if drive.level != "full":
            raise InputError(
                f"joint {drive.joint!r} is {drive.level}; accepted in a symbolic arm:"
                " full"
            )
    rotors = [int(model.joint(d.rotor).dofadr[0]) for d in drives]
    links = [int(model.joint(d.joint).dofadr[0]) for d in drives]
    q, v = ca.SX.sym("q", model.nv), ca.SX.sym("v", model.nv)
    torque, torsions, elastic = ca.SX(model.nv, 1), [], []
    for drive, r, k in zip(drives, rotors, links, strict=True):
        law = smooth_forces(drive.drive, damping=drive.damping, creep_speed=creep_speed)
        force, torsion = law(q[[r, k]], v[[r, k]])
        torque[r] += force[0]
        torque[k] += force[1]
        torsions.append(torsion)
        elastic.append(elastic_torque(drive.drive)(q[[r, k]]))
    return SymbolicArm(
        inverse_dynamics=inverse_dynamics(model),
        drive_forces=ca.Function("drives", [q, v], [torque, ca.vertcat(*torsions)]),
        elastic=ca.Function("elastic", [q], [ca.vertcat(*elastic)]),
        rotors=np.array(rotors, dtype=np.intp),
        links=np.array(links, dtype=np.intp),
    )


def inverse_dynamics(model: mujoco.MjModel) -> Any:
    """Function ``(q, v, a) -> tau`` for a tree of hinges without its drives [N·m].

    Raises:
        InputError: If a joint is not a hinge.
    """
    ca = casadi()
    for j in range(model.njnt):
        if model.jnt_type[j] != _HINGE:
            raise InputError(
                f"joint {model.joint(j).name!r} is not a hinge; accepted in a symbolic"
                " arm: hinges only"
            )
    n = model.nv
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    bodies = [_Body.world(ca)]
    axes, anchors = [], []
    for b in range(1, model.nbody):
        body = bodies[model.body_parentid[b]].carried(
            model.body_pos[b], ca.DM(_matrix(model.body_quat[b]))
        )
        first = int(model.body_jntadr[b])
        for j in range(first, first + int(model.body_jntnum[b])):
            turn = q[j] - model.qpos0[j]
            body, axis, anchor = body.turned(
                model.jnt_axis[j], model.jnt_pos[j], turn, v[j], a[j]
            )
            axes.append(axis)
            anchors.append(anchor)
        bodies.append(body)
    tau = ca.DM(model.dof_damping) * v + ca.DM(model.dof_armature) * a
    force = [ca.SX(3, 1) for _ in bodies]
    moment = [ca.SX(3, 1) for _ in bodies]  # about the origin of the world
    for b in range(model.nbody - 1, 0, -1):
        centre, f, about = bodies[b].needs(
            float(model.body_mass[b]),
            model.body_ipos[b],
            _matrix(model.body_iquat[b]),
            model.body_inertia[b],
            model.opt.gravity,
        )
        force[b] += f
        moment[b] += about + ca.cross(centre, f)
        parent = int(model.body_parentid[b])
        force[parent] += force[b]
        moment[parent] += moment[b]
        first = int(model.body_jntadr[b])
        for j in range(first, first + int(model.body_jntnum[b])):
            tau[j] += ca.dot(axes[j], moment[b] - ca.cross(anchors[j], force[b]))
    return ca.Function("inverse_dynamics", [q, v, a], [tau])


def inertia_of(dynamics: Any) -> Any:
    """Function ``q -> M`` for the joint inertia matrix with armature [kg·m²].

    Args:
        dynamics: Function from :func:`inverse_dynamics`.
    """
    ca = casadi()
    n = dynamics.size1_in(0)
    q, a = ca.SX.sym("q", n), ca.SX.sym("a", n)
    tau = dynamics(q, ca.SX(n, 1), a)
    return ca.Function("inertia", [q], [ca.jacobian(tau, a)])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Body:
    """Frame of a body and its motion, in world coordinates."""

    place: Any
    """Origin of the frame [m]."""
    turn: Any
    """Rotation matrix from the frame to the world [-]."""
    rate: Any
    """Angular velocity [rad/s]."""
    spin: Any
    """Angular acceleration [rad/s²]."""
    push: Any
    """Acceleration of the origin of the frame [m/s²]."""

    @classmethod
    def world(cls, ca: Any) -> _Body:
        zero = ca.SX(3, 1)
        return cls(place=zero, turn=ca.SX.eye(3), rate=zero, spin=zero, push=zero)

    def at(self, arm: Any) -> Any:
        """Acceleration of the point at a vector ``arm`` from the origin [m/s²]."""
        ca = casadi()
        return (
            self.push
            + ca.cross(self.spin, arm)
            + ca.cross(self.rate, ca.cross(self.rate, arm))
        )

    def carried(self, position: Any, rotation: Any) -> _Body:
        """Body frame at a fixed position and rotation in this one."""
        arm = self.turn @ casadi().DM(position)
        return _Body(
            place=self.place + arm,
            turn=self.turn @ rotation,
            rate=self.rate,
            spin=self.spin,
            push=self.at(arm),
        )

    def turned(
        self, axis: Any, anchor: Any, angle: Any, speed: Any, acceleration: Any
    ) -> tuple[_Body, Any, Any]:
        """Frame behind a hinge, and world axis and anchor of the hinge."""
        ca = casadi()
        z, arm = self.turn @ ca.DM(axis), self.turn @ ca.DM(anchor)
        pivot, push = self.place + arm, self.at(arm)
        turn = self.turn @ _about(ca.DM(axis), angle)
        rate = self.rate + z * speed
        spin = self.spin + z * acceleration + ca.cross(self.rate, z) * speed
        at_pivot = _Body(place=pivot, turn=turn, rate=rate, spin=spin, push=push)
        return at_pivot.carried(-np.asarray(anchor), ca.DM.eye(3)), z, pivot

    def needs(
        self, mass: float, centre: Any, turn: Any, inertia: Any, gravity: Any
    ) -> tuple[Any, Any, Any]:
        """Centre of mass, and force and moment about it that the motion requires."""
        ca = casadi()
        arm = self.turn @ ca.DM(centre)
        axes = self.turn @ ca.DM(turn)
        tensor = axes @ ca.diag(ca.DM(inertia)) @ axes.T
        force = mass * (self.at(arm) - ca.DM(gravity))
        moment = tensor @ self.spin + ca.cross(self.rate, tensor @ self.rate)
        return self.place + arm, force, moment


def _about(axis: Any, angle: Any) -> Any:
    """Rotation matrix about a unit axis by Rodrigues' formula."""
    ca = casadi()
    K = ca.skew(axis)
    return ca.DM.eye(3) + ca.sin(angle) * K + (1 - ca.cos(angle)) * (K @ K)


def _matrix(quaternion: Any) -> Any:
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, np.asarray(quaternion, float))
    return out.reshape(3, 3)
