"""Loads of the rigid arm in its tasks, and the limits that they leave to a drive.

The output torque of a drive is that of the rigid arm, apart from vibrations, because
the rotors turn on the other side of the drive. Each drive can therefore be compared
with its ratings at each joint before anything is simulated.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any

import numpy as np

from swgjoint.drives.sections import LifeSection
from swgjoint.explore.select.options import DriveOption
from swgjoint.gear.bearing_life import EXPONENT, RatedLife
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import rigid_arm_of
from swgjoint.sim.assembly_steps import load_torque
from swgjoint.sim.figures.keys import LOWER
from swgjoint.sim.figures.rating_use import AT_REST, SLACK, cubed_mean
from swgjoint.sim.life.figures import rated_life
from swgjoint.sim.life.loads import TaskLoads, mean_load
from swgjoint.sim.life.motion_loads import rest_loads
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.sim.motion.trajectory import Trajectory
from swgjoint.sim.scene.scene import Scene
from swgjoint.typing import Array
from swgjoint.units import hour, rpm

SAMPLES = 2000
"""Smallest number of poses of a task, if its motion has as many samples."""
MARGIN = 1.1
"""Factor on the torque of the rigid arm above which a drive is dropped without
simulation. It allows for the difference between this torque and the simulated one; life
has its cube."""
PEAK, MEAN = "peak_torque_of_rating", "cubed_mean_torque_of_rating"
RATINGS: Mapping[str, float] = {PEAK: SLACK, MEAN: SLACK}
"""Limits that apply unless the specification states others: the peak torque is at most
the repeated peak torque, and the cubic mean torque at most the rated torque."""
STIFFNESS, LIFE = "K1_Nm_rad", "L10_h"
MAX_SPEED, AVERAGE_SPEED = "max_input_speed_rpm", "average_input_speed_rpm"


@dataclass(frozen=True, kw_only=True)
class LimitCheck:
    """A figure beside its limit."""

    key: str
    """Key of the figure."""
    value: float | None
    """Value; None if it is not known."""
    limit: float
    """Limit: a lower one for the keys of :data:`LOWER`, else an upper one."""
    reason: str = ""
    """Reason why the value is not known, or why it meets no limit."""

    @property
    def use(self) -> float:
        """Part of the limit that the value uses [-]; above 1 if it misses the limit."""
        if self.value is None:
            return inf
        if self.key in LOWER:
            return self.limit / self.value if self.value else inf
        return self.value / self.limit

    @property
    def text(self) -> str:
        """Figure, value and limit."""
        value = "without a value" if self.value is None else f"= {self.value:.4g}"
        why = f" ({self.reason})" if self.reason else ""
        return f"{self.key} {value}{why}, limit {self.limit:.4g}"

    def to_json(self) -> dict[str, Any]:
        """Figure, value, limit and use; an infinite number is None."""
        numbers = {"value": self.value, "limit": self.limit, "use": self.use}
        return {
            "figure": self.key,
            **{
                k: v if v is not None and isfinite(v) else None
                for k, v in numbers.items()
            },
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidTask:
    """Loads of the rigid arm in one task."""

    scene: Scene
    """Scene of the task."""
    arm: RigidArm
    """The arm with the payload of the task."""
    trajectory: Trajectory
    """Commanded motion."""
    stride: int
    """Time steps of the scene between two samples."""
    torque: Array
    """Torques of the rigid arm, without the table ``load`` [N·m]. Shape (n, n_joints).
    """
    duration: float
    """Duration of one occurrence [s]."""
    times: int
    """Number of occurrences in a cycle."""
    rest: bool = False
    """Whether the joints stand still."""

    def joint_loads(self, j: int, drive: DriveMap) -> TaskLoads:
        """Loads of one joint with a drive.

        Args:
            j: Index of the joint.
            drive: Its drive, whose rated torque scales a relative load.
        """
        if self.rest:
            return rest_loads("rest", self.duration, self.times, 1)
        speed = self.trajectory.velocity[:, j : j + 1]
        load = load_torque(self.scene, self.arm.joints[j], drive)
        return TaskLoads(
            name="task",
            duration=self.duration,
            times=self.times,
            torque=self.torque[:, j : j + 1] + load,
            speed=speed,
            input_speed=drive.ratio * speed,
            place=np.empty((len(speed), 0)),
        )


def rigid_tasks(scene: Scene) -> tuple[RigidTask, tuple[RigidTask, ...]]:
    """The motion of a scene, and the tasks of its duty cycle.

    Args:
        scene: The scene.

    Returns:
        The motion, and the tasks; without a duty cycle, the motion is the only task.

    Raises:
        InputError: If a task does not fit the arm or the time step.
    """
    own = _rigid_task(scene, scene.simulation.duration_s, 1)
    tasks = []
    for k, task in enumerate(scene.cycle):
        duration = task.duration_s or scene.simulation.duration_s
        if task.rest:
            one = replace(own, rest=True)
        elif task.changes or task.duration_s is not None:
            one = _rigid_task(scene.task_scene(k), duration, task.times)
        else:
            one = own
        tasks.append(replace(one, duration=duration, times=task.times))
    return own, tuple(tasks) or (own,)


def _rigid_task(scene: Scene, duration: float, times: int) -> RigidTask:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the runs repeat these warnings
        arm = rigid_arm_of(scene)
        path = trajectory_of(scene, arm)
        stride = max(1, len(path.time) // SAMPLES)
        path = path.every(stride)
        torque = arm.torques(path.position, path.velocity, path.acceleration)
    return RigidTask(
        scene=scene,
        arm=arm,
        trajectory=path,
        stride=stride,
        torque=torque,
        duration=duration,
        times=times,
    )


def check_loads(
    own: RigidTask,
    cycle: Sequence[RigidTask],
    j: int,
    option: DriveOption,
    spec: Mapping[str, float],
    life: LifeSection | None,
) -> tuple[LimitCheck, ...]:
    """Ratings, input speeds, and limits of stiffness and life that a drive meets.

    Args:
        own: The motion of the scene.
        cycle: The tasks of its duty cycle.
        j: Index of the joint.
        option: The drive.
        spec: Limits by figure, with those of :data:`RATINGS`.
        life: Table ``life`` of the joint, which the rated life of the drive precedes.
    """
    drive = option.map
    loads = [task.joint_loads(j, drive) for task in cycle]
    motion = own.joint_loads(j, drive)
    mean = mean_load(loads, 0, EXPONENT)
    torque, speed = motion.torque[:, 0], np.abs(motion.speed[:, 0])
    moving = own.trajectory.top_speed[j] > AT_REST and speed.any()
    cubed = cubed_mean(torque, speed if moving else np.ones_like(speed))
    peak = max(float(np.abs(torque).max()), mean.peak)
    top = max(
        float(task.trajectory.top_speed[j]) for task in (own, *cycle) if not task.rest
    )
    values: dict[str, float | None] = {
        PEAK: peak / drive.ratings.repeated_peak,
        MEAN: max(cubed, mean.torque or 0.0) / drive.ratings.rated_torque,
        MAX_SPEED: abs(drive.ratio) * top / rpm,
        AVERAGE_SPEED: mean.input_speed / rpm,
    }
    reasons: dict[str, str] = {}
    limits = dict(spec) | {
        MAX_SPEED: option.max_input_speed / rpm,
        AVERAGE_SPEED: option.average_input_speed / rpm,
    }
    if STIFFNESS in spec:
        values[STIFFNESS] = drive.spec_sheet((STIFFNESS,))[STIFFNESS]
    if LIFE in spec:
        rated = rated_life(drive, option.life or life or LifeSection())
        values[LIFE] = None
        if mean.torque is None:
            values[LIFE] = inf
        elif isinstance(rated, RatedLife):
            factor = rated.factor(
                drive.ratings.rated_torque, mean.torque, mean.input_speed
            )
            values[LIFE] = factor * rated.L10 / hour
        else:
            reasons[LIFE] = rated.partition(";")[0]
    return tuple(
        LimitCheck(key=key, value=value, limit=limits[key], reason=reasons.get(key, ""))
        for key, value in values.items()
    )


def find_excess(checks: Sequence[LimitCheck]) -> LimitCheck | None:
    """The check that is missed by most beyond the margin of its figure, or None.

    Args:
        checks: Checks of one drive at one joint, see :func:`check_loads`.
    """
    margins = {PEAK: MARGIN, MEAN: MARGIN, LIFE: MARGIN**EXPONENT}
    over = [one for one in checks if one.use > margins.get(one.key, 1.0)]
    return max(over, key=lambda one: one.use, default=None)
