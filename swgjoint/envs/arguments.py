"""Checks of the arguments of environments, with one-line error messages."""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.errors import InputError


def is_number(value: Any) -> bool:
    """Whether a value is a finite number and not a bool."""
    plain = isinstance(value, int | float | np.integer | np.floating)
    # compare without conversion: an integer may exceed the range of floats
    return plain and not isinstance(value, bool) and bool(-1e300 < value < 1e300)


def is_whole(value: Any) -> bool:
    """Whether a value is a finite number without a fractional part."""
    return is_number(value) and int(value) == value


def is_flag(value: Any) -> bool:
    """Whether a value is a bool, or 0 or 1."""
    return isinstance(value, bool | np.bool_) or (is_number(value) and value in (0, 1))


def format_value(value: Any) -> str:
    """Format a value for a message: numpy scalars as numbers, others as their repr.

    Texts of more than 60 characters are shortened.
    """
    plain = isinstance(value, np.generic)
    text = str(value) if plain else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def check_number(key: str, value: Any, unit: str, *, zero: bool) -> None:
    """Reject a value that is not a positive number, or zero where this is accepted.

    Args:
        key: Name of the argument.
        value: Value to check.
        unit: Unit in the message; empty if dimensionless.
        zero: Whether zero is accepted.

    Raises:
        InputError: If the value is not accepted.
    """
    if not (is_number(value) and (value > 0 or (zero and value == 0))):
        text = f"{key} {format_value(value)} {unit}".rstrip()
        raise InputError(f"{text}; accepted: a number {'>=' if zero else '>'} 0")


def check_count(key: str, value: Any, least: int) -> None:
    """Reject a value that is not an integer >= ``least``.

    Args:
        key: Name of the argument.
        value: Value to check.
        least: Smallest accepted integer.

    Raises:
        InputError: If the value is not accepted.
    """
    integer = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (integer and value >= least):
        raise InputError(
            f"{key} {format_value(value)}; accepted: an integer >= {least}"
        )


def check_flag(key: str, value: Any) -> None:
    """Reject a value that is neither a bool nor 0 or 1.

    Args:
        key: Name of the argument.
        value: Value to check.

    Raises:
        InputError: If the value is not accepted.
    """
    if not is_flag(value):
        raise InputError(f"{key} {format_value(value)}; accepted: True, False")
