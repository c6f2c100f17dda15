"""What a simulated scene leaves behind: every state, and the figures made of them."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.sim.assembly import Assembly
from swgjoint.sim.figures.contains import contents
from swgjoint.sim.figures.metrics import run_metrics
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A recorded run; arrays hold every state, the first included.

    Angles and torques at the output side unless named motor; n states, joints in the
    order of ``joints``. Torques and torsions are the drive's law at the recorded state;
    the motor's torque is the mean over the step that led to it.
    """

    name: str
    assembly: Assembly
    joints: tuple[str, ...]
    time: Array
    """[s]. Shape (n,)."""
    position: Array
    """Link angles [rad]. Shape (n, n_joints)."""
    velocity: Array
    """Link speeds [rad/s]. Shape (n, n_joints)."""
    motor_position: Array
    """Input angles [rad]; without a rotor those that the gear, ideal or with its
    prescribed error, gives the link angles. Shape (n, n_joints)."""
    motor_velocity: Array
    """[rad/s]. Shape (n, n_joints)."""
    reference: Array
    """Commanded link angles [rad]. Shape (n, n_joints)."""
    torsion: Array
    """[rad]. Shape (n, n_joints)."""
    transmission_error: Array
    """Output minus ideal output [rad]. Shape (n, n_joints)."""
    output_torque: Array
    """That the drive exerts on the link [N·m]. Shape (n, n_joints)."""
    motor_torque: Array
    """[N·m]. Shape (n, n_joints)."""
    wanted_torque: Array
    """What the controller asked the motors for, without limits [N·m]. Same shape."""
    slipping_torque: Array
    """Hysteresis torque along the torsion [N·m]; zero if there is none. Same shape."""
    friction_torque: Array
    """Friction torque of the wave generator on the flexspline [N·m]. Same shape."""
    tool_position: Array
    """Tool in the world [m]. Shape (n, 3), or (n, 0) where the arm has no tool."""
    tool_reference: Array
    """Tool on the commanded motion without any error [m]. Same shape."""
    wall: float
    """Time that the steps took [s]."""
    recording: Path | None = None
    """The recording for the viewer that was written with the run."""

    @property
    def steps_per_second(self) -> float:
        """Recorded steps, each with its sub-steps, per second of wall time."""
        return (self.time.size - 1) / self.wall

    @property
    def steady(self) -> slice:
        """Samples of the constant-speed part."""
        return self.assembly.trajectory.steady

    @property
    def contains(self) -> dict[str, Any]:
        """What the compiled model contains, and what was left out and why."""
        return contents(self.assembly)

    def tool_error(self, other: Run | None = None) -> Array:
        """Distance of the tool from that of another run [m]. Shape (n,).

        Args:
            other: A run of the same motion, usually the rigid arm; None compares with
                the commanded path.
        """
        reference = self.tool_reference if other is None else other.tool_position
        return np.asarray(np.linalg.norm(self.tool_position - reference, axis=1))

    def metrics(self) -> dict[str, Any]:
        """Figures of the run under the keys of ``swgjoint run --json``."""
        return deepcopy(self._figures)

    @cached_property
    def _figures(self) -> dict[str, Any]:
        return run_metrics(self)
