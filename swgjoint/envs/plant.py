"""Parallel simulations of one model with driven joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from swgjoint.envs.arguments import check_count
from swgjoint.envs.rest import DriveRest, balance_specimens
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.response import responses
from swgjoint.joint.variation import SIZE, Variation
from swgjoint.sim.stepping import skip_idle_stages
from swgjoint.typing import Array

Index = NDArray[np.intp]
"""Array of addresses."""


class Plant:
    """Motors, drives and links of n simulations; joints are the last axis.

    Results are bit-identical to those of a loop over single simulations, for any n and
    any number of threads.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        drives: Sequence[JointDrive],
        count: int,
        *,
        start: tuple[Array, Array],
        sub_steps: int = 1,
        threads: int = 0,
        variable: bool = False,
    ) -> None:
        """Make the simulations.

        Args:
            model: Compiled model, where actuator j applies the motor torque of joint j.
            drives: Drives of the joints, of level ``linear`` or ``full``.
            count: Number of simulations.
            start: Motor angles [rad] and torques of the drives on the links [N·m] at
                the start of every episode without an own start. Shapes (n_joints,).
            sub_steps: Number of engine steps per control period.
            threads: Number of engine threads; 0: one per core.
            variable: Whether drives differ between simulations.
        """
        check_count("num_envs", count, 1)
        check_count("threads", threads, 0)
        self.model, self.drives, self.sub_steps = model, tuple(drives), sub_steps
        self.batch = Batch(skip_idle_stages(model), count, nthread=threads)
        self.ratio: Array = np.array([d.ratio for d in drives])
        links = [model.joint(d.joint) for d in drives]
        rotors = [model.joint(d.rotor) for d in drives]
        self._link_q, self._link_v = _addresses(links)
        self._rotor_q, self._rotor_v = _addresses(rotors)
        batch = self.batch
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._ctrl, self._load = batch.bind("ctrl"), batch.bind("qfrc_applied")
        self.variable = variable
        self._user = batch.expand("tendon_user") if variable else None
        self._tendons = np.array([int(model.tendon(d.tendon).id) for d in drives])
        self._others: tuple[Array, Index] | None = None
        if all(d.level == "full" for d in drives):
            state = batch.bind("plugin_state")
            instances = [
                mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_PLUGIN, d.plugin)
                for d in drives
            ]
            # per joint: acceleration of the rotor, then of the link
            others = [int(model.plugin_stateadr[k]) + 1 for k in instances]
            self._others = state, np.array(others)
            self._qacc = batch.bind("qacc")
            self._factor = batch.bind("qLD"), batch.bind("qLDiagInv")
        self._start = start
        self._kept: Array | None = None
        self._one = int(self._link_v[0]), int(self._rotor_v[0])
        self._nominal = self._balance(np.zeros((1, len(drives), SIZE)), start)

    @property
    def motor_angle(self) -> Array:
        """Motor angles [rad]. Shape (n, n_joints)."""
        return np.asarray(self._qpos[:, self._rotor_q])

    @property
    def motor_speed(self) -> Array:
        """Motor speeds [rad/s]. Shape (n, n_joints)."""
        return np.asarray(self._qvel[:, self._rotor_v])

    @property
    def link_angle(self) -> Array:
        """Link angles [rad]. Shape (n, n_joints)."""
        return np.asarray(self._qpos[:, self._link_q])

    @property
    def link_speed(self) -> Array:
        """Link speeds [rad/s]. Shape (n, n_joints)."""
        return np.asarray(self._qvel[:, self._link_v])

    def output_torque(self) -> Array:
        """Torque of every drive on its link [N·m]. Shape (n, n_joints).

        At level ``full`` this is the mean over the engine's last step. It is computed
        from the link acceleration minus the acceleration due to all other forces, which
        the plugin stores. At level ``linear`` it is the torque of spring and damper at
        the current state.
        """
        if self._others is not None:
            state, index = self._others
            v = self._link_v
            weight = responses(self.model, *self._factor, v)
            return np.asarray((self._qacc[:, v] - state[:, index]) / weight)
        stiffness = np.array([d.stiffness for d in self.drives])
        damping = np.array([d.damping for d in self.drives])
        torsion = self.motor_angle / self.ratio - self.link_angle
        rate = self.motor_speed / self.ratio - self.link_speed
        return np.asarray(stiffness * torsion + damping * rate)

    def step(
        self, torque: Array, load: Array, active: NDArray[np.bool_] | None
    ) -> None:
        """Advance by one control period.

        Args:
            torque: Inputs of the motors: their torques or, with motor loops, the
                commands of the loops [N·m]. Shape (n, n_joints).
            load: Load torques that act against positive rotation of the links [N·m].
                Same shape.
            active: Whether each simulation advances; None: all do. Shape (n,).
        """
        self._ctrl[:, : torque.shape[1]] = torque
        self._load[:, self._link_v] = -load
        self.batch.step(active, nstep=self.sub_steps)

    def step_one(self, torque: float, load: float) -> tuple[float, float, float, float]:
        """Advance the only simulation of a single joint, as :meth:`step`.

        Args:
            torque: Input of the motor [N·m].
            load: Load torque against positive rotation of the link [N·m].

        Returns:
            Motor angle [rad] and speed [rad/s], link angle [rad], and torque of the
            drive on the link [N·m].
        """
        link, rotor = self._one
        self._ctrl[0, 0], self._load[0, link] = torque, -load
        self.batch.step(None, nstep=self.sub_steps)
        # the bench has hinges only, so that angles and speeds have the same addresses
        theta, psi = self._qpos.item(rotor), self._qpos.item(link)
        speed = self._qvel.item(rotor)
        if self._others is not None:
            state, (index,) = self._others
            added = self._qacc.item(link) - state.item(index)
            # the mass matrix of the bench is diagonal
            return theta, speed, psi, added / self._factor[1].item(link)
        drive, ratio = self.drives[0], self.drives[0].ratio
        torsion, rate = theta / ratio - psi, speed / ratio - self._qvel.item(link)
        return theta, speed, psi, drive.stiffness * torsion + drive.damping * rate

    def place(
        self,
        rows: Index,
        variations: Array | None,
        start: tuple[Array, Array] | None = None,
    ) -> Array:
        """Set simulations to rest at the start, the drives with their torques there.

        Args:
            rows: Indices of the simulations. Shape (m,).
            variations: ``numbers`` of the drives' deviations in these simulations, or
                None if drives and loads are nominal. Shape (m, n_joints, 5).
            start: Own motor angles [rad] and torques of the drives on the links [N·m]
                of these simulations; None: those of the plant. Shapes (m, n_joints).

        Returns:
            Torques of the drives on the links [N·m], shape (m, n_joints), or
            (n_joints,) if all are the same.
        """
        rests, nominal = self._nominal, variations is None and start is None
        if variations is None:
            variations = np.zeros((rows.size, len(self.drives), SIZE))
        elif self._user is not None:
            self._user[rows[:, None], self._tendons, :SIZE] = variations
        theta, torque = start or self._start
        if not nominal:
            rests = self._balance(variations, (theta, torque))
        batch = self.batch
        batch.reset(rows, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        for j, one in enumerate(rests):
            self._qpos[rows, self._link_q[j]] = one.link_angle
        self._qpos[rows[:, None], self._rotor_q] = theta
        if self._others is None:
            return torque
        state, others = self._others
        if nominal and self._kept is not None:
            state[rows] = self._kept
            return torque
        # initialise the plugin state as in equilibrium: the accelerations due to all
        # other forces cancel those due to the drive, and hysteresis is relaxed
        batch.forward(rows)
        factor, inverse = (part[rows] for part in self._factor)
        for side, dofs in enumerate((self._rotor_v, self._link_v)):
            weight = responses(self.model, factor, inverse, dofs)
            for j, one in enumerate(rests):
                force = (one.input_torque, one.output_torque)[side]
                state[rows, others[j] - 1 + side] = -weight[:, j] * force
        for j, one in enumerate(rests):
            for k in range(len(self.drives[j].drive.hysteresis)):
                state[rows, others[j] + 1 + k] = one.torsion
        if nominal:
            self._kept = state[rows[0]].copy()
        return torque

    def _balance(
        self, variations: Array, start: tuple[Array, Array]
    ) -> list[DriveRest]:
        """Equilibria of the drives at a start. Arguments as in :meth:`place`."""
        rests = []
        for j, attached in enumerate(self.drives):
            theta, torque = (one[..., j] for one in start)
            if attached.level == "full":
                own = variations[:, j]
                rests.append(balance_specimens(attached.drive, own, theta, torque))
                continue
            torsion = torque / attached.stiffness * np.ones(1)
            angle = theta / attached.ratio - torsion
            still = 0.0 * torsion
            rests.append(
                DriveRest(
                    link_angle=angle,
                    input_torque=still,
                    output_torque=still,
                    torsion=torsion,
                )
            )
        return rests


def specimen(attached: JointDrive, variation: Variation) -> JointDrive:
    """Copy the drive of a joint with the map of one specimen.

    Args:
        attached: Nominal drive of the joint.
        variation: Deviations of the specimen.
    """
    return replace(
        attached,
        drive=variation.apply_to(attached.drive),
        stiffness=attached.stiffness * (1.0 + variation.stiffness),
    )


def _addresses(joints: Sequence[object]) -> tuple[Index, Index]:
    """Addresses of joints in qpos and qvel."""
    return (
        np.array([int(j.qposadr[0]) for j in joints]),  # type: ignore[attr-defined]
        np.array([int(j.dofadr[0]) for j in joints]),  # type: ignore[attr-defined]
    )
