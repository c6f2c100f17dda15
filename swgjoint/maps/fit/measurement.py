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
from swgjoint.maps.fit.error_fit import ORDERS, ErrorFit, fit_error
from swgjoint.maps.fit.loop_match import match_loop
from swgjoint.maps.fit.loop_units import check_direction, check_units
from swgjoint.maps.fit.overlay import COMPARED, overlay
from swgjoint.maps.fit.torsion_fit import INTERVALS, TorsionFit, fit_torsion
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import TorqueLoop, torque_loop
from swgjoint.maps.torsion_law import potential_of_stiffness
from swgjoint.units import arcmin, deg

LEG_STEPS = 2.0
"""Smallest accepted mean number of steps between reversals of the torque. The mean is
1.5 for rows in random order, because two thirds of random numbers are local extremes,
and much larger for rows in order of time."""
# accepted column names of each quantity, with the factor to SI
TORQUE = {"torque_Nm": 1.0}
TORSION = {"torsion_arcmin": arcmin, "torsion_rad": 1.0}
OUTPUT = {"output_deg": deg, "output_rad": 1.0}
ERROR = {"error_arcmin": arcmin, "error_rad": 1.0}
_ERROR_FIGURES = (
    "transmission_accuracy_arcmin",
    "transmission_accuracy_rated_arcmin",
    "ripple_rms_percent",
    "ripple_pp_percent",
    "orders",
)
"""Keys of the spec sheet that need a record of the kinematic error."""

Map = TypeVar("Map", bound=Potential)


def read_loop(path: str | Path) -> TorqueLoop:
    """The loop in a CSV file: ``torque_Nm`` and ``torsion_arcmin`` or ``torsion_rad``.

    Raises:
        InputError: If the file cannot be read or is not a loop over both signs of the
            torque, with rows in order of time.
    """
    data = read_columns(path, {"torque": TORQUE, "torsion": TORSION})
    torque, torsion = data["torque"], data["torsion"]
    if torque.size < 8:
        raise InputError(
            f"{path}: too few samples: {torque.size}; accepted: at least 8"
        )
    low, high = float(torque.min()), float(torque.max())
    if not (low < 0.0 < high and min(-low, high) > 0.05 * max(-low, high)):
        raise InputError(
            f"{path}: torque_Nm from {low:g} to {high:g} N·m; accepted: both signs"
        )
    loop = TorqueLoop(torque=torque, torsion=torsion)
    legs = len(loop.turns())
    if torque.size - 1 < LEG_STEPS * legs:
        raise InputError(
            f"{path}: torque_Nm reverses {legs - 1} times in {torque.size} samples;"
            " accepted: rows in order of time"
        )
    ends = loop.mid_line(np.array([0.9 * low, 0.9 * high]))
    if not ends[1] > ends[0]:
        raise InputError(
            f"{path}: torsion does not increase with the torque; accepted: both of the"
            " same sign"
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
    """The map of a measured drive; see :meth:`DriveMap.from_measurement`.

    Args:
        path: CSV file of the torque-torsion loop, see :func:`read_loop`.
        cls: Class of the map to return.
        teeth_flexspline: Number of teeth of the flexspline, z_fs.
        teeth_circular_spline: Number of teeth of the circular spline, z_cs.
        ratings: All catalogue torques, or only the rated torque [N·m].
        kinematic_error: CSV file of the kinematic error over one output turn, with
            ``output_deg`` or ``output_rad`` and ``error_arcmin`` or ``error_rad``. The
            map has no kinematic error if None.
        layout: Which member is fixed.
        orders: Pairs (p, q) of the kinematic error to fit.
        intervals: Number of equal intervals of the torsion curve.
        damping_ratio: Damping ratio of the map [-].
        name: Name of the map; the name of the loop file without suffix if None.

    Raises:
        InputError: If a file or an option cannot be used.
    """
    _check_options(layout, (teeth_flexspline, teeth_circular_spline), intervals)
    loop = read_loop(path)
    rated = _ratings(ratings, float(np.abs(loop.torque).max()))
    doubts = check_units(path, loop, rated.rated_torque)
    gear: dict[str, Any] = {
        "layout": layout,
        "teeth_flexspline": teeth_flexspline,
        "teeth_circular_spline": teeth_circular_spline,
    }
    head = gear | {
        "name": name or Path(path).stem,
        "level": "measurement",
        "ratings": rated,
    }
    torsion = match_loop(
        fit_torsion(loop, intervals=intervals),
        lambda tried: _map_of(Potential, head, tried),
        rated.rated_torque,
    )
    error = None
    if kinematic_error is not None:
        error = _read_error(kinematic_error, orders, gear)
    drive = _map_of(cls, head | {"damping_ratio": damping_ratio}, torsion, error)
    try:
        check_map(drive)
    except ValueError as exc:  # the samples do not determine the fit
        raise InputError(f"{path}: the fitted map is not valid: {exc}") from None
    files = [Path(file).name for file in (path, kinematic_error) if file is not None]
    info: dict[str, Any] = {
        "source": f"measurement {', '.join(files)}",
        "fit": _fit_report(drive, loop, torsion, error, doubts),
        "missing": _missing(torsion, error),
    }
    if torsion.hysteresis:
        info["hysteresis"] = _hysteresis_label(files[0], info["fit"]["torsion"])
    return replace(drive, info=info)


def _check_options(layout: str, teeth: tuple[int, int], intervals: int) -> None:
    """Reject a layout, numbers of teeth or intervals out of range."""
    if layout not in LAYOUTS:
        raise InputError(f"layout {layout!r}; accepted: {', '.join(LAYOUTS)}")
    if not 0 < teeth[0] < teeth[1]:
        raise InputError(
            f"teeth {teeth[0]} and {teeth[1]}; accepted: 0 < flexspline < circular"
            " spline"
        )
    if intervals < 1:
        raise InputError(f"intervals {intervals}; accepted: >= 1")


def _read_error(
    path: str | Path, orders: Sequence[tuple[int, int]], gear: dict[str, Any]
) -> ErrorFit:
    """Harmonics of the kinematic error in a CSV file."""
    record = read_columns(path, {"output": OUTPUT, "error": ERROR})
    largest = float(np.abs(record["error"]).max())
    if largest > np.pi:
        raise InputError(
            f"{path}: kinematic error of {largest:.4g} rad; accepted: less than half a"
            " turn; check the unit in the column name"
        )
    return fit_error(
        record["output"], record["error"], **gear, orders=orders, where=str(path)
    )


def _map_of(
    cls: type[Map],
    head: dict[str, Any],
    torsion: TorsionFit,
    error: ErrorFit | None = None,
) -> Map:
    """The map of a spring and elements, with a kinematic error if there is one."""
    orders, amplitudes = np.zeros((1, 2), dtype=np.int64), np.zeros((1, 2))
    if error is not None:
        orders = np.concatenate([orders, error.orders])
        amplitudes = np.concatenate([amplitudes, error.amplitudes])
    potential, ends = potential_of_stiffness(
        torsion.knots, torsion.stiffness, n_harmonics=len(orders)
    )
    return cls(
        **head,
        torsion_knots=torsion.knots,
        orders=orders,
        potential=potential,
        end_stiffness=ends,
        kinematic_error=amplitudes,
        hysteresis=torsion.hysteresis,
    )


def _fit_report(
    drive: Potential,
    loop: TorqueLoop,
    torsion: TorsionFit,
    error: ErrorFit | None,
    doubts: list[str],
) -> dict[str, Any]:
    """Residuals of the fits, and the loop of the map compared with the measured one."""
    report: dict[str, Any] = {"torsion": torsion.report}
    if torsion.hysteresis:
        # elements reproduce other loops than Maxwell slip only on average, so that the
        # width of the loop of the map may differ from the measured one
        width = torque_loop(drive).hysteresis_loss() / arcmin
        report["torsion"] = {**torsion.report, "hysteresis_loss_map_arcmin": width}
    if error is not None:
        report["kinematic_error"] = error.report
    smooth = replace(drive, kinematic_error=0.0 * drive.kinematic_error)
    compared = overlay(smooth, loop).as_dict()
    return report | {
        "loop": {key: compared[key] for key in ("rms_arcmin", *COMPARED)}
        | {
            "warnings": [
                *doubts,
                *compared["warnings"],
                *(error.warnings() if error is not None else ()),
            ]
        }
    }


def _missing(torsion: TorsionFit, error: ErrorFit | None) -> dict[str, str]:
    """Reasons why the measurement does not provide figures, by key of the figure."""
    missing = {}
    if not torsion.hysteresis:
        width = torsion.report["hysteresis_loss_arcmin"]
        missing["hysteresis_loss_arcmin"] = (
            "the record contains only one direction of the torque"
            if width is None
            else f"the measured loop is {width:.4g} arcmin wide, no more than its noise"
        )
    if error is None:
        reason = "no record of the kinematic error was given"
        missing |= dict.fromkeys(_ERROR_FIGURES, reason)
    return missing


def _hysteresis_label(file: str, report: dict[str, Any]) -> str:
    """Source of the hysteresis, with the widths of both loops."""
    return (
        f"measured loop {file}, {report['hysteresis_loss_arcmin']:.4g} arcmin wide;"
        f" loop of the map {report['hysteresis_loss_map_arcmin']:.4g} arcmin wide"
    )


def _ratings(ratings: Ratings | float, largest: float) -> Ratings:
    """The given ratings, or ratings from a rated torque and the largest loop torque."""
    if isinstance(ratings, Ratings):
        return ratings
    rated = float(ratings)
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
