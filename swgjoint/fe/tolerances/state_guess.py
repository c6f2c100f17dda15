"""Guess of which contacts are active, learned from problems that are solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.typing import Array, Mask

COORDINATES = 64
"""Largest number of coordinates of the gap changes on which a guess depends."""
FAINT = 1e-6
"""Variance of a coordinate of the gap changes below which it is left out, relative to
the largest one [-]."""
CUT = 0.9
"""Quantile of the margins of active contacts at which all margins are cut off [-]: a
contact that is far from a change of its state tells little about others."""
RIDGE = 3e-3
"""Regularisation of the regression, relative to the mean square of its inputs [-]."""
STEPS = 127
"""Number of steps between no margin and one that is cut off, in which features are
counted: those of a position with 20,200 pitches fill 30 instead of 230 MB."""
BLOCK = 1024
"""Number of problems that are guessed at once, so that their inputs stay in the cache.
A guess is no result: single precision suffices for it."""
Features = NDArray[np.int8]
"""Margins of some problems, whole numbers from -STEPS to STEPS."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StateGuess:
    """Linear regression for the margins of contacts: active ones have positive margins.

    Its inputs are the gap changes and, if they are known, margins of the same drive
    under the torque before and at positions nearby, where it is linearised with other
    contacts. In size-25-100-bought under 117 N·m, 4.9 contacts per problem are guessed
    wrong from the torque before, 2.6 with the positions nearby. In the most similar
    problem that is solved, 22 are different.
    """

    mean: Array
    """Mean gap changes (n,) [m]."""
    directions: Array
    """Directions in which the gap changes vary most (n, n_coordinates) [1/m]."""
    always: Mask
    """Contacts that are active in all solved problems (k,)."""
    varied: Mask
    """Contacts that are active in some of them (k,)."""
    most: float
    """Margin at which margins are cut off."""
    coefficients: Array
    """Features by the inputs (n_inputs, n_varied)."""

    @classmethod
    def fit(
        cls, gap_change: Array, known: Sequence[Features], margin: Array
    ) -> StateGuess:
        """Regression through the solutions of some problems.

        Args:
            gap_change: Gap changes (n_problems, n) [m].
            known: Features of solutions nearby, each (n_problems, n_features).
            margin: Margins, see :class:`swgjoint.fe.common.influence.Response`
                (n_problems, k).
        """
        share = (margin > 0.0).mean(axis=0)
        varied = (share > 0.0) & (share < 1.0)
        near = margin[:, varied]
        close = near[near > 0.0]
        mean = gap_change.mean(axis=0)
        moved = gap_change - mean
        size, axes = np.linalg.eigh(moved.T @ moved / len(moved))
        size, axes = size[-COORDINATES:], axes[:, -COORDINATES:]
        largest = size.max(initial=1e-300)
        guess = cls(
            mean=mean,
            directions=axes[:, size > FAINT * largest] / np.sqrt(largest),
            always=share == 1.0,
            varied=varied,
            most=float(np.quantile(close, CUT)) if close.size else 1.0,
            coefficients=np.zeros((0, 0)),
        )
        inputs = guess._inputs(gap_change, known).astype(float)
        square = inputs.T @ inputs
        square += RIDGE * square.trace() / len(square) * np.eye(len(square))
        # rounded features have no sign where contacts are close to a change
        right = inputs.T @ guess._steps(margin)
        coefficients = np.asarray(np.linalg.solve(square, right))
        return replace(guess, coefficients=coefficients)

    def features(self, margin: Array) -> Features:
        """Margins that vary (n_problems, n_varied), in steps up to where they are cut.

        Args:
            margin: Margins (n_problems, k); NaN if unsolved, which counts as zero.
        """
        return np.rint(self._steps(margin)).astype(np.int8)

    def active(self, gap_change: Array, known: Sequence[Features]) -> Mask:
        """Contacts that are likely to be active (n_problems, k).

        Args:
            gap_change: Gap changes (n_problems, n) [m].
            known: Features of solutions nearby, each (n_problems, n_features).
        """
        coefficients = self.coefficients.astype(np.float32)
        active = np.tile(self.always, (len(gap_change), 1))
        for k in range(0, len(gap_change), BLOCK):
            part = slice(k, k + BLOCK)
            inputs = self._inputs(gap_change[part], [one[part] for one in known])
            active[part, self.varied] = inputs @ coefficients > 0.0
        return active

    def _steps(self, margin: Array) -> Array:
        """The same, not rounded."""
        steps = margin[:, self.varied]
        steps *= STEPS / self.most
        np.clip(steps, -STEPS, STEPS, out=steps)
        steps[np.isnan(steps)] = 0.0
        return steps

    def _inputs(
        self, gap_change: Array, known: Sequence[Features]
    ) -> NDArray[np.float32]:
        """One, the coordinates of the gap changes, and the features nearby."""
        moved = (gap_change - self.mean) @ self.directions
        widths = np.cumsum([1, moved.shape[1], *(one.shape[1] for one in known)])
        inputs = np.empty((len(moved), widths[-1]), dtype=np.float32)
        inputs[:, 0] = 1.0
        inputs[:, 1 : widths[1]] = moved
        for one, start in zip(known, widths[1:], strict=False):
            inputs[:, start : start + one.shape[1]] = one
        inputs[:, widths[1] :] /= np.float32(STEPS)
        return inputs


@dataclass(frozen=True, kw_only=True, eq=False)
class NearbyPositions:
    """Features of all pitches at positions that were solved before, by torque [N·m].

    The positions within a pitch are solved one after another. Each of them lies between
    the one before it and the first position of the next pitch.
    """

    first: dict[float, Features] = field(default_factory=dict)
    """Features at the first position (n_sets, n)."""
    latest: dict[float, Features] = field(default_factory=dict)
    """The same at the latest position."""

    def features(self, torque: float) -> list[Features]:
        """Features at both positions, each (n_sets, n); none if they are not known."""
        if torque not in self.latest:
            return []
        return [self.latest[torque], np.roll(self.first[torque], -1, axis=0)]

    def store(self, torque: float, features: Features) -> None:
        """Keep the features of one position under a torque.

        Args:
            torque: Torque T [N·m].
            features: Features (n_sets, n).
        """
        self.latest[torque] = features
        self.first.setdefault(torque, features)
