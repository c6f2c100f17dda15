"""Drives whose maps no figure of a run needs, because their joints are rigid.

A rigid joint uses the ratio and the ratings of its drive, which a design states itself.
"""

from __future__ import annotations

from collections import defaultdict

from swgjoint.drives.references import find_drive, may_be_built
from swgjoint.drives.sections import JointSection
from swgjoint.drives.stand_in import stand_in
from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.scene.scene import Scene


def rigid_drives(scene: Scene) -> dict[str, DriveMap]:
    """Stand-ins for the maps that a run of a scene does not need.

    They suffice for the motion, the figures and the recording of a run, but not for the
    spec sheets of a report. The life over a duty cycle needs the stresses of a map.

    Args:
        scene: The scene.

    Returns:
        Stand-ins by drive reference, for ``drives`` of
        :func:`swgjoint.view.run.run_scene`.
    """
    if scene.cycle:
        return {}
    sections = [scene.defaults, *map(scene.joint_settings, scene.joints)]
    by_reference = defaultdict[str, list[JointSection]](list)
    for section in sections:
        if section.drive is not None and may_be_built(section.drive):
            by_reference[section.drive].append(section)
    found = {}
    for reference, users in by_reference.items():
        models = {section.model for section in users}
        if len(models) > 1 or not all(map(_needs_ratio_only, users)):
            continue
        try:
            design = find_drive(reference)
        except InputError:  # the scene reports it together with its other faults
            continue
        (model,) = models
        if isinstance(design, Design) and (drive := stand_in(design, model)):
            found[reference] = drive
    return found


def _needs_ratio_only(section: JointSection) -> bool:
    """Whether a joint is rigid and states nothing that its map may contradict."""
    return (
        section.level == "rigid"
        and not section.kinematic_error_arcmin
        and section.temperature_C is None
        and section.thermal is None
    )
