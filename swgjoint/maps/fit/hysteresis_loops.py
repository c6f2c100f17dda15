r"""Hysteresis from computed loops with and without friction.

At every input position the loop with friction provides the torsion x(T). The drive
without friction provides the torsion :math:`x_0(T)`, whose inverse is the torque
:math:`T_0(x)` of the potential. The torque that friction adds at the same torsion,

.. math:: R = T - T_0(x), \qquad \oint R\,dx = \oint T\,dx = \text{work of friction},

is the target of the fit of Jenkin elements; see
:mod:`swgjoint.maps.fit.hysteresis_elements`. The report compares the loops of the map
with those of the finite elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from swgjoint.maps.equilibrium import move_sliders, output_angle
from swgjoint.maps.fit.friction_loop import FrictionLoop
from swgjoint.maps.fit.hysteresis_elements import fit_elements, is_large
from swgjoint.maps.hysteresis import total_yield
from swgjoint.maps.potential import Potential
from swgjoint.maps.sliders import Sliders
from swgjoint.typing import Array
from swgjoint.units import arcmin

Map = TypeVar("Map", bound=Potential)

STIFFEST = 25.0
"""Largest stiffness of the elements that stick at a load, over the mean stiffness of
the map [-]. Teeth that stick can be stiffer, but where the sum exceeds 30
(:mod:`swgjoint.joint.region`), no step is known to integrate a joint stably.
"""


def with_hysteresis(drive: Map, loops: Sequence[FrictionLoop]) -> Map:
    """The map with hysteresis elements fitted to loops; its info compares both.

    Args:
        drive: The map of the drive without friction.
        loops: Loops with friction, at representative input positions: large loops to
            one torque and, if there are any, small loops.
    """
    elements = fit_elements(loops, drive.max_stiffness, STIFFEST * drive.mean_stiffness)
    fitted = drive.with_parts(hysteresis=elements)
    pairs = list(zip(loops, play_loops(fitted, loops), strict=True))
    small = _compare_small([pair for pair in pairs if not is_large(pair[0])])
    loops, played = zip(*[pair for pair in pairs if is_large(pair[0])], strict=True)
    width = np.array([loop.width for loop in loops])
    shift = np.array([loop.shift for loop in loops])
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
        "torques_Nm": grid.tolist(),
        "widths_arcmin": (width.mean(axis=0) / arcmin).tolist(),
        "widths_map_arcmin": (widths.mean(axis=0) / arcmin).tolist(),
        "small_loops": small,
        "elements": len(fitted.hysteresis),
        "yield_torque_Nm": total_yield(fitted.hysteresis, 0.0),
        "yield_torque_at_end_Nm": total_yield(fitted.hysteresis, float(grid[-1])),
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
    return fitted.with_parts(info=info)


def _compare_small(
    pairs: Sequence[tuple[FrictionLoop, FrictionLoop]],
) -> list[dict[str, float]]:
    """Width and area of small loops, computed and of a map, as means over positions.

    Args:
        pairs: Small loops with those of the map; loops about the same torque belong
            together.
    """
    rows = []
    for mean in sorted({loop.mean_torque for loop, _ in pairs}):
        some = [pair for pair in pairs if pair[0].mean_torque == mean]
        first = some[0][0]
        rows.append(
            {
                "mean_torque_Nm": mean,
                "amplitude_Nm": float(first.branches(first.torque)[1][-1] - mean),
                "width_arcmin": float(np.mean([one.loss for one, _ in some]) / arcmin),
                "width_map_arcmin": float(
                    np.mean([played.loss for _, played in some]) / arcmin
                ),
                "friction_work_J": float(
                    np.mean([one.friction_work for one, _ in some])
                ),
                "round_area_J": float(np.mean([one.area for one, _ in some])),
                "round_area_map_J": float(np.mean([played.area for _, played in some])),
            }
        )
    return rows


def play_loops(drive: Potential, loops: Sequence[FrictionLoop]) -> list[FrictionLoop]:
    """The loops of a map along the torques of computed loops.

    Paths at one input angle usually begin alike: that of a small loop begins with the
    large loop. The longest one is then played once for all of them.

    Args:
        drive: The map.
        loops: Loops whose torques and input angles are used.
    """
    longest = {loop.input_angle: loop for loop in sorted(loops, key=_points)}
    whole = {angle: played_loop(drive, loop) for angle, loop in longest.items()}
    played = []
    for loop in loops:
        path, end = whole[loop.input_angle], _points(loop)
        begins = np.array_equal(path.torque[:end], loop.torque)
        played.append(
            path.cut_path(end, loop.quarter) if begins else played_loop(drive, loop)
        )
    return played


def _points(loop: FrictionLoop) -> int:
    """Number of points of the path."""
    return loop.torque.size


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
    once, place = np.unique(loop.torque, return_inverse=True)
    elastic = output_angle(drive, theta, once)
    ideal = theta / drive.ratio
    stiffness = drive.stiffness(drive.torsion(theta, elastic), theta, elastic)
    return FrictionLoop(
        input_angle=theta,
        quarter=loop.quarter,
        torque=loop.torque,
        torsion=ideal - psi,
        elastic_torsion=ideal - elastic[place],
        stiffness=stiffness[place],
        work=np.zeros(loop.torque.size),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
