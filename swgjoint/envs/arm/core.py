"""Episodes of an arm that follows the path of a scene or drawn paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.envs.arm.paths import ArmPaths, JointPath, ToolPath, tool_slopes
from swgjoint.envs.arm.payload import DrawnPayloads, check_strength, start_of
from swgjoint.envs.arm.scene import at_rest, check_assembly, drives_of, scene_of
from swgjoint.envs.arm.settings import ArmSettings
from swgjoint.envs.core import Core, Rows
from swgjoint.envs.entries import Entry, ceiling, error_bounds
from swgjoint.envs.limits import EpisodeLimits
from swgjoint.envs.loop import MotorLoop
from swgjoint.envs.plant import Plant, specimen
from swgjoint.envs.references import Instants, Motion
from swgjoint.envs.sensors import Sensors
from swgjoint.envs.specimen import SpecimenTolerances, tolerances_of
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.region import check_region
from swgjoint.sim.assembly import Assembly, assemble
from swgjoint.sim.control import feedforward
from swgjoint.sim.controller import Task
from swgjoint.sim.scene.task import task_of
from swgjoint.typing import Array
from swgjoint.units import arcmin, mm

ANGLE_MARGIN = 0.3
"""Deviation of a link from the range of its path at which an episode ends [rad]."""
SPEED_MARGIN = 20.0
"""Excess of a motor speed over twice the largest motor speed of the path at which an
episode ends [rad/s]."""
FEEDFORWARD, SLOPES, ROWS = 5, slice(6, 9), 9
"""Further rows of a plan: feed-forward of the motors [N·m], and displacement of the
tool per link angle [m/rad] in three rows. Then the number of all rows."""


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
        scene = scene_of(s)
        fastest = s.max_speed_rad_s if s.kinds else 0.0
        assembly = assemble(
            scene, drives=drives_of(scene), variable=variable, top_speed=fastest
        )
        check_assembly(scene, assembly)
        if s.kinds:
            assembly = at_rest(assembly)
        self._assembly, task = assembly, task_of(assembly)
        steps = round(s.episode_s / task.period)
        drives = [t.attached for t in assembly.transmissions]
        self.payloads: DrawnPayloads | None = None
        """Drawn payloads; None if all episodes have the same one."""
        if s.draws_payload:
            self.payloads = DrawnPayloads(assembly, s.payload_bounds)
        _check_stability(
            assembly, drives, tolerances if variable else None, self.payloads
        )
        plant = Plant(
            assembly.model,
            drives,
            count,
            start=start_of(assembly),
            sub_steps=round(task.period / assembly.step),
            threads=threads,
            variable=variable,
        )
        if self.payloads is not None:
            self.payloads.attach_to(plant.batch)
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
        check_strength(assembly, self.payloads, np.minimum(momentary, ratcheting))
        ratio = np.abs(task.joints.ratio)
        self.authority = s.authority_of_rated * rated / ratio
        """Largest added motor torques [N·m]. Shape (n_joints,)."""
        self._paths: ArmPaths | None = None
        if s.kinds:
            low, high = self._prepare_drawn_paths(task, steps)
            # an episode ends before a drive carries more
            self._top_torque = float(momentary.max())
        else:
            steps = min(steps, len(task.position) - 1)
            low, high = self._prepare_path(task, steps)
        super().__init__(
            plant,
            joints=task.joints,
            loop=MotorLoop(
                stiffness=assembly.loops.stiffness,
                damping=assembly.loops.damping,
                ratio=task.joints.ratio,
            ),
            limits=EpisodeLimits(
                angle=0.5 * (high - low) + ANGLE_MARGIN,
                centre=0.5 * (high + low),
                motor_speed=2.0 * ratio * self._tops[0] + SPEED_MARGIN,
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
            shared=self._paths is None,
            plan_rows=ROWS,
        )

    def _prepare_drawn_paths(self, task: Task, steps: int) -> tuple[Array, Array]:
        """Prepare to draw paths, and return the bounds of their link angles [rad]."""
        s, start = self.settings, task.position[0]
        self._instants = Instants(task.period * np.arange(steps + 1.0))
        self._paths = ArmPaths(
            self._assembly.arm,
            start,
            self._instants,
            kinds=s.kinds,
            max_speed=s.max_speed_rad_s,
            max_angle=s.max_angle_rad,
            max_acceleration=s.max_acceleration,
            max_distance=s.max_distance_mm * mm,
        )
        one = np.ones(len(start))
        self._tops = s.max_speed_rad_s * one, s.max_acceleration * one
        return start - s.max_angle_rad, start + s.max_angle_rad

    def _prepare_path(self, task: Task, steps: int) -> tuple[Array, Array]:
        """Plan the path of the scene, and return the bounds of its angles [rad]."""
        assembly, part = self._assembly, slice(0, steps + 1)
        motion = task.position[part], task.velocity[part], task.acceleration[part]
        self._path = path = self._rows(
            motion,
            task.link_torque[part],
            assembly.feedforward[:: assembly.sub_steps][part],
        )
        self._tops = np.abs(path[:, 1]).max(axis=0), np.abs(path[:, 2]).max(axis=0)
        self._top_torque = float(np.abs(path[:, 4]).max())
        return path[:, 0].min(axis=0), path[:, 0].max(axis=0)

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
                    speed=float(self._tops[0][j]),
                    acceleration=float(self._tops[1][j]),
                    age=self.sensors.delay_periods * self.period,
                    period=self.period,
                )
                for j, one in enumerate(self.joints.ratio)
            ]
        ).max(axis=0)

        def each(meaning: str, unit: str, top: float, count: int = n) -> Entry:
            top = ceiling(top)
            return Entry(meaning=meaning, unit=unit, low=-top, high=top, count=count)

        link_speed = max(float(self._tops[0].max()), 0.01)
        torque = max(self._top_torque, 0.1)
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
        """Do nothing, because payloads change the load.

        Args:
            index: Index of the simulation.
            shares: Relative changes of the load inertia [-]. Shape (n_joints,).
        """

    def restart(self, rows: Sequence[int], rngs: Sequence[np.random.Generator]) -> None:
        """Begin episodes of some simulations, and draw their payloads.

        Args:
            rows: Indices of the simulations.
            rngs: Random generators, one for each of them.
        """
        if self.payloads is not None:
            self.payloads.draw(rows, rngs)
        super().restart(rows, rngs)

    def start_of(self, rows: Rows) -> tuple[Array, Array] | None:
        """Motor angles [rad] and drive torques [N·m] with drawn payloads."""
        return None if self.payloads is None else self.payloads.start_of(rows)

    def draw(
        self, rng: np.random.Generator
    ) -> tuple[JointPath | ToolPath | None, Array]:
        """Plan of an episode: the path of the scene, or a drawn one."""
        if self._paths is None:
            return None, self._path
        drawn, motion = self._paths.draw(rng)
        return drawn, self._plan(motion)

    def sample(self, drawn: JointPath | ToolPath | None, part: slice) -> Array:
        """Part of a plan.

        Args:
            drawn: Path in joint or tool space; None for that of the scene.
            part: Range of the instants.
        """
        if drawn is None:
            return self._path[part]
        return self._plan(drawn.sample(self._instants, part))

    def _plan(self, motion: Motion) -> Array:
        """Plan of a drawn path, with the torques that the controller's model states."""
        assembly, controller = self._assembly, self._assembly.scene.controller
        known_arm, load = assembly.known_arm, assembly.load
        torque = known = load + known_arm.torques(*motion)
        if controller.feedforward == "gravity":
            torque = load + known_arm.gravity(motion[0])
        ahead = feedforward(
            controller.feedforward,
            link_torque=torque,
            acceleration=motion[2],
            ratio=assembly.ratio,
            rotor_inertia=assembly.rotor_inertia,
        )
        return self._rows(motion, known, ahead)

    def _rows(self, motion: Motion, known: Array, ahead: Array) -> Array:
        """Plan of a motion with known torques of links and feed-forward of motors."""
        plan = np.empty((len(known), ROWS, known.shape[1]))
        for row, values in enumerate((*motion, self._assembly.load, known, ahead)):
            plan[:, row] = values
        plan[:, SLOPES] = tool_slopes(self._assembly.arm, motion[0])
        return plan

    def command(self, action: Array) -> Array:
        """Input of the scene's motor loops with the action [N·m]. (n, n_joints)."""
        s, plan = self.settings, self.next_plan()
        if s.action == "torque":
            own = self.loop.command(plan[:, 0], plan[:, 1])
            own = own + action * self.authority
        else:
            shift = s.shift_arcmin * arcmin * action
            own = self.loop.command(plan[:, 0] + shift, plan[:, 1])
        return np.asarray(own + plan[:, FEEDFORWARD])

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
        slopes = self.now[:, SLOPES]  # (n, 3, n_joints)
        # sum joint by joint: the order must not depend on the number of episodes
        offset = [np.zeros(len(slopes)) for _ in range(3)]
        for axis in range(3):
            for j in range(slopes.shape[2]):
                offset[axis] = offset[axis] + slopes[:, axis, j] * self.link_error[:, j]
        x, y, z = offset
        self.tool_error = np.sqrt(x * x + y * y + z * z)

    def deviation(self) -> tuple[Array, Array]:
        """Square of the tool error over its scale, and mean square of the actions."""
        effort = np.zeros(len(self.action))
        for share in self.action.T:
            effort = effort + share * share
        error = self.tool_error / (1e-3 * self.settings.error_scale_mm)
        return error * error, effort / self.action.shape[1]

    @property
    def worst_error(self) -> float:
        """Tool error that stands for an exceeded limit: all links at theirs [m]."""
        slopes = tool_slopes(self._assembly.arm, self._assembly.trajectory.position[:1])
        return float(np.linalg.norm(np.abs(slopes[0]) @ self.limits.angle))

    def shown_error(self) -> Array:
        """Distance of the tool from its reference [m]. Shape (n,)."""
        return self.tool_error

    def feedforward(self, plan: Array) -> Array:
        """Feed-forward of the scene's controller [N·m]."""
        return np.asarray(plan[FEEDFORWARD])

    def reward(self) -> Array:
        """Reward as :class:`~swgjoint.envs.arm_tracking.ArmTrackingEnv` defines it."""
        error, effort = self.deviation()
        return np.asarray(1.0 / (1.0 + error) - self.settings.effort_weight * effort)

    def info(self) -> dict[str, NDArray[Any]]:
        """True values, with the error of the tool [mm] and a drawn payload [kg]."""
        values = super().info() | {"tool_error_mm": 1e3 * self.tool_error}
        if self.payloads is not None:
            values["payload_kg"] = self.payloads.mass
        return values


def _check_stability(
    assembly: Assembly,
    drives: Sequence[JointDrive],
    tolerances: SpecimenTolerances | None,
    payloads: DrawnPayloads | None,
) -> None:
    """Reject specimens and payloads with which a drive is too stiff for the step."""
    missing = np.zeros(len(drives))
    if payloads is not None:
        missing = payloads.link_inertia_missing()
    extremes = tolerances.extremes() if tolerances is not None else ()
    for one, less in zip(drives, missing, strict=True):
        for kind in (one, *(specimen(one, each) for each in extremes)):
            check_region(
                replace(kind, link_inertia=kind.link_inertia - float(less)),
                timestep=assembly.step,
                integrator=assembly.scene.simulation.integrator,
            ).require(1)
