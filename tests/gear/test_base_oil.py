"""Viscosity of a base oil over temperature: ends, hand calculation, a standard oil."""

from __future__ import annotations

from math import log10

import pytest

from swgjoint.gear.bearing.base_oil import MAKER_GREASES, ROOM, BaseOil
from swgjoint.units import ZERO_CELSIUS

OIL = BaseOil(at_40=100e-6, at_100=11.1e-6)
"""ISO VG 100 with a viscosity index of about 95."""


def test_the_line_passes_through_both_values():
    """40 and 100 °C return the given viscosities."""
    assert OIL.viscosity(40.0 + ZERO_CELSIUS) == pytest.approx(OIL.at_40, rel=1e-12)
    assert OIL.temperature(OIL.viscosity(300.0)) == pytest.approx(300.0, rel=1e-12)
    assert OIL.viscosity(100.0 + ZERO_CELSIUS) == pytest.approx(OIL.at_100, rel=1e-12)


def test_hand_calculation_at_room_temperature():
    """log10 log10(nu + 0.7) = A - B log10 T, A and B by hand."""
    y40, y100 = log10(log10(100.7)), log10(log10(11.8))
    B = (y40 - y100) / (log10(373.15) - log10(313.15))
    A = y40 + B * log10(313.15)
    wanted = 10.0 ** (10.0 ** (A - B * log10(293.15))) - 0.7
    assert 1e6 * OIL.viscosity(ROOM) == pytest.approx(wanted, rel=1e-12)
    assert wanted == pytest.approx(341.8, abs=0.1)


def test_viscosity_falls_with_temperature_less_for_a_high_index():
    """Monotone; an oil with more viscosity at 100 °C is thinner in the cold."""
    grid = [t + ZERO_CELSIUS for t in (-40.0, -10.0, 20.0, 50.0, 80.0, 120.0)]
    for oil in (OIL, *MAKER_GREASES.values()):
        values = [oil.viscosity(t) for t in grid]
        assert values == sorted(values, reverse=True)
    flatter = BaseOil(at_40=OIL.at_40, at_100=1.3 * OIL.at_100)
    assert flatter.viscosity(grid[0]) < OIL.viscosity(grid[0])
