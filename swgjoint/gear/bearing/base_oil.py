r"""Kinematic viscosity of the base oil of a grease as a function of temperature.

Two values at 40 and 100 °C determine the line of Walther through the viscosity nu
[mm2/s] and the absolute temperature T [K]:

.. math:: \log_{10}\log_{10}(\nu + 0.7) = A - B \log_{10} T

Source:
    ASTM D341, "Standard Practice for Viscosity-Temperature Equations and Charts for
    Liquid Petroleum or Hydrocarbon Products": the equation for viscosities above 2
    mm2/s, where its correction terms vanish.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log10

from swgjoint.units import ZERO_CELSIUS, mm

ROOM = 20.0 + ZERO_CELSIUS
"""Temperature at which catalogues state losses [K]."""
THICKEST = 500e-6
"""Largest viscosity for which the drag of a flooded bearing is modelled [m2/s]: a
condition of the bearing maker, from memory."""
_SHIFT = 0.7
_COLD, _HOT = 40.0 + ZERO_CELSIUS, 100.0 + ZERO_CELSIUS


@dataclass(frozen=True, kw_only=True)
class BaseOil:
    """Base oil of a grease."""

    at_40: float
    """Kinematic viscosity at 40 °C [m2/s]."""
    at_100: float
    """Kinematic viscosity at 100 °C [m2/s], below that at 40 °C."""

    def viscosity(self, temperature: float) -> float:
        """Kinematic viscosity nu [m2/s].

        Args:
            temperature: Absolute temperature [K].
        """
        slope, at_cold = self._line
        twice = at_cold - slope * (log10(temperature) - log10(_COLD))
        return float((10.0 ** (10.0**twice) - _SHIFT) * mm**2)

    def temperature(self, viscosity: float) -> float:
        """Absolute temperature at which the oil has a viscosity [K].

        Args:
            viscosity: Kinematic viscosity [m2/s].
        """
        slope, at_cold = self._line
        return float(_COLD * 10.0 ** ((at_cold - _twice_log(viscosity)) / slope))

    @property
    def _line(self) -> tuple[float, float]:
        """Slope B, and value of the line at 40 °C."""
        cold, hot = _twice_log(self.at_40), _twice_log(self.at_100)
        return (cold - hot) / (log10(_HOT) - log10(_COLD)), cold


def _twice_log(viscosity: float) -> float:
    return log10(log10(viscosity / mm**2 + _SHIFT))


MAKER_GREASES = {
    "SK-1A, SK-2": BaseOil(at_40=37e-6, at_100=5.9e-6),
    "4B No.2": BaseOil(at_40=50e-6, at_100=12e-6),
    "Flexolub-A1": BaseOil(at_40=25e-6, at_100=5.2e-6),
}
"""Base oils of the greases that Harmonic Drive recommends. The values are from memory
of the table of lubricants in its engineering data (HFUC-2A, chapter on lubrication) and
could not be checked against it."""
