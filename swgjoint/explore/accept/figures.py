r"""Figures of acceptance tests from the log of a bench, simulated or measured.

With input angle theta, output angle psi and signed ratio i, the error of the output is
psi - theta/i, and its negative, measured from any rest, the torsion under load.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np

from swgjoint.errors import InputError
from swgjoint.gear.ratings import Ratings
from swgjoint.identify.log import BenchLog
from swgjoint.maps.sheet.loop import TorqueLoop
from swgjoint.typing import Array
from swgjoint.units import arcmin, deg, rpm

AVERAGE = 0.1
"""Time over which the speed of the input is averaged, and that is left out at either
end of a period of constant speed [s]."""
BAND = 0.02
"""Largest deviation from a speed as a fraction of it [-]."""
SHORTEST = 0.5
"""Shortest accepted time at a speed [s]."""
TURNED = 1.0 * deg
"""Angle by which the input must turn to count as moving [rad]; the friction of a drive
yields by less before it slips."""
LIGHT = 1e-3
"""Torque at which a branch of the loop counts as unloaded, as a fraction of the rated
torque [-]."""
PADDING = 16
"""Factor by which zeros lengthen a decay, so that its spectrum is finely sampled."""


@dataclass(frozen=True, kw_only=True)
class Bench:
    """What a figure needs to know of the drive and of the test besides the log."""

    ratio: float
    """Signed ratio i, output = input / i."""
    ratings: Ratings
    """Ratings of the drive."""
    speeds: tuple[float, ...]
    """Speeds of the output in their order [rad/s]; empty for a test at rest."""

    def at_speeds(self, log: BenchLog) -> dict[str, slice]:
        """Samples of a log at every speed, by the input speed as text.

        A positive speed is one that turns the output forward.
        """
        return {
            f"{abs(self.ratio) * speed / rpm:.4g} rpm": _at(log, self.ratio * speed)
            for speed in self.speeds
        }


Figures = dict[str, dict[str, float | None]]
"""Values by figure and by condition; None where the drive has no such figure."""


def no_load(log: BenchLog, bench: Bench) -> Figures:
    """No-load running torque at the input over its speed.

    Args:
        log: Log of the test.
        bench: Drive and speeds of the test.
    """
    motor = _torque(log, "motor")
    torque: dict[str, float | None] = {
        speed: abs(float(motor[part].mean()))
        for speed, part in bench.at_speeds(log).items()
    }
    return _with_percent("no_load_torque", torque, bench, abs(bench.ratio))


def starting(log: BenchLog, bench: Bench) -> Figures:
    """Largest torque at the input from rest until it turns.

    Args:
        log: Log of the test.
        bench: Drive and speeds of the test.
    """
    torque, first = _torque(log, "motor"), _first_turned(log)
    if first is None:
        raise InputError(f"{log.where}: the input turns by less than 1 deg")
    value = float(np.abs(torque[: first + 1]).max())
    return _with_percent("starting_torque", {"": value}, bench, abs(bench.ratio))


def back_driving(log: BenchLog, bench: Bench) -> Figures:
    """Output torque at which the free input begins to turn; None if it does not.

    Args:
        log: Log of the test.
        bench: Drive and speeds of the test.
    """
    torque, first = _torque(log, "output"), _first_turned(log)
    value = None if first is None else abs(float(torque[first]))
    return _with_percent("back_driving_torque", {"": value}, bench, 1.0)


def efficiency(log: BenchLog, bench: Bench) -> Figures:
    """Output work over input work under load, by input speed.

    Args:
        log: Log of the test.
        bench: Drive and speeds of the test.
    """
    output, motor = _torque(log, "output"), _torque(log, "motor")
    found: dict[str, float | None] = {}
    for speed, part in bench.at_speeds(log).items():
        work = float(bench.ratio * motor[part].mean())
        if work == 0.0:
            raise InputError(
                f"{log.where}: motor_torque_Nm is 0 N·m at {speed}; accepted: the"
                " torque that drives the load"
            )
        found[speed] = 100.0 * float(output[part].mean()) / work
    return {"efficiency_percent": found}


def stiffness(log: BenchLog, bench: Bench) -> Figures:
    """Slopes, hysteresis loss and lost motion of the loop with a locked input.

    Args:
        log: Log of the test.
        bench: Drive and speeds of the test.
    """
    r, error = bench.ratings, _error(log, bench)
    loop = TorqueLoop(torque=_torque(log, "output"), torsion=error[0] - error)
    top = min(float(loop.torque.max()), float(-loop.torque.min()))
    if top < 1.05 * r.T2:
        raise InputError(
            f"{log.where}: torques of both signs to {top:.4g} N·m; accepted: to more"
            f" than T2, {r.T2:.4g} N·m"
        )
    limits = (0.0, r.T1, r.T2, 0.999 * top)
    K1, K2, K3 = (loop.stiffness(low, high) for low, high in pairwise(limits))
    light = LIGHT * r.rated_torque
    width = _branch(loop, light, rising=False) - _branch(loop, -light, rising=True)
    if np.isnan(width):
        raise InputError(
            f"{log.where}: the torque does not come to zero from both sides; accepted:"
            " a loop that ends at least where it began"
        )
    return {
        "K1_Nm_rad": {"": K1},
        "K2_Nm_rad": {"": K2},
        "K3_Nm_rad": {"": K3},
        "hysteresis_loss_arcmin": {"": (width - 2.0 * light / K1) / arcmin},
        "lost_motion_arcmin": {"": loop.lost_motion(r.rated_torque) / arcmin},
    }


def kinematic_error(log: BenchLog, bench: Bench) -> Figures:
    """Accuracy over one output turn in both directions, and their mean difference.

    Args:
        log: Log of the test.
        bench: Drive and speeds of the test.
    """
    error, means = _error(log, bench), []
    width: dict[str, float | None] = {}
    for speed, part in bench.at_speeds(log).items():
        angle = np.abs(log.link_angle[part] - log.link_angle[part][0])
        if angle[-1] < 2.0 * pi:
            raise InputError(
                f"{log.where}: {angle[-1] / deg:.4g} deg of the output at"
                f" {speed}; accepted: a whole turn in either direction"
            )
        turn = error[part][angle <= 2.0 * pi]
        means.append(float(turn.mean()))
        width[speed] = float(np.ptp(turn)) / arcmin
    return {
        "transmission_accuracy_arcmin": width,
        "reversal_error_arcmin": {"": abs(means[0] - means[1]) / arcmin},
    }


def resonance(log: BenchLog, bench: Bench) -> Figures:
    """Natural frequency of the load after a push, with the input held.

    Args:
        log: Log of the test.
        bench: Drive and speeds of the test.
    """
    error = _error(log, bench)
    push = int(np.abs(error - np.median(error)).argmax())
    step = float(np.median(np.diff(log.time)))
    decay = np.interp(
        np.arange(log.time[push], log.time[-1], step), log.time, error
    )  # at equal steps
    spectrum = np.abs(np.fft.rfft(decay - decay.mean(), PADDING * decay.size))
    k = int(spectrum.argmax())
    if not 0 < k < spectrum.size - 1:
        raise InputError(f"{log.where}: no vibration after a push")
    value = float(k / (PADDING * decay.size * step))
    return {"resonance_Hz": {"": value}}


TESTS: Mapping[str, Callable[[BenchLog, Bench], Figures]] = {
    "no_load": no_load,
    "starting": starting,
    "stiffness": stiffness,
    "kinematic_error": kinematic_error,
    "efficiency": efficiency,
    "back_driving": back_driving,
    "resonance": resonance,
}
"""Evaluation of every test, by its name in a scene."""


FIGURES: Mapping[str, Mapping[str, str]] = {
    "no_load": {
        "no_load_torque_Nm": "Mean torque at the input without load, at every speed.",
        "no_load_torque_percent": "The same at the output, in % of the rated torque.",
    },
    "starting": {
        "starting_torque_Nm": "Largest torque at the input until it turns.",
        "starting_torque_percent": "The same at the output, in % of the rated torque.",
    },
    "stiffness": {
        "K1_Nm_rad": "Slope of the loop from zero to T1.",
        "K2_Nm_rad": "Slope of the loop from T1 to T2.",
        "K3_Nm_rad": "Slope of the loop from T2 to its largest torque.",
        "hysteresis_loss_arcmin": "Width of the loop where the load comes to zero.",
        "lost_motion_arcmin": "Torsion between -4 and 4 % of the rated torque.",
    },
    "kinematic_error": {
        "transmission_accuracy_arcmin": "Peak to peak of the error over a turn.",
        "reversal_error_arcmin": "Difference of the mean errors of both directions.",
    },
    "efficiency": {
        "efficiency_percent": "Output work over input work at rated torque.",
    },
    "back_driving": {
        "back_driving_torque_Nm": "Torque on the output that turns the free input.",
        "back_driving_torque_percent": "The same in % of the rated torque.",
    },
    "resonance": {
        "resonance_Hz": "Natural frequency of the load of the bench, input held.",
    },
}
"""Figures of every test with their meaning."""
LIMITED = tuple(figure for figures in FIGURES.values() for figure in figures)
"""Figures that can be limited."""
LOWER = ("K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad", "efficiency_percent", "resonance_Hz")
"""Figures that a limit bounds from below."""


def _error(log: BenchLog, bench: Bench) -> Array:
    """Output minus ideal output [rad]. Shape (n,)."""
    return log.link_angle - log.motor_angle / bench.ratio


def _torque(log: BenchLog, side: str) -> Array:
    """Torque of the motor or of the output, which this test needs [N·m]. Shape (n,)."""
    values: Array | None = getattr(log, f"{side}_torque")
    if values is None:
        raise InputError(f"{log.where}: no column {side}_torque_Nm")
    return values


def _branch(loop: TorqueLoop, torque: float, *, rising: bool) -> float:
    """Torsion where the torque of a loop first rises or falls to a value [rad].

    The load bounces when it has crossed a clearance; first passages are on the way
    there. The mean of all parts of the loop but the first, which starts from rest; this
    one only where no other comes to the torque.

    Args:
        loop: The loop.
        torque: The torque [N·m].
        rising: Whether to read the branch of rising or of falling torque.
    """
    sign = 1.0 if rising else -1.0
    found: list[float] = []
    for first, last in loop.turns()[::-1]:
        part = sign * (loop.torque[first : last + 1] - torque)
        k = int((part >= 0.0).argmax())
        if part[-1] < part[0] or k == 0 or (found and first == 0):
            continue
        here = loop.torsion[first + k - 1 : first + k + 1]
        found.append(float(np.interp(0.0, part[k - 1 : k + 1], here)))
    return float(np.mean(found)) if found else float("nan")


def _at(log: BenchLog, speed: float) -> slice:
    """Samples of the longest period at a speed of the input [rad/s]."""
    t, theta, half = log.time, log.motor_angle, 0.5 * AVERAGE
    rate = (np.interp(t + half, t, theta) - np.interp(t - half, t, theta)) / AVERAGE
    near = np.abs(rate - speed) <= BAND * abs(speed)
    edges = np.flatnonzero(np.diff(near, prepend=False, append=False))
    first, last = edges[::2], edges[1::2] - 1
    length = t[last] - t[first]
    if not length.size or length.max() < SHORTEST:
        raise InputError(
            f"{log.where}: the input does not turn at {speed / rpm:.4g} rpm for"
            f" {SHORTEST:g} s; accepted: speeds within {100 * BAND:g} %"
        )
    k = int(length.argmax())
    # the ends still accelerate
    begin, end = t[first[k]] + AVERAGE, t[last[k]] - AVERAGE
    return slice(int(np.searchsorted(t, begin)), int(np.searchsorted(t, end)))


def _first_turned(log: BenchLog) -> int | None:
    """First sample at which the input has turned by :data:`TURNED`."""
    moved = np.abs(log.motor_angle - log.motor_angle[0]) > TURNED
    return int(moved.argmax()) if moved.any() else None


def _with_percent(
    name: str, torque: dict[str, float | None], bench: Bench, at_output: float
) -> Figures:
    """A torque in N·m, and at the output in percent of the rated torque.

    Args:
        name: Name of the figure without its unit.
        torque: Torque by condition [N·m].
        bench: The drive.
        at_output: Factor from this torque to that at the output [-].
    """
    percent = 100.0 * at_output / bench.ratings.rated_torque
    share = {k: None if v is None else percent * v for k, v in torque.items()}
    return {f"{name}_Nm": torque, f"{name}_percent": share}
