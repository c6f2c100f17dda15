"""``swgjoint.attach``: drives by name, file or design on the hinges of any model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypedDict, Unpack, overload

import mujoco

from swgjoint.drives.references import drive_of, load_drive
from swgjoint.drives.rotors import catalogue_rotor_inertia
from swgjoint.drives.sections import JointSection
from swgjoint.errors import InputError
from swgjoint.faults import validate
from swgjoint.gear.design.design import Design
from swgjoint.joint.attach import attach_all
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.fitting import Fitting, check_spec
from swgjoint.joint.patterns import chosen_hinges
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import with_assumed_error
from swgjoint.units import arcmin

DriveSource = DriveMap | Design | str | Path


class AttachOptions(TypedDict, total=False):
    """Options of :func:`attach`, which says what they mean."""

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
) -> JointDrive | dict[str, JointDrive]:
    """Turn hinges of a model into outputs of strain wave gears.

    One joint, or many with one compilation::

        swgjoint.attach(spec, joint="elbow", drive="CSG-25-100")
        swgjoint.attach(spec, {"shoulder_*": "CSG-32-100", "*": "CSG-17-100"})

    A drive is a catalogue name, the path of a ``.swg`` map or of a design, the name of
    a bundled design, a :class:`~swgjoint.gear.design.design.Design`, whose map is built
    (and cached), or a :class:`~swgjoint.maps.drive_map.DriveMap`. What the model gets
    and keeps: :func:`swgjoint.joint.attach.attach`.

    A step outside the integrator's region gives a warning: here if it is outside at
    rest, and by the engine when the model leaves the region while it runs, see
    :mod:`swgjoint.joint.watch`.

    Args:
        spec: Model to edit, as whole or not at all.
        drives: Drive by joint name or pattern (``*``, ``?``, ``[...]``). The first key
            that matches a joint counts. Hinges that a pattern matches and that cannot
            take a drive are left out, with one warning that lists them.
        joint: Name of one hinge, in place of ``drives``.
        drive: Its drive.
        level: ``rigid``, ``kinematic``, ``linear``, ``native`` or ``full``.
        rotor_inertia: Rotor and wave generator about their axis [kg·m²]. None for
            catalogue drives: twice the inertia of the wave generator.
        damping_ratio: Share of critical damping of rotor against link with the link
            inertia at qpos0, the other joints held; that of the map if None [-].
        friction: Whether the model has the friction of the map, where it has any.
        rotor: ``gyroscopic`` or ``lumped``.
        variable: At ``full``, let one specimen deviate from its map, see
            :mod:`swgjoint.joint.variation`.
        max_input_speed: Largest speed of the rotor [rad/s]; harmonics that the step
            cannot carry at it are left out. None keeps all.
        max_phase_step: Largest phase step h n |theta rate| that is kept [rad].
        integrator: ``discrete`` replaces Euler, ``implicit`` and ``implicitfast``, the
            latter two with a warning, and too few or too coarse iterations of the
            solver; ``keep`` keeps them.
        model: Fidelity of the map of a design: ``ring``, ``2d`` or ``3d``; its default
            if None.
        kinematic_error_arcmin: Peak to peak over one output turn of the error that a
            catalogue drive, or a map without any, is assumed to have, see
            :mod:`swgjoint.maps.fit.error_spectrum`. None: what the catalogue states.
        seed: Of that error; joints differ by their names.

    Returns:
        What the joint has, or by joint in the order of the model.

    Raises:
        InputError: If a joint, a drive or a value cannot be used, a line for each; the
            spec is then unchanged.
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
    known: dict[str, DriveMap] = {}
    fittings = {}
    for name, key in chosen.items():
        found = _map(sources[key], name, known, model, kinematic_error_arcmin, seed)
        fittings[name] = Fitting(
            drive=found,
            rotor_inertia=_rotor(name, found, rotor_inertia),
            level=level,
            damping_ratio=damping_ratio,
            friction=friction,
            rotor=rotor,
            variable=variable,
            max_input_speed=max_input_speed,
            max_phase_step=max_phase_step,
        )
    got = attach_all(spec, fittings, integrator=integrator, watch=True)
    return got if joint is None else got[joint]


def _map(
    source: Any,
    joint: str,
    known: dict[str, DriveMap],
    model: str | None,
    error: float | None,
    seed: int,
) -> DriveMap:
    """The map of one joint; ``known`` keeps what several joints share."""
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


def _rotor(joint: str, drive: DriveMap, given: float | None) -> float:
    """Inertia of the rotor [kg·m²]."""
    if given is not None:
        return given
    assumed = (
        catalogue_rotor_inertia(drive.name) if drive.level == "catalogue" else None
    )
    if assumed is None:
        raise InputError(
            f"joint {joint!r}: rotor_inertia of drive {drive.name!r} is not known;"
            " accepted: rotor_inertia=... [kg·m²], rotor and wave generator about their"
            " axis"
        )
    return assumed
