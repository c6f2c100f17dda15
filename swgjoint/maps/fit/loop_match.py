"""Spring and elements that reproduce a measured hysteresis loss and lost motion.

A least-squares fit approximates a loop as a whole. Parallel elements have a constant
width in torque, whereas a loop of constant width in torsion is wider in torque where
the drive is stiffer. The mean of these widths is too large at zero torque, where the
drive is softest. The yield torques are therefore scaled until the loop of the map is as
wide at zero torque as the measured one. In each round the spring is fitted again, and
its stiffness around zero torque is scaled until the lost motion matches. The remaining
differences occur under load, and the report states them.
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
"""Relative tolerance of hysteresis loss and lost motion [-]."""
ROUNDS = 20
"""Largest number of rounds of the scaling."""
LARGEST = 3.0
"""Limit of both scale factors and of their inverses [-]; no loop needs more."""
DAMPED = 0.7
"""Exponent that damps a correction [-]; width and stiffness affect both figures."""
SAMPLES = 8
"""Number of samples around a torque to which a line is fitted to read a branch. If they
are not close to it, the branch is interpolated between the two nearest samples."""
COMPENSATED = 2.5
"""Torsion within which a change of stiffness is compensated to keep the torque beyond,
as a multiple of the torsion within which the stiffness is scaled [-]."""


@dataclass(frozen=True, kw_only=True)
class LoopReadings:
    """Figures of a loop around zero torque."""

    hysteresis_loss: float
    """Width of the loop at zero torque [rad]; NaN if a branch does not reach it."""
    lost_motion: float
    """Lost motion [rad]; NaN if a branch does not pass through zero torque."""


def readings(loop: TorqueLoop, rated_torque: float) -> LoopReadings:
    """Hysteresis loss and lost motion, read from several samples to reduce noise.

    Args:
        loop: Measured or computed loop.
        rated_torque: Rated torque that defines the lost motion [N·m].
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
    """Torsion at torques around zero on one branch [rad]; NaN if no leg has them."""
    near = 2.0 * np.abs(wanted).max()
    legs = [leg for leg in reversed(loop.legs()) if leg[0] == rising]
    # prefer a leg through zero, then one that only reaches zero; the first loading from
    # rest begins at zero and is not used
    for least in (near, 0.0):
        for _, torque, torsion in legs:
            ways = -torque[0], torque[-1]
            start, end = ways if rising else ways[::-1]
            if start < near or end < least:
                continue
            return np.array([_read(torque, torsion, at, near) for at in wanted])
    return np.full(wanted.shape, np.nan)


def _read(torque: Array, torsion: Array, at: float, near: float) -> float:
    """Torsion of a leg at a torque [rad]; NaN if the leg does not reach it."""
    if not torque[0] <= at <= torque[-1]:
        return np.nan
    apart = np.abs(torque - at)
    chosen = np.argsort(apart, kind="stable")[:SAMPLES]
    if chosen.size < SAMPLES or apart[chosen].max() > near:
        return float(np.interp(at, torque, torsion))
    return float(np.polyval(np.polyfit(torque[chosen] - at, torsion[chosen], 1), 0.0))


def _shown(drive: Potential, rated_torque: float) -> LoopReadings:
    """Figures of the standard loop of a map, which has no noise."""
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
    """The fit whose standard loop has the figures of the measured loop.

    If no fit within :data:`CLOSE` is found, the closest one is returned.

    Args:
        fit: Fit by least squares alone.
        play: Function that builds the map of a fit.
        rated_torque: Rated torque that defines the lost motion [N·m].
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
        shown = _shown(play(tried), rated_torque)
        pairs = [
            (with_loss, shown.hysteresis_loss, wanted.hysteresis_loss),
            (with_motion, shown.lost_motion, wanted.lost_motion),
        ]
        miss = max(abs(got / aim - 1.0) for used, got, aim in pairs if used)
        if miss < least:
            best, least = tried, miss
        if not miss > CLOSE:
            break
        if with_loss:
            wider = _next(wider, wanted.hysteresis_loss / shown.hysteresis_loss)
        if with_motion:
            stiffer = _next(stiffer, shown.lost_motion / wanted.lost_motion)
    return best


def _next(factor: float, change: float) -> float:
    """Factor of the next round, damped so that both figures converge."""
    if not (np.isfinite(change) and change > 0.0):
        return factor
    return float(np.clip(factor * change**DAMPED, 1.0 / LARGEST, LARGEST))


def _stiffened(fit: TorsionFit, factor: float, reach: float) -> TorsionFit:
    """The fit with its stiffness scaled around zero torsion.

    The stiffness just outside compensates the change, so that the torque at larger
    torsion is kept.

    Args:
        fit: Spring and elements.
        factor: Factor of the stiffness [-].
        reach: Torsion on either side within which the stiffness is scaled [rad].
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
