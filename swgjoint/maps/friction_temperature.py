r"""Friction of a map at the temperature of its lubricant.

A map with a table of its friction over temperature can be brought to any temperature of
the table. Between two temperatures the logarithm of a torque is linear in the
temperature, because the viscosity falls nearly exponentially.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

from swgjoint.errors import InputError
from swgjoint.maps.friction import Friction
from swgjoint.maps.potential import Potential
from swgjoint.typing import Array
from swgjoint.units import ZERO_CELSIUS

KEY = "friction_over_temperature"
"""Key of the table in the record ``info`` of a map."""
_FIELDS = {
    "coulomb": "coulomb_Nm",
    "static": "static_Nm",
    "stribeck_speed": "stribeck_rad_s",
    "viscous": "viscous_Nms_rad",
    "load": "load",
    "stiffness": "stiffness_Nm_rad",
    "damping": "damping_Nms_rad",
}

Map = TypeVar("Map", bound=Potential)


def friction_table(laws: Mapping[float, Friction], *, lubricant: str) -> dict[str, Any]:
    """Table of a friction law over temperature, for the record of a map.

    Args:
        laws: Friction by absolute temperature [K], in increasing order.
        lubricant: Lubricant and source of its temperature dependence.
    """
    return {
        "temperature_C": [round(T - ZERO_CELSIUS, 9) for T in laws],
        "lubricant": lubricant,
        "source": next(iter(laws.values())).source,
        **{
            key: [float(getattr(one, field)) for one in laws.values()]
            for field, key in _FIELDS.items()
        },
    }


def at_temperature(drive: Map, temperature: float, *, where: str) -> Map:
    """The map with its friction at an absolute temperature [K].

    Args:
        drive: A map with a table of its friction.
        temperature: Absolute temperature of the lubricant [K].
        where: Key and value for messages, such as ``joints.a.temperature_C = 30``.

    Raises:
        InputError: If the map has no table, or the temperature is outside of it.
    """
    table: dict[str, Any] | None = drive.info.get(KEY)
    if table is None:
        why = "has no friction" if drive.friction is None else "states no lubricant"
        raise InputError(
            f"{where}: drive {drive.name!r} {why}; accepted: a design with [losses], a"
            " map built from one, or a catalogue drive with stated losses"
        )
    celsius = temperature - ZERO_CELSIUS
    grid = np.array(table["temperature_C"])
    if not grid[0] - 1e-9 <= celsius <= grid[-1] + 1e-9:
        raise InputError(
            f"{where}: outside the friction table of drive {drive.name!r}; accepted:"
            f" {grid[0]:.4g} to {grid[-1]:.4g} °C"
        )
    values = {
        field: _interpolated(grid, np.array(table[key]), celsius)
        for field, key in _FIELDS.items()
    }
    label = f"{table['source']}; at {celsius:.4g} °C, {table['lubricant']}"
    return drive.with_parts(friction=Friction(**values, source=label))


def _interpolated(grid: Array, values: Array, celsius: float) -> float:
    """Value at a temperature, logarithmic where all values are positive."""
    if (values > 0.0).all():
        return float(np.exp(np.interp(celsius, grid, np.log(values))))
    return float(np.interp(celsius, grid, values))
