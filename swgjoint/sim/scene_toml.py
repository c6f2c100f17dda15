"""A scene as the text of a scene file."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swgjoint.sim.scene import Scene


def scene_toml(scene: Scene) -> str:
    """What the scene sets, as TOML that :meth:`Scene.load_file` reads anywhere.

    Files that it names stand with their whole paths.
    """
    data = scene.model_dump(exclude_unset=True, exclude_none=True)
    for table in (data, data.get("defaults", {}), *data.get("joints", {}).values()):
        for key in ("arm", "drive"):
            if Path(table.get(key, "")).is_file():
                table[key] = str(Path(table[key]).resolve())
    return "\n".join(_lines(data, ())).strip() + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    values = [k for k, v in table.items() if not isinstance(v, Mapping)]
    lines = []
    if path and (values or not table):
        lines += ["", f"[{'.'.join(map(_key, path))}]"]
    lines += [f"{_key(k)} = {_value(table[k])}" for k in values]
    for key, inner in table.items():
        if isinstance(inner, Mapping):
            lines += _lines(inner, (*path, key))
    return lines


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


def _value(value: Any) -> str:
    """A TOML value; a JSON text or number is one, too."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value)
