"""Episodes of an arm that follows the path of a scene."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.drives.references import names_catalogue
from swgjoint.envs.arm_settings import ArmSettings
from swgjoint.envs.core import Core, EpisodeLimits
from swgjoint.envs.entries import Entry, ceiling, error_bounds
from swgjoint.envs.loop import MotorLoop
from swgjoint.envs.plant import Plant, specimen
from swgjoint.envs.sensors import Sensors
from swgjoint.envs.specimen import load_drive_once, tolerances_of
from swgjoint.errors import InputError
from swgjoint.joint.region import check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.payload import arms_of
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import is_arm, scene_of_arm
from swgjoint.sim.assembly import Assembly, assemble
from swgjoint.sim.equilibrium import start_state
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.task import task_of
from swgjoint.typing import Array
from swgjoint.units import arcmin

ANGLE_MARGIN = 0.3
"""Deviation of a link from the range of its path at which an episode ends [rad]."""
SPEED_MARGIN = 20.0
"""Excess of a motor speed over twice the largest motor speed of the path at which an
episode ends [rad/s]."""


class ArmCore(Core):
    """Episodes of ``ArmTracking-v0``."""

    def __init__(self, count: int, threads: int, settings: ArmSettings) -> None:
        """Assemble the scene once, then ``count`` simulations of it.

        Args:
            count: Number of episodes.
            threads: Number of engine threads; 0: one per core.
            settings: Arguments of the environment.
        """
        self.settings = s = settings
        tolerances = tolerances_of(s.randomise, s.level)
        variable = tolerances is not None and s.level == "full"
        scene = _scene(s)
        assembly = assemble(scene, drives=_drives(scene), variable=variable)
        _check(scene, assembly)
        task = task_of(assembly)
        steps = min(round(s.episode_s / task.period), len(task.position) - 1)
        drives = [t.attached for t in assembly.transmissions]
        if tolerances is not None and variable:
            for one in drives:
                for kind in tolerances.extremes():
                    check_region(
                        specimen(one, kind),
                        timestep=assembly.step,
                        integrator=scene.simulation.integrator,
                    ).require(1)
        plant = Plant(
            assembly.model,
            drives,
            count,
            start=_start(assembly),
            sub_steps=round(task.period / assembly.step),
            threads=threads,
            variable=variable,
        )
        load = np.broadcast_to(assembly.load, (steps + 1, len(drives)))
        self._path = np.stack(
            [
                task.position[: steps + 1],
                task.velocity[: steps + 1],
                task.acceleration[: steps + 1],
                load,
                task.link_torque[: steps + 1],
            ],
            axis=1,
        )
        self._by_joint = _tool_slopes(assembly, self._path[:, 0])
        maps = [t.drive for t in assembly.transmissions]
        rated, momentary, ratcheting = np.array(
            [
                (
                    m.ratings.rated_torque,
                    m.ratings.momentary_peak,
                    m.ratings.ratcheting_torque or np.inf,
                )
                for m in maps
            ]
        ).T
        ratio = np.abs(task.joints.ratio)
        path = self._path[:, 0]
        self._authority = s.authority_of_rated * rated / ratio
        self._feedforward = assembly.feedforward[:: assembly.sub_steps][: steps + 1]
        top = 2.0 * ratio * np.abs(self._path[:, 1]).max(axis=0) + SPEED_MARGIN
        super().__init__(
            plant,
            joints=task.joints,
            loop=MotorLoop(
                stiffness=assembly.loops.stiffness,
                damping=assembly.loops.damping,
                ratio=task.joints.ratio,
            ),
            limits=EpisodeLimits(
                angle=0.5 * np.ptp(path, axis=0) + ANGLE_MARGIN,
                centre=0.5 * (path.max(axis=0) + path.min(axis=0)),
                motor_speed=top,
                momentary_peak=momentary,
                ratcheting=ratcheting,
                motor_torque=task.joints.torque_limit,
            ),
            sensors=Sensors.from_argument(s.sensors),
            tolerances=tolerances,
            period=task.period,
            steps=steps,
            normalise=bool(s.normalise),
            gauges={
                task.joints.names.index(name): one
                for name, one in assembly.gauges.items()
            },
            shared=True,
        )

    def entries(self) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
        """Entries of observation and action."""
        n, limits, s = len(self.joints.names), self.limits, self.settings
        reach = np.abs(limits.centre) + limits.angle
        ratio = np.abs(self.joints.ratio)
        angle = float(np.max(ratio * reach))
        speed = 1.5 * float(limits.motor_speed.max())
        off = np.array(
            [
                error_bounds(
                    one,
                    speed=float(np.abs(self._path[:, 1, j]).max()),
                    acceleration=float(np.abs(self._path[:, 2, j]).max()),
                    age=self.sensors.delay_periods * self.period,
                    period=self.period,
                )
                for j, one in enumerate(self.joints.ratio)
            ]
        ).max(axis=0)

        def each(meaning: str, unit: str, top: float, count: int = n) -> Entry:
            top = ceiling(top)
            return Entry(meaning=meaning, unit=unit, low=-top, high=top, count=count)

        link_speed = max(float(np.abs(self._path[:, 1]).max()), 0.01)
        torque = max(float(np.abs(self._path[:, 4]).max()), 0.1)
        further = []
        if self.sensors.link_encoder:
            top = 1.01 * float(reach.max())
            further.append(each("measured link angle of every joint", "rad", top))
        if self.sensors.torque_sensor:
            top = 1.1 * float(limits.momentary_peak.max())
            further.append(each("measured output torque of every joint", "N·m", top))
        if self.gauges:
            top = 1.1 * max(
                float(limits.momentary_peak[j]) + one.largest_ripple
                for j, one in self.gauges.items()
            )
            what = "output torque that strain gauges read, of every joint with gauges"
            further.append(each(what, "N·m", top, len(self.gauges)))
        what = {
            "torque": "added motor torque of every joint relative to authority",
            "setpoint": "set-point shift of every joint relative to largest shift",
        }[s.action]
        return (
            each("measured motor angle of every joint", "rad", 1.01 * angle),
            each("measured motor speed of every joint", "rad/s", speed),
            each("motor angle error of every joint", "rad", float(off[0])),
            each("motor speed error of every joint", "rad/s", float(off[1])),
            each("reference speed of every link", "rad/s", link_speed),
            each("known torque of every link", "N·m", torque),
            each("last action for every joint", "1", 1.0),
            *further,
        ), (each(what, "1", 1.0),)

    def vary_load(self, index: int, shares: Array) -> None:
        """Do nothing, because the scene sets the payload.

        Args:
            index: Index of the simulation.
            shares: Relative changes of the load inertia [-]. Shape (n_joints,).
        """

    def draw(self, rng: np.random.Generator) -> tuple[None, Array]:
        """Plan of every episode: the path of the scene."""
        return None, self._path

    def sample(self, drawn: None, part: slice) -> Array:
        """Part of the path of the scene.

        Args:
            drawn: None.
            part: Range of the instants.
        """
        return self._path[part]

    def command(self, action: Array) -> Array:
        """Input of the scene's motor loops with the action [N·m]. (n, n_joints)."""
        s, plan = self.settings, self.next_plan()
        here = np.minimum(self.instant + 1, self.steps)
        if s.action == "torque":
            own = self.loop.command(plan[:, 0], plan[:, 1])
            own = own + action * self._authority
        else:
            shift = s.shift_arcmin * arcmin * action
            own = self.loop.command(plan[:, 0] + shift, plan[:, 1])
        return np.asarray(own + self._feedforward[here])

    def columns(self) -> list[Array]:
        """Parts of the observation in the order of its table."""
        read, ratio, now = self.readout, self.joints.ratio, self.now
        angle, speed = read.value[:, : ratio.size], read.motor_speed
        return [
            angle,
            speed,
            ratio * now[:, 0] - angle,
            ratio * now[:, 1] - speed,
            now[:, 1],
            now[:, 4],
            self.action,
            *self.readings(),
        ]

    def judge(self) -> None:
        """Set the errors of links [rad] and tool [m] from the current state."""
        super().judge()
        slopes = self._by_joint[self._here]  # (n, 3, n_joints)
        # sum joint by joint: the order must not depend on the number of episodes
        offset = [np.zeros(len(slopes)) for _ in range(3)]
        for axis in range(3):
            for j in range(slopes.shape[2]):
                offset[axis] = offset[axis] + slopes[:, axis, j] * self.link_error[:, j]
        x, y, z = offset
        self.tool_error = np.sqrt(x * x + y * y + z * z)

    def reward(self) -> Array:
        """Reward as :class:`~swgjoint.envs.arm_tracking.ArmTrackingEnv` defines it."""
        s, effort = self.settings, np.zeros(len(self.action))
        for share in self.action.T:
            effort = effort + share * share
        error = self.tool_error / (1e-3 * s.error_scale_mm)
        mean = effort / self.action.shape[1]
        return np.asarray(1.0 / (1.0 + error * error) - s.effort_weight * mean)

    def info(self) -> dict[str, NDArray[Any]]:
        """True values, including the error of the tool [mm]."""
        return super().info() | {"tool_error_mm": 1e3 * self.tool_error}


def _scene(settings: ArmSettings) -> Scene:
    """The scene with level, friction and kinematic error of the settings."""
    name = str(settings.scene)
    if is_arm(name):
        scene = scene_of_arm(name).with_changes({"controller.kind": "pd"})
    else:
        scene = Scene.load_file(name)
    for section in (scene.defaults, *scene.joints.values()):
        if section.output_bearing is not None:
            raise InputError(f"scene {scene.name!r} has output_bearing; accepted: none")
    scene = scene.with_level(settings.level)  # type: ignore[arg-type]
    scene = scene.with_friction(bool(settings.friction))
    return scene.with_kinematic_error(settings.kinematic_error_arcmin)


def _drives(scene: Scene) -> dict[str, DriveMap]:
    """Maps that need finite elements or a file, loaded once for all environments.

    Unsuitable scenes are rejected before any map is built.
    """
    sections = [scene.defaults, *scene.joints.values()]
    names = {s.drive for s in sections if s.drive is not None and s.model is None}
    slow = sorted(name for name in names if not names_catalogue(name))
    if slow:
        arm, _ = arms_of(
            scene.arm,
            tool_site=scene.tool_site,
            payload=scene.payload,
            where=scene.where,
            reading=scene.reading,
        )
        _check_motion(scene, arm, trajectory_of(scene, arm).velocity[0])
    return {name: load_drive_once(name) for name in slow}


def _check_motion(scene: Scene, arm: RigidArm, first: Array) -> None:
    """Reject disturbances, an arm without a tool, and a start that is not at rest."""
    where = f"scene {scene.name!r}"
    if scene.disturbance:
        raise InputError(f"{where} has disturbances; accepted: none")
    if arm.tool < 0:
        raise InputError(
            f"{where}: the arm has no tool site; accepted: an arm with a tool site,"
            " which the reward needs"
        )
    if np.abs(first).max() > 0.0:
        raise InputError(f"{where} starts moving; accepted: a path that starts at rest")


def _check(scene: Scene, assembly: Assembly) -> None:
    """Reject scenes with features that episodes do not support."""
    _check_motion(scene, assembly.arm, assembly.trajectory.velocity[0])
    where, loops = f"scene {scene.name!r}", assembly.loops
    if loops.sampled or any(loops.setpoints(j) for j in range(len(assembly.joints))):
        raise InputError(
            f"{where}: controller {scene.controller.kind!r}; accepted: kind pd within"
            " the engine's step, without sensors, control period or motor lines"
        )
    if scene.simulation.integrator != "discrete":
        raise InputError(
            f"{where}: integrator {scene.simulation.integrator!r}; accepted: discrete"
        )


def _start(assembly: Assembly) -> tuple[Array, Array]:
    """Motor angles [rad] and drive torques [N·m] at the start of the scene."""
    qpos, _ = start_state(assembly)
    theta, psi = qpos[assembly.motor_position], qpos[assembly.link_position]
    torque = [
        float(t.law.forces(a, b)[1])
        for t, a, b in zip(assembly.transmissions, theta, psi, strict=True)
        if t.law is not None
    ]
    return theta, np.array(torque)


def _tool_slopes(assembly: Assembly, path: Array) -> Array:
    """Tool displacement per link angle along the path [m/rad]. (n, 3, n_joints)."""
    arm, out = assembly.arm, np.empty((len(path), 3, path.shape[1]))
    data = mujoco.MjData(arm.model)
    for row, q in zip(out, path, strict=True):
        data.qpos[:] = q
        mujoco.mj_kinematics(arm.model, data)
        mujoco.mj_comPos(arm.model, data)
        mujoco.mj_jacSite(arm.model, data, row, None, arm.tool)
    return out
