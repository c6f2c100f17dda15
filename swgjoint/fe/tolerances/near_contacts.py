"""Superposition of errors in those contacts that may change their state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.fe.common.influence import Influence, Response
from swgjoint.fe.common.pivoting import TOLERANCE
from swgjoint.typing import Array, Index, Mask

BLOCK = 256
"""Number of problems that are checked at once, so that their slacks stay in the cache.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class NearContacts:
    """A linearised drive, reduced to some of its contacts.

    Most contacts never change their state: supports stay pressed on the wave generator,
    and flanks stay apart. The errors are superposed in the other contacts alone. The
    slacks of the left-out contacts show afterwards whether this was right.
    """

    at: Influence
    """The drive with all m contacts, n of them at teeth."""
    contacts: Index
    """Contacts that may change their state, increasing (k,)."""
    near: Influence
    """The drive with these contacts."""
    teeth: Index
    """Those of them at teeth (k_teeth,)."""
    others: Index
    """Left-out contacts, those at teeth first (m - k,)."""
    by_inputs: Array
    """Slacks of the left-out contacts, scaled, by the gap changes of the teeth, the
    scaled unknowns and the approaches of the strips (k_teeth + k + n_strips, m - k)."""

    @classmethod
    def choose(
        cls, at: Influence, changing: Mask, force: Array | None = None
    ) -> NearContacts:
        """Drive with the contacts that change, and with all closed ones at teeth.

        Args:
            at: The linearised drive.
            changing: Contacts that change their state under some errors (m,).
            force: Forces of the strips under some errors (n_sets, n_strips) [N], NaN
                if unsolved; None if they are not known.
        """
        n = len(at.sector)
        chosen = changing.copy()
        chosen[:n] |= at.closed[:n]
        contacts, others = np.flatnonzero(chosen), np.flatnonzero(~chosen)
        teeth, apart = contacts[contacts < n], others[others < n]
        # the gap of an open contact has no effect beyond its own slack
        assert not at.by_gap[np.ix_(contacts, apart)].any()
        assert not at.angle_by_gap[apart].any()
        strips, pushed = at.strips, np.zeros((n, 0))
        if strips is not None:
            pushed = np.eye(strips.force.size)[strips.strip]
            usual = None
            if force is not None:
                loaded = force > 0.0
                usual = np.where(loaded, force, 0.0).sum(axis=0)
                usual /= np.maximum(loaded.sum(axis=0), 1)
            strips = replace(strips, strip=strips.strip[teeth], usual=usual)
        near = replace(
            at,
            sector=at.sector[teeth],
            tooth=at.tooth[teeth],
            direction=at.direction[:, teeth],
            by_tilt=at.by_tilt[teeth],
            closed=at.closed[contacts],
            matrix=at.matrix[np.ix_(contacts, contacts)],
            slack=at.slack[contacts],
            by_gap=at.by_gap[np.ix_(contacts, teeth)],
            by_torque=at.by_torque[contacts],
            angle_by_value=at.angle_by_value[contacts],
            angle_by_gap=at.angle_by_gap[teeth],
            strips=strips,
            supports=None,
        )
        scale = np.sqrt(np.diag(at.matrix))
        inputs = [
            at.by_gap[np.ix_(others, teeth)],
            at.matrix[np.ix_(others, contacts)] / scale[contacts],
            at.by_gap[others] @ pushed,
        ]
        return cls(
            at=at,
            contacts=contacts,
            near=near,
            teeth=teeth,
            others=others,
            by_inputs=np.concatenate(inputs, axis=1).T / scale[others],
        )

    def respond(
        self, gap_change: Array, torque: float, start: Mask | None
    ) -> tuple[Response, Mask]:
        """Equilibria with errors, and which of them are right (n_sets,).

        Args:
            gap_change: Gap changes of all contacts at teeth (n_sets, n) [m].
            torque: Torque T [N·m].
            start: Guess of the active sets of the near contacts (n_sets, k); None for
                none.
        """
        at, change = self.at, np.take(gap_change, self.teeth, axis=1)
        found = self.near.respond(change, torque, start)
        assert found.margin is not None and found.approach is not None
        inputs = np.concatenate(
            [change, np.maximum(found.margin, 0.0), found.approach], axis=1
        )
        scale = np.sqrt(np.diag(at.matrix))
        begin = (at.slack + (torque - at.torque) * at.by_torque) / scale
        tolerance = TOLERANCE * np.abs(begin).max()
        begin = begin[self.others]
        # most contacts keep their state whatever the inputs within their ranges are
        low, high = inputs.min(axis=0), inputs.max(axis=0)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        central, reach = begin + middle @ self.by_inputs, half @ np.abs(self.by_inputs)
        apart = self.others[self.others < len(at.sector)]
        least, narrowest = central - reach, gap_change.min(axis=0)
        least[: apart.size] += narrowest[apart] / scale[apart]
        doubtful = np.flatnonzero(~(least >= -tolerance))
        teeth = apart[doubtful[doubtful < apart.size]]

        # of the others, single precision shows most that keep their state
        by_unit = (half[:, None] * self.by_inputs[:, doubtful]).astype(np.float32)
        inverse = np.divide(1.0, half, out=np.zeros_like(half), where=half != 0.0)
        size = reach[doubtful] + np.abs(central[doubtful])
        widest = np.maximum(gap_change.max(axis=0), -narrowest)
        size[: teeth.size] += widest[teeth] / scale[teeth]
        rounding = (len(half) + 8) * np.finfo(np.float32).eps * size
        limit = (rounding - tolerance - central[doubtful]).astype(np.float32)
        right = np.ones(len(inputs), dtype=bool)
        for k in range(0, len(inputs), BLOCK):
            part = slice(k, k + BLOCK)
            units = ((inputs[part] - middle) * inverse).astype(np.float32)
            slack = units @ by_unit
            slack[:, : teeth.size] += (
                np.take(gap_change[part], teeth, axis=1) / scale[teeth]
            )
            right[part] = (slack >= limit).all(axis=1)
        rows = np.flatnonzero(~right)
        exact = begin[doubtful] + inputs[rows] @ self.by_inputs[:, doubtful]
        exact[:, : teeth.size] += gap_change[np.ix_(rows, teeth)] / scale[teeth]
        right[rows] = exact.min(axis=1, initial=0.0) >= -tolerance
        return found, right
