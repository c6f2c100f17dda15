"""Scene-file table of the temperature of one drive."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from swgjoint.faults import Section


class ThermalSection(Section):
    """Warming of one drive by its own losses, with one uniform temperature.

    The drive starts at ``temperature_C`` of the joint or, without that key, at
    ``ambient_C``.
    """

    heat_capacity_J_K: Annotated[float, Field(gt=0, le=1e9)]
    """Heat capacity of the parts that warm with the drive [J/K]."""
    conductance_W_K: Annotated[float, Field(ge=0, le=1e15)]
    """Heat flow to the surroundings per temperature difference [W/K]; 0 for a drive
    that keeps all heat."""
    ambient_C: Annotated[float, Field(ge=-60, le=200)] = 20.0
    """Temperature of the surroundings [°C]."""
    update_s: Annotated[float, Field(gt=0, le=3600)] = 0.1
    """Interval at which temperature and friction are updated [s], rounded to steps of
    the simulation; between updates the friction is that of the last temperature. The
    shortest interval of a scene applies to all its joints."""
