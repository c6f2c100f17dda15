"""Spring and elements whose loop shows what a sheet reads from a measured loop.

Least squares follow a loop as a whole. Parallel elements have one width in torque; a
loop of one width in torsion is wider in torque where the drive is stiffer, and the mean
of these widths is too much at zero torque, where the drive is softest. So the yield
torques are scaled until the loop of the map is as wide at zero torque as the measured
one, the spring is fitted anew, and its stiffness about zero torque is scaled until the
lost motion is that of the loop. What is left is under load, and the report has it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from swgjoint.maps.fit.torsion_fit import SOFTEST, TorsionFit
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import LOST_MOTION_TORQUE, TorqueLoop, torque_loop
from swgjoint.typing import Array

CLOSE = 0.002
"""Part by which hysteresis loss and lost motion may miss those of the loop."""
ROUNDS = 20
LARGEST = 3.0
"""Factor of a correction; who asks for more has no loop of spring and elements."""
DAMPED = 0.7
"""Exponent of a correction: width and stiffness act on both readings."""
SAMPLES = 8
"""Next to a torque, from which a branch is read along a line if they are close; else
between the two next to it."""
COMPENSATED = 2.5
"""Torsion up to which the torque of a changed stiffness is given back, of the torsion
of the lost motion."""


@dataclass(frozen=True, kw_only=True)
class LoopReadings:
    """What a sheet reads about zero torque."""

    hysteresis_loss: float
    """[rad], NaN where the loop does not come to zero in both directions."""
    lost_motion: float
    """[rad], NaN where it does not pass zero in both."""


def readings(loop: TorqueLoop, rated_torque: float) -> LoopReadings:
    """Hysteresis loss and lost motion, noise averaged where there are samples.

    Args:
        loop: Measured or computed.
        rated_torque: Of the lost motion [N·m].
    """
    at = LOST_MOTION_TORQUE * rated_torque
    wanted = np.array([-at, 0.0, at])
    falling, rising = (_branch(loop, wanted, rising=r) for r in (False, True))
    mid = 0.5 * (falling + rising)
    return LoopReadings(
        hysteresis_loss=float(falling[1] - rising[1]),
        lost_motion=float(mid[2] - mid[0]),
    )


def _branch(loop: TorqueLoop, wanted: Array, *, rising: bool) -> Array:
    """Torsion at torques about zero on one branch; NaN where no leg comes by."""
    near = 2.0 * np.abs(wanted).max()
    legs = [leg for leg in reversed(loop.legs()) if leg[0] == rising]
    # past zero if there is such a leg, else up to it; a first loading from rest is none
    for least in (near, 0.0):
        for _, torque, torsion in legs:
            ways = -torque[0], torque[-1]
            start, end = ways if rising else ways[::-1]
            if start < near or end < least:
                continue
            return np.array([_read(torque, torsion, at, near) for at in wanted])
    return np.full(wanted.shape, np.nan)


def _read(torque: Array, torsion: Array, at: float, near: float) -> float:
    """Torsion of a leg at a torque; NaN where the leg does not reach."""
    if not torque[0] <= at <= torque[-1]:
        return np.nan
    apart = np.abs(torque - at)
    chosen = np.argsort(apart, kind="stable")[:SAMPLES]
    if chosen.size < SAMPLES or apart[chosen].max() > near:
        return float(np.interp(at, torque, torsion))
    return float(np.polyval(np.polyfit(torque[chosen] - at, torsion[chosen], 1), 0.0))


def _shown(drive: Potential, rated_torque: float) -> LoopReadings:
    """Readings of the standard loop of a map, as a sheet has them; no noise."""
    loop = torque_loop(drive)
    return LoopReadings(
        hysteresis_loss=loop.hysteresis_loss(),
        lost_motion=loop.lost_motion(rated_torque),
    )


def match_loop(
    fit: TorsionFit,
    play: Callable[[TorsionFit], Potential],
    rated_torque: float,
) -> TorsionFit:
    """The fit whose standard loop shows the readings of the measured one.

    Where no such spring and elements are found, those that come closest.

    Args:
        fit: By least squares alone.
        play: The map of a fit.
        rated_torque: Of the lost motion [N·m].
    """
    wanted = readings(fit.record.loop, rated_torque)
    with_loss = bool(fit.hysteresis) and wanted.hysteresis_loss > 0.0
    with_motion = wanted.lost_motion > 0.0
    if not (with_loss or with_motion):
        return fit
    reach = 0.5 * max(wanted.lost_motion, 0.0) + 0.5 * max(wanted.hysteresis_loss, 0.0)
    wider = stiffer = 1.0
    best, least = fit, np.inf
    for _ in range(ROUNDS):
        scaled = fit.with_yields(wider * fit.yields) if with_loss else fit
        tried = _stiffened(scaled, stiffer, reach)
        found = _shown(play(tried), rated_torque)
        apart = [
            (with_loss, found.hysteresis_loss, wanted.hysteresis_loss),
            (with_motion, found.lost_motion, wanted.lost_motion),
        ]
        miss = max(abs(got / aim - 1.0) for asked, got, aim in apart if asked)
        if miss < least:
            best, least = tried, miss
        if not miss > CLOSE:
            break
        if with_loss:
            wider = _next(wider, wanted.hysteresis_loss / found.hysteresis_loss)
        if with_motion:
            stiffer = _next(stiffer, found.lost_motion / wanted.lost_motion)
    return best


def _next(factor: float, change: float) -> float:
    """Factor of the next round, less changed than asked so that both settle."""
    if not (np.isfinite(change) and change > 0.0):
        return factor
    return float(np.clip(factor * change**DAMPED, 1.0 / LARGEST, LARGEST))


def _stiffened(fit: TorsionFit, factor: float, reach: float) -> TorsionFit:
    """Stiffness scaled about zero torsion, torque farther out as it was.

    Args:
        fit: Spring and elements.
        factor: Of the stiffness.
        reach: Torsion on either side that is scaled [rad].
    """
    if factor == 1.0 or not reach > 0.0:
        return fit
    x = np.abs(fit.knots)
    step = float(fit.knots[1] - fit.knots[0])
    reach = max(reach, step)
    outer = max(COMPENSATED * reach, reach + 2.0 * step)
    inside = np.clip((reach + step - x) / step, 0.0, 1.0)
    around = np.clip((outer + step - x) / step, 0.0, 1.0) - inside
    change = (factor - 1.0) * fit.stiffness * inside
    share = -change.sum() / max(around.sum(), 1.0)
    least = SOFTEST * float(fit.stiffness.mean())
    stiffness = np.maximum(fit.stiffness + change + share * around, least)
    return replace(fit, stiffness=stiffness)
