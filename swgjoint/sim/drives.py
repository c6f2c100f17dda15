"""Drives that a scene names, as maps."""

from __future__ import annotations

from collections.abc import Mapping

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.scene_sections import JointSection, LinearDrive


def drive_of(
    section: JointSection,
    *,
    known: dict[str, DriveMap],
    progress: Progress = silent,
) -> DriveMap:
    """The map of a joint's drive; what was built is kept in ``known``.

    Args:
        section: Settings of the joint with a drive.
        known: Maps by reference; extended.
        progress: Called while a map is built.

    Raises:
        InputError: If the reference is no design and no map file.
    """
    if section.linear is not None:
        return linear_map(section.linear)
    reference = section.drive
    if reference is None:
        raise ValueError("a joint without a drive has no map")
    if reference not in known:
        known[reference] = load_drive(reference, progress=progress)
    return known[reference]


def linear_map(section: LinearDrive) -> DriveMap:
    """A map of constant stiffness from the scene's own numbers."""
    return DriveMap.linear(
        section.stiffness_Nm_rad,
        teeth_flexspline=section.teeth_flexspline,
        teeth_circular_spline=section.teeth_circular_spline,
        rated_torque=section.rated_torque_Nm,
    )


def load_drive(reference: str, *, progress: Progress = silent) -> DriveMap:
    """The map of a ``.swg`` file, or one built from a design (cached)."""
    if reference.endswith(".swg"):
        return DriveMap.load(reference)
    from swgjoint.fe.build_map import build_map
    from swgjoint.gear.design import Design

    return build_map(Design.load(reference), progress=progress)


def check_joint_names(
    named: Mapping[str, set[str]], joints: tuple[str, ...], *, where: str, arm: str
) -> None:
    """Refuse keys that name a joint which the arm does not have, all at once."""
    lines = [
        f"{where}: {key}.{name}: no such joint in arm {arm!r}; accepted:"
        f" {', '.join(joints)}"
        for key, names in named.items()
        for name in sorted(names - set(joints))
    ]
    if lines:
        raise InputError("\n".join(lines))
