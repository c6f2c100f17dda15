"""Checks of an identification: ratio, clocks, signs and residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from swgjoint.errors import InputError
from swgjoint.gear.kinematics import LAYOUTS
from swgjoint.gear.kinematics import ratio as signed_ratio
from swgjoint.identify.log import BenchLog
from swgjoint.identify.unknowns import SPRINGS
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.loop_units import TORSION_AT_RATED
from swgjoint.typing import Array
from swgjoint.units import arcmin, deg

if TYPE_CHECKING:
    from swgjoint.identify.identification import Estimate
    from swgjoint.identify.model import Model


MOVES = 0.05
"""Link travel that torsion alone cannot cause [rad], about three times 60 arcmin."""
TOGETHER = 0.99
"""Correlation of motor and link angle above which the gear moves the link [-]."""
RATIO_OFF = 0.05
"""Relative tolerance of the ratio of a log [-]; torsion shifts that ratio slightly."""
SHARE_LEFT = 0.05
"""Largest accepted residual of a torque relative to its root mean square [-].

On simulated benches the residual is 0.3 % for drives that the model describes exactly
and 0.8 % for drives with Bouc-Wen hysteresis. If the link angles have a delay of 0.5 ms
that is not corrected, it is 20 %.
"""
SURE = 3.0
"""Number of standard deviations beyond which an implausible value is reported [-]."""
POSITIVE = (
    "damping",
    "hardening",
    "friction_coulomb",
    "friction_load",
    "friction_viscous",
    "rotor_inertia",
)
"""Parameters that are never negative in a real drive."""
STIFFNESS = ("K1", "K2", "K3", "stiffness")
"""Parameters without which the map has no stiffness."""
SMALL = 0.01
"""Effect on each torque, relative to its rms, below which a negative parameter is a
note instead of a doubt [-].

Encoder noise delays the hysteresis element, which the fit balances by negative damping
of 0.05 to 0.2 % of the torque on simulated benches.
"""
SHIFTED = 0.05
"""Shift by noise, relative to a parameter, above which it is a doubt instead of a note
[-]. The intervals of logs with little noise of the torques are far narrower."""
SETTINGS = ("zero", "link_skew")
"""Parameters of the log, not of the drive."""
OVERLOAD = 20.0
"""Largest torque of a log relative to the rated torque [-]; the ratcheting torque of
catalogue drives is at most 16 times the rated torque (``models/catalogue``)."""
TORQUE_OFF = 10.0
"""Factor between the two torques of a log, beyond the ratio, that is a mistake [-]."""
OWN_PART = 0.05
"""Part of the output torque that motion must not explain in order to check it [-]."""
JUMP = 10.0
"""Step of an angle relative to its median step that is a jump [-]."""

PHASE_STEP = 1.0
"""Phase change of a harmonic per window above which a note is added [rad].

The torques at mean angles then differ from the mean torques: on a simulated bench
without noise, hysteresis and viscous friction were 0.4 % off at 0.9 rad and 2 % at
2.1 rad.
"""


def check_ratio(log: BenchLog, layout: str, teeth: tuple[int, int]) -> None:
    """Reject a layout or signs whose ratio differs from that of the log.

    The check applies only if the gear moves the link, so that the angles have a ratio.

    Args:
        log: Log of the bench.
        layout: Which member is fixed.
        teeth: Number of teeth of flexspline and circular spline.

    Raises:
        InputError: If the ratio differs; the message names a layout or sign that fits.
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
            f"{layout} with the opposite sign of motor_angle or link_angle, and of its"
            " torque"
        )
    accepted = " or ".join(fitting) or "other teeth, or other units of the angles"
    raise InputError(
        f"{log.where}: the link turns by {slope:.4g} times the motor angle, a ratio of"
        f" {1.0 / slope:.4g}; {layout} with {teeth[0]}/{teeth[1]} teeth has"
        f" {ratio:g}; accepted: {accepted}"
    )


def check_angles(log: BenchLog) -> None:
    """Reject angles that jump, as those of an encoder that restarts at every turn.

    Raises:
        InputError: If an angle changes by more than half a turn from one sample to the
            next, and by far less between most samples.
    """
    for name in ("motor_angle", "link_angle"):
        steps = np.abs(np.diff(getattr(log, name)))
        at = int(steps.argmax()) if steps.size else 0
        if steps.size and steps[at] > max(np.pi, JUMP * float(np.median(steps))):
            raise InputError(
                f"{log.where}: {name} jumps by {steps[at] / deg:.4g} deg at"
                f" {log.time[at + 1]:g} s; accepted: angles that continue beyond a turn"
            )


def check_torsion(log: BenchLog, ratio: float) -> None:
    """Reject single samples that one of the encoders lost.

    Args:
        log: Log of the bench, with the ratio of the drive.
        ratio: Signed ratio i [-].

    Raises:
        InputError: If the torsion changes by more than half a turn of the motor over
            the ratio from one sample to the next.
    """
    steps = np.abs(np.diff(log.motor_angle / ratio - log.link_angle))
    at = int(steps.argmax()) if steps.size else 0
    if steps.size and steps[at] > np.pi / abs(ratio):
        raise InputError(
            f"{log.where}: the torsion, motor_angle/{ratio:g} - link_angle, jumps by"
            f" {steps[at] / arcmin:.4g} arcmin at {log.time[at + 1]:g} s; accepted:"
            " angles without lost samples"
        )


def check_torques(model: Model, where: str) -> None:
    """Reject two torques whose signs or units contradict each other.

    The motor torque is a sum of the output torque over the ratio, inertia, friction and
    an offset. A least-squares fit of this sum gives the factor of the output torque. It
    is checked only if motion does not explain the output torque.

    Args:
        model: Model of the log.
        where: Name of the log in messages.

    Raises:
        InputError: If the factor times the ratio is not between 1/10 and 10.
    """
    samples, i = model.samples, model.ratio
    if samples.output_torque is None or samples.motor_torque is None:
        return
    motion = np.column_stack(
        [
            model.motor_acceleration,
            model.relative_rate,
            model.slipping,
            np.ones(len(samples.time)),
        ]
    )
    motion /= np.maximum(np.abs(motion).max(axis=0), 1e-300)
    torques = np.column_stack([samples.output_torque, samples.motor_torque])
    rest = torques - motion @ np.linalg.lstsq(motion, torques, rcond=None)[0]
    power = float(rest[:, 0] @ rest[:, 0])
    if power <= OWN_PART**2 * float(torques[:, 0] @ torques[:, 0]):
        return
    factor = float(rest[:, 0] @ rest[:, 1]) / power
    if 1.0 / TORQUE_OFF < factor * i < TORQUE_OFF:
        return
    raise InputError(
        f"{where}: motor_torque changes by {factor:.3g} N·m per N·m of output_torque;"
        f" {model.layout} with {model.teeth[0]}/{model.teeth[1]} teeth has {1 / i:.3g}"
        f" without losses; accepted: torques in N·m with the signs of the drive,"
        f" {1 / TORQUE_OFF:g} to {TORQUE_OFF:g} times this factor"
    )


def without_skew(log: BenchLog, skew: float) -> BenchLog:
    """The log with its link angles corrected for their delay.

    The link angles are interpolated at the instants of the other channels; samples for
    which there is none are omitted.

    Args:
        log: Recorded log.
        skew: Delay of the link angles [s].
    """
    from scipy.interpolate import CubicSpline

    # linear interpolation would damp fast motion in this channel alone
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
    estimates: Mapping[str, Estimate],
    left: Mapping[str, float],
    effects: Mapping[str, float],
    model: Model,
) -> list[str]:
    """Doubts about implausible parameters and poorly modelled torques, one line each.

    Args:
        estimates: Estimates of all parameters by name.
        left: Residual of each torque relative to its rms [-].
        effects: Effect of each parameter on the torques, relative to their rms [-].
        model: The fitted model.
    """
    window, rated = model.step, model.ratings.rated_torque
    lines = [line for line, effect in negative(estimates, effects) if effect > SMALL]
    lines += [
        f"{name}: the residual of the model is {share:.1%} of its rms; plausible: at"
        f" most {SHARE_LEFT:.0%}"
        for name, share in left.items()
        if share > SHARE_LEFT
    ]
    if lines:
        lines[-1] += (
            "; check the clocks of the channels, their noise and signs, the teeth, and"
            " orders and corners of the model"
        )
    for name in STIFFNESS:
        e = estimates.get(name)
        if e is not None and e.low <= 0.0:
            lines.append(
                f"the log does not determine {name}: {e.value:.3g} {e.unit}"
                f" ({e.low:.3g} to {e.high:.3g}); check the unit of the torque, the"
                " rated torque and the corners"
            )
    if model.largest_torque > OVERLOAD * rated:
        lines.append(
            f"the largest torque of the log at the output, {model.largest_torque:.4g}"
            f" N·m, is {model.largest_torque / rated:.3g} times the rated {rated:g}"
            f" N·m; plausible: at most {OVERLOAD:g} times, as catalogue drives ratchet"
            " below that; check the unit of the torques and the rated torque"
        )
    first, last = estimates.get("K1"), estimates.get("K3")
    if first is not None and last is not None:
        apart = SURE * np.hypot(first.deviation, last.deviation)
        if first.value - last.value > apart:
            lines.append(
                f"K1 {first.value:.4g} N·m/rad is above K3 {last.value:.4g} N·m/rad:"
                " drives stiffen under load"
            )
    skew = estimates.get("link_skew")
    if skew is not None and abs(skew.value) > window:
        lines.append(
            f"link_angle is {1e3 * skew.value:.3g} ms behind motor_angle, more than the"
            f" window of {1e3 * window:g} ms"
        )
    return lines


def describe_shifts(
    estimates: Mapping[str, Estimate], shifts: Mapping[str, float]
) -> tuple[str, float]:
    """A line on parameters that noise shifts beyond their intervals, and the largest.

    Args:
        estimates: Estimates of all parameters by name.
        shifts: Shift of each parameter by noise of the angles, in its unit.

    Returns:
        The line, empty if there are none, and the largest shift as a fraction of its
        parameter (of the amplitude for kinematic errors) [-].
    """
    parts, largest = [], 0.0
    for name, e in estimates.items():
        shift = shifts.get(name, 0.0)
        if name in SETTINGS or abs(shift) <= e.high - e.value:
            continue
        parts.append(f"{name} by about {shift:.2g} {e.unit}")
        size = abs(e.value)
        if name.startswith("error_"):
            other = estimates[name[:-3] + ("sin" if name.endswith("cos") else "cos")]
            size = hypot(size, other.value)
        largest = max(largest, abs(shift) / max(size, 1e-300))
    if not parts:
        return "", 0.0
    line = (
        f"noise of the angles shifts {', '.join(parts)}, which the intervals do not"
        " include; use a longer --window, or angles with less noise"
    )
    return line, largest


def negative(
    estimates: Mapping[str, Estimate], effects: Mapping[str, float]
) -> list[tuple[str, float]]:
    """A line for each parameter that is negative but must not be, and its effect.

    Args:
        estimates: Estimates of all parameters by name.
        effects: Effect of each parameter on the torques, relative to their rms [-].
    """
    lines = []
    for name in POSITIVE:
        e = estimates.get(name)
        if e is not None and e.value + SURE * e.deviation < 0.0:
            line = (
                f"{name} {e.value:.3g} {e.unit} ({e.low:.3g} to {e.high:.3g}) is"
                f" negative; its effect is {100 * effects[name]:.2g} % of the torque"
            )
            lines.append((line, effects[name]))
    return lines


def remarks(model: Model, drive: DriveMap, residuals: Mapping[str, Array]) -> list[str]:
    """Notes on lines that the log does not reach, sensor offsets, window and units.

    Args:
        model: The fitted model.
        drive: The identified map.
        residuals: Measured minus modelled torque by channel [N·m].
    """
    offset = [
        f"{key} {r.mean():.3g} N·m (deviation {r.std():.3g} N·m)"
        for key, r in residuals.items()
        if abs(r.mean()) > r.std()
    ]
    notes = []
    if model.spring == "three_lines" and len(model.slopes) < 3:
        corner = ("T1", "T2")[len(model.slopes) - 1]
        missing = " or ".join(SPRINGS["three_lines"][len(model.slopes) :])
        notes.append(
            f"the log reaches {model.largest_torque:.3g} N·m, below the corner {corner}"
            f" {getattr(model.ratings, corner):.3g} N·m: no {missing}; beyond the log"
            f" the map continues with {model.slopes[-1]}"
        )
    if offset:
        notes.append(
            f"mean of measured minus modelled torque: {', '.join(offset)}; offset of a"
            " sensor? The intervals do not include this offset"
        )
    phase = model.phase_step
    if phase > PHASE_STEP:
        window = model.step * PHASE_STEP / phase
        samples = model.samples
        apart = model.step * samples.time.size / samples.window.size
        advice = f"use --window {window:.2g}"
        if window < apart:  # a window needs a sample
            advice = f"use a log with a sample every {window:.2g} s or a slower motion"
        notes.append(
            f"the phase of the kinematic error changes by up to {phase:.2g} rad in a"
            f" window of {model.step:.3g} s, and the intervals do not include the"
            f" resulting error; {advice} for at most {PHASE_STEP:g} rad"
        )
    rated = drive.ratings.rated_torque
    low, high = TORSION_AT_RATED
    try:
        torsion = drive.mean_torsion(rated) / arcmin
    except ValueError:  # the spring softens below the rated torque
        return notes
    if not low <= torsion <= high:
        notes.append(
            f"torsion at the rated {rated:g} N·m is {torsion:.3g} arcmin; plausible:"
            f" {low:g} to {high:g} arcmin (catalogue drives have 5 to 7): check the"
            " units of the angles and the rated torque"
        )
    return notes
