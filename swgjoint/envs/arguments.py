"""Checks of what environments are made with; one line each: what, value, accepted."""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.errors import InputError


def is_number(value: Any) -> bool:
    """Whether a value is a finite number; a bool is none."""
    plain = isinstance(value, int | float | np.integer | np.floating)
    # compared, not converted: an integer may be beyond the range of floats
    return plain and not isinstance(value, bool) and bool(-1e300 < value < 1e300)


def is_whole(value: Any) -> bool:
    """Whether a value is an integer, of whatever numeric type."""
    return is_number(value) and int(value) == value


def is_flag(value: Any) -> bool:
    """Whether a value is a bool, or 0 or 1."""
    return isinstance(value, bool | np.bool_) or (is_number(value) and value in (0, 1))


def format_value(value: Any) -> str:
    """A value in a message: numbers plain, the rest as Python writes it, cut short."""
    plain = isinstance(value, np.generic)
    text = str(value) if plain else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def check_number(key: str, value: Any, unit: str, *, zero: bool) -> None:
    """Refuse what is no positive number; ``zero`` is accepted where it says so."""
    if not (is_number(value) and (value > 0 or (zero and value == 0))):
        got = f"{key} {format_value(value)} {unit}".rstrip()
        raise InputError(f"{got}; accepted: a number {'>=' if zero else '>'} 0")


def check_count(key: str, value: Any, least: int) -> None:
    """Refuse what is no integer of at least ``least``."""
    integer = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (integer and value >= least):
        raise InputError(
            f"{key} {format_value(value)}; accepted: an integer >= {least}"
        )


def check_flag(key: str, value: Any) -> None:
    """Refuse a value that is not a bool."""
    if not is_flag(value):
        raise InputError(f"{key} {format_value(value)}; accepted: True, False")
