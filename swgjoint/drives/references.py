"""Find, load or build the maps of the drives that a scene refers to."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from swgjoint.drives.sections import JointSection, LinearDrive, NumbersDrive
from swgjoint.errors import InputError
from swgjoint.gear.design.family import family_member
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import with_assumed_error
from swgjoint.maps.friction_temperature import at_temperature
from swgjoint.maps.from_catalogue import (
    catalogue_names,
    is_catalogue_name,
    with_stated_error,
)
from swgjoint.models_path import bundled_names, is_file, named_kind, near_names
from swgjoint.progress import Progress, silent
from swgjoint.units import ZERO_CELSIUS, arcmin

if TYPE_CHECKING:
    from swgjoint.gear.design.design import Design

WITHOUT_HARMONICS = ("rigid", "linear", "native")
"""Levels that use only the mean of a map, without its harmonics."""


def drive_of(
    section: JointSection,
    *,
    known: dict[str, DriveMap],
    joint: str = "",
    progress: Progress = silent,
) -> DriveMap:
    """The map of a joint's drive; ``known`` collects the maps that are loaded or built.

    The friction is that at the temperature of the section, if it states one. The map
    omits hysteresis if the section switches it off and, at levels that use
    harmonics, the harmonics below the tolerance of the section. A catalogue drive gets
    the kinematic error of its tables or of the section, with different phases at every
    joint. Maps in ``known`` are neither loaded nor built again.

    Args:
        section: Settings of the joint, which must have a drive.
        known: Maps by reference; the key ends with `` --model MODEL`` if the section
            sets a fidelity. New maps are added.
        joint: Name of the joint.
        progress: Called while a map is built.

    Returns:
        The map with the options of the section applied.

    Raises:
        InputError: If the reference is not a design, map file or catalogue drive, or
            does not support the options of the section.
    """
    drive = _without_options(section, known=known, joint=joint, progress=progress)
    if section.hysteresis is False and drive.hysteresis:
        info = {**drive.info, "hysteresis_left_out": len(drive.hysteresis)}
        drive = drive.with_parts(hysteresis=(), info=info)
    key, celsius = "temperature_C", section.temperature_C
    if celsius is None and section.thermal is not None:
        key, celsius = "thermal.ambient_C", section.thermal.ambient_C
    if celsius is not None:
        where = f"joints.{joint}." if joint else ""
        drive = at_temperature(
            drive,
            celsius + ZERO_CELSIUS,
            where=f"{where}{key} = {celsius:g} °C",
        )
    tolerance = section.harmonics_tolerance_arcmin
    if tolerance is None or section.level in WITHOUT_HARMONICS:
        return drive
    return drive.pruned(tolerance)


def _without_options(
    section: JointSection,
    *,
    known: dict[str, DriveMap],
    joint: str,
    progress: Progress,
) -> DriveMap:
    """The map with its kinematic error, hysteresis and all harmonics."""
    reference, model = section.drive, section.model
    wanted, seed = section.kinematic_error_arcmin, section.seed or 0
    where = f"joints.{joint}: " if joint else ""
    if model is not None and (reference is None or not may_be_built(reference)):
        stated = "linear" if section.linear else "numbers"
        drive_name = stated if reference is None else f"drive {reference!r}"
        raise InputError(
            f"{where}model {model!r} with {drive_name}, which is not a design;"
            " accepted: a design, or no model"
        )
    if section.linear is not None:
        drive = linear_map(section.linear)
    elif section.numbers is not None:
        key = f"numbers {section.numbers.model_dump_json()}"
        if key not in known:
            known[key] = numbers_map(section.numbers, where=where)
        drive = known[key]
    elif reference is None:
        raise ValueError("a joint without a drive has no map")
    elif reference not in known and names_catalogue(reference):
        return with_stated_error(
            _catalogue_drive(reference), wanted, seed=seed, joint=joint
        )
    else:
        drive = _loaded(reference, model, known, progress)
    if not wanted:
        return drive
    try:
        return with_assumed_error(drive, wanted * arcmin, seed=seed, joint=joint)
    except InputError as error:
        raise InputError(f"{where}{error}") from None


def _loaded(
    reference: str, model: str | None, known: dict[str, DriveMap], progress: Progress
) -> DriveMap:
    """The map of a file or a design, taken from ``known`` if present."""
    loaded = known.get(reference)
    if loaded is not None and model in (None, loaded.level):
        return loaded
    key = reference if model is None else f"{reference} --model {model}"
    if key not in known:
        known[key] = load_drive(reference, model=model, progress=progress)
    return known[key]


@lru_cache(maxsize=64)
def _catalogue_drive(reference: str) -> DriveMap:
    """A catalogue drive without kinematic error; arms often use one repeatedly."""
    return DriveMap.from_catalogue(reference, kinematic_error_arcmin=0.0)


def given_drives(drives: Mapping[str, DriveMap]) -> dict[str, DriveMap]:
    """Select the loaded drives that a scene need not load again.

    Catalogue drives are omitted because each joint gets its own specimen.
    """
    return {name: one for name, one in drives.items() if not names_catalogue(name)}


def linear_map(section: LinearDrive) -> DriveMap:
    """A map of constant stiffness from the ``linear`` table of a scene."""
    return DriveMap.linear(
        section.stiffness_Nm_rad,
        teeth_flexspline=section.teeth_flexspline,
        teeth_circular_spline=section.teeth_circular_spline,
        rated_torque=section.rated_torque_Nm,
    )


def numbers_map(section: NumbersDrive, *, where: str = "") -> DriveMap:
    """A map from the ``numbers`` table of a scene.

    Args:
        section: The table.
        where: Text that messages put before the key.

    Raises:
        InputError: If a figure contradicts another one.
    """
    K1, K2, K3 = section.K1_Nm_rad, section.K2_Nm_rad, section.K3_Nm_rad
    try:
        return DriveMap.from_numbers(
            stiffness=(K1, K2 or K1, K3 or K2 or K1),
            rated_torque=section.rated_torque_Nm,
            ratio=section.ratio,
            lost_motion_arcmin=section.lost_motion_arcmin,
            hysteresis_loss_arcmin=section.hysteresis_loss_arcmin,
            kinematic_error={
                int(order): amplitude
                for order, amplitude in section.kinematic_error_arcmin.items()
            },
            T1=section.T1_Nm,
            T2=section.T2_Nm,
            repeated_peak=section.repeated_peak_Nm,
            momentary_peak=section.momentary_peak_Nm,
            name=section.name,
        )
    except InputError as error:
        raise InputError(f"{where}numbers: {error}") from None


def load_drive(
    reference: str | Path | Design | DriveMap,
    *,
    model: str | None = None,
    angles: int | None = None,
    errors: bool = True,
    kinematic_error_arcmin: float | None = None,
    progress: Progress = silent,
) -> DriveMap:
    """The map of a ``.swg`` file, of the catalogue, or built from a design (cached).

    Args:
        reference: See :func:`find_drive`.
        model: Fidelity for a design; None takes its default.
        angles: Number of wave-generator positions for a design; None takes the default.
        errors: Whether a design keeps its manufacturing errors. Superposing them over
            the meshing cycle of the teeth takes minutes.
        kinematic_error_arcmin: Assumed kinematic error, peak to peak [arcmin], of a
            catalogue drive or of another drive without kinematic error. None takes the
            value of the catalogue and leaves other drives unchanged.
        progress: Called while a map is built.

    Returns:
        The map, loaded or built.

    Raises:
        InputError: If the reference is none of these, if ``model`` is given for
            something other than a design, or if a kinematic error is given for a drive
            that has its own.
    """
    wanted = kinematic_error_arcmin
    named = isinstance(reference, str) and names_catalogue(reference)
    if wanted is not None and named and model is None:
        return DriveMap.from_catalogue(str(reference), kinematic_error_arcmin=wanted)
    drive = _from_source(reference, model, angles, errors, progress)
    return with_assumed_error(drive, wanted * arcmin) if wanted else drive


def _from_source(
    reference: str | Path | Design | DriveMap,
    model: str | None,
    angles: int | None,
    errors: bool,
    progress: Progress,
) -> DriveMap:
    """See :func:`load_drive`."""
    source = find_drive(reference)
    if isinstance(source, DriveMap):
        if model is not None:
            raise InputError(
                f"model {model!r} with {_named(reference)!r}, a map of level"
                f" {source.level!r}; accepted: with a design"
            )
        return source
    from swgjoint.drives.build_map import build_map
    from swgjoint.gear.design.tolerances import has_errors, without_errors

    omit_errors = not errors and has_errors(source)
    if omit_errors:
        source = without_errors(source)
    drive = build_map(source, model=model, angles=angles, progress=progress)
    if not omit_errors:
        return drive
    return drive.with_parts(info={**drive.info, "manufacturing_errors": "left out"})


def _named(reference: str | Path | Design | DriveMap) -> str:
    return reference.name if isinstance(reference, DriveMap) else str(reference)


def find_drive(reference: str | Path | Design | DriveMap) -> DriveMap | Design:
    """Resolve a drive reference to a map or a design without building anything.

    A name that ends with ``.swg`` is a map; an existing file, a bundled name or
    ``size-NN-RRR`` is a design; a name that begins with a catalogue series
    (``CSG-25-100``) is a catalogue drive. A design or map object is returned unchanged.

    Raises:
        InputError: If the reference is none of these.

    >>> find_drive("CSG-25-100").level
    'catalogue'
    >>> find_drive("reference-2d").drive.teeth_flexspline
    120
    """
    if isinstance(reference, DriveMap):
        return reference
    from swgjoint.gear.design.design import Design

    if isinstance(reference, Design):
        return reference
    reference = str(reference)
    if reference.endswith(".swg"):
        return DriveMap.load(reference)
    if reference.endswith(".csv"):
        raise InputError(
            f"drive {reference!r}: a measured torque loop needs the teeth and the rated"
            f" torque of its drive; make a map of it: swgjoint map {reference} -o"
            " drive.swg --measured-teeth FS/CS --measured-rated NM"
        )
    if names_catalogue(reference):
        return DriveMap.from_catalogue(reference)
    try:
        return Design.load(reference)
    except InputError:
        file = is_file(reference)
        if file or named_kind(reference) or not re.fullmatch(r"[\w-]+", reference):
            raise
        if family_member(reference) is not None:
            raise
        raise InputError(_unknown(reference)) from None


def _unknown(reference: str) -> str:
    """Message for a name that is neither a design nor in the catalogue."""
    designs = bundled_names("drives", ".toml")
    near = near_names(reference, [*catalogue_names(), *designs])
    hint = f"did you mean {' or '.join(near)}? " if near else ""
    rows = [name.rsplit("-", 2)[:2] for name in catalogue_names()]
    series = ", ".join(dict.fromkeys(name for name, _ in rows))
    sizes = sorted({int(size) for _, size in rows})
    return (
        f"drive {reference!r} is neither a file nor in models/drives or"
        f" models/catalogue; {hint}accepted: a catalogue drive ({series}; sizes"
        f" {sizes[0]} to {sizes[-1]}; swgjoint list drives), a design (swgjoint list"
        " designs), size-NN-RRR, a design file or a .swg map"
    )


def names_catalogue(reference: str) -> bool:
    """Whether a reference names a catalogue drive rather than a file or a design."""
    return (
        is_catalogue_name(reference)
        and not reference.endswith(".swg")
        and not is_file(reference)
        and reference not in bundled_names("drives", ".toml")
    )


def may_be_built(reference: str) -> bool:
    """Whether a reference may name a design, from which a map can be built."""
    return not reference.endswith(".swg") and not names_catalogue(reference)


def check_joint_names(
    named: Mapping[str, set[str]], joints: tuple[str, ...], *, where: str, arm: str
) -> None:
    """Reject keys that name joints which the arm does not have, all in one message.

    Args:
        named: Joint names by the key that uses them.
        joints: Joints of the arm.
        where: File name for messages.
        arm: Name of the arm.

    Raises:
        InputError: If a name is not a joint of the arm, with one line for each.
    """
    lines = [
        f"{where}: {_placed(key, name)}: no such joint in arm {arm!r};"
        f" {_meant(key, name, joints)}accepted: {', '.join(joints)}"
        for key, names in named.items()
        for name in sorted(names - set(joints))
    ]
    if lines:
        raise InputError("\n".join(lines))


def _placed(key: str, name: str) -> str:
    """A joint name as a key below a table, or as the value of a key."""
    is_value = key == "recording.joints" or key.endswith(".joint")
    return f"{key} = {name!r}" if is_value else f"{key}.{name}"


def _meant(key: str, name: str, joints: tuple[str, ...]) -> str:
    """Suggestion for a name that matches no joint."""
    if key == "joints" and name == "*":
        return "keys of all joints are under 'defaults', e.g. defaults.friction; "
    near = near_names(name, joints)
    return f"did you mean {' or '.join(near)}? " if near else ""
