"""Conversion factors for inputs and outputs; the package itself computes in SI units.

Multiply by a factor to convert to SI and divide by it to convert from SI:

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
hertz = 2.0 * pi
