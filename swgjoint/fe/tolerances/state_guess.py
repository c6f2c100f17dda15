"""Guess of which contacts are active, learned from problems that are solved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

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


@dataclass(frozen=True, kw_only=True, eq=False)
class StateGuess:
    """Linear regression for the margins of contacts: active ones have positive margins.

    Its inputs are the gap changes and, if they are known, the margins under the torque
    before, at which the drive is linearised with other contacts. In size-25-100-bought
    under 117 N·m, 4.9 contacts per problem are guessed wrong. In the most similar
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
    def fit(cls, gap_change: Array, before: Array | None, margin: Array) -> StateGuess:
        """Regression through the solutions of some problems.

        Args:
            gap_change: Gap changes (n_problems, n) [m].
            before: Features under the torque before (n_problems, n_before), or None.
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
        inputs = guess._inputs(gap_change, before)
        square = inputs.T @ inputs
        square += RIDGE * square.trace() / len(square) * np.eye(len(square))
        right = inputs.T @ guess.features(margin)
        coefficients = np.asarray(np.linalg.solve(square, right))
        return replace(guess, coefficients=coefficients)

    def features(self, margin: Array) -> Array:
        """Margins that vary, from -1 to 1, where they are cut off.

        Args:
            margin: Margins (n_problems, k); NaN if unsolved.
        """
        return np.nan_to_num(np.clip(margin[:, self.varied] / self.most, -1.0, 1.0))

    def active(self, gap_change: Array, before: Array | None) -> Mask:
        """Contacts that are likely to be active (n_problems, k).

        Args:
            gap_change: Gap changes (n_problems, n) [m].
            before: Features under the torque before (n_problems, n_before), or None.
        """
        margins = self._inputs(gap_change, before) @ self.coefficients
        active = np.tile(self.always, (len(gap_change), 1))
        active[:, self.varied] = margins > 0.0
        return active

    def _inputs(self, gap_change: Array, before: Array | None) -> Array:
        """One, the coordinates of the gap changes, and the features before."""
        known = [] if before is None else [before]
        moved = (gap_change - self.mean) @ self.directions
        return np.concatenate([np.ones((len(moved), 1)), moved, *known], axis=1)
