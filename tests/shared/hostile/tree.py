"""Changes of nested tables, and TOML text of values that no writer would write."""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from hostile.values import NUMBERS, TEXTS, WHOLE, factor, pick


class Raw(str):
    """Text that stands in the file as it is."""


RAW = (
    *("9" * 4301, "0x" + "f" * 4000, "1" + "0" * 400, "-9" * 2, "1_000", "0o17"),
    *("1e400", "+inf", "-nan", "1979-05-27T07:32:00Z", "07:32:00", "00.1", ""),
    *("[" * 1200 + "]" * 1200, "[" * 50 + "]" * 50, "{a = {a = {a = 1}}}", "'''x'''"),
    *('"\\ud800"', '"\\uFFFF"', "[1, 'a', true]", "[[], [1]]"),
)


def hostile_value(rng: np.random.Generator, like: Any = None) -> Any:
    """A value instead of ``like``: near it, of another type, or absurd."""
    what = int(rng.integers(16)) - 6
    if what < 3 and isinstance(like, int | float) and not isinstance(like, bool):
        scaled = max(-1e300, min(1e300, like)) * factor(rng)
        return int(scaled) if isinstance(like, int) else scaled
    if what < 4 and isinstance(like, list):
        return list_of(rng, like)
    if what < 2 and isinstance(like, str):
        return pick(rng, TEXTS)
    if what == 4 and isinstance(like, int | float):
        return str(like)
    if what < 6:
        return pick(rng, NUMBERS)
    if what == 6:
        return pick(rng, WHOLE)
    if what == 7:
        return pick(rng, TEXTS)
    if what == 8:
        return Raw(pick(rng, RAW))
    other = (True, False, [], {}, [{}], [like], {"a": like}, [like] * 3, [[like]])
    return pick(rng, other)


def list_of(rng: np.random.Generator, items: list[Any]) -> list[Any]:
    """The list with another length, order or content."""
    what = int(rng.integers(5))
    if what == 0 or not items:
        return items[:-1]
    if what == 1:
        return items * 2
    if what == 2:
        return items[::-1]
    if what == 3:
        return items * 400
    changed = list(items)
    k = int(rng.integers(len(items)))
    changed[k] = hostile_value(rng, items[k])
    return changed


def places(table: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of everything in nested tables and lists of tables."""
    found: list[tuple[Any, ...]] = [path] if path else []
    if isinstance(table, Mapping):
        items = list(table.items())
    elif isinstance(table, list):
        items = [*enumerate(table)]
    else:
        items = []
    for key, value in items:
        found += places(value, (*path, key))
    return found


def changed(
    rng: np.random.Generator, data: dict[str, Any], most: int = 2
) -> dict[str, Any]:
    """A copy with one to ``most`` changes anywhere."""
    data = copy.deepcopy(data)
    for _ in range(int(rng.integers(1, most + 1))):
        all_places = places(data)
        if not all_places:
            return data
        *above, key = pick(rng, all_places)
        owner: Any = data
        for part in above:
            owner = owner[part]
        what = int(rng.integers(20))
        if what == 0:
            del owner[key]
        elif what == 1 and isinstance(owner, dict):
            owner[new_key(rng, str(key))] = owner.pop(key)
        elif what == 2 and isinstance(owner, dict):
            owner[new_key(rng, str(key))] = hostile_value(rng, owner[key])
        elif what == 3:
            *there, other = pick(rng, all_places)
            value: Any = data
            for part in (*there, other):
                value = value[part]
            owner[key] = copy.deepcopy(value)
        else:
            owner[key] = hostile_value(rng, owner[key])
    return data


def new_key(rng: np.random.Generator, key: str) -> str:
    """A key that is nearly the old one, or no key of any file."""
    near = (key[:-1], key + "s", key.upper(), key.replace("_mm", "_m"), f"{key}.{key}")
    return pick(rng, (*near, *TEXTS))


def text_of(data: Mapping[str, Any]) -> str:
    """TOML text; tables inside lists stand in one line."""
    lines: list[str] = []
    _write(data, (), lines)
    return "\n".join(lines) + "\n"


def _write(table: Mapping[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    if path:
        lines.append(f"[{'.'.join(map(_key, path))}]")
    for key, value in table.items():
        if not isinstance(value, Mapping) or not value:
            lines.append(f"{_key(key)} = {_value(value)}")
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            _write(value, (*path, key), lines)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items())
        return f"{{{inside}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return f'"{value}"'  # dates
