r"""What rubs in a thin-ring drive under torque, the wave generator locked.

The rim slides in the tooth spaces and on the race; the balls roll. Along the path of
the drive without friction, contacts of normal force N that slide by :math:`d\sigma`
take the work

.. math:: dW = \mu \sum N\,|d\sigma| = R\,dx,

so that a torque :math:`R = dW/dx` stands against any change of the torsion x: the loop
is the curve T(x) without friction, R above it while x grows and R below it while x
falls. This is the first order in mu. It takes every contact as sliding and none as
sticking, so near the turns of a loop it is wrong, and what sticks makes it narrower.

The race is free to creep in the bore: it turns so that the work is least. One mu holds
for both: what is stated for teeth is taken for rim on race, too, which is assumed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import InputError, Outcome
from swgjoint.fe.rings.contacts import PARTS
from swgjoint.fe.rings.loading import SMALL, positions, solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.sliding import sliding_sums
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.typing import Array

POSITIONS = 2
"""Wave-generator angles of a mean: torsion differs by 0.2 % between them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RubbedPath:
    """Torsion without friction, and the work of friction per mu, over the torque.

    Means over the wave-generator angles; torsion is zero in the middle of the play.
    """

    torque: Array
    """T, positive and increasing, the first takes up the play [N·m]. Shape (n,)."""
    torsion: Array
    """x, what is in series included [rad]. Shape (n,)."""
    series: float
    """Compliance of what is in series, mostly the cup [rad/(N·m)]."""
    teeth_work: Array
    """Sum of N |d sigma| of the teeth from torque to torque [J]. Shape (n - 1,)."""
    race_work: Array
    """The same of rim and race [J]. Shape (n - 1,)."""
    compliance: Array
    """Tangent at the torques, what is in series included [rad/(N·m)]. Shape (n,)."""
    shares: Mapping[str, Array]
    """Of that compliance by part of the rings: ``rim``, ``race``, ``balls``, ``bore``
    (pressed on the race), ``teeth``; the rest is in series. Shapes (n,)."""
    balls: Array
    """Balls that carry load. Shape (n,)."""
    tooth_pairs: Array
    """Tooth contacts that do. Shape (n,)."""
    outcome: Outcome
    """Outcome of the first solve that failed; the path ends before it."""

    @property
    def torque_per_mu(self) -> Array:
        """R/mu from torque to torque [N·m]. Shape (n - 1,)."""
        return np.asarray((self.teeth_work + self.race_work) / np.diff(self.torsion))

    def torsion_at(self, torque: float) -> float:
        """Torsion at a torque, on a straight line below the second one [rad].

        Args:
            torque: T, from zero to the last of the path [N·m].

        Raises:
            InputError: If the path does not reach that far.
        """
        last = float(self.torque[-1])
        if not 0.0 <= torque <= last * (1.0 + 1e-9):  # the same torque, rounded
            raise InputError(
                f"torque = {torque:.6g} N·m: outside the path; accepted: 0 to"
                f" {last:.6g} N·m"
            )
        if torque <= self.torque[1]:
            slope = np.diff(self.torsion[:2]) / np.diff(self.torque[:2])
            return float(self.torsion[0] + slope[0] * (torque - self.torque[0]))
        return float(np.interp(torque, self.torque, self.torsion))

    def hysteresis_loss(self, mu: float) -> float:
        """Width of the loop where the load is zero, the play included [rad].

        The falling branch comes to rest where T(x) = R, the rising one where it is -R.

        Raises:
            InputError: If the path does not reach R.
        """
        return 2.0 * self.torsion_at(mu * float(self.torque_per_mu[0]))

    def widths(self, mu: float) -> Array:
        """Width 2 R/K between the torques [rad]. Shape (n - 1,)."""
        slope = np.diff(self.torsion) / np.diff(self.torque)
        return np.asarray(2.0 * mu * self.torque_per_mu * slope)

    def round_loss(self, mu: float) -> Array:
        """Work of a round between plus and minus each torque [J]. Shape (n,)."""
        work = self.teeth_work + self.race_work
        return np.asarray(4.0 * mu * np.concatenate([[0.0], np.cumsum(work)]))


def friction_path(
    design: Design,
    torques: ArrayLike,
    *,
    angles: ArrayLike | None = None,
) -> RubbedPath:
    """Load a drive with the wave generator locked and look at what slides.

    Args:
        design: The drive, with the bearing of its wave generator; its own coefficient
            of friction must be absent.
        torques: T, positive [N·m]; 1 % of the rated torque is put before them.
        angles: Wave-generator angles [rad]; by default :data:`POSITIONS`.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
    """
    model = thin_ring(design)
    small = SMALL * ratings_of(design).rated_torque
    wanted = np.unique(np.append(np.asarray(torques, dtype=float).ravel(), small))
    wanted = wanted[wanted >= small]
    at = positions(model, POSITIONS) if angles is None else np.asarray(angles, float)
    tables, outcome = [], Outcome.CONVERGED
    for alpha in at.ravel():
        rows, ended = _along(model, float(alpha), wanted)
        tables.append(rows)
        outcome = ended if outcome.ok else outcome
    reached = min(len(rows) for rows in tables)
    table = np.mean([rows[:reached] for rows in tables], axis=0)
    table = table.reshape(reached, 6 + len(PARTS))
    series = series_compliance(design, cup=True)
    return RubbedPath(
        torque=wanted[:reached],
        torsion=table[:, 0] + series * wanted[:reached],
        series=series,
        teeth_work=table[1:, 1],
        race_work=table[1:, 2],
        compliance=table[:, 5] + series,
        shares={
            name: table[:, 6 + k] / (table[:, 5] + series)
            for k, name in enumerate(PARTS)
        },
        balls=table[:, 3],
        tooth_pairs=table[:, 4],
        outcome=outcome,
    )


def _along(
    model: ThinRing, alpha: float, torques: Array
) -> tuple[list[list[float]], Outcome]:
    """Torsion, works, balls, tooth contacts, compliance and its parts, by torque.

    Works since the torque before [J], compliance without what is in series.
    """
    rest = solve_unloaded(model, alpha)
    if not rest.outcome.ok:
        return [], rest.outcome
    # the middle of the play between the smallest torque and its opposite
    down = solve_loaded(model, rest, -float(torques[0]))
    if not down.outcome.ok:
        return [], down.outcome
    rows: list[list[float]] = []
    state, middle = rest, 0.0
    for torque in torques.tolist():
        found = solve_loaded(model, state, torque)
        if not found.outcome.ok:
            return rows, found.outcome
        if not rows:
            middle = 0.5 * (found.rotation + down.rotation)
        work = sliding_sums(model, state, found) if rows else (0.0, 0.0)
        assert found.ball_force is not None
        balls = float((found.ball_force > 0.0).sum())
        c = found.compliance
        rows.append(
            [
                middle - found.rotation,
                *work,
                balls,
                float(found.loaded_teeth),
                c,
                *(c * found.shares.get(name, 0.0) for name in PARTS),
            ]
        )
        state = found
    return rows, Outcome.CONVERGED
