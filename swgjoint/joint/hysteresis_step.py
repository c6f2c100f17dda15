r"""Hysteresis in one step of the law of the engine plugin, for the tests.

The elements have a stiffness k and a yield torque f, and each is relaxed at a torsion
r. The stretch of an element changes from :math:`u_0` to
:math:`u_1 = \mathrm{clip}(u_0 + \Delta^+ - \Delta, \pm f/k)`. With s the fraction of
the torsion step in which it sticks, the mean of its torque over the step and the slope
of this mean are

.. math::
    \bar q = k\,[\tfrac12 (u_0 + u_1)\,s + u_1 (1 - s)], \qquad
    \partial\bar q/\partial\Delta^+ = \tfrac12 k s^2.

The work :math:`\bar q\,(\Delta^+ - \Delta)` is the change of :math:`k u^2/2` plus the
slip dissipation, which is never negative.

A yield torque that depends on the load is constant within a step, with the mean elastic
torque of the step. If it is smaller than in the step before, the slider first slips
back, to :math:`|u_0| = f/k`. This slip needs no work and only reduces :math:`k u^2/2`,
so steps of any length are passive.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swgjoint.maps.hysteresis import Jenkin


def yield_torsions(elements: Sequence[Jenkin], elastic: float) -> tuple[float, ...]:
    """Yield torsion f/k of each element [rad].

    Args:
        elements: Jenkin elements of the drive.
        elastic: Elastic torque of the drive [N·m].
    """
    return tuple(float(element.reach(elastic)) for element in elements)


def move_rests(
    rest: Sequence[float], reach: Sequence[float], torsion: float
) -> tuple[float, ...]:
    """Torsion at which each element is relaxed after a monotone path [rad].

    Args:
        rest: Torsion at which each element is relaxed before [rad].
        reach: Yield torsion of each element [rad]; empty if nothing slips.
        torsion: Torsion at the end of the path [rad].
    """
    if not reach:
        return tuple(rest)
    limit = np.array(reach)
    return tuple(np.clip(rest, torsion - limit, torsion + limit).tolist())


def mean_torque(
    elements: Sequence[Jenkin],
    rest: Sequence[float],
    reach: Sequence[float],
    torsion: float,
    change: float = 0.0,
) -> tuple[float, float, float]:
    """Mean torque of the elements over a change of the torsion.

    Args:
        elements: Jenkin elements of the drive.
        rest: Torsion at which each element is relaxed [rad].
        reach: Yield torsion of each element in this step [rad].
        torsion: Torsion at the start [rad].
        change: Change of the torsion [rad].

    Returns:
        Mean torque [N·m], its slope and the sticking stiffness [N·m/rad].
    """
    torque = slope = sticking = 0.0
    for element, r, d in zip(elements, rest, reach, strict=True):
        k = element.stiffness
        begin = float(np.clip(torsion - r, -d, d))
        end = float(np.clip(begin + change, -d, d))
        part = 1.0 if end == begin + change else (end - begin) / change
        torque += k * (0.5 * (begin + end) * part + end * (1.0 - part))
        slope += 0.5 * k * part**2
        sticking += k * part
    return torque, slope, sticking
