"""What makes one doubt an identification: ratio, clocks, signs, what is left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from swgjoint.errors import InputError
from swgjoint.gear.kinematics import LAYOUTS
from swgjoint.gear.kinematics import ratio as signed_ratio
from swgjoint.identify.log import BenchLog
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.loop_units import TORSION_AT_RATED
from swgjoint.typing import Array
from swgjoint.units import arcmin

if TYPE_CHECKING:
    from swgjoint.identify.identification import Estimate
    from swgjoint.identify.model import Model


MOVES = 0.05
"""Motion of the link beyond what torsion alone can be [rad]: three times 60 arcmin."""
TOGETHER = 0.99
"""Correlation of both angles from which the gear moves the link."""
RATIO_OFF = 0.05
"""Part by which the ratio of a log may be off: torsion over the travel of the link."""
SHARE_LEFT = 0.05
"""Of the rms of a torque, beyond which the model is not that of the drive.

Simulated benches of drives within the model leave 0.3 %, of Bouc-Wen hysteresis 0.8 %;
link angles that are 0.5 ms late left 20 % before their clock was found.
"""
SURE = 3.0
"""Standard deviations by which a value must be on the wrong side."""
POSITIVE = (
    "damping",
    "hardening",
    "friction_coulomb",
    "friction_load",
    "friction_viscous",
    "rotor_inertia",
)
"""Parameters that no drive has below zero."""

PHASE_STEP = 1.0
"""Of a harmonic per window, beyond which a note says so [rad].

Torques of mean angles are then no longer mean torques: on a simulated bench without
noise hysteresis and viscous friction were 0.4 % off at 0.9 rad, 2 % at 2.1 rad.
"""


def check_ratio(log: BenchLog, layout: str, teeth: tuple[int, int]) -> None:
    """Refuse a layout or signs whose ratio is not that of the log.

    Only where the gear moves the link: a locked one says nothing.

    Raises:
        InputError: With the layout or the sign that fits.
    """
    theta, psi = log.motor_angle, log.link_angle
    if np.ptp(psi) < MOVES or np.ptp(theta) == 0.0:
        return
    if abs(np.corrcoef(theta, psi)[0, 1]) < TOGETHER:
        return
    slope = float(np.polyfit(theta, psi, 1)[0])
    ratio = signed_ratio(layout, *teeth)
    if abs(slope * ratio - 1.0) <= RATIO_OFF:
        return
    ratios = {name: signed_ratio(name, *teeth) for name in LAYOUTS}
    fitting = [
        f"layout {name} (ratio {i:g})"
        for name, i in ratios.items()
        if abs(slope * i - 1.0) <= RATIO_OFF
    ]
    if abs(slope * ratio + 1.0) <= RATIO_OFF:
        fitting.append(
            f"{layout} with the other sign of motor_angle or link_angle, and of its"
            " torque"
        )
    accepted = " or ".join(fitting) or "other teeth, or angles in their unit"
    raise InputError(
        f"{log.where}: the link turns {slope:.4g} of the motor, a ratio of"
        f" {1.0 / slope:.4g}; {layout} with {teeth[0]}/{teeth[1]} teeth has"
        f" {ratio:g}; accepted: {accepted}"
    )


def without_skew(log: BenchLog, skew: float) -> BenchLog:
    """The log with the link angles of the instants of all other channels.

    Args:
        log: As recorded.
        skew: By which the link angles are late [s].
    """
    from scipy.interpolate import CubicSpline

    # a straight line between samples would take fast motion out of one channel alone
    link = CubicSpline(log.time, log.link_angle)
    there = log.time + skew
    known = (there >= log.time[0]) & (there <= log.time[-1])

    def kept(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[known]

    return replace(
        log,
        time=log.time[known],
        motor_angle=log.motor_angle[known],
        link_angle=np.asarray(link(there[known]), dtype=np.float64),
        output_torque=kept(log.output_torque),
        motor_torque=kept(log.motor_torque),
    )


def doubts_of(
    estimates: Mapping[str, Estimate], left: Mapping[str, float], window: float
) -> list[str]:
    """Lines on parameters that no drive has, and on torques that are not explained.

    Args:
        estimates: Of all parameters.
        left: Part of the rms of each torque that the model leaves.
        window: Of the averages [s].
    """
    lines = []
    for name in POSITIVE:
        e = estimates.get(name)
        if e is not None and e.value + SURE * e.deviation < 0.0:
            lines.append(
                f"{name} {e.value:.3g} {e.unit} ({e.low:.3g} to {e.high:.3g}) is below"
                " zero"
            )
    first, last = estimates.get("K1"), estimates.get("K3")
    if first is not None and last is not None:
        apart = SURE * np.hypot(first.deviation, last.deviation)
        if first.value - last.value > apart:
            lines.append(
                f"K1 {first.value:.4g} N·m/rad is above K3 {last.value:.4g} N·m/rad:"
                " drives stiffen under load"
            )
    for name, share in left.items():
        if share > SHARE_LEFT:
            lines.append(
                f"{name}: {share:.1%} of its rms is not explained; plausible: at most"
                f" {SHARE_LEFT:.0%}"
            )
    if lines:
        lines[-1] += "; see the clocks of the channels, their signs and the teeth"
    skew = estimates.get("link_skew")
    if skew is not None and abs(skew.value) > window:
        lines.append(
            f"link_angle is {1e3 * skew.value:.3g} ms behind motor_angle, more than the"
            f" window of {1e3 * window:g} ms"
        )
    return lines


def remarks(model: Model, drive: DriveMap, residuals: Mapping[str, Array]) -> list[str]:
    """What makes one doubt the figures: offsets of sensors, window, units."""
    offset = [
        f"{key} {r.mean():.3g} N·m (deviation {r.std():.3g} N·m)"
        for key, r in residuals.items()
        if abs(r.mean()) > r.std()
    ]
    notes = []
    if offset:
        notes.append(
            f"measured less modelled in the mean: {', '.join(offset)}; offset of a"
            " sensor? The intervals do not tell it"
        )
    phase = model.phase_step
    if phase > PHASE_STEP:
        notes.append(
            f"kinematic error turns by up to {phase:.2g} rad in a window of"
            f" {model.step:.3g} s, which the intervals do not tell; better: at most"
            f" {PHASE_STEP:g} rad, --window {model.step * PHASE_STEP / phase:.2g}"
        )
    rated = drive.ratings.rated_torque
    low, high = TORSION_AT_RATED
    try:
        torsion = drive.mean_torsion(rated) / arcmin
    except ValueError:  # the spring softens before
        return notes
    if not low <= torsion <= high:
        notes.append(
            f"torsion at the rated {rated:g} N·m is {torsion:.3g} arcmin; plausible:"
            f" {low:g} to {high:g} arcmin (the catalogue's are 5 to 7): see the units"
            " of the angles and the rated torque"
        )
    return notes
