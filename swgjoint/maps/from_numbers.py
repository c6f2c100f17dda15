"""A drive map from the figures of a data sheet.

The curve of torque against torsion has up to three slopes, as in
:mod:`swgjoint.maps.from_catalogue`. A lost motion beyond that of the first slope
becomes a clearance, in which the output is free, and a hysteresis loss beyond the
clearance becomes a friction torque. Slopes, clearance and friction torque are iterated
until the standard procedures of :mod:`swgjoint.maps.sheet.loop` find the stated
figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import isfinite
from typing import Any, TypeVar

import numpy as np

from swgjoint.errors import InputError
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.fit.error_spectrum import LARGEST
from swgjoint.maps.fit.loop_units import IMPOSSIBLE, TORSION_AT_RATED
from swgjoint.maps.from_catalogue import (
    CLOSE,
    CORNER,
    LOBES,
    ROUNDS,
    three_lines,
)
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import LOST_MOTION_TORQUE, largest_torque, torque_loop
from swgjoint.maps.torsion_law import potential_of_stiffness
from swgjoint.typing import Array, Index
from swgjoint.units import arcmin

FREE = 1e-10
"""Torque at the ends of a clearance as a fraction of the rated torque [-]. It is below
the torque at which a loop counts as unloaded."""
RATIOS = (30, 320)
"""Accepted ratios [-]."""
MAX_ORDER = 1000
"""Largest order of the kinematic error [1/turn]."""

Map = TypeVar("Map", bound=Potential)


def map_from_numbers(
    cls: type[Map],
    *,
    stiffness: float | Sequence[float],
    rated_torque: float,
    ratio: int = 100,
    lost_motion_arcmin: float | None = None,
    hysteresis_loss_arcmin: float | None = None,
    kinematic_error: Mapping[int, float] | None = None,
    T1: float | None = None,
    T2: float | None = None,
    repeated_peak: float | None = None,
    momentary_peak: float | None = None,
    name: str = "numbers",
) -> Map:
    """The map of stated figures; see :meth:`DriveMap.from_numbers`.

    Args:
        cls: Class of the map to return.
        stiffness: Torsional stiffness, or K1, K2 and K3 [N·m/rad].
        rated_torque: Rated torque [N·m].
        ratio: Magnitude of the ratio, with the circular spline fixed [-].
        lost_motion_arcmin: Lost motion [arcmin]; None takes that of the stiffness.
        hysteresis_loss_arcmin: Hysteresis loss [arcmin]; None takes the clearance.
        kinematic_error: Amplitude, zero to peak [arcmin], by order per input turn.
        T1: End of the first line [N·m]; None takes 0.2 of the rated torque.
        T2: End of the second line [N·m]; None takes 0.6 of the rated torque.
        repeated_peak: Repeated peak torque [N·m]; None takes twice the rated torque.
        momentary_peak: Momentary peak torque [N·m]; None takes four times the rated
            torque.
        name: Name of the drive.

    Raises:
        InputError: If a figure is out of range or contradicts another one.
    """
    slopes = [stiffness] * 3 if isinstance(stiffness, int | float) else [*stiffness]
    if len(slopes) != 3:
        raise InputError(
            f"stiffness: {len(slopes)} values; accepted: one, or K1, K2 and K3"
            " [N·m/rad]"
        )
    K = [_positive(value, "stiffness", "N·m/rad") for value in slopes]
    rated = _positive(rated_torque, "rated_torque", "N·m")
    if not (isinstance(ratio, int) and RATIOS[0] <= ratio <= RATIOS[1]):
        raise InputError(
            f"ratio {ratio!s:.40}; accepted: a whole number from {RATIOS[0]} to"
            f" {RATIOS[1]}"
        )
    given = {
        "T1": (T1, 0.2),
        "T2": (T2, 0.6),
        "repeated_peak": (repeated_peak, 2.0),
        "momentary_peak": (momentary_peak, 4.0),
    }
    torques = {
        key: factor * rated if value is None else _positive(value, key, "N·m")
        for key, (value, factor) in given.items()
    }
    if not LOST_MOTION_TORQUE * rated < torques["T1"] < torques["T2"]:
        raise InputError(
            f"T1 = {torques['T1']:g} N·m, T2 = {torques['T2']:g} N·m; accepted: more"
            f" than {LOST_MOTION_TORQUE * rated:g} N·m (4 % of the rated torque),"
            " increasing"
        )
    absent = [f"{key}_Nm" for key, (value, _) in given.items() if value is None]
    rule = f"default ({', '.join(absent)}): multiples of the rated torque"
    source = rule if absent else "given"
    r = Ratings(rated_torque=rated, source=source, **torques)
    _check_units(K, r)
    orders, error = _harmonics(kinematic_error or {})
    teeth = LOBES * ratio
    drive = cls(
        name=name,
        level="numbers",
        layout="circular_spline_fixed",
        teeth_flexspline=teeth,
        teeth_circular_spline=teeth + LOBES,
        orders=orders,
        **_spring(r, K, 0.0, len(orders)),
        kinematic_error=error,
        ratings=r,
        info={"source": "stated figures"},
    )
    lost = loss = None
    if lost_motion_arcmin is not None:
        lost = _positive(lost_motion_arcmin, "lost_motion_arcmin", "arcmin") * arcmin
        least = 2.0 * LOST_MOTION_TORQUE * rated / K[0]
        most = 2.0 * r.T1 / K[0]
        if not least * (1.0 - CLOSE) <= lost < most:
            raise InputError(
                f"lost_motion_arcmin {lost / arcmin:g}; accepted: {least / arcmin:.4g},"
                " the torsion of K1 between -4 and 4 % of the rated torque, to less"
                f" than {most / arcmin:.4g}, that between -T1 and T1"
            )
    if hysteresis_loss_arcmin is not None:
        loss = hysteresis_loss_arcmin
        loss = _positive(loss, "hysteresis_loss_arcmin", "arcmin") * arcmin
    return _with_loop(drive, K, lost, loss)


def _check_units(K: Sequence[float], r: Ratings) -> None:
    """Reject a stiffness with which no gear turns by so much at its rated torque."""
    ends = [0.0, *(min(end, r.rated_torque) for end in (r.T1, r.T2)), r.rated_torque]
    torsion = sum((b - a) / k for (a, b), k in zip(pairwise(ends), K, strict=True))
    low, high = IMPOSSIBLE
    if low <= torsion / arcmin <= high:
        return
    fitting = [
        unit
        for unit, factor in (("N·m/arcmin", 1.0 / arcmin), ("1e4 N·m/rad", 1e4))
        if TORSION_AT_RATED[0] <= torsion / factor / arcmin <= TORSION_AT_RATED[1]
    ]
    hint = f": is it in {' or '.join(fitting)}?" if fitting else ""
    raise InputError(
        f"stiffness {', '.join(f'{k:g}' for k in dict.fromkeys(K))} N·m/rad: torsion"
        f" {torsion / arcmin:.4g} arcmin at the rated {r.rated_torque:g} N·m{hint};"
        f" accepted: {low:g} to {high:g} arcmin, catalogue drives have 5 to 7 arcmin"
    )


def _with_loop(
    drive: Map, K: list[float], lost: float | None, loss: float | None
) -> Map:
    """The map whose loop has given slopes [N·m/rad], lost motion and loss [rad].

    Args:
        drive: The map without clearance and hysteresis.
        K: Slopes K1, K2 and K3 of the loop.
        lost: Lost motion; None leaves out the clearance.
        loss: Hysteresis loss; None leaves out the hysteresis.

    Raises:
        InputError: If no map has these figures.
    """
    r, count = drive.ratings, len(drive.orders)
    if lost is None and loss is None:
        return drive
    limits = (0.0, r.T1, r.T2, largest_torque(r))
    light = LOST_MOTION_TORQUE * r.rated_torque
    # a clearance of 2 c and a first slope that meet K1 and the lost motion
    own, play = np.array(K), 0.0
    if lost is not None:
        own[0] = (r.T1 - light) / (r.T1 / K[0] - 0.5 * lost)
        play = max(0.0, 0.5 * lost - light / own[0])
    if loss is not None and lost is not None and play > CLOSE * lost:
        if not 2.0 * play <= loss <= lost:
            raise InputError(
                f"hysteresis_loss_arcmin {loss / arcmin:g}; accepted with"
                f" lost_motion_arcmin {lost / arcmin:g}: {2.0 * play / arcmin:.4g}, the"
                f" clearance that this implies, to {lost / arcmin:g}; friction that"
                " widens the loop further also holds the output at 4 % of the rated"
                " torque: leave out one of the two"
            )
    torque = 0.0 if loss is None else 0.5 * K[0] * (loss - 2.0 * play)
    for _ in range(ROUNDS):
        rubs = torque > 1e-9 * r.rated_torque
        drive = replace(
            drive,
            **_spring(r, own.tolist(), play, count),
            hysteresis=(
                (Jenkin(stiffness=float(own[0]), yield_torque=torque),) if rubs else ()
            ),
        )
        loop = torque_loop(drive)
        change = np.array(K) / [loop.stiffness(a, b) for a, b in pairwise(limits)]
        off = [*(change - 1.0)]
        own = own * change
        if lost is not None:
            missing = lost - loop.lost_motion(r.rated_torque)
            play = max(0.0, play + 0.5 * missing)
            off.append(missing / lost)
        if loss is not None:
            missing = loss - loop.hysteresis_loss()
            torque = max(0.0, torque + 0.5 * K[0] * missing)
            off.append(missing / loss)
        if np.abs(off).max() < CLOSE:
            if loss is None:
                return drive
            label = f"stated: {loss / arcmin:g} arcmin"
            return drive.with_parts(info={**drive.info, "hysteresis": label})
    raise InputError(
        f"stated figures: found no drive with stiffness {K[0]:g}, {K[1]:g} and {K[2]:g}"
        f" N·m/rad, lost motion {(lost or 0.0) / arcmin:g} and hysteresis loss"
        f" {(loss or 0.0) / arcmin:g} arcmin; accepted: figures of one torque loop"
    )


def _spring(r: Ratings, K: Sequence[float], play: float, count: int) -> dict[str, Any]:
    """Arguments of a map with three slopes beyond a clearance.

    Args:
        r: Ratings, of which T1 and T2 are measured beyond the clearance.
        K: The slopes [N·m/rad].
        play: Half of the clearance [rad].
        count: Number of harmonics.
    """
    top = max(r.momentary_peak, 1.5 * r.T2)
    knots, stiffness = three_lines(r.T1, r.T2, *K, largest=top)
    if play:
        width = CORNER * min(play, float(knots[-5]))
        begin = [play - width, play + width]
        half = np.array([*begin, *(knots[5:] + play)])
        values = np.array([FREE * r.rated_torque / play, K[0], *stiffness[5:]])
        knots = np.concatenate([-half[::-1], half])
        stiffness = np.concatenate([values[::-1], values])
    potential, ends = potential_of_stiffness(knots, stiffness, n_harmonics=count)
    return {"torsion_knots": knots, "potential": potential, "end_stiffness": ends}


def _harmonics(error: Mapping[int, float]) -> tuple[Index, Array]:
    """Orders (n, 2) and kinematic error (n, 2) [rad], the mean first."""
    orders = np.zeros((1 + len(error), 2), dtype=np.int64)
    values = np.zeros((1 + len(error), 2))
    for k, (order, amplitude) in enumerate(sorted(error.items()), 1):
        if not (isinstance(order, int) and 1 <= order <= MAX_ORDER):
            raise InputError(
                f"kinematic_error: order {order!s:.40}; accepted: whole numbers from 1"
                f" to {MAX_ORDER} per input turn"
            )
        orders[k, 0] = order
        where = f"kinematic_error of order {order}"
        values[k, 0] = _positive(amplitude, where, "arcmin") * arcmin
        if amplitude > LARGEST:
            raise InputError(
                f"{where} {amplitude:g} arcmin; accepted: up to {LARGEST:g} arcmin"
            )
    return orders, values


def _positive(value: Any, key: str, unit: str) -> float:
    """A finite number above zero, or an error that names it."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and isfinite(value) and 1e-9 < value < 1e12):
        raise InputError(
            f"{key} {value!s:.40} {unit}; accepted: a number > 1e-9 and < 1e12"
        )
    return float(value)
