"""Checks that units and direction of a measured loop are as its columns state."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swgjoint.errors import InputError
from swgjoint.maps.fit.torsion_fit import fit_torsion
from swgjoint.maps.sheet.loop import TorqueLoop
from swgjoint.units import arcmin

TORSION_AT_RATED = (0.3, 60.0)
"""Plausible torsion of a strain wave gear at rated torque [arcmin].

The torsion is 4.9 to 7.4 arcmin for the 22 component sets of series CSG in
models/catalogue (sizes 14 to 32). The range extends about ten times further on both
sides; outside it the reader warns.
"""
IMPOSSIBLE = (0.02, 1200.0)
"""Torsion at rated torque outside of which a record is rejected [arcmin]: no gear is
stiffer than the lower limit, and 1200 arcmin (20 degrees) are several teeth."""
TORQUE = (0.005, 200.0)
"""Accepted ratio of the largest torque of a loop to the rated torque [-]. Lost motion
is read at a ratio of 0.04, and teeth ratchet below 20; a unit error by a factor of 1000
is far outside on both sides."""


def check_units(path: str | Path, loop: TorqueLoop, rated_torque: float) -> list[str]:
    """Reject a loop whose units differ from its column names; warn about doubtful ones.

    Args:
        path: Path of the file, for messages.
        loop: The loop as read.
        rated_torque: Rated torque of the drive [N·m].

    Returns:
        Warnings, one line each.

    Raises:
        InputError: If torque or torsion is far from that of any drive with this rated
            torque.
    """
    largest = float(np.abs(loop.torque).max())
    times, (least, most) = largest / rated_torque, TORQUE
    if not least <= times <= most:
        other = "mN·m" if times > most else "kN·m"
        raise InputError(
            f"{path}: torque_Nm to {largest:.4g} N·m is {times:.4g} x the rated"
            f" torque of {rated_torque:g} N·m: is it {other}? accepted: {least:g} to"
            f" {most:g} x"
        )
    slope = float(np.ptp(loop.torsion) / np.ptp(loop.torque))
    torsion = slope * rated_torque / arcmin
    where = f"{path}: torsion {torsion:.4g} arcmin at the rated {rated_torque:g} N·m"
    low, high = TORSION_AT_RATED
    if not IMPOSSIBLE[0] <= torsion <= IMPOSSIBLE[1]:
        fitting = [
            name
            for name, factor in (
                ("arcmin under torsion_rad", arcmin),
                ("rad under torsion_arcmin", 1.0 / arcmin),
            )
            if low <= torsion * factor <= high
        ]
        hint = f": is it {' or '.join(fitting)}?" if fitting else ""
        raise InputError(
            f"{where}{hint}; accepted: {IMPOSSIBLE[0]:g} to {IMPOSSIBLE[1]:g} arcmin,"
            f" catalogue drives have 5 to 7 arcmin"
        )
    if not low <= torsion <= high:
        return [
            f"{where}; plausible: {low:g} to {high:g} arcmin (catalogue drives have 5"
            " to 7): check the units of the torsion and the rated torque"
        ]
    return []


def check_direction(path: str | Path, loop: TorqueLoop) -> None:
    """Reject a loop that runs backwards, unless its width is only noise.

    Args:
        path: Path of the file, for messages.
        loop: The loop as read.

    Raises:
        InputError: If the loop generates energy, as a loop reversed in time does.
    """
    width = loop.hysteresis_loss()
    if not width < 0.0:
        return
    backwards = TorqueLoop(torque=loop.torque[::-1], torsion=loop.torsion[::-1])
    if not fit_torsion(backwards).hysteresis:
        return
    raise InputError(
        f"{path}: the loop runs in the wrong direction: its hysteresis loss is"
        f" {width / arcmin:.4g} arcmin, as if the drive generated energy; accepted:"
        " >= 0, with torque and torsion of the same sign, rows in order of time and"
        " simultaneous columns (reversed rows or a delayed torque reverse the sign)"
    )
