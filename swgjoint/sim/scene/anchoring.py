"""Paths in a scene file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from swgjoint.models_path import is_file


def anchor_paths(data: dict[str, Any], folder: Path) -> None:
    """Resolve paths in a scene file relative to its folder; keep names unchanged.

    Args:
        data: Tables of the file, in which the paths are replaced.
        folder: Folder of the file.
    """

    def anchor(table: Any, key: str) -> None:
        value = table.get(key) if isinstance(table, dict) else None
        if isinstance(value, str) and is_file(folder / value):
            table[key] = str(folder / value)

    anchor(data, "arm")
    anchor(data.get("trajectory"), "file")
    tasks = data.get("cycle")
    for task in tasks if isinstance(tasks, list) else ():
        anchor(task.get("trajectory") if isinstance(task, dict) else None, "file")
    anchor(data.get("defaults"), "drive")
    joints = data.get("joints")
    for joint in joints.values() if isinstance(joints, dict) else ():
        anchor(joint, "drive")
