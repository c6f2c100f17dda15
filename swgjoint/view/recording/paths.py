"""Entity paths of the runs in a recording."""

from __future__ import annotations


def part_of_path(label: str) -> str:
    """Name of a run, which may be that of a file, as one part of a path."""
    import rerun as rr

    return str(rr.escape_entity_path_part(label))


def prefix_of(label: str) -> str:
    """Path of a run, with a slash at its end; empty for a lone run."""
    return f"{part_of_path(label)}/" if label else ""


def drive_path(joint: str, label: str) -> str:
    """Where the drive of a joint is drawn."""
    return f"drive/{joint}/{part_of_path(label)}" if label else f"drive/{joint}"


def phase_path(joint: str, label: str) -> str:
    """Where torque against torsion of one run lies."""
    return f"phase/{joint}/{part_of_path(label or 'run')}"
