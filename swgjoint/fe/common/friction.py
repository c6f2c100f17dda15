r"""Coulomb friction between the flanks, with a soft stick spring.

The material points of both flanks that face each other have the arc lengths s_f and
s_c, both counted from tip to root, in opposite directions. Rolling leaves their sum
unchanged; sliding changes it: :math:`\sigma = s_f + s_c`. With the friction force t on
the flexspline counted from tip to root, a step from :math:`(\sigma_0, t_0)` ends at

.. math:: t = \mathrm{clip}(t_0 + k (\sigma - \sigma_0), -\mu F, \mu F) ,

the implicit Euler step of a spring k and a slider in series, whose dissipation
:math:`t\,(\sigma - \sigma_0 - (t - t_0)/k)` is never negative. Points that are close
but do not touch yet carry :math:`\sigma` along, so that a new contact knows which way
it slides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.typing import Array, Index

STICK_STIFFNESS = 0.05
"""k in face width times Young's modulus: a tooth sticks within some ten nanometres,
far below its sliding of micrometres, and the spring is no stiffer than the tooth."""


@dataclass(frozen=True, kw_only=True)
class CoulombFriction:
    """Law of the flanks."""

    coefficient: float
    """mu [-]."""
    stiffness: float
    """k of the stick spring [N/m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SlipHistory:
    """Pairs of flanks close to contact at the end of a step or iteration."""

    contacts: Contacts
    """Their candidates."""
    normal: Array
    """Normal forces of the candidates (n,) [N]."""
    force: Array
    """Friction on the flexspline at the candidates, tip to root (n,) [N]."""

    @cached_property
    def pairs(self) -> Pairs:
        """The pairs of flanks of the candidates."""
        return Pairs.from_contacts(self.contacts, self.normal)


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Contacts gathered by the two flanks that touch; one stick spring each.

    The points of a pair share its friction in proportion to their normal forces: on
    conforming flanks the force hops between points that slide alike.
    """

    key: Index
    """Sector, side and tooth (n_pairs, 3)."""
    pair: Index
    """Pair of each contact (n,)."""
    share: Array
    """Share of each contact in its pair (n_pairs, n)."""
    slip: Array
    """sigma (n_pairs,) [m]."""

    @classmethod
    def from_contacts(cls, contacts: Contacts, normal: Array) -> Pairs:
        """Gather contacts; where none carries force the closest one stands for all."""
        keys = np.stack([contacts.sector, contacts.side, contacts.tooth], axis=-1)
        key, pair = np.unique(keys, axis=0, return_inverse=True)
        pair = pair.ravel()
        share = np.zeros((len(key), len(contacts)))
        share[pair, np.arange(len(contacts))] = normal
        gap = np.where(pair == np.arange(len(key))[:, None], contacts.gap, np.inf)
        open_ = np.flatnonzero(share.sum(axis=1) == 0.0)
        if open_.size:
            share[open_, gap[open_].argmin(axis=1)] = 1.0
        share /= share.sum(axis=1, keepdims=True)
        return cls(key=key, pair=pair, share=share, slip=share @ contacts.slip)

    def find_in(self, others: Pairs) -> Index:
        """Index of the same pair in others, -1 without it (n_pairs,)."""
        found = np.full(len(self.key), -1, dtype=np.int64)
        same = (self.key[:, None] == others.key).all(axis=-1)
        mine, theirs = np.nonzero(same)
        found[mine] = theirs
        return found


def _since(history: SlipHistory | None, pairs: Pairs) -> tuple[Array, Array, Index]:
    """Slip of pairs since the last step, their friction then, and their index there."""
    slip, force = np.zeros(len(pairs.key)), np.zeros(len(pairs.key))
    if history is None:
        return slip, force, np.full(len(pairs.key), -1, dtype=np.int64)
    index = pairs.find_in(history.pairs)
    known = index >= 0
    before = (history.pairs.share > 0.0) @ history.force
    slip[known] = pairs.slip[known] - history.pairs.slip[index[known]]
    force[known] = before[index[known]]
    return slip, force, index


@dataclass(frozen=True, kw_only=True, eq=False)
class Sliding:
    """Contacts of one iteration as lines of force: normal, then tangential."""

    lines: Contacts
    """All normal lines, then all tangential ones; the gap of a tangential line is that
    of its stick condition."""
    stick: Array
    """Shares of the contacts in the pairs that stick (n_stick, n)."""
    push: Array
    """t over the normal force where a contact slides, else zero (n,)."""
    fixed: Array
    """t where it is prescribed (n,) [N]."""
    limit: Array
    """Friction that the normal forces of the last iteration allow (n,) [N]."""
    softness: float
    """1/k [m/N]."""

    @classmethod
    def from_trial(
        cls,
        friction: CoulombFriction,
        contacts: Contacts,
        history: SlipHistory | None,
        last: SlipHistory | None,
    ) -> Sliding:
        """Which pairs stick and which slide, from the trial force of the spring.

        A pair whose direction of sliding turned over since the last iteration is taken
        to stick: between the two directions there is a place where it does.

        Args:
            friction: The law.
            contacts: Candidates of this iteration.
            history: Of the last step; None where contact begins: no friction yet.
            last: Forces of the last iteration.
        """
        normal, before = np.zeros(len(contacts)), np.zeros(len(contacts))
        if last is not None:
            # every force goes to the one candidate that is closest
            heir = last.contacts.nearest_in(contacts)
            left = heir >= 0
            np.add.at(normal, heir[left], last.normal[left])
            np.add.at(before, heir[left], last.force[left])
        pairs = Pairs.from_contacts(contacts, normal)
        member = pairs.share > 0.0
        slip, force, known = _since(history, pairs)
        trial = force + friction.stiffness * slip
        limit = friction.coefficient * (member @ normal)
        turned_over = trial * (member @ before) < 0.0
        sticks = (np.abs(trial) < limit) | turned_over
        sticks &= (limit > 0.0) & (known >= 0)  # no past, no friction yet
        condition = (-slip - force / friction.stiffness)[pairs.pair]
        return cls(
            lines=Contacts.join(contacts, contacts.tangential(condition)),
            stick=pairs.share[sticks],
            push=np.where(sticks, 0.0, friction.coefficient * np.sign(trial))[
                pairs.pair
            ],
            fixed=np.zeros(len(contacts)),
            limit=friction.coefficient * normal,
            softness=1.0 / friction.stiffness,
        )

    def lag(self) -> Sliding:
        """Sliding under the normal forces of the last iteration: symmetric."""
        fixed = self.limit * np.sign(self.push)
        return replace(self, push=np.zeros_like(self.push), fixed=fixed)

    def forces(self, unknowns: Array) -> Array:
        """Forces of the lines (2 n,) [N]."""
        result = self._carried() @ unknowns
        result[len(self.push) :] += self.fixed
        return np.asarray(result)

    def _carried(self) -> Array:
        """Forces of the lines by the unknowns (normal forces, sticking forces).

        Shape (2 n, n + n_stick).
        """
        n = len(self.push)
        top = np.concatenate([np.eye(n), np.zeros((n, len(self.stick)))], axis=1)
        return np.concatenate([top, np.hstack([np.diag(self.push), self.stick.T])])

    def reduce(self, matrix: Array, offset: Array) -> tuple[Array, Array]:
        """Conditions of gaps and sticking, in the unknowns.

        Args:
            matrix: Of the lines, then the other unknowns (2 n + p, 2 n + p).
            offset: (2 n + p,).
        """
        n, lines = len(self.push), len(self.lines)

        def rows(values: Array) -> Array:
            return np.concatenate(
                [values[:n], self.stick @ values[n:lines], values[lines:]]
            )

        forces = self._carried()
        k = forces.shape[1]
        kept = rows(matrix)
        result = np.concatenate([kept[:, :lines] @ forces, kept[:, lines:]], axis=1)
        stuck = np.arange(n, k)
        result[stuck, stuck] += self.softness
        return result, rows(offset) + kept[:, n:lines] @ self.fixed


def dissipated_work(
    friction: CoulombFriction, history: SlipHistory | None, now: SlipHistory
) -> float:
    """Work of friction over a step [J]; never negative.

    Args:
        friction: The law.
        history: At the start of the step.
        now: At its end.
    """
    if history is None:
        return 0.0
    k = friction.stiffness
    slip, before, index = _since(history, now.pairs)
    force = (now.pairs.share > 0.0) @ now.force
    known = index >= 0
    slid = slip - (force - before) / k
    work = float(np.sum(force[known] * slid[known]))
    # the spring of a pair that parted snaps back
    old = (history.pairs.share > 0.0) @ history.force
    parted = np.setdiff1d(np.arange(len(old)), index)
    return work + float(np.sum(old[parted] ** 2)) / (2.0 * k)


def spring_energy(friction: CoulombFriction, now: SlipHistory) -> float:
    """Energy of the stick springs [J]."""
    force = (now.pairs.share > 0.0) @ now.force
    return 0.5 * float(np.sum(force**2)) / friction.stiffness
