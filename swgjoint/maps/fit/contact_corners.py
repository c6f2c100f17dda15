r"""Corners over the angle at which contacts change between two sampled angles.

A contact that opens or closes under the torque :math:`T_c(\theta)` changes the tangent
compliance above it by w. Output error e and complementary potential G then contain

.. math:: \Delta G = -\frac{w}{2} \langle T - T_c(\theta) \rangle^2, \quad
    \Delta e = \frac{d \Delta G}{dT} = -w \langle T - T_c(\theta) \rangle .

Over the angle, at the torque T, the slope of e jumps by :math:`-w |T_c'|` where
:math:`T_c` passes T, and the slope of the input torque :math:`dG/d\theta` by
:math:`w T_c' |T_c'|`. Harmonics and splines through the samples round these corners.
The load curves at two neighbouring angles say where they are: each predicts the torque
under which the contact changes, which is taken as linear between the two angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from swgjoint.typing import Array, Index

ALIKE = 3.0
"""Largest ratio of the jumps of the compliance that two neighbouring angles predict for
one change of a contact [-]. It is 2.6 where two contacts exchange their order in
reference-2d-dca. With 5, changes of other kinds are paired in reference-2d-simplified.
"""
_REACH = 5
"""Number of samples by which a period is continued at both ends."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactCorners:
    """Contact changes in the steps between sampled angles, for torques of one sign."""

    angle: Array
    """Sampled angles, increasing (n,) [rad]."""
    period: float
    """Period of the samples [rad]."""
    start: Array
    """Sampled angle before each change (m,) [rad]."""
    step: Array
    """Step from there to the next sampled angle (m,) [rad]."""
    torque: Array
    """Magnitude of the torque under which the contact changes, at both angles (m, 2)
    [N·m]."""
    jump: Array
    """Jump of the compliance above this torque (m,) [rad/(N·m)]."""
    uncertain: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """Where the load curves of the sampled angles are likely to be least accurate:
    magnitude of the torque [N·m], angle [rad] and estimated error of the output error
    [rad] in each interval between sampled torques (k, 3)."""

    @classmethod
    def from_changes(
        cls,
        angle: Array,
        period: float,
        changes: Sequence[tuple[Array, Array, Index]],
        uncertain: Array | None = None,
    ) -> ContactCorners:
        """Changes that neighbouring angles predict alike.

        The last step of the period is left out: the contacts of the first angle have
        other numbers one pitch later.

        Args:
            angle: Sampled angles, increasing (n,) [rad].
            period: Period of the samples [rad].
            changes: Torques [N·m], jumps of the compliance [rad/(N·m)] and numbers of
                the contacts that change, each (m,), at every angle.
            uncertain: Number of the angle, torque [N·m] and estimated error of the
                output error [rad] where the load curves are likely to be least
                accurate (k, 3); None without any.
        """
        rows = [np.zeros((0, 5))]
        for k, (one, two) in enumerate(pairwise(changes)):
            here, there = pair_changes(one, two)
            ends = np.stack([one[0][here], two[0][there]], axis=1)
            jump = 0.5 * (one[1][here] + two[1][there])
            step = np.broadcast_to([angle[k], angle[k + 1] - angle[k]], ends.shape)
            rows.append(np.column_stack([step, ends, jump]))
        start, step, first, last, jump = np.concatenate(rows).T
        number, torque, error = (np.zeros((0, 3)) if uncertain is None else uncertain).T
        return cls(
            uncertain=np.column_stack([torque, angle[number.astype(int)], error]),
            angle=angle,
            period=period,
            start=start,
            step=step,
            torque=np.stack([first, last], axis=1),
            jump=jump,
        )

    def spline_errors(self, torque: float, theta: Array) -> tuple[Array, Array]:
        """Errors of cubic splines through the samples, as far as corners cause them.

        Args:
            torque: Magnitude of the torque [N·m].
            theta: Input angles within the period (n,) [rad].

        Returns:
            Spline minus function, of the output error under torques of this sign [rad]
            and of the input torque [N·m], each (n,).
        """
        there, place = self._crossings(torque)
        if not place.size:
            return np.zeros(theta.size), np.zeros(theta.size)
        slope = np.diff(self.torque[there])[:, 0] / self.step[there]
        images = self.period * np.array([[-1.0], [0.0], [1.0]])
        place = (place + images).ravel()
        of_error = np.tile(-self.jump[there] * np.abs(slope), 3)
        of_moment = np.tile(self.jump[there] * slope * np.abs(slope), 3)

        # corners with equal slopes on both sides; a spline is exact for the difference
        around = np.arange(-_REACH, self.angle.size + _REACH + 1)
        turns, own = np.divmod(around, self.angle.size)
        samples = self.angle[own] + turns * self.period
        apart, away = samples[:, None] - place, theta[:, None] - place
        error = 0.5 * np.abs(apart) @ of_error
        potential = 0.25 * (apart * np.abs(apart)) @ of_moment
        spline = CubicSpline(samples, np.column_stack([error, potential]))
        return (
            spline(theta)[:, 0] - 0.5 * np.abs(away) @ of_error,
            spline(theta, 1)[:, 1] - 0.5 * np.abs(away) @ of_moment,
        )

    def places(self, torque: float) -> Array:
        """Angles at which contacts change under a torque of this magnitude (m,) [rad].

        The errors of the input torque are largest there.
        """
        return self._crossings(torque)[1]

    def _crossings(self, torque: float) -> tuple[Index, Array]:
        """Indices of the changes under a torque, and their angles [rad], each (m,)."""
        low, high = self.torque.min(axis=1), self.torque.max(axis=1)
        there = np.flatnonzero((low <= torque) & (torque < high))
        first, last = self.torque[there].T
        way = (torque - first) / (last - first)
        return there, self.start[there] + way * self.step[there]


def pair_changes(
    one: tuple[Array, Array, Index], two: tuple[Array, Array, Index]
) -> tuple[Index, Index]:
    """Indices of the same contact changes in two predictions.

    Each is, for the other one, the nearest change of the same contact in the same
    direction, and their jumps are similar. Much smaller changes are no obstacle: a
    contact may change several times, most of them by little.

    Args:
        one: Torques or places, jumps of the compliance [rad/(N·m)] and numbers of the
            contacts of one prediction, each (n,).
        two: The same of the other prediction, each (m,).
    """
    none = np.zeros(0, dtype=np.int64)
    if not one[0].size or not two[0].size:
        return none, none
    jump, other = one[1][:, None], two[1]
    same = (jump * other > 0.0) & (one[2][:, None] == two[2])
    apart = np.where(same, np.abs(one[0][:, None] - two[0]), np.inf)
    not_less = ALIKE * np.abs(other) > np.abs(jump)
    not_more = ALIKE * np.abs(jump) > np.abs(other)
    there = np.where(not_less, apart, np.inf).argmin(axis=1)
    back = np.where(not_more, apart, np.inf).argmin(axis=0)
    here = np.arange(there.size)
    alike = not_less[here, there] & not_more[here, there]
    mutual = (back[there] == here) & np.isfinite(apart[here, there])
    return here[mutual & alike], there[mutual & alike]
