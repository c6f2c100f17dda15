"""Settings of a drive at one joint, their checks, and the resulting joint drive."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.flags import check_flags
from swgjoint.joint.drive import (
    CONTACT_DAMPING_RATIO,
    LEAST_DAMPING_RATIO,
    JointDrive,
    UnresolvedOrder,
    prune,
)
from swgjoint.joint.native import NativeSpring, fit_native
from swgjoint.joint.place import DrivePlace
from swgjoint.joint.prescribed import kinematic_part, ratio_variation
from swgjoint.maps.drive_map import DriveMap

LEVELS = ("rigid", "kinematic", "linear", "native", "full")
"""Levels of detail of a joint, see :func:`swgjoint.joint.attach.attach`."""
ROTORS = ("gyroscopic", "lumped")
"""Models of the rotor, see :func:`swgjoint.joint.attach.attach`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitting:
    """Drive and settings of one joint, see :func:`swgjoint.joint.attach.attach`."""

    drive: DriveMap
    """Map of the drive."""
    rotor_inertia: float
    """Inertia of rotor and wave generator about their axis [kg·m²]."""
    level: str = "full"
    """Level of detail, one of :data:`LEVELS`."""
    damping_ratio: float | None = None
    """Damping ratio of the torsional vibration [-]; None takes that of the map."""
    friction: bool = True
    """Whether the model includes the friction of the map."""
    rotor: str = "gyroscopic"
    """Model of the rotor, one of :data:`ROTORS`."""
    variable: bool = False
    """Whether the drive may deviate from its map at ``full``."""
    max_input_speed: float | None = None
    """Largest speed of the rotor [rad/s]; None keeps all harmonics."""
    max_phase_step: float = 0.5
    """Largest phase step h n |theta rate| of a harmonic that is kept [rad]."""

    @property
    def has_rotor(self) -> bool:
        """Whether the level gives the rotor a joint of its own."""
        return self.level not in ("rigid", "kinematic")

    def check(self, joint: str) -> None:
        """Reject values outside their range.

        Raises:
            InputError: If a value is outside its range; the message states the value,
                its unit and the accepted values.
        """
        if not isinstance(self.drive, DriveMap):
            raise InputError(
                f"drive of joint {joint!r}: {type(self.drive).__name__}"
                f" {str(self.drive)[:60]!r}; accepted: a DriveMap"
            )
        if self.level not in LEVELS:
            raise InputError(
                f"level {self.level!r} unknown; accepted: {', '.join(LEVELS)}"
            )
        _positive("rotor_inertia", self.rotor_inertia, "kg·m²")
        if self.rotor not in ROTORS:
            raise InputError(
                f"rotor {self.rotor!r} unknown; accepted: {', '.join(ROTORS)}"
            )
        check_flags(friction=self.friction, variable=self.variable)
        ratio = self.damping_ratio
        if ratio is not None and not (np.isfinite(ratio) and 0.0 <= ratio < 1.0):
            raise InputError(f"damping_ratio {ratio} of {joint!r}; accepted: >= 0, < 1")
        if self.max_input_speed is not None:
            _positive("max_input_speed", self.max_input_speed, "rad/s")
        _positive("max_phase_step", self.max_phase_step, "rad")


def fit_drive(
    joint: str, fitting: Fitting, place: DrivePlace, *, timestep: float
) -> JointDrive:
    """Drive of a joint: names of its elements, parameters and map as simulated.

    Args:
        joint: Name of the joint.
        fitting: Drive and settings of the joint.
        place: Position and inertia of the joint in the model.
        timestep: Step of the model [s].

    Raises:
        InputError: At ``kinematic``, if the kinematic error varies the ratio by 100 %
            or more.
    """
    drive, level = fitting.drive, fitting.level
    if not fitting.friction and drive.friction is not None:
        drive = drive.with_parts(friction=None)
    ratio, stiffness = drive.ratio, drive.mean_stiffness
    damping_ratio = fitting.damping_ratio
    if damping_ratio is None:
        damping_ratio = drive.damping_ratio
    reflected = ratio**2 * fitting.rotor_inertia
    reduced = reflected * place.inertia / (reflected + place.inertia)
    critical = 2.0 * float(np.sqrt(stiffness * reduced))
    lossless = drive.friction is None and damping_ratio < LEAST_DAMPING_RATIO
    if level == "kinematic":
        drive = kinematic_part(drive)
    unresolved: tuple[UnresolvedOrder, ...] = ()
    if level in ("kinematic", "full") and fitting.max_input_speed is not None:
        drive, unresolved = prune(
            drive,
            timestep=timestep,
            max_input_speed=fitting.max_input_speed,
            max_phase_step=fitting.max_phase_step,
        )
    if level == "kinematic" and not ratio_variation(drive) < 1.0:
        raise InputError(
            f"map {drive.name!r}: its kinematic error changes the ratio by up to"
            f" {ratio_variation(drive):.3g} of its value; accepted at level kinematic:"
            " below 1"
        )
    spring: NativeSpring | None = fit_native(drive) if level == "native" else None
    elements = range(len(spring.hysteresis)) if spring else ()
    corners = range(len(spring.corners)) if spring else ()
    own = fitting.has_rotor
    return JointDrive(
        joint=joint,
        rotor=f"{joint}_rotor" if own else None,
        tendon=f"{joint}_drive" if own else None,
        plugin=f"{joint}_drive" if level == "full" else None,
        level=level,
        ratio=ratio,
        rotor_inertia=float(fitting.rotor_inertia),
        link_inertia=place.inertia,
        stiffness=stiffness,
        damping=damping_ratio * critical if own else 0.0,
        contact_damping=(
            CONTACT_DAMPING_RATIO * critical if level == "full" and lossless else 0.0
        ),
        drive=drive,
        unresolved=unresolved,
        native=spring,
        hysteresis=tuple(f"{joint}_hysteresis{k}" for k in elements),
        corners=tuple(f"{joint}_corner{k}" for k in corners),
        motors=tuple(actuator.name for actuator in place.actuators.values()),
        variable=fitting.variable and level == "full",
    )


def check_spec(spec: object) -> None:
    """Reject an argument that is not an ``MjSpec``, naming its type.

    Raises:
        InputError: If ``spec`` is of another type; the message names it.
    """
    if isinstance(spec, mujoco.MjSpec):
        return
    what = f"a {type(spec).__name__}"
    if isinstance(spec, mujoco.MjModel):
        what = "a compiled MjModel, which cannot be edited"
    elif isinstance(spec, str):
        what = f"the text {spec[:60]!r}"
    raise InputError(
        f"spec is {what}; accepted: a mujoco.MjSpec, e.g."
        " mujoco.MjSpec.from_file('arm.xml')"
    )


def _positive(name: str, value: float, unit: str) -> None:
    number = isinstance(value, int | float | np.integer | np.floating)
    if not (number and np.isfinite(value) and value > 0.0):
        raise InputError(f"{name} {value!s} {unit}; accepted: a finite number > 0")
