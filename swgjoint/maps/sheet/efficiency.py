"""Efficiency over load, speed and temperature as one table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.maps.friction_temperature import KEY, at_temperature
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.friction_running import efficiency
from swgjoint.typing import Array
from swgjoint.units import ZERO_CELSIUS, rpm

SPEEDS = np.array([500.0, 1000.0, 2000.0, 3500.0]) * rpm
"""Input speeds of the table, those of catalogues [rad/s]."""
TEMPERATURES = np.array([0.0, 20.0, 40.0, 60.0]) + ZERO_CELSIUS
"""Temperatures of the table [K]."""
LOADS = (0.1, 0.25, 0.5, 1.0)
"""Loads of the table, divided by the rated torque [-]."""
_SAMPLES = 64
"""Largest number of samples of a period for one value of the table."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EfficiencyTable:
    """Efficiency of a drive whose input is the wave generator."""

    load: Array
    """Output torques [N·m]. Shape (n_load,)."""
    speed: Array
    """Input speeds [rad/s]. Shape (n_speed,)."""
    temperature: Array
    """Absolute temperatures of the lubricant [K]. Shape (n_temperature,)."""
    efficiency: Array
    """Output work over input work [-]. Shape (n_temperature, n_speed, n_load)."""

    def as_dict(self) -> dict[str, Any]:
        """The table in the units of its keys, for JSON."""
        return {
            "load_Nm": self.load.tolist(),
            "speed_rpm": np.round(self.speed / rpm, 9).tolist(),
            "temperature_C": np.round(self.temperature - ZERO_CELSIUS, 9).tolist(),
            "efficiency_percent": (100.0 * self.efficiency).tolist(),
        }


def efficiency_of_map(drive: Potential) -> EfficiencyTable | None:
    """Efficiency of a map from its law of friction at several temperatures.

    None if the map has no table of its friction over temperature.

    Args:
        drive: The map.
    """
    if KEY not in drive.info:
        return None
    ends = drive.info[KEY]["temperature_C"]
    celsius = TEMPERATURES - ZERO_CELSIUS
    modelled = TEMPERATURES[(celsius >= ends[0]) & (celsius <= ends[-1])]
    warm = [at_temperature(drive, T, where="") for T in modelled.tolist()]
    load = drive.ratings.rated_torque * np.array(LOADS)
    return EfficiencyTable(
        load=load,
        speed=SPEEDS,
        temperature=modelled,
        efficiency=np.array(
            [
                [
                    [efficiency(one, T, speed, at_most=_SAMPLES) for T in load.tolist()]
                    for speed in SPEEDS.tolist()
                ]
                for one in warm
            ]
        ),
    )
