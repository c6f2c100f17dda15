"""Conversion factors for inputs and outputs; the package itself computes in SI units.

Multiply a value by its factor to convert it to SI units, and divide by the factor to
convert from SI units:

>>> 120 * mm
0.12
>>> round(1e-3 / arcmin, 3)
3.438
"""

from __future__ import annotations

from math import pi

mm = 1e-3
um = 1e-6
GPa = 1e9
MPa = 1e6
deg = pi / 180.0
arcmin = pi / 10800.0
arcsec = pi / 648000.0
rpm = pi / 30.0
hour = 3600.0
hertz = 2.0 * pi
ZERO_CELSIUS = 273.15
"""Temperature of 0 °C [K]; add it to degrees Celsius."""
