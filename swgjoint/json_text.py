"""Results as JSON; numpy types are converted and non-finite numbers become null."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any


def plain(value: Any) -> Any:
    """Convert a value to dicts, lists, strings, finite numbers, booleans and None.

    Members of an enumeration become their names in lower case, dataclasses become dicts
    of their fields, and numbers that are not finite become None.

    Raises:
        TypeError: If a value has another type.

    >>> plain({"torque_Nm": (1.5, float("nan"))})
    {'torque_Nm': [1.5, None]}
    """
    if value is None or isinstance(value, bool | str | int):
        return value.name.lower() if isinstance(value, Enum) else value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Path):
        return str(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            item.name: plain(getattr(value, item.name))
            for item in dataclasses.fields(value)
        }
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy scalars and arrays, without importing numpy
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def json_text(value: Any, *, indent: int | None = 2, ascii_only: bool = False) -> str:
    """Format a value as one JSON document.

    Args:
        value: Anything that :func:`plain` converts.
        indent: Indentation [spaces]; None writes everything on one line.
        ascii_only: Whether characters outside ASCII are escaped.
    """
    return json.dumps(
        plain(value), indent=indent, ensure_ascii=ascii_only, allow_nan=False
    )
