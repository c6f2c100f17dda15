"""Catalogue-style spec sheet of a map, determined by the standard procedures."""

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
from swgjoint.maps.hysteresis import total_yield
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
from swgjoint.maps.sheet.no_width import (
    held_clearance_text,
    hysteresis_source,
    why_no_width,
)
from swgjoint.maps.sheet.spec_validity import judge_figures
from swgjoint.maps.sheet.turn import Turn, measure_turns, strongest_orders
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import arcmin, rpm

RATING_KEYS = (
    "T1_Nm",
    "T2_Nm",
    "rated_torque_Nm",
    "repeated_peak_Nm",
    "momentary_peak_Nm",
)
"""Keys of the figures that come from the ratings alone."""
LOOP_KEYS = (
    "K1_Nm_rad",
    "K2_Nm_rad",
    "K3_Nm_rad",
    "hysteresis_loss_arcmin",
    "lost_motion_arcmin",
)
"""Keys of the figures from the torque loop with the input locked."""
TURN_KEYS = (
    "transmission_accuracy_arcmin",
    "transmission_accuracy_rated_arcmin",
    "ripple_rms_percent",
    "ripple_pp_percent",
    "orders",
)
"""Keys of the figures from one output turn."""
_NO_FRICTION = "the map has no friction of bearing, seals and teeth at speed"
SOLID_KEYS = ("fatigue_safety_factor", "radial_stiffness_N_mm")
"""Keys of figures from the 3D finite elements of a design, which no map contains."""
RATCHETING_KEY = "ratcheting_torque_Nm"
"""Key of the figure from the 2D finite elements of a design."""
SLOW_KEYS = ("no_load_running_torque_Nm", "starting_torque_Nm")
"""Keys of figures that tooth and race friction of a slowly turning design provide."""
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
"""Keys of figures that no map provides, with the reason."""
KEYS = (*RATING_KEYS, *LOOP_KEYS, *TURN_KEYS, *LOSS_KEYS, *ABSENT_KEYS)
"""All keys of the sheet, in its order."""

_CURVE = 64
"""Largest number of samples per period for a point of the efficiency curve."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LossCurve:
    """Efficiency as a function of the load at several constant speeds."""

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
    """Reason for each figure that is None, by key."""
    loop: TorqueLoop | None = None
    """Torque loop; None if no requested key needs it."""
    turns: dict[str, Turn] = field(default_factory=dict)
    """Error [rad] for ``no_load`` and ``rated``, torque [N·m] for ``ripple``."""
    losses: LossCurve | None = None
    """Efficiency curves; None without friction or if efficiency was not requested."""
    uncertain: dict[str, Difference] = field(default_factory=dict)
    """Difference from unseen solves that makes a figure uncertain, by its key."""

    def as_dict(self) -> dict[str, Any]:
        """Figures by key, then ``missing`` and ``uncertain``, as JSON values."""
        uncertain = {key: one.to_json() for key, one in self.uncertain.items()}
        return {**self.figures, "missing": self.missing, "uncertain": uncertain}


def check_keys(only: Collection[str]) -> tuple[str, ...]:
    """The requested keys in the order of the sheet; all keys if empty.

    ``wall_s``, which is not a figure, is accepted and not returned.

    Raises:
        InputError: If a key is unknown; the message has one line per unknown key.
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
    """Whether any key needs the torque loop or an output turn of a map."""
    return any(key in (*LOOP_KEYS, *TURN_KEYS) for key in check_keys(only))


def needs_turn(only: Collection[str]) -> bool:
    """Whether any key is a figure of an output turn."""
    return any(key in TURN_KEYS for key in check_keys(only))


def measure_spec(
    drive: Potential | None = None,
    *,
    ratings: Ratings | None = None,
    only: Collection[str] = (),
    known: Mapping[str, float] | None = None,
    unknown: Mapping[str, str] | None = None,
    progress: Progress = silent,
) -> SpecSheet:
    """The requested figures; only the test procedures that they need are run.

    Stiffness, hysteresis loss and lost motion come from a torque loop to the repeated
    peak torque (at least 1.5 T2) with the input locked at zero. Transmission accuracy
    is the peak to peak of the transmission error over one output turn in one direction,
    without load and at rated torque. Ripple is the torque with the output held on its
    ideal motion at rated torque, in percent of rated torque. Orders are per input turn,
    with zero-to-peak amplitudes. For the losses see
    :mod:`swgjoint.maps.sheet.friction_running`; running torque and efficiency apply at
    an input speed of 2000 rpm, efficiency at rated torque.

    Args:
        drive: The map; may be None if :func:`needs_map` is false.
        ratings: Ratings; those of the map if None. Required without a map.
        only: Keys of the sheet; all if empty.
        known: Figures from other computations, by key: those of :data:`SOLID_KEYS`,
            :data:`RATCHETING_KEY` and losses.
        unknown: Reasons why such figures are missing, by key; also for those of
            :data:`SLOW_KEYS`.
        progress: Called while an output turn is evaluated.

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
            turns = _turns(drive, keys, progress)
            _turn_figures(drive, turns, values, missing)
        # the law of a map approximates the losses that are known of its design
        asked = set(keys) & set(LOSS_KEYS) - set(known or {})
        if drive.friction is not None and asked:
            _loss_figures(drive, asked, values, missing)
            if "efficiency_percent" in asked:
                losses = _loss_curve(drive)
        # a reason stated by the source of the map is more specific
        stated = drive.info.get("missing")
        if isinstance(stated, dict):
            missing |= {k: str(stated[k]) for k in missing if k in stated}
        if loop is not None and "hysteresis_loss_arcmin" in missing:
            missing["hysteresis_loss_arcmin"] += held_clearance_text(drive, loop)
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
    """Add the figures of the torque loop, or the reasons why they are missing."""
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
        missing["hysteresis_loss_arcmin"] = why_no_width(drive)
    values["lost_motion_arcmin"] = loop.lost_motion(r.rated_torque) / arcmin


def _turns(
    drive: Potential, keys: Collection[str], progress: Progress
) -> dict[str, Turn]:
    """Output turns that the keys need; empty if the map has no harmonics."""
    if len(drive.orders) == 1:
        return {}
    rated = drive.ratings.rated_torque
    wanted = {
        "no_load": ("transmission_accuracy_arcmin", "orders"),
        "rated": ("transmission_accuracy_rated_arcmin", "orders"),
        "ripple": ("ripple_rms_percent", "ripple_pp_percent", "orders"),
    }
    names = [name for name, of in wanted.items() if set(keys) & set(of)]
    torques = {"no_load": 0.0, "rated": rated}
    error = {name: torques[name] for name in names if name != "ripple"}
    ripple = {name: rated for name in names if name == "ripple"}
    return measure_turns(drive, error, ripple, progress)


def _turn_figures(
    drive: Potential,
    turns: dict[str, Turn],
    values: dict[str, Any],
    missing: dict[str, str],
) -> None:
    """Add the figures of the output turns, or the reasons why they are missing."""
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
    """Add the requested losses of a map with friction."""
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
    """Efficiency up to repeated peak torque at a quarter and all of the test speed."""
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
    """The spec sheet of a map as JSON values: figures and records by key.

    In addition to the figures it contains ``design`` (the name of the map),
    ``missing``, ``uncertain``, ``validity``, ``validation``, ``validation_reason`` and
    ``wall_s`` [s].

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

    ``torque_range_Nm`` includes the yield torques of the hysteresis elements.
    ``kinematic_error``, ``hysteresis`` and ``friction`` state the sources of these
    parts of the map. Figures of an output turn (accuracy, ripple) exclude hysteresis
    and friction; figures of the loop exclude friction.
    """
    low, high = drive.torque_range
    low -= total_yield(drive.hysteresis, low)
    high += total_yield(drive.hysteresis, high)
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
        "hysteresis": hysteresis_source(drive),
        "friction": drive.friction.source if drive.friction else "none",
        "running_speed_rpm": RUNNING_SPEED / rpm if drive.friction else None,
    }
