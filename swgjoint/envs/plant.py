"""Simulations of one model with driven joints that run side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.variation import SIZE, Variation
from swgjoint.maps.drive_map import DriveMap

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Plant:
    """Motors, drives and links of n simulations; joints are the last axis.

    Arrays that begin with the simulations are exactly what a loop over simulations
    gives, whatever n and the number of threads.
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
            model: Compiled; actuator j turns the motor of joint j with its torque.
            drives: Of the joints, ``linear`` or ``full``.
            count: Of the simulations.
            sub_steps: Steps of the engine per control period.
            threads: Of the engine; 0: one per core.
            variable: Whether drives differ between simulations.
        """
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
            others = [int(model.plugin_stateadr[k]) + 1 for k in instances]
            self._others = state, np.array(others)
            self._qacc, self._weight = batch.bind("qacc"), batch.bind("qLDiagInv")

    @property
    def motor_angle(self) -> Array:
        """[rad]. Shape (n, n_joints)."""
        return np.asarray(self._qpos[:, self._rotor_q])

    @property
    def motor_speed(self) -> Array:
        """[rad/s]. Shape (n, n_joints)."""
        return np.asarray(self._qvel[:, self._rotor_v])

    @property
    def link_angle(self) -> Array:
        """[rad]. Shape (n, n_joints)."""
        return np.asarray(self._qpos[:, self._link_q])

    @property
    def link_speed(self) -> Array:
        """[rad/s]. Shape (n, n_joints)."""
        return np.asarray(self._qvel[:, self._link_v])

    def output_torque(self) -> Array:
        """Torque of every drive on its link [N·m]. Shape (n, n_joints).

        At ``full`` its mean over the engine's last step: what the link's acceleration
        is more than all other forces cause, which the plugin keeps; at ``linear`` the
        spring at the state.
        """
        if self._others is not None:
            state, index = self._others
            v = self._link_v
            return np.asarray((self._qacc[:, v] - state[:, index]) / self._weight[:, v])
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
            torque: Of the motors [N·m]. Shape (n, n_joints).
            load: Against the links [N·m]. Same shape.
            active: Simulations that move; None: all. Shape (n,).
        """
        self._ctrl[:, : torque.shape[1]] = torque
        self._load[:, self._link_v] = -load
        self.batch.step(active, nstep=self.sub_steps)

    def place(self, index: int, link_angle: Array, maps: Sequence[DriveMap]) -> None:
        """Let one simulation begin at rest, without torsion.

        Args:
            index: Of the simulation.
            link_angle: [rad]. Shape (n_joints,).
            maps: Of its joints.
        """
        self.batch.reset([index], stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._qpos[index, self._link_q] = link_angle
        self._qpos[index, self._rotor_q] = [
            _untwisted(drive, float(psi))
            for drive, psi in zip(maps, link_angle, strict=True)
        ]

    def vary(self, index: int, variations: Sequence[Variation]) -> None:
        """Give one simulation drives of its own."""
        if self._user is None:
            raise InputError("drives of this plant are all alike")
        for tendon, variation in zip(self._tendons, variations, strict=True):
            self._user[index, tendon, :SIZE] = variation.numbers


def specimen(attached: JointDrive, variation: Variation) -> JointDrive:
    """The drive on a joint with the map of one specimen."""
    return replace(
        attached,
        drive=variation.of(attached.drive),
        stiffness=attached.stiffness * (1.0 + variation.stiffness),
    )


def _addresses(joints: Sequence[object]) -> tuple[Index, Index]:
    return (
        np.array([int(j.qposadr[0]) for j in joints]),  # type: ignore[attr-defined]
        np.array([int(j.dofadr[0]) for j in joints]),  # type: ignore[attr-defined]
    )


def _untwisted(drive: DriveMap, psi: float) -> float:
    """Motor angle without torsion at a link angle [rad], by Newton's method."""
    theta = drive.ratio * psi
    if not drive.kinematic_error.any():
        return theta
    for _ in range(20):
        e0, slope, _ = drive.error_at(drive.phases(theta, psi))
        change = (psi - theta / drive.ratio - float(e0)) / (
            1.0 / drive.ratio + float(slope)
        )
        theta += change
        if abs(change) < 1e-12 * abs(drive.ratio):
            break
    return theta
