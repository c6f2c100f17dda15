"""Entity paths of the runs in a recording."""

from __future__ import annotations


def part_of_path(label: str) -> str:
    """Name of a run, possibly a file name, escaped as one part of an entity path."""
    import rerun as rr

    return str(rr.escape_entity_path_part(label))


def prefix_of(label: str) -> str:
    """Entity path of a run with a trailing slash; empty for a single, unnamed run."""
    return f"{part_of_path(label)}/" if label else ""


def drive_path(joint: str, label: str) -> str:
    """Entity path of the drawing of a joint's drive.

    Args:
        joint: Name of the joint.
        label: Name of the run; empty for a single run.
    """
    return f"drive/{joint}/{part_of_path(label)}" if label else f"drive/{joint}"


def phase_path(joint: str, label: str) -> str:
    """Entity path of the plot of torque against torsion of one run.

    Args:
        joint: Name of the joint.
        label: Name of the run; empty for a single run.
    """
    return f"phase/{joint}/{part_of_path(label or 'run')}"
