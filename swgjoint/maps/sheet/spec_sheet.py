"""Catalogue-style spec sheet of a map, measured by the standard procedures."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from math import isnan
from typing import Any

import numpy as np

from swgjoint.errors import InputError
from swgjoint.gear.catalogue_stated import LOSS_KEYS
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.friction_running import (
    RUNNING_SPEED,
    back_driving_torque,
    efficiency,
    no_load_running_torque,
    starting_torque,
)
from swgjoint.maps.sheet.loop import NO_WIDTH, TorqueLoop, largest_torque, torque_loop
from swgjoint.maps.sheet.map_validity import Difference, validation_json
from swgjoint.maps.sheet.spec_validity import judge_figures
from swgjoint.maps.sheet.turn import Turn, error_turn, ripple_turn, strongest_orders
from swgjoint.typing import Array
from swgjoint.units import arcmin, rpm

RATING_KEYS = (
    "T1_Nm",
    "T2_Nm",
    "rated_torque_Nm",
    "repeated_peak_Nm",
    "momentary_peak_Nm",
)
"""Figures from the ratings alone."""
LOOP_KEYS = (
    "K1_Nm_rad",
    "K2_Nm_rad",
    "K3_Nm_rad",
    "hysteresis_loss_arcmin",
    "lost_motion_arcmin",
)
"""Figures from the torque loop with the input locked."""
TURN_KEYS = (
    "transmission_accuracy_arcmin",
    "transmission_accuracy_rated_arcmin",
    "ripple_rms_percent",
    "ripple_pp_percent",
    "orders",
)
"""Figures from one output turn."""
_NO_FRICTION = "the map has no friction of bearing, seals and teeth at speed"
SOLID_KEYS = ("fatigue_safety_factor", "radial_stiffness_N_mm")
"""Figures of the 3D finite elements of a design, which no map contains."""
RATCHETING_KEY = "ratcheting_torque_Nm"
"""Figure of the 2D finite elements of a design."""
SLOW_KEYS = ("no_load_running_torque_Nm", "starting_torque_Nm")
"""Figures from tooth and bearing-race friction of a slowly turning design."""
ABSENT_KEYS = {
    RATCHETING_KEY: "needs the 2D finite elements of a design, which take a minute or"
    " more: request it with --only",
    "repeatability_arcmin": "the map has no random part: a repeated approach ends"
    " at the same position",
    "fatigue_safety_factor": "needs the stresses of the finite elements; a map contains"
    " torque and torsion only",
    "radial_stiffness_N_mm": "needs the finite elements of the flexspline; a map"
    " contains torque and torsion only",
}
"""Figures that no map provides, with the reason."""
KEYS = (*RATING_KEYS, *LOOP_KEYS, *TURN_KEYS, *LOSS_KEYS, *ABSENT_KEYS)

_CURVE = 64
"""Samples per period for a point of the efficiency curve."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LossCurve:
    """Efficiency over the load at several constant speeds."""

    load: Array
    """Output torque [N·m]. Shape (n,)."""
    efficiency: dict[float, Array]
    """Output work over input work [-], by input speed [rad/s]. Shapes (n,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SpecSheet:
    """Figures of one drive and the curves from which they were read."""

    figures: dict[str, Any]
    """Value of every requested key; None if the source does not provide it."""
    missing: dict[str, str]
    """Reason for every None."""
    loop: TorqueLoop | None = None
    turns: dict[str, Turn] = field(default_factory=dict)
    """Error [rad] for ``no_load`` and ``rated``, torque [N·m] for ``ripple``."""
    losses: LossCurve | None = None
    """Efficiency over the load; None without friction or if it was not requested."""
    uncertain: dict[str, Difference] = field(default_factory=dict)
    """Differences that make figures uncertain, by key; see :mod:`.map_validity`."""

    def as_dict(self) -> dict[str, Any]:
        """Figures, then ``missing`` and ``uncertain``."""
        uncertain = {key: one.to_json() for key, one in self.uncertain.items()}
        return {**self.figures, "missing": self.missing, "uncertain": uncertain}


def check_keys(only: Collection[str]) -> tuple[str, ...]:
    """The requested keys in the order of the sheet; all keys if empty.

    Raises:
        InputError: If the sheet lacks a key; the message has one line per unknown key.
    """
    wanted = set(only) - {"wall_s"}
    lines = []
    for key in sorted(wanted - set(KEYS)):
        near = [k for k in KEYS if key and k.startswith(key)]
        near = near or get_close_matches(key, KEYS, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        lines.append(f"key {key!r}: {hint}accepted: {', '.join((*KEYS, 'wall_s'))}")
    if lines:
        raise InputError("\n".join(lines))
    return tuple(key for key in KEYS if key in wanted) if only else KEYS


def needs_map(only: Collection[str]) -> bool:
    """Whether any key is read from a map instead of the ratings alone."""
    return any(key in (*LOOP_KEYS, *TURN_KEYS) for key in check_keys(only))


def needs_turn(only: Collection[str]) -> bool:
    """Whether any key depends on more than one input angle."""
    return any(key in TURN_KEYS for key in check_keys(only))


def measure_spec(
    drive: Potential | None = None,
    *,
    ratings: Ratings | None = None,
    only: Collection[str] = (),
    known: Mapping[str, float] | None = None,
    unknown: Mapping[str, str] | None = None,
) -> SpecSheet:
    """Run the test procedures that the requested keys need, and no others.

    Stiffness, hysteresis loss and lost motion come from a torque loop to the repeated
    peak torque (at least 1.5 T2) with the input locked at zero. Transmission accuracy
    is the peak to peak of the transmission error over one output turn in one direction,
    without load and at rated torque. Ripple is the torque with the output held on its
    ideal motion at rated torque, in percent of rated. Orders are per input turn, their
    amplitudes zero to peak. For the losses see
    :mod:`swgjoint.maps.sheet.friction_running`; running torque and efficiency apply to
    2000 rpm of the input, efficiency to rated torque.

    Args:
        drive: The map; may be None if :func:`needs_map` is false.
        ratings: Ratings; those of the map if None, required without a map.
        only: Keys of the sheet; all if empty.
        known: Values from other computations, for :data:`SOLID_KEYS` and
            :data:`RATCHETING_KEY`.
        unknown: Reasons why such values are missing, also for :data:`SLOW_KEYS`.

    Raises:
        InputError: If a key is unknown.
        ValueError: If a required map or required ratings are missing.
    """
    keys = check_keys(only)
    if ratings is None:
        if drive is None:
            raise ValueError("a sheet needs a map or ratings")
        ratings = drive.ratings
    if drive is None and needs_map(keys):
        raise ValueError("these keys need a map")
    values: dict[str, Any] = {
        "T1_Nm": float(ratings.T1),
        "T2_Nm": float(ratings.T2),
        "rated_torque_Nm": float(ratings.rated_torque),
        "repeated_peak_Nm": float(ratings.repeated_peak),
        "momentary_peak_Nm": float(ratings.momentary_peak),
        **(known or {}),
    }
    missing = ABSENT_KEYS | dict.fromkeys(LOSS_KEYS, _NO_FRICTION)
    loop, turns, losses = None, {}, None
    uncertain: dict[str, Difference] = {}
    if drive is not None:
        if set(keys) & set(LOOP_KEYS):
            loop = torque_loop(drive)
            _loop_figures(drive, loop, ratings, values, missing)
        if set(keys) & set(TURN_KEYS):
            turns = _turns(drive, keys)
            _turn_figures(drive, turns, values, missing)
        if drive.friction is not None and set(keys) & set(LOSS_KEYS):
            _loss_figures(drive, keys, values, missing)
            if "efficiency_percent" in keys:
                losses = _loss_curve(drive)
        # the reason stated by the source is the most specific one
        stated = drive.info.get("missing")
        if isinstance(stated, dict):
            missing |= {k: str(stated[k]) for k in missing if k in stated}
        uncertain = judge_figures(drive, values, missing)
    missing |= dict(unknown or {})
    return SpecSheet(
        figures={key: values.get(key) for key in keys},
        missing={k: missing[k] for k in keys if values.get(k) is None},
        loop=loop,
        turns=turns,
        losses=losses,
        uncertain={
            k: uncertain[k]
            for k in keys
            if k in uncertain and values.get(k) is not None
        },
    )


def _loop_figures(
    drive: Potential,
    loop: TorqueLoop,
    r: Ratings,
    values: dict[str, Any],
    missing: dict[str, str],
) -> None:
    T3 = largest_torque(r)
    for k, (low, high) in enumerate(((0.0, r.T1), (r.T1, r.T2), (r.T2, T3)), 1):
        value = loop.stiffness(low, high)
        values[f"K{k}_Nm_rad"] = None if isnan(value) else value
        missing[f"K{k}_Nm_rad"] = f"the loop does not reach {high:g} N·m"
    width = loop.hysteresis_loss()
    travel = float(loop.torsion.max() - loop.torsion.min())
    if abs(width) > NO_WIDTH * travel:
        values["hysteresis_loss_arcmin"] = width / arcmin
    else:
        missing["hysteresis_loss_arcmin"] = (
            "the torque loop is conservative: the map has no hysteresis"
            if not drive.hysteresis
            else "the hysteresis of the map does not slip within this loop"
        )
    values["lost_motion_arcmin"] = loop.lost_motion(r.rated_torque) / arcmin


def _turns(drive: Potential, keys: Collection[str]) -> dict[str, Turn]:
    if len(drive.orders) == 1:
        return {}
    rated = drive.ratings.rated_torque
    wanted = {
        "no_load": ("transmission_accuracy_arcmin", "orders"),
        "rated": ("transmission_accuracy_rated_arcmin", "orders"),
        "ripple": ("ripple_rms_percent", "ripple_pp_percent", "orders"),
    }
    build = {
        "no_load": lambda: error_turn(drive),
        "rated": lambda: error_turn(drive, rated),
        "ripple": lambda: ripple_turn(drive, rated),
    }
    return {name: build[name]() for name, of in wanted.items() if set(keys) & set(of)}


def _turn_figures(
    drive: Potential,
    turns: dict[str, Turn],
    values: dict[str, Any],
    missing: dict[str, str],
) -> None:
    if not turns:
        reason = "the map has no harmonics of the gear angles"
        missing |= dict.fromkeys(TURN_KEYS, reason)
        return
    percent = 100.0 / drive.ratings.rated_torque
    if "no_load" in turns:
        width = turns["no_load"].peak_to_peak()
        values["transmission_accuracy_arcmin"] = width / arcmin
    if "rated" in turns:
        width = turns["rated"].peak_to_peak()
        values["transmission_accuracy_rated_arcmin"] = width / arcmin
    if "ripple" in turns:
        values["ripple_rms_percent"] = percent * turns["ripple"].rms()
        values["ripple_pp_percent"] = percent * turns["ripple"].peak_to_peak()
    if len(turns) == 3:
        units = {
            "kinematic_error_arcmin": ("no_load", 1.0 / arcmin),
            "transmission_error_arcmin": ("rated", 1.0 / arcmin),
            "ripple_percent": ("ripple", percent),
        }
        values["orders"] = strongest_orders(
            {
                key: Turn(
                    period_turns=turns[name].period_turns,
                    turns=turns[name].turns,
                    signal=turns[name].signal * factor,
                )
                for key, (name, factor) in units.items()
            }
        )


def _loss_figures(
    drive: Potential,
    keys: Collection[str],
    values: dict[str, Any],
    missing: dict[str, str],
) -> None:
    if "no_load_running_torque_Nm" in keys:
        values["no_load_running_torque_Nm"] = no_load_running_torque(drive)
    if "starting_torque_Nm" in keys:
        values["starting_torque_Nm"] = starting_torque(drive)
    if "back_driving_torque_Nm" in keys:
        values["back_driving_torque_Nm"] = back_driving_torque(drive)
        missing["back_driving_torque_Nm"] = (
            "no torque up to the momentary peak turns the input"
        )
    if "efficiency_percent" in keys:
        rated = drive.ratings.rated_torque
        values["efficiency_percent"] = 100.0 * efficiency(drive, rated)


def _loss_curve(drive: Potential) -> LossCurve:
    load = np.linspace(0.0, drive.ratings.repeated_peak, 25)
    return LossCurve(
        load=load[1:],
        efficiency={
            speed: np.array(
                [efficiency(drive, float(T), speed, at_most=_CURVE) for T in load[1:]]
            )
            for speed in (0.25 * RUNNING_SPEED, RUNNING_SPEED)
        },
    )


def spec_sheet(drive: Potential, only: Collection[str] = ()) -> dict[str, Any]:
    """Figures, ``missing``, ``uncertain``, ``validity``, ``validation``, ``wall_s``.

    Args:
        drive: The map.
        only: Keys of the sheet; all if empty.
    """
    start = time.perf_counter()
    sheet = measure_spec(drive, only=only)
    return {
        "design": drive.name,
        **sheet.as_dict(),
        "validity": validity(drive),
        **validation_json(drive),
        "wall_s": time.perf_counter() - start,
    }


def validity(drive: Potential) -> dict[str, Any]:
    """Level of the map, its torque range, and whether the loop exceeds this range.

    ``kinematic_error``, ``hysteresis`` and ``friction`` state their sources. Figures of
    an output turn (accuracy, ripple) exclude hysteresis and friction; the loop excludes
    friction.
    """
    low, high = drive.torque_range
    slipping = sum(element.yield_torque for element in drive.hysteresis)
    low, high = low - slipping, high + slipping
    top = largest_torque(drive.ratings)
    reach = 1.0 + 1e-6
    return {
        "level": drive.level,
        "torque_range_Nm": [low, high],
        "loop_to_Nm": top,
        "beyond_range": bool(top > reach * high or -top < reach * low),
        "ratings": drive.ratings.source,
        "kinematic_error": str(drive.info.get("kinematic_error", "given"))
        if drive.kinematic_error[1:].any()
        else "none",
        "hysteresis": str(drive.info.get("hysteresis", "given"))
        if drive.hysteresis
        else "none",
        "friction": drive.friction.source if drive.friction else "none",
        "running_speed_rpm": RUNNING_SPEED / rpm if drive.friction else None,
    }
