r"""Coulomb friction between the flanks, regularised by a soft stick spring.

At a contact the material points of both flanks have the arc lengths s_f (flexspline)
and s_c (circular spline), each counted from tip to root and hence in opposite
directions. Rolling leaves their sum :math:`\sigma = s_f + s_c` unchanged; sliding
changes it. Let t be the friction force on the flexspline, positive from tip to root. A
step from :math:`(\sigma_0, t_0)` ends at

.. math:: t = \mathrm{clip}(t_0 + k (\sigma - \sigma_0), -\mu F, \mu F) ,

where F is the normal force. This is the implicit Euler step of a spring k and a slider
in series, whose dissipation :math:`t\,(\sigma - \sigma_0 - (t - t_0)/k)` is never
negative. The history also contains :math:`\sigma` of points that are close but not yet
in contact, so that the sliding direction of a new contact is known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.typing import Array, Index

STICK_STIFFNESS = 0.05
"""Stick stiffness k divided by face width and Young's modulus [-].

The spring deforms by a few tens of nanometres before a contact slides, far less than
the sliding distance of micrometres, and it is no stiffer than the tooth."""


@dataclass(frozen=True, kw_only=True)
class CoulombFriction:
    """Parameters of the friction law of the flanks."""

    coefficient: float
    """Friction coefficient mu [-]."""
    stiffness: float
    """Stiffness k of the stick spring [N/m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SlipHistory:
    """Flank pairs close to contact at the end of a step or iteration."""

    contacts: Contacts
    """Contact candidates (n) on these pairs."""
    normal: Array
    """Normal force at each candidate (n,) [N]."""
    force: Array
    """Friction force t on the flexspline at each candidate (n,) [N]."""

    @cached_property
    def pairs(self) -> Pairs:
        """Flank pairs of the candidates."""
        return Pairs.from_contacts(self.contacts, self.normal)


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Contacts grouped by the two flanks that touch; each pair has one stick spring.

    The contacts of a pair share its friction in proportion to their normal forces,
    because on conforming flanks the force jumps between points that slide equally.
    """

    key: Index
    """Sector, side and circular-spline tooth of each pair (n_pairs, 3)."""
    pair: Index
    """Number of the pair to which each contact belongs (n,)."""
    share: Array
    """Share of each contact in the force of its pair (n_pairs, n) [-]."""
    slip: Array
    """Sum of arc lengths sigma of each pair, weighted by the shares (n_pairs,) [m]."""

    @classmethod
    def from_contacts(cls, contacts: Contacts, normal: Array) -> Pairs:
        """Flank pairs of given contacts.

        In a pair without force the contact with the smallest gap gets the whole share.

        Args:
            contacts: Contact candidates.
            normal: Their normal forces (n,) [N].
        """
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
        """Index of each pair in ``others``, -1 if it is absent; shape (n_pairs,)."""
        index = np.full(len(self.key), -1, dtype=np.int64)
        same = (self.key[:, None] == others.key).all(axis=-1)
        mine, theirs = np.nonzero(same)
        index[mine] = theirs
        return index


def _since(history: SlipHistory | None, pairs: Pairs) -> tuple[Array, Array, Index]:
    """Slip of each pair since the history, and its friction and its index there."""
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
    """Lines of action of the contact forces in one iteration, normal and tangential."""

    lines: Contacts
    """All normal lines, then all tangential lines. The gap of a tangential line is the
    offset of its stick condition."""
    stick: Array
    """Shares of the contacts in the pairs that stick (n_stick, n) [-]."""
    push: Array
    """Ratio of friction t to normal force at sliding contacts; zero elsewhere (n,) [-].
    """
    fixed: Array
    """Prescribed part of the friction t (n,) [N]."""
    limit: Array
    """Friction limit under the normal forces of the last iteration (n,) [N]."""
    softness: float
    """Compliance 1/k of the stick spring [m/N]."""

    @classmethod
    def from_trial(
        cls,
        friction: CoulombFriction,
        contacts: Contacts,
        history: SlipHistory | None,
        last: SlipHistory | None,
    ) -> Sliding:
        """Sticking and sliding contacts, from the trial force of the stick spring.

        A pair whose sliding direction has reversed since the last iteration is assumed
        to stick, because it sticks somewhere between the two directions.

        Args:
            friction: Friction law.
            contacts: Contact candidates (n) of this iteration.
            history: History at the end of the last step; None before the first contact,
                when there is no friction yet.
            last: Forces of the last iteration; None in the first iteration.
        """
        normal, before = np.zeros(len(contacts)), np.zeros(len(contacts))
        if last is not None:
            # each force is assigned to the closest candidate
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
        sticks &= (limit > 0.0) & (known >= 0)  # a new pair has no friction yet
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
        """Copy with prescribed sliding friction, which makes the system symmetric.

        Its magnitude is the friction limit of the last iteration.
        """
        fixed = self.limit * np.sign(self.push)
        return replace(self, push=np.zeros_like(self.push), fixed=fixed)

    def forces(self, unknowns: Array) -> Array:
        """Forces along all lines (2 n,) [N] from the unknowns (n + n_stick,) [N]."""
        result = self._carried() @ unknowns
        result[len(self.push) :] += self.fixed
        return np.asarray(result)

    def _carried(self) -> Array:
        """Matrix from the unknowns (normal, then sticking forces) to line forces.

        Shape (2 n, n + n_stick).
        """
        n = len(self.push)
        top = np.concatenate([np.eye(n), np.zeros((n, len(self.stick)))], axis=1)
        return np.concatenate([top, np.hstack([np.diag(self.push), self.stick.T])])

    def reduce(self, matrix: Array, offset: Array) -> tuple[Array, Array]:
        """System of all lines, reduced to normal and sticking forces.

        Args:
            matrix: Matrix of the 2 n lines, followed by p other unknowns
                (2 n + p, 2 n + p).
            offset: Offset of the same rows (2 n + p,).

        Returns:
            Matrix (n + n_stick + p, n + n_stick + p) and offset (n + n_stick + p,).
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
    """Work dissipated by friction over a step [J]; never negative.

    Args:
        friction: Friction law.
        history: History at the start of the step; None before the first contact.
        now: History at the end of the step.
    """
    if history is None:
        return 0.0
    k = friction.stiffness
    slip, before, index = _since(history, now.pairs)
    force = (now.pairs.share > 0.0) @ now.force
    known = index >= 0
    slid = slip - (force - before) / k
    work = float(np.sum(force[known] * slid[known]))
    # the spring of a pair that has separated loses its energy
    old = (history.pairs.share > 0.0) @ history.force
    parted = np.setdiff1d(np.arange(len(old)), index)
    return work + float(np.sum(old[parted] ** 2)) / (2.0 * k)


def spring_energy(friction: CoulombFriction, now: SlipHistory) -> float:
    """Energy stored in the stick springs [J].

    Args:
        friction: Friction law.
        now: History with the friction forces.
    """
    force = (now.pairs.share > 0.0) @ now.force
    return 0.5 * float(np.sum(force**2)) / friction.stiffness
