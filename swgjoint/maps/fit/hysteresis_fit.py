"""Elements that give the standard loop of a map a wanted width."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from swgjoint.errors import InputError
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import TorqueLoop, largest_torque, torque_loop
from swgjoint.units import arcmin

LARGE = 0.75
"""Yield torsion of the second element, of the torsion at the tip of the loop: more than
half, so that it sticks about zero torque and stiffens the mid-line there."""
STEPS = 25
"""Sizes of the second element that are tried, up to the largest torque of the loop."""
_RTOL = 1e-6
_GROWTH = 1.5


def hysteresis_from(
    drive: Potential,
    *,
    loss: float,
    stiffness: float | None = None,
    lost_motion: float | None = None,
) -> tuple[Jenkin, ...]:
    """Elements with which the standard loop of a map shows a hysteresis loss.

    One element, its yield torque solved on the loop of the map; near 2 f/K, see
    :mod:`swgjoint.maps.hysteresis`. With a lost motion a second element that sticks
    about zero torque: parallel elements only stiffen the mid-line, so a lost motion
    above that of the map cannot be had.

    Args:
        drive: The map; elements that it has already are put aside.
        loss: Full width of the loop at zero torque [rad].
        stiffness: Of the first element while it sticks; that of the mean curve at zero
            torsion if None, so that small motions meet twice the stiffness [N·m/rad].
        lost_motion: Mid-line torsion between +4 and -4 % of rated torque [rad].

    Raises:
        InputError: If no elements of this kind give the loop; with what can be had.
    """
    k = float(drive.coefficients(0.0, 2)[0, 0]) if stiffness is None else stiffness
    if stiffness is None:
        k = max(k, 1e-3 * drive.mean_stiffness)  # clearance has none about zero
    for what, value in (("loss", loss), ("lost motion", lost_motion)):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise InputError(f"hysteresis {what} {value} rad; accepted: > 0 rad")
    top = largest_torque(drive.ratings)

    def played(*elements: Jenkin) -> TorqueLoop:
        return torque_loop(replace(drive, hysteresis=elements))

    def first(second: tuple[Jenkin, ...] = ()) -> tuple[Jenkin, ...]:
        """The first element beside a second one."""

        def width(f: float) -> float:
            element = Jenkin(stiffness=k, yield_torque=f)
            return played(element, *second).hysteresis_loss()

        f = _solve(width, loss, 0.5 * loss * k, top)
        return (Jenkin(stiffness=k, yield_torque=f), *second)

    if lost_motion is None:
        return first()

    tip = float(played().torsion.max())

    def both(f: float) -> tuple[Jenkin, ...]:
        return first((Jenkin(stiffness=f / (LARGE * tip), yield_torque=f),))

    def excess(f: float) -> float:
        found = both(f) if f else first()
        return played(*found).lost_motion(drive.ratings.rated_torque) - lost_motion

    # the lost motion falls as the second element grows, until it is too wide alone
    tried = [0.0]
    over = [excess(0.0)]
    for f in top * np.geomspace(1e-4, 1.0, STEPS):
        try:
            here = excess(f)
        except InputError:
            break
        if here <= 0.0 <= over[-1]:
            return both(float(brentq(excess, tried[-1], f, rtol=_RTOL)))
        tried.append(f)
        over.append(here)
    low, high = (lost_motion + value for value in (min(over), max(over)))
    raise InputError(
        f"lost motion {lost_motion / arcmin:.4g} arcmin of {drive.name!r} with a"
        f" hysteresis loss of {loss / arcmin:.4g} arcmin; accepted: {low / arcmin:.4g}"
        f" to {high / arcmin:.4g} arcmin"
    )


def _solve(
    width: Callable[[float], float], loss: float, start: float, top: float
) -> float:
    """Yield torque at which the loop is as wide as the loss [N·m]."""
    low, high = 0.0, min(start, 0.5 * top)
    best = 0.0
    while (here := width(high)) < loss:
        best = max(best, here)
        if high > top:
            raise InputError(
                f"hysteresis loss {loss / arcmin:.4g} arcmin; accepted: up to"
                f" {best / arcmin:.4g} arcmin with an element of this stiffness"
            )
        low, high = high, _GROWTH * high
    if low == 0.0:
        low = 1e-9 * high
        if (here := width(low)) >= loss:
            raise InputError(
                f"hysteresis loss {loss / arcmin:.4g} arcmin; accepted: above the"
                f" clearance of the map, {here / arcmin:.4g} arcmin"
            )
    return float(brentq(lambda f: width(f) - loss, low, high, rtol=_RTOL))
