"""Loads of the joints during the motion of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.sim.figures.output_bearing import bearing_loads
from swgjoint.sim.life.loads import TaskLoads

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


def motion_loads(run: Run) -> TaskLoads:
    """Loads of all joints during a run, as a task that occurs once.

    Args:
        run: The run.
    """
    # the gear angle beta is that of the wave generator relative to the flexspline
    of_input, of_output = np.transpose(
        [angle_coefficients(t.drive.layout)[1] for t in run.assembly.transmissions]
    )
    return TaskLoads(
        name=run.name,
        duration=float(run.time[-1] - run.time[0]),
        times=1,
        torque=run.output_torque,
        speed=run.velocity,
        input_speed=run.motor_velocity,
        place=-(of_input * run.motor_position + of_output * run.position),
        bearings=bearing_loads(run),
    )


def rest_loads(name: str, duration: float, times: int, joints: int) -> TaskLoads:
    """A rest, which has no samples.

    Args:
        name: Name of the task.
        duration: Duration of one occurrence [s].
        times: Number of occurrences in a cycle.
        joints: Number of joints.
    """
    none = np.empty((0, joints))
    return TaskLoads(
        name=name,
        duration=duration,
        times=times,
        torque=none,
        speed=none,
        input_speed=none,
        place=none,
    )
