"""Entity paths of the runs in a recording."""

from __future__ import annotations


def part_of_path(label: str) -> str:
    """Name of a run, joint, body or geom, escaped as one part of an entity path."""
    import rerun as rr

    return str(rr.escape_entity_path_part(label))


def prefix_of(label: str) -> str:
    """Entity path of a run with a trailing slash; empty for a single, unnamed run."""
    return f"{part_of_path(label)}/" if label else ""


def joint_path(joint: str, label: str) -> str:
    """Entity path of the signals of a joint.

    Args:
        joint: Name of the joint.
        label: Name of the run; empty for a single, unnamed run.
    """
    return f"{prefix_of(label)}joint/{part_of_path(joint)}"


def body_path(prefix: str, body: str) -> str:
    """Entity path of a body.

    Args:
        prefix: Path of the run with a trailing slash, or empty.
        body: Name of the body.
    """
    return f"{prefix}arm/{part_of_path(body)}"


def drive_path(joint: str, label: str) -> str:
    """Entity path of the drawing of a joint's drive.

    Args:
        joint: Name of the joint.
        label: Name of the run; empty for a single run.
    """
    drive = f"drive/{part_of_path(joint)}"
    return f"{drive}/{part_of_path(label)}" if label else drive


def phase_plot(joint: str) -> str:
    """Entity path of the plots of torque against torsion of all runs.

    Args:
        joint: Name of the joint.
    """
    return f"phase/{part_of_path(joint)}"


def phase_path(joint: str, label: str) -> str:
    """Entity path of the plot of torque against torsion of one run.

    Args:
        joint: Name of the joint.
        label: Name of the run; empty for a single run.
    """
    return f"{phase_plot(joint)}/{part_of_path(label or 'run')}"
