"""Recorded run of a scene: states, signals and the figures computed from them."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.sim.assembly import Assembly
from swgjoint.sim.figures.contains import contents
from swgjoint.sim.figures.metrics import run_metrics
from swgjoint.sim.life.loads import TaskLoads
from swgjoint.sim.life.motion_loads import motion_loads
from swgjoint.sim.thermal import HeatCourse
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A recorded run; arrays contain all n recorded states, including the first.

    Angles and torques refer to the output side unless their name contains ``motor``.
    The joint axis has the order of ``joints``. Torques and torsions result from the law
    of the drive at the recorded state. The motor torque is the mean over the step that
    led to the state.
    """

    name: str
    """Name of the run."""
    assembly: Assembly
    """The scene as it was compiled."""
    joints: tuple[str, ...]
    """Names of the driven joints."""
    time: Array
    """Times of the recorded states [s]. Shape (n,)."""
    position: Array
    """Link angles [rad]. Shape (n, n_joints)."""
    velocity: Array
    """Link speeds [rad/s]. Shape (n, n_joints)."""
    motor_position: Array
    """Motor angles [rad]. At levels without a rotor they follow from the link angles
    and the prescribed error. Shape (n, n_joints)."""
    motor_velocity: Array
    """Motor speeds [rad/s]. Shape (n, n_joints)."""
    reference: Array
    """Commanded link angles [rad]. Shape (n, n_joints)."""
    torsion: Array
    """Torsion of the drives [rad]. Shape (n, n_joints)."""
    transmission_error: Array
    """Output minus ideal output [rad]. Shape (n, n_joints)."""
    output_torque: Array
    """Torque of the drives on the links [N·m]. Shape (n, n_joints)."""
    motor_torque: Array
    """Motor torques after limitation [N·m]. Shape (n, n_joints)."""
    wanted_torque: Array
    """Motor torques that the controller commanded, before limitation [N·m]. Shape
    (n, n_joints)."""
    slipping_torque: Array
    """Hysteresis torque along the torsion [N·m]; zero if the drive has none. Shape
    (n, n_joints)."""
    hysteresis_energy: Array
    """Change of the energy stored in the hysteresis springs [J]. Shape (n_joints,)."""
    friction_torque: Array
    """Friction torque of the wave generator on the flexspline [N·m]. Shape
    (n, n_joints)."""
    tool_position: Array
    """Tool position in the world frame [m]. Shape (n, 3), or (n, 0) without a tool."""
    tool_reference: Array
    """Tool position on the commanded motion [m]. Shape of ``tool_position``."""
    wall: float
    """Wall time of all steps [s]."""
    tilt: Array
    """Tilts of the output bearings [rad], two for each bearing. Shape (n, n_tilts)."""
    tilt_velocity: Array
    """Tilt speeds [rad/s]. Shape of ``tilt``."""
    recording: Path | None = None
    """File of the recording for the viewer; None if none was written."""
    heat: dict[str, HeatCourse] = field(default_factory=dict)
    """Temperature and losses of the drives that warm, by joint."""
    cycle: tuple[TaskLoads, ...] = ()
    """Loads by task of the duty cycle; empty if the scene has none."""

    @property
    def steps_per_second(self) -> float:
        """Recorded steps, each with its sub-steps, per second of wall time [1/s]."""
        return (self.time.size - 1) / self.wall

    @property
    def steady(self) -> slice:
        """Samples that the figures use, see :attr:`.Trajectory.steady`."""
        return self.assembly.trajectory.steady

    @property
    def contains(self) -> dict[str, Any]:
        """Contents of the compiled model, and what it leaves out and why."""
        return contents(self.assembly)

    @cached_property
    def repeated(self) -> tuple[TaskLoads, ...]:
        """Loads of the duty cycle or, without one, of the motion of this run."""
        return self.cycle or (motion_loads(self),)

    def gauge_torque(self, j: int) -> Array | None:
        """Torque that the strain gauges of a joint read [N·m]; None without gauges.

        Args:
            j: Index of the joint.

        Returns:
            Readings. Shape (n,).
        """
        gauges = self.assembly.gauges.get(self.joints[j])
        if gauges is None:
            return None
        return gauges.read_torque(
            self.output_torque[:, j], self.motor_position[:, j], self.position[:, j]
        )

    def tool_error(self, other: Run | None = None) -> Array:
        """Distance between the tool and a reference at every instant [m]. Shape (n,).

        Args:
            other: Run of the same motion that provides the reference, usually that of
                the rigid arm; None uses the commanded path.
        """
        reference = self.tool_reference if other is None else other.tool_position
        return np.asarray(np.linalg.norm(self.tool_position - reference, axis=1))

    def metrics(self) -> dict[str, Any]:
        """Figures of the run under the keys of ``swgjoint run --json``.

        The result is a copy, which may be changed.
        """
        return deepcopy(self.figures)

    @cached_property
    def figures(self) -> dict[str, Any]:
        """The same figures, which must not be changed; reading them takes no copy."""
        return run_metrics(self)
