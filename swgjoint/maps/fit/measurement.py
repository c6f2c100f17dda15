"""A drive map from measurements: a torque-torsion loop and a kinematic-error record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from swgjoint.csv_columns import read_columns
from swgjoint.errors import InputError
from swgjoint.gear.kinematics import LAYOUTS
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.checks import check_map
from swgjoint.maps.fit.error_fit import ORDERS, fit_error
from swgjoint.maps.fit.loop_match import match_loop
from swgjoint.maps.fit.loop_units import check_direction, check_units
from swgjoint.maps.fit.overlay import COMPARED, overlay
from swgjoint.maps.fit.torsion_fit import INTERVALS, TorsionFit, fit_torsion
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import TorqueLoop, torque_loop
from swgjoint.maps.torsion_law import potential_of_stiffness
from swgjoint.units import arcmin, deg

LEG_STEPS = 2.0
"""Smallest mean number of steps between reversals of the torque. Rows in random order
have 1.5 (two of three random numbers are extremes; textbook), rows in order many."""
TORQUE = {"torque_Nm": 1.0}
TORSION = {"torsion_arcmin": arcmin, "torsion_rad": 1.0}
OUTPUT = {"output_deg": deg, "output_rad": 1.0}
ERROR = {"error_arcmin": arcmin, "error_rad": 1.0}

Map = TypeVar("Map", bound=Potential)


def read_loop(path: str | Path) -> TorqueLoop:
    """Loop from a CSV file: ``torque_Nm`` and ``torsion_arcmin`` or ``torsion_rad``.

    Raises:
        InputError: If the file is not a loop over both signs of the torque.
    """
    data = read_columns(path, {"torque": TORQUE, "torsion": TORSION})
    torque, torsion = data["torque"], data["torsion"]
    if torque.size < 8:
        raise InputError(f"{path}: {torque.size} samples; accepted: at least 8")
    low, high = float(torque.min()), float(torque.max())
    if not (low < 0.0 < high and min(-low, high) > 0.05 * max(-low, high)):
        raise InputError(
            f"{path}: torque_Nm from {low:g} to {high:g} N·m; accepted: both signs"
        )
    loop = TorqueLoop(torque=torque, torsion=torsion)
    legs = len(loop.turns())
    if torque.size - 1 < LEG_STEPS * legs:
        raise InputError(
            f"{path}: torque_Nm turns {legs - 1} times in {torque.size} samples;"
            " accepted: rows in order of time"
        )
    ends = loop.mid_line(np.array([0.9 * low, 0.9 * high]))
    if not ends[1] > ends[0]:
        raise InputError(
            f"{path}: torsion does not grow with the torque; accepted: both of the same"
            " sign"
        )
    check_direction(path, loop)
    return loop


def map_from_measurement(
    path: str | Path,
    cls: type[Map],
    *,
    teeth_flexspline: int,
    teeth_circular_spline: int,
    ratings: Ratings | float,
    kinematic_error: str | Path | None = None,
    layout: str = "circular_spline_fixed",
    orders: Sequence[tuple[int, int]] = ORDERS,
    intervals: int = INTERVALS,
    damping_ratio: float = 0.02,
    name: str | None = None,
) -> Map:
    """The map of a measured drive; see :meth:`DriveMap.from_measurement`."""
    if layout not in LAYOUTS:
        raise InputError(f"layout {layout!r}; accepted: {', '.join(LAYOUTS)}")
    if not 0 < teeth_flexspline < teeth_circular_spline:
        raise InputError(
            f"teeth {teeth_flexspline} and {teeth_circular_spline}; accepted: 0 <"
            " flexspline < circular spline"
        )
    if intervals < 1:
        raise InputError(f"intervals {intervals}; accepted: 1 and more")
    loop = read_loop(path)
    rated = _ratings(ratings, float(np.abs(loop.torque).max()))
    doubts = check_units(path, loop, rated.rated_torque)

    def play(tried: TorsionFit) -> Potential:
        """The map of a spring and elements alone."""
        potential, ends = potential_of_stiffness(tried.knots, tried.stiffness)
        return Potential(
            name=name or Path(path).stem,
            level="measurement",
            layout=layout,
            teeth_flexspline=teeth_flexspline,
            teeth_circular_spline=teeth_circular_spline,
            torsion_knots=tried.knots,
            orders=np.zeros((1, 2), dtype=np.int64),
            potential=potential,
            end_stiffness=ends,
            kinematic_error=np.zeros((1, 2)),
            ratings=rated,
            hysteresis=tried.hysteresis,
        )

    fit = match_loop(fit_torsion(loop, intervals=intervals), play, rated.rated_torque)
    info: dict[str, Any] = {
        "source": f"measurement {Path(path).name}",
        "fit": {"torsion": fit.report},
        "missing": {},
    }
    width = fit.report["hysteresis_loss_arcmin"]
    if not fit.hysteresis:
        info["missing"]["hysteresis_loss_arcmin"] = (
            "the record has one direction of the torque only"
            if width is None
            else f"the measured loop is {width:.4g} arcmin wide, no more than its noise"
        )
    harmonics = np.zeros((1, 2), dtype=np.int64)
    amplitudes = np.zeros((1, 2))
    if kinematic_error is not None:
        record = read_columns(kinematic_error, {"output": OUTPUT, "error": ERROR})
        largest = float(np.abs(record["error"]).max())
        if largest > np.pi:
            raise InputError(
                f"{kinematic_error}: kinematic error of {largest:.4g} rad; accepted:"
                " less than half a turn; check the unit in the column name"
            )
        found = fit_error(
            record["output"],
            record["error"],
            layout=layout,
            teeth_flexspline=teeth_flexspline,
            teeth_circular_spline=teeth_circular_spline,
            orders=orders,
            where=str(kinematic_error),
        )
        info["source"] += f", {Path(kinematic_error).name}"
        info["fit"]["kinematic_error"] = found.report
        harmonics = np.concatenate([harmonics, found.orders])
        amplitudes = np.concatenate([amplitudes, found.amplitudes])
    else:
        info["missing"] |= dict.fromkeys(
            (
                "transmission_accuracy_arcmin",
                "transmission_accuracy_rated_arcmin",
                "ripple_rms_percent",
                "ripple_pp_percent",
                "orders",
            ),
            "no record of the kinematic error was given",
        )
    potential, ends = potential_of_stiffness(
        fit.knots, fit.stiffness, n_harmonics=len(harmonics)
    )
    drive = cls(
        name=name or Path(path).stem,
        level="measurement",
        layout=layout,
        teeth_flexspline=teeth_flexspline,
        teeth_circular_spline=teeth_circular_spline,
        torsion_knots=fit.knots,
        orders=harmonics,
        potential=potential,
        end_stiffness=ends,
        kinematic_error=amplitudes,
        ratings=rated,
        damping_ratio=damping_ratio,
        hysteresis=fit.hysteresis,
        info=info,
    )
    try:
        check_map(drive)
    except ValueError as exc:  # the samples do not determine the fit
        raise InputError(f"{path}: the fitted map is not valid: {exc}") from None
    laid = overlay(replace(drive, kinematic_error=0.0 * amplitudes), loop).as_dict()
    compared = {key: laid[key] for key in ("rms_arcmin", *COMPARED)}
    compared["warnings"] = [*doubts, *laid["warnings"]]
    info["fit"] = {**info["fit"], "loop": compared}
    if fit.hysteresis:
        # a loop that is no Maxwell slip is followed as a whole, not under every load
        played = torque_loop(drive).hysteresis_loss() / arcmin
        report = {**fit.report, "hysteresis_loss_map_arcmin": played}
        info["fit"] = {**info["fit"], "torsion": report}
        info["hysteresis"] = (
            f"measured loop {Path(path).name}, {width:.4g} arcmin wide; that of the map"
            f" {played:.4g} arcmin"
        )
    return replace(drive, info=info)


def _ratings(given: Ratings | float, largest: float) -> Ratings:
    """The given ratings, or ratings from a rated torque and the largest loop torque."""
    if isinstance(given, Ratings):
        return given
    rated = float(given)
    if not (np.isfinite(rated) and rated > 0.0):
        raise InputError(f"rated torque {rated:g} N·m; accepted: > 0 N·m")
    peak = max(rated, largest)
    return Ratings(
        rated_torque=rated,
        repeated_peak=peak,
        momentary_peak=peak,
        T1=0.2 * rated,
        T2=0.6 * rated,
        source=f"rated torque given; peaks from the loop to {largest:g} N·m; T1, T2 are"
        " 0.2 and 0.6 of rated",
    )
