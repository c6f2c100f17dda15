"""Kinematic error of a drive whose map has none: amplitudes that tolerances leave.

A catalogue bounds the error of a drive and says nothing about its orders. They are
taken from finite elements of one drive at the limits of its tolerances; how large the
whole is comes from the catalogue, and phases are those of a specimen.
"""

from __future__ import annotations

import numpy as np

from swgjoint.maps.drive_map import DriveMap

AMPLITUDES: dict[tuple[int, int], float] = {
    (2, 0): 1.0,
    (0, 2): 0.98,
    (4, 0): 0.46,
    (0, 4): 0.48,
    (-1, 1): 0.18,
    (1, 1): 0.18,
    (1, 0): 0.15,
    (0, 1): 0.07,
}
"""By (p, q) of p alpha + q beta, over that of 2 alpha: low orders of e0 in the map of
``reference-2d-tolerances`` (model 2d), whose teeth have errors of ISO 1328-1 class 4
and whose members are as round and centred as ISO 286-1 IT3 and IT4 ask for. It is
0.138 arcmin there."""
EVEN = tuple(pq for pq in AMPLITUDES if 0 in pq and max(pq) > 1)
"""Of these, 2 and 4 cycles per turn of the wave generator against either member: where
position errors of teeth show when two opposite lobes average them. The others come of
lobes that differ."""


def peak_to_peak(drive: DriveMap) -> float:
    """Of e0 over one turn of the output [rad]."""
    psi = np.linspace(0.0, 2.0 * np.pi, 40 * round(abs(drive.ratio)) + 1)
    phases = drive.phases(drive.ratio * psi, psi)
    return float(np.ptp(drive.error_at(phases)[0]))
