"""Test-bench logs: motor and link angles, motor and output torques."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from swgjoint.csv_columns import header_of, read_columns
from swgjoint.errors import InputError
from swgjoint.typing import Array
from swgjoint.units import arcmin, deg

NEEDED = {
    "time": {"time_s": 1.0},
    "motor_angle": {"motor_angle_deg": deg, "motor_angle_rad": 1.0},
    "link_angle": {
        "link_angle_deg": deg,
        "link_angle_rad": 1.0,
        "link_angle_arcmin": arcmin,
    },
}
TORQUES = {
    "output_torque": {"output_torque_Nm": 1.0},
    "motor_torque": {"motor_torque_Nm": 1.0},
}
"""Accepted columns of each channel and their factors to SI units; ``TORQUES`` are those
of which at least one is required."""
JITTER = 0.5
"""Largest distance of a time from an even one, in steps, that counts as jitter [-]."""
WHOLE = 1e-3
"""Largest distance of the samples per window from a whole number [-]."""
FEWEST = 200
"""Smallest number of averaged samples for a fit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Averaged:
    """Means of a log over n windows of equal duration; arrays of shape (n,)."""

    time: Array
    """Mean time of the samples in a window [s]."""
    motor_angle: Array
    """Input angle theta [rad]."""
    link_angle: Array
    """Output angle psi [rad]."""
    output_torque: Array | None
    """Torque of the drive on the output [N·m]; None if it was not logged."""
    motor_torque: Array | None
    """Torque of the motor on the input [N·m]; None if it was not logged."""
    window: NDArray[np.intp]
    """Index of the window that contains each sample of the log. Shape (n_samples,)."""

    def mean(self, values: Array) -> Array:
        """Window means of values at the samples of the log. Shape (n, ...)."""
        total = np.zeros((len(self.time), *values.shape[1:]))
        np.add.at(total, self.window, values)
        counts = np.bincount(self.window)
        return total / counts.reshape(-1, *[1] * (values.ndim - 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchLog:
    """Samples of a bench; arrays of shape (n,). At least one torque is required."""

    time: Array
    """Time, increasing [s]."""
    motor_angle: Array
    """Angle theta of the input member [rad]."""
    link_angle: Array
    """Angle psi of the output member [rad]."""
    output_torque: Array | None = None
    """Torque of the drive on the output [N·m]; None if it was not logged."""
    motor_torque: Array | None = None
    """Torque of the motor on the input [N·m]; None if it was not logged."""
    where: str = "log"
    """File or name of the log in messages."""

    def __post_init__(self) -> None:
        if self.output_torque is None and self.motor_torque is None:
            raise InputError(
                f"{self.where}: no torque; accepted: output_torque_Nm, motor_torque_Nm"
                " or both"
            )
        n = len(self.time)
        for key in ("motor_angle", "link_angle", "output_torque", "motor_torque"):
            values = getattr(self, key)
            if values is not None and len(values) != n:
                raise InputError(
                    f"{self.where}: {len(values)} values of {key}; accepted: {n}, one"
                    " for each time"
                )
        back = np.flatnonzero(np.diff(self.time) <= 0.0)
        if back.size:
            raise InputError(
                f"{self.where}: time_s {self.time[back[0] + 1]:g} after"
                f" {self.time[back[0]]:g}; accepted: increasing times"
            )

    def average(self, window: float) -> Averaged:
        """Means over windows of equal duration.

        Args:
            window: Duration of a window [s].

        Raises:
            InputError: If the window is invalid, if a window contains no sample, or if
                there are too few windows.
        """
        _, place, counts = np.unique(
            self.number_windows(window), return_inverse=True, return_counts=True
        )

        def mean(values: Array | None) -> Array | None:
            return None if values is None else np.bincount(place, values) / counts

        time, motor, link = (
            np.bincount(place, x) / counts
            for x in (self.time, self.motor_angle, self.link_angle)
        )
        return Averaged(
            time=time,
            motor_angle=motor,
            link_angle=link,
            output_torque=mean(self.output_torque),
            motor_torque=mean(self.motor_torque),
            window=np.asarray(place, dtype=np.intp),
        )

    def fill_windows(self, window: float) -> BenchLog:
        """The log with the same number of evenly spaced samples in every window.

        The mean of samples that are lost here and there, or of two and three samples in
        turn, belongs to a time that differs from the centre of its window. At constant
        speed this would look like an acceleration. Such a log is interpolated by cubic
        splines; any other log is returned as it is. Times that stray by less than
        :data:`JITTER` steps from even ones are taken as even, because a logger that
        receives samples of an even clock gives them such times.

        Args:
            window: Duration of a window [s].

        Raises:
            InputError: As :meth:`average`.
        """
        self.number_windows(window)
        number = np.arange(len(self.time))
        step, first = np.polyfit(number, self.time - self.time[0], 1)
        even = self.time[0] + first + step * number
        per_window = window / step
        if np.abs(self.time - even).max() > JITTER * step:
            even = self.time
        elif abs(per_window - round(per_window)) < WHOLE:
            return self
        count = ceil(per_window)
        fine = window / count
        time = even[0] + fine * np.arange(int(np.ptp(even) / fine) + 1)

        keys = ("motor_angle", "link_angle", "output_torque", "motor_torque")
        known = {key: x for key in keys if (x := getattr(self, key)) is not None}
        filled = {key: CubicSpline(even, x)(time) for key, x in known.items()}
        return replace(self, time=time, **filled)

    def number_windows(self, window: float) -> NDArray[np.intp]:
        """Number of the window of every sample. Shape (n,).

        Args:
            window: Duration of a window [s].

        Raises:
            InputError: As :meth:`average`.
        """
        if not (np.isfinite(window) and window > 0.0):
            raise InputError(f"window {window:g} s; accepted: > 0 s")
        # half a step early, so that round-off of the time moves no sample
        step = float(np.median(np.diff(self.time))) if len(self.time) > 1 else 1.0
        if window < 0.5 * step:
            raise InputError(
                f"window {window:g} s; accepted: at least the {step:g} s from sample to"
                f" sample of {self.where}"
            )
        bins = np.floor((self.time - self.time[0] + 0.5 * step) / window).astype(int)
        gap = np.diff(bins).max(initial=0)
        if gap > 1:
            at = float(self.time[np.diff(bins).argmax()])
            raise InputError(
                f"{self.where}: no sample for {gap * window:g} s after {at:g} s;"
                f" accepted: at least one sample in every {window:g} s"
            )
        count = np.unique(bins).size
        if count < FEWEST:
            raise InputError(
                f"{self.where}: too few windows of {window:g} s in a log of"
                f" {np.ptp(self.time):g} s with {len(self.time)} samples:"
                f" {count}; accepted: at least {FEWEST}"
            )
        return np.asarray(bins, dtype=np.intp)


def read_log(path: str | Path) -> BenchLog:
    """A log from a CSV file.

    The columns are ``time_s``, ``motor_angle_deg`` (or ``_rad``), ``link_angle_deg``
    (or ``_rad``, ``_arcmin``), and ``output_torque_Nm``, ``motor_torque_Nm`` or both.
    A warning names other columns, which are ignored.

    Raises:
        InputError: If the file cannot be used; the message names file, line and column.
    """
    header = header_of(path)
    has = {*header}
    torques = {key: names for key, names in TORQUES.items() if has & set(names)}
    data = read_columns(path, {**NEEDED, **torques})
    known = {name for names in (NEEDED | TORQUES).values() for name in names}
    if unused := [name for name in header if name not in known]:
        warnings.warn(
            f"{path}: columns that are not used: {', '.join(unused)[:200]}; accepted:"
            f" {', '.join(sorted(known))}",
            stacklevel=2,
        )
    return BenchLog(**data, where=str(path))


def mean_rate(means: Array, step: float) -> Array:
    """Mean rate in each window from window means of a signal, fourth-order accurate.

    The value at each border between windows is interpolated from the two means on
    either side. The two windows at each end use lower-order differences.

    Args:
        means: Window means of the signal. Shape (n,).
        step: Duration of a window [s].

    Returns:
        Mean rate in each window, per second. Shape (n,).
    """
    out = np.gradient(means, step)
    x = means
    faces = (7.0 * (x[1:-2] + x[2:-1]) - x[:-3] - x[3:]) / 12.0
    out[2:-2] = np.diff(faces) / step
    return np.asarray(out)


def mean_acceleration(means: Array, step: float) -> Array:
    """Mean second derivative in each window from window means, fourth-order accurate.

    The two windows at each end use lower-order differences.

    Args:
        means: Window means of the signal. Shape (n,).
        step: Duration of a window [s].

    Returns:
        Mean second derivative in each window, per second squared. Shape (n,).
    """
    out = np.gradient(np.gradient(means, step), step)
    x = means
    faces = (15.0 * (x[2:-1] - x[1:-2]) - (x[3:] - x[:-3])) / (12.0 * step)
    out[2:-2] = np.diff(faces) / step
    return np.asarray(out)
