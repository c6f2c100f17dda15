"""The scene of an assembly with exactly the drives that it simulates."""

from __future__ import annotations

from swgjoint.drives.sections import JointSection
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.scene.scene import Scene


def scene_of_run(assembly: Assembly) -> tuple[Scene, dict[str, DriveMap]]:
    """The scene and its drives, reduced to the orders that the assembly simulates.

    Args:
        assembly: The compiled scene.

    Returns:
        The scene, and the drives by the references in it.
    """
    scene, sections, drives = assembly.scene, dict[str, JointSection](), {}
    for joint, transmission in zip(
        assembly.joints, assembly.transmissions, strict=True
    ):
        name = f"simulated drive of {joint}"
        section = scene.joint_settings(joint).with_drive(name)
        # the drive has its error already
        error = {"kinematic_error_arcmin": 0.0}
        sections[joint] = section.model_copy(update=error)
        drives[name] = transmission.attached.drive
    return scene.model_copy(update={"joints": sections}), drives
