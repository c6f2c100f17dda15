"""Joint test bench for many simulations: one drive with its motor and a load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from swgjoint.drives.sections import GaugesSection
from swgjoint.envs.arguments import check_flag, check_number, format_value
from swgjoint.envs.core import Core
from swgjoint.envs.entries import Entry, ceiling, error_bounds
from swgjoint.envs.limits import EpisodeLimits
from swgjoint.envs.loop import MotorLoop
from swgjoint.envs.plant import Plant, specimen
from swgjoint.envs.sensors import Sensors
from swgjoint.envs.specimen import (
    SpecimenTolerances,
    drive_of_environment,
    tolerances_of,
)
from swgjoint.errors import InputError
from swgjoint.faults import validate
from swgjoint.joint.attach import attach
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.region import check_region
from swgjoint.joint.step_damping import damp_as_asked
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm, compile_spec
from swgjoint.sim.controller import KnownJoints
from swgjoint.sim.figures.transmission import transmission_of
from swgjoint.sim.gauges import JointGauges, gauges_of_drive
from swgjoint.typing import Array

LEVELS = ("full", "linear")
"""Levels of the drive that environments accept."""
MAX_SUB_STEPS = 16
"""Largest number of simulation steps in a control period."""
MAX_PERIOD = 0.05
"""Largest control period [s]; longer periods do not resolve the references."""
JOINT, BODY = "joint", "load"
"""Names of the joint and of the load body in the model."""
REACH = 0.5
"""Length of the bar of the bench, which carries the payload at its end [m]."""


@dataclass(frozen=True, kw_only=True)
class BenchSettings:
    """Arguments common to all environments on the bench.

    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv` describes them.
    """

    drive: str | DriveMap = "CSG-25-100"
    """Catalogue name, map file or design file of the drive, or its map."""
    level: str = "full"
    """Level of the drives: ``full`` or ``linear``."""
    rotor_inertia_kgm2: float = 1e-4
    """Inertia of motor rotor and wave generator about the motor axis [kg·m²]."""
    load_inertia_kgm2: float = 1.0
    """Inertia of the load about the joint [kg·m²]."""
    payload_kg: float = 0.0
    """Payload at the end of the bar [kg]."""
    friction: bool = True
    """Whether drives have the friction of their maps."""
    kinematic_error_arcmin: float | None = None
    """Peak-to-peak kinematic error over one output turn [arcmin], or None."""
    torque_limit_Nm: float | None = None
    """Torque limit of the motor [N·m]; None: repeated peak torque over ratio."""
    max_speed_rad_s: float = 0.6
    """Largest link speed of references [rad/s]."""
    max_angle_rad: float = 1.0
    """Largest link angle of references [rad]."""
    period_s: float = 1e-3
    """Control period [s]."""
    episode_s: float = 2.0
    """Duration of an episode [s]."""
    load_of_rated: float = 0.5
    """Largest load torque relative to rated torque [-]."""
    sensors: Mapping[str, float] | Sensors | None = None
    """Sensors of every joint; None: the default sensors."""
    gauges: Mapping[str, Any] | None = None
    """Strain gauges on the flexspline, with the keys of a scene; None: no gauges."""
    randomise: bool | Mapping[str, float] | SpecimenTolerances = False
    """Whether, or with which tolerances, drives and loads vary."""
    normalise: bool = True
    """Whether observations lie between -1 and 1, or have SI units."""

    def __post_init__(self) -> None:
        for key, unit in (
            ("rotor_inertia_kgm2", "kg·m²"),
            ("load_inertia_kgm2", "kg·m²"),
            ("max_speed_rad_s", "rad/s"),
            ("max_angle_rad", "rad"),
            ("period_s", "s"),
            ("episode_s", "s"),
        ):
            self._check(key, unit, zero=False)
        for key, unit in (("payload_kg", "kg"), ("load_of_rated", "")):
            self._check(key, unit, zero=True)
        if self.torque_limit_Nm is not None:
            self._check("torque_limit_Nm", "N·m", zero=False)
        if self.kinematic_error_arcmin is not None:
            self._check("kinematic_error_arcmin", "arcmin", zero=True)
        check_flag("friction", self.friction)
        check_flag("normalise", self.normalise)
        if not isinstance(self.drive, str | DriveMap):
            raise InputError(
                f"drive {format_value(self.drive)}; accepted: a catalogue name, a map"
                " or design file, or a DriveMap"
            )
        if self.level not in LEVELS:
            raise InputError(
                f"level {self.level!r} of an environment; accepted: {', '.join(LEVELS)}"
            )
        if self.period_s > MAX_PERIOD:
            raise InputError(
                f"period_s {self.period_s} s; accepted: a number > 0, up to"
                f" {MAX_PERIOD:g}"
            )
        if not 0.5 <= self.episode_s <= 600.0 or self.steps > 10**6:
            raise InputError(
                f"episode_s {self.episode_s} s with a period of {self.period_s} s;"
                " accepted: 0.5 to 600 s and at most 1e6 periods"
            )

    def _check(self, key: str, unit: str, *, zero: bool) -> None:
        check_number(key, getattr(self, key), unit, zero=zero)

    @property
    def steps(self) -> int:
        """Number of control periods of an episode."""
        return round(self.episode_s / self.period_s)

    @property
    def link_inertia(self) -> float:
        """Nominal inertia of load and payload about the joint [kg·m²]."""
        return self.load_inertia_kgm2 + self.payload_kg * REACH**2


class BenchCore(Core):
    """Episodes of the bench joint."""

    def __init__(
        self,
        count: int,
        threads: int,
        settings: BenchSettings,
        *,
        loop_Hz: float | None = None,
        loop_damping_ratio: float = 1.0,
    ) -> None:
        """Build the model once, then ``count`` simulations of it.

        Args:
            count: Number of episodes.
            threads: Number of engine threads; 0: one per core.
            settings: Arguments of the environment.
            loop_Hz: Natural frequency of the motor loop [Hz]; None: no motor loop.
            loop_damping_ratio: Damping ratio of the motor loop [-].
        """
        self.settings = s = settings
        tolerances = tolerances_of(s.randomise, s.level)
        drive = drive_of_environment(s.drive, s.kinematic_error_arcmin)
        ratio, ratings = drive.ratio, drive.ratings
        top_speed = 2.0 * s.max_speed_rad_s * abs(ratio)
        variable = tolerances is not None and s.level == "full"
        spec, attached = _bench(s, drive, variable=variable, top_speed=top_speed)
        kinds = [attached]
        if tolerances is not None and variable:
            kinds += [specimen(attached, v) for v in tolerances.extremes()]
        sub_steps = max(
            check_region(
                kind,
                timestep=s.period_s,
                max_input_speed=top_speed,
                max_torque=ratings.momentary_peak,
            ).require(MAX_SUB_STEPS)
            for kind in kinds
        )
        spec.option.timestep = s.period_s / sub_steps
        attached = damp_as_asked(spec, {JOINT: attached})[JOINT]
        one = np.ones(1)
        limit = s.torque_limit_Nm or ratings.repeated_peak / abs(ratio)
        joints = KnownJoints(
            names=(JOINT,),
            drives=(transmission_of(attached, drive).told,),
            rotor_inertia=s.rotor_inertia_kgm2 * one,
            link_inertia=s.link_inertia * one,
            damping=attached.damping * one,
            torque_limit=limit * one,
        )
        loop = MotorLoop.none(joints.ratio)
        if loop_Hz is not None:
            loop = MotorLoop.from_frequency(
                joints, frequency=loop_Hz, damping_ratio=loop_damping_ratio
            )
        motor = spec.add_actuator(name="motor", target=attached.rotor)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gear[0] = 1.0
        motor.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        motor.forcerange = [-limit, limit]
        if loop_Hz is not None:
            motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            motor.biasprm[:3] = [0.0, -loop.stiffness[0], -loop.damping[0]]
        self.spec = spec
        """Specification of the model, with drive and motor."""
        model = compile_spec(spec, where="environment on the bench")
        plant = Plant(
            model,
            [attached],
            count,
            start=(np.zeros(1), np.zeros(1)),
            sub_steps=sub_steps,
            threads=threads,
            variable=variable,
        )
        self._place = int(model.body(BODY).id), int(model.joint(JOINT).dofadr[0])
        self._inertias: tuple[Array, Array] | None = None
        if tolerances is not None and tolerances.load_inertia:
            # the engine takes dof_M0 for a body whose part of the matrix is diagonal
            names = "body_inertia", "dof_M0"
            self._inertias = tuple(plant.batch.expand(name) for name in names)
        self.joint = attached
        super().__init__(
            plant,
            joints=joints,
            loop=loop,
            limits=EpisodeLimits(
                angle=(2.0 * s.max_angle_rad + 1.0) * one,
                centre=np.zeros(1),
                motor_speed=top_speed * one,
                momentary_peak=ratings.momentary_peak * one,
                ratcheting=(ratings.ratcheting_torque or np.inf) * one,
                motor_torque=limit * one,
            ),
            sensors=Sensors.from_argument(s.sensors),
            tolerances=tolerances,
            period=s.period_s,
            steps=s.steps,
            normalise=bool(s.normalise),
            gauges=_gauges(s, drive),
        )

    @property
    def worst_error(self) -> float:
        """Link error that stands for an exceeded limit [rad]."""
        return float(self.limits.angle[0])

    def shown_error(self) -> Array:
        """Link angle minus reference [rad]. Shape (n,)."""
        return self.link_error[:, 0]

    def vary_load(self, index: int, shares: Array) -> None:
        """Change the load inertia of one simulation.

        Args:
            index: Index of the simulation.
            shares: Change of the inertia relative to its nominal value [-]. Shape (1,).
        """
        if self._inertias is not None:
            inertia = (1.0 + float(shares[0])) * self.settings.link_inertia
            (of_bodies, of_dofs), (body, dof) = self._inertias, self._place
            of_bodies[index, body, 2] = of_dofs[index, dof] = inertia

    @property
    def varies_load(self) -> bool:
        """Whether the simulations have load inertias of their own."""
        return self._inertias is not None

    @property
    def load_inertia(self) -> Array:
        """Load inertia of every simulation [kg·m²]. Shape (n,)."""
        if self._inertias is None:
            return np.full(len(self.instant), self.settings.link_inertia)
        return np.asarray(self._inertias[0][:, self._place[0], 2])

    def motor_entries(self) -> tuple[Entry, ...]:
        """Entries of the measured motor angle and speed."""
        ratio, limits = abs(self.joint.ratio), self.limits
        angle = ceiling(1.01 * ratio * float(limits.angle[0]))
        speed = ceiling(1.5 * float(limits.motor_speed[0]))
        return (
            Entry(meaning="measured motor angle", unit="rad", low=-angle, high=angle),
            Entry(meaning="measured motor speed", unit="rad/s", low=-speed, high=speed),
        )

    def error_entries(self, acceleration: float) -> tuple[Entry, ...]:
        """Entries of the measured tracking errors of motor angle and speed.

        Args:
            acceleration: Largest acceleration of the reference at the link [rad/s²].
        """
        angle, speed = error_bounds(
            self.joint.ratio,
            speed=self.settings.max_speed_rad_s,
            acceleration=acceleration,
            age=self.sensors.delay_periods * self.period,
            period=self.period,
        )
        return (
            Entry(meaning="motor angle error", unit="rad", low=-angle, high=angle),
            Entry(meaning="motor speed error", unit="rad/s", low=-speed, high=speed),
        )

    def sensor_entries(self) -> tuple[Entry, ...]:
        """Entries of link encoder, torque sensor and strain gauges, if present."""
        limits, entries = self.limits, []
        if self.sensors.link_encoder:
            angle = ceiling(1.01 * float(limits.angle[0]))
            entries.append(
                Entry(meaning="measured link angle", unit="rad", low=-angle, high=angle)
            )
        if self.sensors.torque_sensor:
            top = ceiling(1.1 * float(limits.momentary_peak[0]))
            entries.append(
                Entry(meaning="measured output torque", unit="N·m", low=-top, high=top)
            )
        for gauges in self.gauges.values():
            ripple = gauges.largest_ripple
            top = ceiling(1.1 * (float(limits.momentary_peak[0]) + ripple))
            what = "output torque that strain gauges read"
            entries.append(Entry(meaning=what, unit="N·m", low=-top, high=top))
        return tuple(entries)


def _gauges(settings: BenchSettings, drive: DriveMap) -> dict[int, JointGauges]:
    """Strain gauges of the settings on the nominal drive, of joint 0."""
    stated = settings.gauges
    if stated is None:
        return {}
    if not isinstance(stated, Mapping):
        raise InputError(
            f"gauges {format_value(stated)}; accepted: None or a mapping with"
            f" {', '.join(GaugesSection.model_fields)}"
        )
    section = validate(GaugesSection, stated, where="gauges")
    reference = settings.drive if isinstance(settings.drive, str) else None
    return {0: gauges_of_drive(section, drive, reference, where="gauges")}


def _bench(
    settings: BenchSettings, drive: DriveMap, *, variable: bool, top_speed: float
) -> tuple[mujoco.MjSpec, JointDrive]:
    """Model of the bench with load and drive but without a motor, and the drive."""
    s, spec = settings, RigidArm("bench").spec()
    spec.option.timestep = s.period_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    body = spec.body(BODY)
    # the engine requires each principal inertia to be at most the sum of the others
    across = max(float(body.inertia[0]), 0.6 * s.link_inertia)
    body.inertia = np.array([across, across, s.link_inertia])
    attached = attach(
        spec,
        joint=JOINT,
        drive=drive,
        level=s.level,
        rotor_inertia=s.rotor_inertia_kgm2,
        friction=s.friction,
        variable=variable,
        max_input_speed=top_speed,
    )
    return spec, attached


def settings_of(kind: type[Any], arguments: dict[str, Any]) -> Any:
    """Settings from the keyword arguments of an environment.

    Args:
        kind: Class of the settings.
        arguments: Keyword arguments of the environment.

    Raises:
        InputError: If an argument is unknown or its value is not accepted.
    """
    known = kind.__dataclass_fields__
    if unknown := sorted(set(arguments) - set(known)):
        raise InputError(
            f"environment has no argument {unknown[0]!r}; accepted: {', '.join(known)}"
        )
    return kind(**arguments)
