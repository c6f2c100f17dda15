r"""Jenkin elements fitted to the friction torque of computed loops.

For a given yield torsion the torque of an element is its yield torque times a known
signal, so the yield torques follow from a non-negative least-squares problem. The same
holds for a yield torsion that is D times a given function of the elastic torque. These
functions are piecewise linear between the torques of the loop: 1, ramps that begin at
one of the torques, and functions that differ from 0 at a single torque. Their sums with
non-negative factors represent any piecewise linear yield torque.

Samples are weighted with the torsion between them. An element that slips throughout
then takes the mean of R and thereby dissipates the work of friction in a round. The
small loops of a position have the same weight together as its large loop. They
determine the yield torsions: after a reversal the teeth stick, and the large loop has
few steps there. An element whose yield torsion they do not determine, because no small
loop is close to its load, takes a yield torsion close to those of the other elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from swgjoint.maps.fit.friction_loop import FrictionLoop
from swgjoint.maps.fit.torsion_fit import FAINT
from swgjoint.maps.hysteresis import (
    MAX_ELEMENTS,
    Jenkin,
    sticking_stiffness,
    stretches,
)
from swgjoint.typing import Array

REACHES = 2.0 ** -np.arange(0.0, 10.5, 0.5)
"""Yield torsions of the candidate elements as fractions of the travel [-], from 1 to
0.1 %. An element with 1 always sticks, like teeth that do not slide and thereby stiffen
a drive."""
TORQUES = 12
"""Largest number of intervals of a yield curve."""
STEEPEST = 0.8
"""Largest slope of a yield torsion over the torsion [-]. The law requires at most 1 at
the largest stiffness of the map; the rest is a margin for specimens that are stiffer.
"""
STEEPEST_SUM = 0.9
"""Largest sum of the slopes of all yield torques over the elastic torque [-]; the law
requires less than 1."""
SLACK = 1e-3
"""Excess of this sum over its limit that costs as much as a residual of the largest
friction torque [-]."""
CLOSE = 0.05
"""Residual of constant yield torques, relative to the friction torque, below which they
suffice [-]."""
SAME = 1e-9
"""Largest difference of two signals that count as the same [-]."""
BETTER = 0.9
"""Residual relative to that of constant yield torques below which yield torques that
depend on the load are used [-]."""


def is_large(loop: FrictionLoop) -> bool:
    """Whether the round of a loop covers all torques of its path."""
    return bool(np.abs(loop.torque).max() == -loop.branches(loop.torque)[1][0])


def fit_elements(
    loops: Sequence[FrictionLoop], largest: float, stiffest: float = inf
) -> tuple[Jenkin, ...]:
    """Jenkin elements fitted to the friction torque, one set for all positions.

    Yield torques depend on the load only if constant ones do not suffice, see
    :data:`CLOSE` and :data:`BETTER`. If the elements are too stiff, the smallest yield
    torsions are left out.

    Args:
        loops: Large loops and, if there are any, small loops.
        largest: Largest elastic stiffness of the map [N·m/rad].
        stiffest: Largest sum of the stiffnesses of elements that stick at a load
            [N·m/rad].
    """
    elements = _fit_reaches(loops, REACHES, largest)
    for count in range(REACHES.size - 1, 0, -1):
        if sticking_stiffness(elements) <= stiffest:
            break
        elements = _fit_reaches(loops, REACHES[:count], largest)
    return elements


def _fit_reaches(
    loops: Sequence[FrictionLoop], reaches: Array, largest: float
) -> tuple[Jenkin, ...]:
    """Elements whose yield torsions are given fractions of the travel [-]."""
    travel = max(float(np.ptp(loop.torsion)) for loop in loops)
    path = next(loop for loop in loops if is_large(loop))
    at = path.branches(path.torque)[1][path.quarter :]
    at = at[:: -(-path.quarter // TORQUES)] if path.quarter > TORQUES else at
    constant = [(reach, np.ones_like(at)) for reach in reaches * travel]
    shapes = [np.clip((at - start) / (at[-1] - start), 0.0, 1.0) for start in at[:-1]]
    shapes += list(np.eye(at.size))
    steepest = [float(np.abs(np.diff(one) / np.diff(at)).max()) for one in shapes]
    loaded = [
        (reach, shape)
        for shape, steep in zip(shapes, steepest, strict=True)
        for reach in reaches * travel
        if reach * steep * largest <= STEEPEST
    ]
    plain, off = _elements(loops, at, constant)
    if not plain or not loaded or off <= CLOSE:
        return plain
    elements, left = _elements(loops, at, constant + loaded)
    if _largest_slope(elements, at) > STEEPEST_SUM:
        elements, left = _elements(loops, at, constant + loaded, limited=True)
    too_steep = _largest_slope(elements, at) > STEEPEST_SUM + SLACK
    if left > BETTER * off or too_steep or len(elements) > MAX_ELEMENTS:
        return plain
    return elements


def _largest_slope(elements: Sequence[Jenkin], at: Array) -> float:
    """Largest sum of the slopes of all yield torques between torques ``at`` [-]."""
    slopes = (np.abs(np.diff(one.yields(at)) / np.diff(at)) for one in elements)
    return float(np.max(sum(slopes, np.zeros(at.size - 1))))


def _elements(
    loops: Sequence[FrictionLoop],
    at: Array,
    candidates: Sequence[tuple[float, Array]],
    *,
    limited: bool = False,
) -> tuple[tuple[Jenkin, ...], float]:
    """Elements chosen from candidates, and the relative residual of the fit [-].

    Args:
        loops: Large and small loops.
        at: Torques at which the candidates are given, from zero [N·m]. Shape (m,).
        candidates: Yield torsion [rad] and its factors at these torques [-], (m,).
        limited: Whether to keep the sum of the slopes within :data:`STEEPEST_SUM`.
    """
    from scipy.optimize import nnls

    count = sum(not is_large(loop) for loop in loops) / sum(map(is_large, loops))
    rows, wanted = [], []
    for loop in loops:
        path, elastic = loop.torsion - loop.torsion[0], np.abs(loop.elastic_torque)
        columns = [
            stretches(path, d * np.interp(elastic, at, shape)) / d
            for d, shape in candidates
        ]
        step = np.abs(np.gradient(path))[loop.round]
        weight = np.sqrt(step / step.sum() / (1.0 if is_large(loop) else count))
        rows.append(weight[:, None] * np.column_stack(columns)[loop.round])
        wanted.append(weight * loop.friction_torque[loop.round])
    target = np.concatenate(wanted)
    unit = float(np.abs(target).max())
    if unit == 0.0:
        return (), 0.0
    matrix = np.concatenate(rows)
    alike = _alike(matrix, candidates)
    signals = matrix[:, [group[0] for group in alike]]
    if limited:
        shapes = np.array([candidates[group[0]][1] for group in alike]).T
        slopes = unit * np.abs(np.diff(shapes, axis=0)) / np.diff(at)[:, None]
        factors = nnls(*_with_limits(signals, target / unit, slopes))[0][: len(alike)]
        off = np.linalg.norm(signals @ factors - target / unit)
    else:
        factors, off = nnls(signals, target / unit)
    reaches = np.log([reach for reach, _ in candidates])
    typical = _typical_reach(factors, alike, reaches)
    yields = np.zeros(len(candidates))
    for factor, group in zip(factors, alike, strict=True):
        closest = np.abs(reaches[group] - typical).argmin()
        yields[group[int(closest)]] = unit * factor
    elements = tuple(
        _element(float(f), d, at, shape)
        for f, (d, shape) in zip(yields, candidates, strict=True)
        if f > FAINT * yields.sum()
    )
    return elements, unit * float(off) / float(np.linalg.norm(target))


def _with_limits(matrix: Array, target: Array, slopes: Array) -> tuple[Array, Array]:
    """Least squares whose sums of slopes stay within :data:`STEEPEST_SUM`.

    A non-negative slack variable per interval turns each limit into an equation, which
    a large weight enforces.

    Args:
        matrix: Signals of the candidates (n_points, n_candidates).
        target: Friction torque in units of its largest value (n_points,).
        slopes: Slope of each candidate's yield torque (n_intervals, n_candidates).

    Returns:
        Matrix and right-hand side; the slack variables follow the candidates.
    """
    count = len(slopes)
    free = np.zeros((len(matrix), count))
    limits = np.hstack([slopes, np.eye(count)]) / SLACK
    full = np.vstack([np.hstack([matrix, free]), limits])
    return full, np.append(target, np.full(count, STEEPEST_SUM / SLACK))


def _alike(
    signals: Array, candidates: Sequence[tuple[float, Array]]
) -> list[list[int]]:
    """Numbers of the candidates, grouped by equal signals.

    Elements of the same factors that slide at every point of the loops have the same
    signals: the loops do not determine their yield torsion.

    Args:
        signals: Weighted signal of each candidate (n_points, n_candidates).
        candidates: As in :func:`_elements`; those of the same factors follow each
            other in the order of decreasing yield torsions.
    """
    groups: list[list[int]] = []
    for k, (_, shape) in enumerate(candidates):
        if groups and np.array_equal(candidates[groups[-1][0]][1], shape):
            apart = np.abs(signals[:, k] - signals[:, groups[-1][0]]).max()
            if apart <= SAME * np.abs(signals[:, k]).max():
                groups[-1].append(k)
                continue
        groups.append([k])
    return groups


def _typical_reach(factors: Array, alike: list[list[int]], reaches: Array) -> float:
    """Logarithm of the yield torsion of the elements for which the loops determine it.

    It is their mean, weighted with the yield torques; without any, the largest one.

    Args:
        factors: Yield torques of the groups of candidates (n_groups,).
        alike: Groups of candidates with equal signals.
        reaches: Logarithms of the yield torsions (n_candidates,).
    """
    sure = [len(group) == 1 for group in alike]
    weight = factors * sure
    if not weight.any():
        return float(reaches.max())
    return float(np.average([reaches[group[0]] for group in alike], weights=weight))


def _element(torque: float, reach: float, at: Array, shape: Array) -> Jenkin:
    """One element with a yield torque [N·m] times ``shape`` at the torques ``at``."""
    stiffness = torque / reach
    if (shape == 1.0).all():
        return Jenkin(stiffness=stiffness, yield_torque=torque)
    slopes = np.diff(shape) / np.diff(at)
    # points where the slope changes, and the last one
    bends = np.append(np.abs(np.diff(slopes)) > 1e-9 * np.abs(slopes).max(), True)
    curve = zip(at[1:][bends], torque * shape[1:][bends], strict=True)
    return Jenkin(
        stiffness=stiffness,
        yield_torque=torque * float(shape[0]),
        yield_curve=tuple((float(t), float(f)) for t, f in curve),
    )
