"""The error that ``swgjoint advise`` accepts, with its unit."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from swgjoint.errors import InputError
from swgjoint.sim.accuracy import QUANTITIES
from swgjoint.units import arcmin, arcsec, deg, mm, um

UNITS = {
    "rad": ("link_angle", 1.0),
    "deg": ("link_angle", deg),
    "arcmin": ("link_angle", arcmin),
    "arcsec": ("link_angle", arcsec),
    "m": ("tool_position", 1.0),
    "mm": ("tool_position", mm),
    "um": ("tool_position", um),
}
"""Quantity and SI value of each accepted unit."""


@dataclass(frozen=True, kw_only=True)
class ErrorBound:
    """An accepted rms error of the link angle or of the tool position."""

    text: str
    """Bound as entered by the user, with its unit."""
    quantity: str
    """``link_angle`` or ``tool_position``."""
    value: float
    """Largest accepted error, in :attr:`unit`."""

    @property
    def unit(self) -> str:
        """Unit of ``value``: arcmin or mm."""
        return QUANTITIES[self.quantity]


def parse_bound(text: str) -> ErrorBound:
    """Parse a number with its unit, such as ``0.1arcmin``, ``2e-5rad`` or ``0.05mm``.

    Raises:
        InputError: If the text is not such a number, or if the number is not positive.
    """
    accepted = f"accepted: a number > 0 with one of {', '.join(UNITS)}, as in 0.1arcmin"
    found = re.fullmatch(r"\s*([0-9.]+(?:e[+-]?[0-9]+)?)\s*([a-z]+)\s*", text, re.I)
    if found is None or found[2].lower() not in UNITS:
        raise InputError(f"--error {text!r}; {accepted}")
    quantity, unit = UNITS[found[2].lower()]
    own = arcmin if quantity == "link_angle" else mm
    try:
        value = float(found[1]) * unit / own
    except ValueError:
        value = 0.0
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"--error {text!r}; {accepted}")
    return ErrorBound(text=text.strip(), quantity=quantity, value=value)
