"""Parallel simulations of one model with driven joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from swgjoint.envs.arguments import check_count
from swgjoint.errors import InputError
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.response import responses
from swgjoint.joint.variation import SIZE, Variation
from swgjoint.maps.drive_map import DriveMap
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
        sub_steps: int = 1,
        threads: int = 0,
        variable: bool = False,
    ) -> None:
        """Make the simulations.

        Args:
            model: Compiled model, where actuator j applies the motor torque of joint j.
            drives: Drives of the joints, of level ``linear`` or ``full``.
            count: Number of simulations.
            sub_steps: Number of engine steps per control period.
            threads: Number of engine threads; 0: one per core.
            variable: Whether drives differ between simulations.
        """
        check_count("num_envs", count, 1)
        check_count("threads", threads, 0)
        self.model, self.drives, self.sub_steps = model, tuple(drives), sub_steps
        self.batch = Batch(model, count, nthread=threads)
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
        self._tendons = [int(model.tendon(d.tendon).id) for d in drives]
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

    def place(
        self,
        index: int,
        motor_angle: Array,
        torque: Array,
        maps: Sequence[DriveMap],
    ) -> None:
        """Set one simulation to a state of rest with given drive torques.

        Args:
            index: Index of the simulation.
            motor_angle: Motor angles [rad]. Shape (n_joints,).
            torque: Torques of the drives on the links [N·m]. Same shape.
            maps: Drive maps of the joints, with the deviations of this simulation.
        """
        batch, links = self.batch, np.empty(len(maps))
        forces = np.zeros((len(maps), 2))
        for j, (attached, drive) in enumerate(zip(self.drives, maps, strict=True)):
            theta, wanted = float(motor_angle[j]), float(torque[j])
            if attached.level == "linear":
                links[j] = theta / drive.ratio - wanted / attached.stiffness
            else:
                links[j], forces[j] = _balance(drive, theta, wanted)
        batch.reset([index], stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._qpos[index, self._link_q] = links
        self._qpos[index, self._rotor_q] = motor_angle
        if self._others is None:
            return
        # initialise the plugin state as in equilibrium: the accelerations due to all
        # other forces cancel those due to the drive, and hysteresis is relaxed
        batch.forward([index])
        state, others = self._others
        factor, inverse = (part[index] for part in self._factor)
        for side, dofs in enumerate((self._rotor_v, self._link_v)):
            weight = responses(self.model, factor, inverse, dofs)
            state[index, others - 1 + side] = -weight * forces[:, side]
        for j, drive in enumerate(maps):
            first = others[j] + 1
            torsion = float(drive.torsion(motor_angle[j], links[j]))
            state[index, first : first + len(drive.hysteresis)] = torsion

    def vary(self, index: int, variations: Sequence[Variation]) -> None:
        """Vary the drives of one simulation.

        Args:
            index: Index of the simulation.
            variations: Deviations of the drives from their maps, one per joint.

        Raises:
            InputError: If the plant was made with ``variable=False``.
        """
        if self._user is None:
            raise InputError("variations of drives need a plant with variable=True")
        for tendon, variation in zip(self._tendons, variations, strict=True):
            self._user[index, tendon, :SIZE] = variation.numbers


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


def _balance(
    drive: DriveMap, theta: float, torque: float
) -> tuple[float, tuple[float, float]]:
    """Link angle [rad] for an output torque, and torques on input and output [N·m]."""
    psi = theta / drive.ratio
    for _ in range(50):
        on_input, on_output = (float(f) for f in drive.forces(theta, psi))
        missing = torque - on_output
        if abs(missing) < 1e-9 * drive.ratings.rated_torque:
            break
        torsion = drive.torsion(theta, psi)
        psi -= missing / float(drive.stiffness(torsion, theta, psi))
    return psi, (on_input, on_output)
