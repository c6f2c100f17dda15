"""A scene file: an arm, its drives, a motion, a controller and a time step."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, PrivateAttr, model_validator

from swgjoint.drives.references import may_be_built
from swgjoint.drives.sections import DRIVE_KEYS, JointSection, Level
from swgjoint.errors import InputError
from swgjoint.faults import Fault, Section, validate
from swgjoint.flags import check_flags
from swgjoint.models_path import find
from swgjoint.sim.arm.reading import ArmReading
from swgjoint.sim.scene.anchoring import anchor_paths
from swgjoint.sim.scene.cycle_section import Cycle
from swgjoint.sim.scene.feature_sections import (
    Disturbance,
    Payload,
    SensorsSection,
    misfits,
    too_fast,
)
from swgjoint.sim.scene.overrides import merge
from swgjoint.sim.scene.sections import (
    AcceptanceSection,
    ControllerSection,
    LoadSection,
    Metrics,
    Recording,
    Several,
    Simulation,
)
from swgjoint.sim.scene.trajectory_sections import ChirpSection, TrajectorySection
from swgjoint.toml_file import parse_toml, read_toml
from swgjoint.units import deg

MAX_STEPS = 2_000_000
"""Largest number of recorded steps of a run. Only the available memory limits the
number of sub-steps."""


class Scene(Section):
    """One scene; its attributes have the names and units of the keys of the file."""

    name: str
    """Name of the scene, and of its runs by default."""
    description: str = ""
    """Description in one sentence, as shown by ``swgjoint list scenes``."""
    arm: str
    """Path of an MJCF or URDF file, or name of a bundled arm."""
    tool_site: str = "tool"
    """Name of the site, or of the body, at the tool position. An arm need not have the
    default site."""
    driven: Annotated[tuple[str, ...], Several] = ()
    """Names or patterns (``*``, ``?``) of the hinges that have drives; all if empty.
    The other hinges are held at ``trajectory.start_deg`` or ``pose``."""
    pose: str | None = None
    """Keyframe of the arm's file at which joints without a drive are held; if omitted,
    they are held at the reference position."""
    balance_inertia: bool = False
    """Whether to repair inertias that no rigid body can have: their mean replaces the
    three principal moments. A body that has a mass alone becomes a solid sphere with
    the density of water."""
    defaults: JointSection = JointSection()
    """Settings of all joints, which ``joints`` overrides."""
    joints: dict[str, JointSection] = Field(default_factory=dict)
    """Settings of single joints, by joint name."""
    trajectory: TrajectorySection
    """Commanded motion; ``kind`` selects the keys."""
    controller: ControllerSection = ControllerSection()
    """Position control of the motors."""
    load: dict[str, LoadSection] = Field(default_factory=dict)
    """Constant torque that the load exerts against a joint, by joint name."""
    sensors: SensorsSection | None = None
    """Sensors of the controller; if omitted, the controller reads every angle exactly
    and without delay."""
    payload: Payload | None = None
    """Body that the arm carries at its tool."""
    disturbance: list[Disturbance] = Field(default_factory=list)
    """Torques and forces that the controller does not know in advance."""
    cycle: Cycle = Field(default_factory=list)
    """Duty cycle for the life of the drives, one table per task; without it, a run
    reports no life. A table without keys is the motion of the scene itself."""
    simulation: Simulation
    """Duration and time stepping."""
    recording: Recording = Recording()
    """Contents and layout of the recording for the viewer."""
    metrics: Metrics = Metrics()
    """Reference values for the figures of a run."""
    acceptance: AcceptanceSection | None = None
    """Test of one drive for ``swgjoint accept``; ``run`` ignores it."""

    _where: str = PrivateAttr(default="scene")

    @property
    def reading(self) -> ArmReading:
        """Choices for reading the arm's file."""
        angles = {name: q * deg for name, q in self.trajectory.start_deg.items()}
        return ArmReading(
            driven=self.driven,
            pose=self.pose,
            angles=angles,
            balance_inertia=self.balance_inertia,
        )

    @property
    def where(self) -> str:
        """Name of this scene in messages: by default its file or ``scene``."""
        return self._where

    @model_validator(mode="after")
    def _times_fit(self) -> Self:
        """Check durations, periods and frequencies against the time step."""
        duration, step = self.simulation.duration_s, self.simulation.step_s
        needed = self.trajectory.shortest_s
        faults = []
        run = round(duration / step) * step
        if run <= needed + 1e-9:
            rounded = (
                "" if abs(run - duration) < 1e-9 else f", in whole steps {run:g} s"
            )
            faults.append(
                (
                    "simulation.duration_s",
                    f"{duration:g} s{rounded}; accepted: more than the {needed:g} s"
                    " of holds, ramps and settling of the trajectory",
                )
            )
        if duration / step > MAX_STEPS:
            faults.append(
                (
                    "simulation.step_s",
                    f"{step:g} s gives {duration / step:.3g} steps; accepted: at most"
                    f" {MAX_STEPS} steps in a run",
                )
            )
        times = {"controller.control_period_s": self.controller.control_period_s}
        for side in ("motor", "link", "torque") if self.sensors else ():
            sensor = getattr(self.sensors, side)
            if sensor is not None:
                times[f"sensors.{side}.delay_s"] = sensor.delay_s
        if self.sensors and self.sensors.link and self.controller.feedback == "motor":
            faults.append(
                (
                    "sensors.link",
                    "not used; accepted: with controller.feedback = 'link'",
                )
            )
        faults += [
            (key, f"{value:g} s; accepted: a multiple of step_s, {step:g} s")
            for key, value in times.items()
            if value
            and (
                round(value / step) < 1
                or abs(value / step - round(value / step)) > 1e-6
            )
        ]
        if isinstance(self.trajectory, ChirpSection):
            faults += [
                (f"trajectory.{key}", fault)
                for key in ("from_Hz", "to_Hz")
                for fault in too_fast(getattr(self.trajectory, key), step)
            ]
        for k, one in enumerate(self.disturbance):
            misfit = misfits(one, run=run, step=step)
            faults += [(f"disturbance[{k}].{key}", fault) for key, fault in misfit]
        if faults:
            raise Fault(*faults)
        return self

    @property
    def sampled(self) -> bool:
        """Whether the controller is sampled, that is, runs once per control period."""
        controller = self.controller
        return (
            controller.kind == "computed_torque"
            or controller.control_period_s is not None
            or controller.feedback == "link"
            or self.sensors is not None
        )

    @classmethod
    def load_file(
        cls,
        reference: str | Path,
        overrides: Mapping[str, Any] | Iterable[str] | None = None,
    ) -> Self:
        """Read a scene file.

        Args:
            reference: Path or bundled name.
            overrides: Dotted keys with new values, as a mapping or as ``key=value``
                strings whose value is parsed as TOML (a bare word is a string).

        Raises:
            InputError: If the file has faults; one line per fault.
        """
        path = find(reference, "scenes", ".toml", what="scene")
        data = read_toml(path, what="scene")
        anchor_paths(data, path.parent)
        return cls.from_data(data, where=str(path), overrides=overrides)

    @classmethod
    def from_toml(cls, text: str, where: str = "scene") -> Self:
        """Read a scene from the text of a scene file.

        Args:
            text: TOML text.
            where: Name of the scene in messages.

        Raises:
            InputError: If the text has faults; one line per fault.
        """
        return cls.from_data(parse_toml(text, where=where), where=where)

    @classmethod
    def from_data(
        cls,
        data: Mapping[str, Any],
        *,
        where: str = "scene",
        overrides: Mapping[str, Any] | Iterable[str] | None = None,
    ) -> Self:
        """Read a scene from plain tables.

        Args:
            data: Tables of a scene file.
            where: Name of the scene in messages.
            overrides: Changes, see :meth:`load_file`.

        Raises:
            InputError: If the tables have faults; one line per fault.
        """
        merged = merge(data, overrides, where)
        lines: list[str] = []
        # tables by joint are checked one by one, so that messages name their keys
        for table, model in (("joints", JointSection), ("load", LoadSection)):
            entries = merged.get(table)
            if not isinstance(entries, dict):
                continue
            faulty = [
                line
                for joint, entry in entries.items()
                if isinstance(entry, dict)
                for line in _faults_of(model, entry, f"{where}: {table}.{joint}")
            ]
            if faulty:
                lines += faulty
                merged[table] = {}
        try:
            scene = validate(cls, merged, where=where)
        except InputError as exc:
            lines += str(exc).split("\n")
        if lines:
            raise InputError("\n".join(dict.fromkeys(lines)))
        scene._where = where
        return scene

    def with_changes(self, overrides: Mapping[str, Any] | Iterable[str]) -> Self:
        """A checked copy with new values for some keys.

        Args:
            overrides: Dotted keys with new values, see :meth:`load_file`.

        Raises:
            InputError: If the changed scene has faults; one line per fault.
        """
        data = self.model_dump(exclude_unset=True)
        return self.from_data(data, where=self.where, overrides=overrides)

    def task_scene(self, k: int) -> Self:
        """The scene of one task of the duty cycle, which must not be a rest.

        Args:
            k: Index of the task.

        Raises:
            InputError: If the task does not fit the time step; one line per fault.
        """
        task = self.cycle[k]
        data = self.model_dump(exclude_unset=True) | {"cycle": []} | task.changes
        if task.duration_s is not None:
            data["simulation"] = data["simulation"] | {"duration_s": task.duration_s}
        return self.from_data(data, where=f"{self.where}: cycle[{k}]")

    def with_drive(self, drive: str) -> Self:
        """A copy in which every joint has this drive, a design at default fidelity."""
        none = dict.fromkeys((*DRIVE_KEYS, "model"))
        return self._with_all(**{**none, "drive": drive})

    def with_drives(self, drives: Mapping[str, str]) -> Self:
        """A copy in which some joints have these drives, by joint name."""
        own = {
            name: self.joints.get(name, JointSection()).with_drive(drive)
            for name, drive in drives.items()
        }
        return self._updated(joints=self.joints | own)

    def with_model(self, model: str) -> Self:
        """A copy whose designs get maps of this fidelity.

        Raises:
            InputError: If the scene states drives and none of them is a design.
        """
        stated = [
            one for one in (self.defaults, *self.joints.values()) if one.has_drive
        ]
        if stated and not any(map(_names_design, stated)):
            drives = sorted({repr(one.drive or "linear or numbers") for one in stated})
            raise InputError(
                f"{self.where}: model {model!r}: no joint has a design, its drives are"
                f" {', '.join(drives)}; accepted: a design, e.g. --set"
                " joints.JOINT.drive=DESIGN, or no model"
            )
        return self._with_all(model=model)

    def with_level(self, level: Level) -> Self:
        """A copy in which every joint has this level."""
        return self._with_all(level=level)

    def with_friction(self, friction: bool) -> Self:
        """A copy in which all joints have the friction of their drives, or none has."""
        check_flags(friction=friction)
        return self._with_all(friction=friction)

    def with_kinematic_error(self, arcmin: float | None) -> Self:
        """A copy with this peak-to-peak kinematic error in every joint.

        Args:
            arcmin: Assumed error [arcmin]; None uses the transmission accuracy that the
                catalogue states, if it states one.
        """
        return self._with_all(kinematic_error_arcmin=arcmin)

    def with_payload(self, payload: Payload | None) -> Self:
        """A copy with this payload at the tool, or without one."""
        return self._updated(payload=payload)

    def _with_all(self, **values: Any) -> Self:
        """A copy in which all joints have these settings."""
        defaults = self.defaults.model_copy(update=values)
        joints = {
            name: joint.model_copy(update={key: None for key in values})
            for name, joint in self.joints.items()
        }
        return self._updated(defaults=defaults, joints=joints)

    def _updated(self, **values: Any) -> Self:
        """A copy with other values of checked keys, from the same file."""
        copy = self.model_copy(update=values)
        copy._where = self._where
        return copy

    def joint_settings(self, name: str) -> JointSection:
        """Settings of one joint; its own values override the defaults.

        The model of the defaults does not apply to a joint whose own drive is not a
        design.
        """
        own, base = self.joints.get(name, JointSection()), self.defaults
        if own.has_drive and not _names_design(own):
            base = base.model_copy(update={"model": None})
        return own.fill_from(base)


def _names_design(section: JointSection) -> bool:
    """Whether the drive of a section may be a design, from which a map is built."""
    return section.drive is not None and may_be_built(section.drive)


def _faults_of(model: type[Section], entry: dict[str, Any], path: str) -> list[str]:
    """Messages about one table at a dotted path of the file."""
    try:
        validate(model, entry, where="\0")
    except InputError as exc:
        return [line.replace("\0: ", f"{path}.", 1) for line in str(exc).split("\n")]
    return []
