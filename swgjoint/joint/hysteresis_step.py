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

The engine receives a torque that is linear in the true change of the torsion d: offset
+ rate d, equal to the mean torque for the predicted change. While the element sticks,
the offset is :math:`k u_0` and the rate k/2. If it slips, the rate is the slope of the
mean torque or, if this is larger, the smallest rate with

.. math:: \mathrm{offset}^2 \le 2\,k\,\mathrm{rate}\,u_0^2 .

The work (offset + rate d) d is then at least :math:`-k u_0^2/2` for every d. The
element ends with at most its initial energy plus that work. It therefore dissipates
energy or returns only stored energy, even if an impact makes the prediction wrong.
With this rate, the passes of the scheme also converge where Newton's method would
alternate between sticking and slipping.

A yield torque that depends on the load is constant within a step, with the mean elastic
torque of the step. If it is smaller than in the step before, the slider first slips
back, to :math:`|u_0| = f/k`. This slip needs no work and only reduces :math:`k u^2/2`,
so steps of any length are passive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

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


@dataclass(frozen=True, kw_only=True)
class ElementStep:
    """Torque of one element over a step, linear in the change of the torsion."""

    stiffness: float
    """Stiffness k while the element sticks [N·m/rad]."""
    stretch: float
    """Stretch at the beginning of the step [rad]."""
    reach: float
    """Largest stretch in this step [rad]."""
    mean: float
    """Mean torque over the predicted change of the torsion [N·m]."""
    offset: float
    """Torque without a change of the torsion [N·m]."""
    rate: float
    """Change of the torque per change of the torsion [N·m/rad]."""
    part: float
    """Fraction of the predicted change over which the element sticks [-]."""

    def stretch_after(self, change: float) -> float:
        """Stretch after the actual change of the torsion in the step [rad].

        Args:
            change: Actual change of the torsion [rad].
        """
        end = min(max(self.stretch + change, -self.reach), self.reach)
        if self.part == 1.0:
            return end
        work = (self.offset + self.rate * change) * change
        most = sqrt(max(0.0, self.stretch**2 + 2.0 * work / self.stiffness))
        return min(max(end, -most), most)


def element_steps(
    elements: Sequence[Jenkin],
    rest: Sequence[float],
    reach: Sequence[float],
    torsion: float,
    change: float = 0.0,
) -> tuple[ElementStep, ...]:
    """Torque of each element over a predicted change of the torsion.

    Args:
        elements: Jenkin elements of the drive.
        rest: Torsion at which each element is relaxed [rad].
        reach: Yield torsion of each element in this step [rad].
        torsion: Torsion at the start [rad].
        change: Predicted change of the torsion [rad].
    """
    steps = []
    for element, r, d in zip(elements, rest, reach, strict=True):
        k = element.stiffness
        begin = min(max(torsion - r, -d), d)
        end = min(max(begin + change, -d), d)
        part = 1.0 if end == begin + change else (end - begin) / change
        mean = k * (0.5 * (begin + end) * part + end * (1.0 - part))
        rate = 0.5 * k * part**2
        if part != 1.0:
            # (mean - rate change)² = 2 k rate begin², the smaller solution
            work, stored = mean * change, k * begin**2
            total = work + stored + sqrt(stored * (2.0 * work + stored))
            if total > 0.0:
                rate = max(rate, mean**2 / total)
        steps.append(
            ElementStep(
                stiffness=k,
                stretch=begin,
                reach=d,
                mean=mean,
                offset=mean - rate * change,
                rate=rate,
                part=part,
            )
        )
    return tuple(steps)


def rests_after(
    steps: Sequence[ElementStep], rest: Sequence[float], torsion: float, change: float
) -> tuple[float, ...]:
    """Torsion at which each element is relaxed after a step [rad].

    Args:
        steps: Torques of the elements in the step.
        rest: Torsion at which each element is relaxed before [rad].
        torsion: Torsion at the start of the step [rad].
        change: Actual change of the torsion [rad].
    """
    rest = move_rests(rest, [step.reach for step in steps], torsion)
    return tuple(
        r + (step.stretch + change - step.stretch_after(change))
        for r, step in zip(rest, steps, strict=True)
    )
