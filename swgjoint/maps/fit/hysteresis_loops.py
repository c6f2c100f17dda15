r"""Hysteresis from computed loops with and without friction.

At every input position the loop with friction provides the torsion x(T). The drive
without friction provides the torsion :math:`x_0(T)`, whose inverse is the torque
:math:`T_0(x)` of the potential. The torque that friction adds at the same torsion,

.. math:: R = T - T_0(x), \qquad \oint R\,dx = \oint T\,dx = \text{work of friction},

is the target of the fit of Jenkin elements. For a given yield torsion, the torque of an
element is its yield torque times a known signal, so the yield torques follow from a
non-negative least-squares problem. Samples are weighted with the torsion between them.
An element that slips throughout then takes the mean of R and thereby dissipates the
work of friction in a round.

Elements yield at a constant torque, whereas tooth friction varies with the load and the
sliding of the teeth. The loop of tooth friction may be narrower in the middle than
under load. Parallel elements cannot reproduce this: their loop is then too wide in the
middle and too narrow elsewhere. The report states the differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from swgjoint.arrays import frozen_array
from swgjoint.maps.equilibrium import move_sliders, output_angle
from swgjoint.maps.fit.torsion_fit import FAINT
from swgjoint.maps.hysteresis import Jenkin, Sliders, stretches
from swgjoint.maps.potential import Potential
from swgjoint.typing import Array
from swgjoint.units import arcmin

Map = TypeVar("Map", bound=Potential)

REACHES = 2.0 ** -np.arange(0.0, 10.5, 0.5)
"""Yield torsions of the candidate elements as fractions of the travel [-], from 1 to
0.1 %. An element with 1 always sticks, like teeth that do not slide and thereby stiffen
a drive."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrictionLoop:
    """Torque loop with locked input, from the first loading to a closed round.

    The last round is T -> 0 -> -T -> 0 -> T. When it begins, the first loading no
    longer affects the drive.
    """

    input_angle: float
    """Locked input angle theta [rad]."""
    quarter: int
    """Number n of steps in each quarter of the last round."""
    torque: Array
    """Torque T along the path, at least 4 n + 1 values [N·m]. Shape (n_points,)."""
    torsion: Array
    """Torsion theta/i - psi with friction [rad]. Shape (n_points,)."""
    elastic_torsion: Array
    """Torsion without friction at the same torques [rad]. Shape (n_points,)."""
    stiffness: Array
    """Tangent stiffness dT/dx without friction [N·m/rad]. Shape (n_points,)."""
    work: Array
    """Work of friction since the start [J]. Shape (n_points,)."""

    def __post_init__(self) -> None:
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        falling, rising = self.branches(torque)
        if rising.size != 2 * self.quarter + 1 or (falling != rising).any():
            raise ValueError(
                f"{torque.size} torques do not end with a round of equal branches, in"
                f" quarters of {self.quarter} steps"
            )
        object.__setattr__(self, "torque", torque)
        for key, unit in (
            ("torsion", "rad"),
            ("elastic_torsion", "rad"),
            ("stiffness", "N·m/rad"),
            ("work", "J"),
        ):
            values = frozen_array(
                getattr(self, key), f"{key} [{unit}]", shape=(torque.size,)
            )
            object.__setattr__(self, key, values)

    @property
    def round(self) -> slice:
        """The last round, closed, from T to T."""
        return slice(-4 * self.quarter - 1, None)

    def branches(self, values: Array) -> tuple[Array, Array]:
        """Values of the falling and the rising branch, both from -T to T (2 n + 1,)."""
        n = self.quarter
        last = values[self.round]
        return last[: 2 * n + 1][::-1], last[2 * n :]

    @property
    def width(self) -> Array:
        """Torsion of the falling minus that of the rising branch (2 n + 1,) [rad]."""
        falling, rising = self.branches(self.torsion)
        return np.asarray(falling - rising)

    @property
    def shift(self) -> Array:
        """Mid-line minus the torsion without friction (2 n + 1,) [rad]."""
        falling, rising = self.branches(self.torsion - self.elastic_torsion)
        return np.asarray(0.5 * (falling + rising))

    @property
    def loss(self) -> float:
        """Full width at zero torque [rad]."""
        return float(self.width[self.quarter])

    @property
    def area(self) -> float:
        """Work of the round, the integral of T dx [J]."""
        return float(np.trapezoid(self.torque[self.round], self.torsion[self.round]))

    @property
    def friction_work(self) -> float:
        """Work of friction over the round [J]."""
        return float(np.ptp(self.work[self.round]))

    @property
    def gap(self) -> float:
        """Torsion at the end of the round minus that at its start [rad]."""
        return float(self.torsion[-1] - self.torsion[self.round][0])

    @property
    def friction_torque(self) -> Array:
        """R = T - T_0(x) along the path (n_points,) [N·m]."""
        torque, place = np.unique(self.torque, return_index=True)
        # friction shifts x only slightly, so interpolation by value and slope suffices
        elastic = CubicHermiteSpline(
            self.elastic_torsion[place], torque, self.stiffness[place]
        )
        return np.asarray(self.torque - elastic(self.torsion))


def fit_elements(loops: Sequence[FrictionLoop]) -> tuple[Jenkin, ...]:
    """Jenkin elements fitted to the friction torque, one set for all positions."""
    from scipy.optimize import nnls

    travel = max(float(np.ptp(loop.torsion)) for loop in loops)
    reaches = REACHES * travel
    rows, wanted = [], []
    for loop in loops:
        path = loop.torsion - loop.torsion[0]
        signals = np.column_stack([stretches(path, d) / d for d in reaches])
        step = np.abs(np.gradient(path))[loop.round]
        weight = np.sqrt(step / step.sum())
        rows.append(weight[:, None] * signals[loop.round])
        wanted.append(weight * loop.friction_torque[loop.round])
    target = np.concatenate(wanted)
    unit = float(np.abs(target).max())
    if unit == 0.0:
        return ()
    yields = unit * nnls(np.concatenate(rows), target / unit)[0]
    return tuple(
        Jenkin(stiffness=float(f / d), yield_torque=float(f))
        for f, d in zip(yields, reaches, strict=True)
        if f > FAINT * yields.sum()
    )


def with_hysteresis(drive: Map, loops: Sequence[FrictionLoop]) -> Map:
    """The map with hysteresis elements fitted to loops; its info compares both.

    Args:
        drive: The map of the drive without friction.
        loops: Loops with friction, at representative input positions.
    """
    fitted = replace(drive, hysteresis=fit_elements(loops))
    width = np.array([loop.width for loop in loops])
    shift = np.array([loop.shift for loop in loops])
    played = [played_loop(fitted, loop) for loop in loops]
    widths = np.array([loop.width for loop in played])
    shifts = np.array([loop.shift for loop in played])
    grid = loops[0].branches(loops[0].torque)[1]
    at = int(width.mean(axis=0).argmax())
    loss, loss_map = (np.array([one.loss for one in some]) for some in (loops, played))
    work = np.array([loop.friction_work for loop in loops])
    taken = np.array([one.area for one in played])
    report: dict[str, Any] = {
        "torque_Nm": float(grid[-1]),
        "input_angles_rad": [loop.input_angle for loop in loops],
        "hysteresis_loss_arcmin": (loss / arcmin).tolist(),
        "hysteresis_loss_map_arcmin": (loss_map / arcmin).tolist(),
        "widest_arcmin": float(width.mean(axis=0)[at] / arcmin),
        "widest_map_arcmin": float(widths.mean(axis=0)[at] / arcmin),
        "widest_at_Nm": float(grid[at]),
        "mid_line_shift_arcmin": float(np.abs(shift).max() / arcmin),
        "residual_width_rms_arcmin": _rms(widths - width) / arcmin,
        "residual_width_max_arcmin": float(np.abs(widths - width).max() / arcmin),
        "residual_mid_line_rms_arcmin": _rms(shifts - shift) / arcmin,
        "residual_mid_line_max_arcmin": float(np.abs(shifts - shift).max() / arcmin),
        "width_rms_arcmin": _rms(width) / arcmin,
        "friction_work_J": work.tolist(),
        "round_area_J": [loop.area for loop in loops],
        "round_area_map_J": taken.tolist(),
        "not_closed_arcmin": float(max(abs(loop.gap) for loop in loops) / arcmin),
        "elements": len(fitted.hysteresis),
        "yield_torque_Nm": float(sum(e.yield_torque for e in fitted.hysteresis)),
    }
    mean, low, high = loss.mean(), loss.min(), loss.max()
    widest = report["widest_arcmin"]
    label = (
        f"tooth friction of the finite elements at {len(loops)} input positions to"
        f" {grid[-1]:.4g} N·m: loop {mean / arcmin:.3g} arcmin wide at zero torque"
        f" ({low / arcmin:.3g} to {high / arcmin:.3g}), at most {widest:.3g} arcmin at"
        f" {grid[at]:.3g} N·m; loop of the map {loss_map.mean() / arcmin:.3g} and"
        f" {report['widest_map_arcmin']:.3g} arcmin wide, work of a round"
        f" {taken.mean() / work.mean():.2f} times that of the finite elements"
    )
    info = {**drive.info, "friction_loop": report, "hysteresis": label}
    return replace(fitted, info=info)


def played_loop(drive: Potential, loop: FrictionLoop) -> FrictionLoop:
    """The loop of a map along the torques of a computed loop.

    Its work of friction is not computed and is zero.

    Args:
        drive: The map.
        loop: Loop whose torques and input angle are used.
    """
    theta = loop.input_angle
    free = float(output_angle(drive, theta, 0.0))
    sliders = Sliders.relax(drive.hysteresis, float(drive.torsion(theta, free)))
    psi = np.full(loop.torque.size, free)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(loop.torque)))) + 1
    for begin, end in pairwise([0, *turns.tolist(), loop.torque.size - 1]):
        leg = slice(begin + 1, end + 1)
        psi[leg] = output_angle(drive, theta, loop.torque[leg], sliders)
        sliders = move_sliders(drive, sliders, theta, float(psi[end]))
    elastic = output_angle(replace(drive, hysteresis=()), theta, loop.torque)
    ideal = theta / drive.ratio
    x = drive.torsion(theta, elastic)
    return FrictionLoop(
        input_angle=theta,
        quarter=loop.quarter,
        torque=loop.torque,
        torsion=ideal - psi,
        elastic_torsion=ideal - elastic,
        stiffness=drive.stiffness(x, theta, elastic),
        work=np.zeros(loop.torque.size),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
