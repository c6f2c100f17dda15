"""``swgjoint.attach``: attach drives, stated by name, file or design, to hinges."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any, TypedDict, Unpack, overload

import mujoco

from swgjoint.drives.references import drive_of, load_drive
from swgjoint.drives.rotors import rotor_inertia_of
from swgjoint.drives.sections import JointSection
from swgjoint.errors import InputError
from swgjoint.faults import validate
from swgjoint.gear.bearing.output_bearing import OutputBearing, catalogue_bearing
from swgjoint.gear.design.design import Design
from swgjoint.joint.attach import attach_all
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.fitting import Fitting, check_spec
from swgjoint.joint.patterns import chosen_hinges
from swgjoint.joint.tilt import add_tilt_hinges
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import with_assumed_error
from swgjoint.maps.friction_temperature import at_temperature
from swgjoint.units import ZERO_CELSIUS, arcmin

DriveSource = DriveMap | Design | str | Path
"""A map, a design, or the name or path of either."""


class AttachOptions(TypedDict, total=False):
    """Options of :func:`attach`, which documents them."""

    level: str
    rotor_inertia: float | None
    damping_ratio: float | None
    friction: bool
    rotor: str
    variable: bool
    max_input_speed: float | None
    max_phase_step: float
    integrator: str
    model: str | None
    kinematic_error_arcmin: float | None
    seed: int
    temperature_C: float | None
    output_bearing: OutputBearing | str | None


@overload
def attach(
    spec: mujoco.MjSpec,
    drives: Mapping[str, DriveSource],
    **options: Unpack[AttachOptions],
) -> dict[str, JointDrive]: ...


@overload
def attach(
    spec: mujoco.MjSpec,
    *,
    joint: str,
    drive: DriveSource,
    **options: Unpack[AttachOptions],
) -> JointDrive: ...


def attach(
    spec: mujoco.MjSpec,
    drives: Mapping[str, DriveSource] | None = None,
    *,
    joint: str | None = None,
    drive: DriveSource | None = None,
    level: str = "full",
    rotor_inertia: float | None = None,
    damping_ratio: float | None = None,
    friction: bool = True,
    rotor: str = "gyroscopic",
    variable: bool = False,
    max_input_speed: float | None = None,
    max_phase_step: float = 0.5,
    integrator: str = "discrete",
    model: str | None = None,
    kinematic_error_arcmin: float | None = None,
    seed: int = 0,
    temperature_C: float | None = None,
    output_bearing: OutputBearing | str | None = None,
) -> JointDrive | dict[str, JointDrive]:
    """Turn hinges of a model into outputs of strain wave gears.

    One call drives a single joint, or many joints with one compilation::

        swgjoint.attach(spec, joint="elbow", drive="CSG-25-100")
        swgjoint.attach(spec, {"shoulder_*": "CSG-32-100", "*": "CSG-17-100"})

    A drive is a catalogue name, the path of a ``.swg`` map or of a design, the name of
    a bundled design, a :class:`~swgjoint.gear.design.design.Design`, whose map is built
    (and cached), or a :class:`~swgjoint.maps.drive_map.DriveMap`.
    :func:`swgjoint.joint.attach.attach` describes what changes in the model.

    A time step outside the stability region of the integrator gives a warning: from
    this function if the model is outside at rest, from the engine if it leaves the
    region while it runs; see :mod:`swgjoint.joint.watch`.

    Args:
        spec: Model to edit; it remains unchanged if anything fails.
        drives: Drive by joint name or pattern (``*``, ``?``, ``[...]``). The first key
            that matches a joint applies. Hinges that match a pattern but cannot take a
            drive are skipped, with one warning that lists them.
        joint: Name of a single hinge, instead of ``drives``.
        drive: Drive of that hinge.
        level: ``rigid``, ``kinematic``, ``linear``, ``native`` or ``full``.
        rotor_inertia: Inertia of rotor and wave generator about their axis [kg·m²].
            None assumes twice the inertia of the wave generator, which follows ratio
            and rated torque; not with a drive of a single stiffness.
        damping_ratio: Damping ratio of the torsional vibration between rotor and link
            [-], with the link inertia at qpos0 and the other joints locked; None takes
            the value of the map.
        friction: Whether the model includes the friction of the map, if it has any.
        rotor: ``gyroscopic`` or ``lumped``.
        variable: At ``full``, let individual drives deviate from their map, see
            :mod:`swgjoint.joint.variation`.
        max_input_speed: Largest speed of the rotor [rad/s]; harmonics that the time
            step cannot resolve at this speed are omitted. None keeps all harmonics.
        max_phase_step: Largest phase step ``h n |theta rate|`` of a harmonic that is
            kept [rad].
        integrator: If a level has a rotor, ``discrete`` replaces Euler, ``implicit``
            and ``implicitfast`` (the last two with a warning), raises iteration limits
            of the solver below MuJoCo's defaults, and replaces a tolerance that is too
            coarse; ``keep`` changes none of these.
        model: Fidelity of the map of a design: ``ring``, ``2d`` or ``3d``; None takes
            the default of the design.
        kinematic_error_arcmin: Assumed kinematic error, peak to peak over one output
            turn [arcmin], of a catalogue drive or of a map without kinematic error; see
            :mod:`swgjoint.maps.fit.error_spectrum`. None takes the catalogue value.
        seed: Seed of the assumed error; joints differ by their names.
        temperature_C: Temperature of the lubricant [°C] of drives that state their
            friction over temperature; None takes the friction of the drive.
        output_bearing: Bearing on which every link tilts, see
            :func:`~swgjoint.joint.tilt.add_tilt_hinges`, or the name of a housed unit
            such as ``CSG-25``; it needs the integrator ``discrete``. None leaves rigid
            hinges.

    Returns:
        The drive of the joint; with ``drives``, all drives by joint name in the order
        of the model.

    Raises:
        InputError: If a joint, a drive or a value cannot be used; the spec is then
            unchanged. One message lists all joints that cannot take a drive.
        ComputationError: If the plugin cannot be loaded.
    """
    check_spec(spec)
    if drives is None:
        if joint is None or drive is None:
            raise InputError(
                "attach needs joint and drive, or a mapping of joint names and"
                " patterns to drives"
            )
        chosen, sources = {joint: joint}, {joint: drive}
    elif joint is not None or drive is not None:
        raise InputError("attach takes joint and drive, or a mapping, not both")
    elif not isinstance(drives, Mapping):
        raise InputError(
            f"drives is a {type(drives).__name__}; accepted: a mapping of joint names"
            " and patterns to drives"
        )
    else:
        chosen, sources = chosen_hinges(spec, drives), dict(drives)
    bearing = _bearing(spec, output_bearing, level=level, integrator=integrator)
    known: dict[str, DriveMap] = {}
    fittings = {}
    for name, key in chosen.items():
        drive_map = _map(sources[key], name, known, model, kinematic_error_arcmin, seed)
        if temperature_C is not None:
            drive_map = at_temperature(
                drive_map,
                _celsius(temperature_C) + ZERO_CELSIUS,
                where=f"joint {name!r}: temperature_C = {temperature_C:g} °C",
            )
        fittings[name] = Fitting(
            drive=drive_map,
            rotor_inertia=_rotor(name, drive_map, rotor_inertia),
            level=level,
            damping_ratio=damping_ratio,
            friction=friction,
            rotor=rotor,
            variable=variable,
            max_input_speed=max_input_speed,
            max_phase_step=max_phase_step,
        )
    attached = attach_all(spec, fittings, integrator=integrator, watch=True)
    if bearing is not None:
        add_tilt_hinges(spec, dict.fromkeys(attached, bearing))
    return attached if joint is None else attached[joint]


def _map(
    source: Any,
    joint: str,
    known: dict[str, DriveMap],
    model: str | None,
    error: float | None,
    seed: int,
) -> DriveMap:
    """The map of one joint; ``known`` keeps the maps that several joints share."""
    if isinstance(source, Design):
        key = f"{id(source)}"
        if key not in known:
            known[key] = load_drive(source, model=model)
        source = known[key]
    if isinstance(source, DriveMap):
        if not error:
            return source
        return with_assumed_error(source, error * arcmin, seed=seed, joint=joint)
    if isinstance(source, str | Path):
        keys = {
            "drive": str(source),
            "model": model,
            "kinematic_error_arcmin": None if error is None else float(error),
            "seed": seed,
        }
        section = validate(JointSection, keys, where=f"joint {joint!r}")
        return drive_of(section, known=known, joint=joint)
    raise InputError(
        f"drive of {joint!r}: {type(source).__name__} {str(source)[:60]!r}; accepted: a"
        " catalogue name, a path, a Design or a DriveMap"
    )


def _bearing(
    spec: mujoco.MjSpec,
    bearing: OutputBearing | str | None,
    *,
    level: str,
    integrator: str,
) -> OutputBearing | None:
    """The output bearing, if the model will have an integrator that can step it."""
    if bearing is None:
        return None
    if isinstance(bearing, str):
        try:
            bearing = catalogue_bearing(bearing)
        except InputError as error:
            raise InputError(f"output_bearing = {error}") from None
    elif not isinstance(bearing, OutputBearing):
        raise InputError(
            f"output_bearing is a {type(bearing).__name__}; accepted: an OutputBearing"
            " or the name of a housed unit"
        )
    kept = integrator == "keep" or level in ("rigid", "kinematic")
    kept |= spec.option.integrator == mujoco.mjtIntegrator.mjINT_RK4
    if kept and spec.option.integrator != mujoco.mjtIntegrator.mjINT_DISCRETE:
        raise InputError(
            "output_bearing needs spec.option.integrator = mjINT_DISCRETE, which steps"
            f" its stiff tilt implicitly; level {level!r} with integrator"
            f" {integrator!r} keeps another one"
        )
    return bearing


def _celsius(value: Any) -> float:
    """A temperature that is a finite number [°C]."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and isfinite(value)):
        raise InputError(f"temperature_C = {value!s:.40}; accepted: a number of °C")
    return float(value)


def _rotor(joint: str, drive: DriveMap, rotor_inertia: float | None) -> float:
    """Inertia of the rotor [kg·m²]: the caller's value or the assumed one."""
    if rotor_inertia is not None:
        return rotor_inertia
    assumed = rotor_inertia_of(drive)
    if assumed is None:
        raise InputError(
            f"joint {joint!r}: the rotor inertia of drive {drive.name!r} is unknown;"
            " set rotor_inertia=... (on the command line --rotor-inertia) [kg·m²], the"
            " inertia of rotor and wave generator about their axis"
        )
    return assumed
