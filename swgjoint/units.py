"""Conversion factors at the rim of the package; everything inside is SI.

``value_in_mm * mm`` is metres, ``angle_in_rad / arcmin`` is arc minutes.
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
