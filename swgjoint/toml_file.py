"""Read untrusted TOML: size, depth and types are checked before use."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swgjoint.errors import InputError
from swgjoint.faults import CONTROL_CHARACTERS, shorten

MAX_BYTES = 2_000_000
"""Largest accepted file size [B]."""


MAX_DEPTH = 16
"""Largest nesting depth of tables and lists; valid input files need five levels."""


MAX_KEY = 200
"""Largest accepted length of a key [characters]."""


_INTEGERS = range(-(2**63), 2**63)
"""Range of integers in TOML 1.0.0, section "Integer"."""


# a dotted key of more than MAX_DEPTH parts; the time for parsing it is quadratic
_LONG_KEY = re.compile(
    r"(?<![\w\"'-])[\w\"'-]++(?:[ \t]*+\.[ \t]*+[\w\"'-]++)"
    rf"{{{MAX_DEPTH}}}"
)


_LONG = f"a key of more than {MAX_DEPTH} parts joined by dots"


_OTHER_FILES = {
    ".xml": "arm (MJCF)",
    ".urdf": "arm (URDF)",
    ".xacro": "template of an arm (URDF)",
    ".swg": "map of a drive",
    ".rrd": "recording",
    ".csv": "table (CSV)",
}
"""Names of other file formats, by suffix."""


_MARKS = {
    "design": {"drive", "flexspline", "circular_spline", "wave_generator"},
    "scene": {"arm", "trajectory", "simulation", "controller"},
    "optimisation": {"plan", "objectives"},
    "sweep": {"plan"},
    "spec": {"spec"},
}
"""Tables and keys that identify each kind of file."""


def read_toml(
    path: Path, *, what: str, error: type[InputError] = InputError
) -> dict[str, Any]:
    """Parse a TOML file; every failure is reported in one line.

    Args:
        path: The file.
        what: Kind of file that is expected, e.g. ``design``.
        error: Exception class to raise.

    Raises:
        InputError: If the file is missing, too large, not UTF-8, not valid TOML or not
            of the kind ``what``.
    """
    try:
        size = path.stat().st_size
        other = _OTHER_FILES.get(path.suffix.lower())
        if other is not None:
            raise error(f"{path}: this is {_a(other)}; accepted: {_a(what)} as TOML")
        if size > MAX_BYTES:
            raise error(f"{path}: {size} bytes; {_a(what)} has at most {MAX_BYTES}")
        data = parse_toml(path.read_bytes().decode(), where=str(path), error=error)
    except OSError as exc:
        raise error(f"{path}: cannot read the {what}: {exc.strerror}") from None
    except UnicodeDecodeError as exc:
        raise error(f"{path}: not UTF-8 text at byte {exc.start}") from None
    kind = kind_of_file(data)
    if kind is not None and what in _MARKS and kind != what:
        marks = ", ".join(sorted(_MARKS[what]))
        raise error(
            f"{path}: this is {_a(kind)} file; accepted: {_a(what)} with keys {marks}"
        )
    return data


def kind_of_file(data: Mapping[str, Any]) -> str | None:
    """Kind of file that its tables and keys identify; None if they do not."""
    if set(data) == {"spec"}:
        return "spec"
    for kind in ("optimisation", "sweep"):
        if _MARKS[kind] <= set(data):
            return kind
    found = [kind for kind in ("design", "scene") if len(_MARKS[kind] & set(data)) > 1]
    return found[0] if len(found) == 1 else None


def _a(noun: str) -> str:
    """Noun with its indefinite article."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def parse_toml(
    text: str, *, where: str, error: type[InputError] = InputError
) -> dict[str, Any]:
    """Parse untrusted TOML text.

    All TOML files are parsed by this function. It guarantees a depth of at most
    :data:`MAX_DEPTH`, 64-bit integers, short keys and strings without control
    characters, so that later code can rely on these properties.

    Args:
        text: The TOML text.
        where: Name of its source, for messages.
        error: Exception class to raise.

    Raises:
        InputError: If the text is not valid; the message has one line about the first
            fault.
    """
    if _LONG_KEY.search(text):
        raise error(f"{where}: {_LONG}")
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise error(f"{where}: {_too_deep()}") from None
    except ValueError as exc:  # Python also raises it for integers of many digits
        raise error(f"{where}: not valid TOML: {exc}") from None
    fault = first_fault(data)
    if fault is not None:
        raise error(f"{where}: {fault}")
    return data


def parse_value(text: str, *, where: str) -> Any:
    """Parse one untrusted TOML value; text that is not TOML becomes a string.

    Args:
        text: The value, as written in a TOML file.
        where: Key or option that it belongs to, for messages.

    Raises:
        InputError: If :func:`parse_toml` would reject the value in a file.

    >>> parse_value("[0.5, 2]", where="--set"), parse_value("qca", where="--set")
    ([0.5, 2], 'qca')
    """
    if _LONG_KEY.search(text):
        raise InputError(f"{where}: {_LONG}")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except RecursionError:
        raise InputError(f"{where}: {_too_deep()}") from None
    except tomllib.TOMLDecodeError:
        value = text.strip()
    except ValueError as exc:
        raise InputError(f"{where}: not a valid value: {exc}") from None
    fault = first_fault({where: value})
    if fault is not None:
        raise InputError(fault)
    return value


def _too_deep() -> str:
    return f"TOML tables or lists nested too deeply; accepted: {MAX_DEPTH} levels"


def first_fault(data: dict[str, Any]) -> str | None:
    """First fault of the parsed data; None if they are valid. No recursion is used."""
    todo: list[tuple[str, Any, int]] = [("", data, 0)]
    while todo:
        path, value, depth = todo.pop()
        if depth > MAX_DEPTH:
            return f"{shorten(path)}: {_too_deep()}"
        if isinstance(value, dict):
            for key, item in value.items():
                if len(key) > MAX_KEY or CONTROL_CHARACTERS.search(key):
                    return (
                        f"{shorten(key)}: not a key; accepted: up to {MAX_KEY}"
                        " characters, no control characters"
                    )
                todo.append((f"{path}.{key}" if path else key, item, depth + 1))
        elif isinstance(value, list):
            todo += [(f"{path}[{k}]", item, depth + 1) for k, item in enumerate(value)]
        elif isinstance(value, int) and value not in _INTEGERS:
            return f"{shorten(path)}: an integer of more than 64 bits"
        elif isinstance(value, str) and CONTROL_CHARACTERS.search(value):
            return f"{shorten(path)} = {shorten(value)!r}: a control character"
    return None
