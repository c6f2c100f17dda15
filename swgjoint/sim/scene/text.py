"""Conversion of a scene to the text of a scene file."""

from __future__ import annotations

from pathlib import Path

from swgjoint.sim.scene.scene import Scene
from swgjoint.toml_text import toml_text


def scene_toml(scene: Scene) -> str:
    """TOML text with the keys that a scene sets.

    File paths in it are absolute, so :meth:`Scene.load_file` can read it from any
    folder.
    """
    data = scene.model_dump(exclude_unset=True, exclude_none=True)
    tasks = [task.get("trajectory", {}) for task in data.get("cycle", [])]
    named = (data, data["trajectory"], data.get("defaults", {}), *tasks)
    for table in (*named, *data.get("joints", {}).values()):
        for key in ("arm", "file", "drive"):
            if Path(table.get(key, "")).is_file():
                table[key] = str(Path(table[key]).resolve())
    return toml_text(data)
