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
        cold, hot = (
            log10(log10(value / mm**2 + _SHIFT)) for value in (self.at_40, self.at_100)
        )
        slope = (cold - hot) / (log10(_HOT) - log10(_COLD))
        twice = cold - slope * (log10(temperature) - log10(_COLD))
        return float((10.0 ** (10.0**twice) - _SHIFT) * mm**2)


MAKER_GREASES = {
    "SK-1A, SK-2": BaseOil(at_40=37e-6, at_100=5.9e-6),
    "4B No.2": BaseOil(at_40=50e-6, at_100=12e-6),
    "Flexolub-A1": BaseOil(at_40=25e-6, at_100=5.2e-6),
}
"""Base oils of the greases that Harmonic Drive recommends. The values are from memory
of the table of lubricants in its engineering data (HFUC-2A, chapter on lubrication) and
could not be checked against it."""
