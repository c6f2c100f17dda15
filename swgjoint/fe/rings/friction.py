r"""Friction losses of a thin-ring drive under torque with a locked wave generator.

The flexspline slides in the tooth spaces and on the race, while the balls roll. If the
drive is loaded along its frictionless path, contacts with the normal force N that slide
by :math:`d\sigma` dissipate the work

.. math:: dW = \mu \sum N\,|d\sigma| = R\,dx,

so that a torque :math:`R = dW/dx` resists any change of the torsion x. The loop is the
frictionless curve T(x), shifted upwards by R while x grows and downwards by R while x
falls. This is a first-order result in mu. It assumes that every contact slides, so it
does not apply near the reversals of a loop; sticking makes the real loop narrower.

The race is free to creep in the bore: it rotates such that the work is least. The
coefficient of friction mu of the teeth is also assumed between rim and race.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import InputError, Outcome
from swgjoint.fe.common.friction import STICK_STIFFNESS
from swgjoint.fe.rings.contacts import PARTS
from swgjoint.fe.rings.loading import SMALL, positions, solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.sliding import sliding_sums, sticking_sum
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.typing import Array
from swgjoint.units import mm

POSITIONS = 2
"""Number of wave-generator angles in a mean; the torsion differs by 0.2 % between
them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RubbedPath:
    """Frictionless torsion, and friction work per mu, along a loading path.

    All values are means over the wave-generator angles. The torsion is zero in the
    middle of the clearance.
    """

    torque: Array
    """Torques T, positive and increasing (n,) [N·m]. The first one takes up the
    clearance."""
    torsion: Array
    """Torsion x, including the torsion of the springs in series (n,) [rad]."""
    series: float
    """Compliance of the springs in series, mostly the cup [rad/(N·m)]."""
    teeth_work: Array
    """Sum of N abs(d sigma) of the teeth between neighbouring torques (n - 1,) [J]."""
    race_work: Array
    """Sum of N abs(d sigma) between rim and race, as for the teeth (n - 1,) [J]."""
    compliance: Array
    """Tangent compliance including the springs in series (n,) [rad/(N·m)]."""
    shares: Mapping[str, Array]
    """Shares of ``rim``, ``race``, ``balls``, ``bore`` (contact of rim and race) and
    ``teeth`` in the compliance, each (n,) [-]. The springs in series account
    for the rest."""
    balls: Array
    """Mean number of loaded balls (n,)."""
    tooth_pairs: Array
    """Mean number of loaded tooth contacts (n,)."""
    outcome: Outcome
    """``CONVERGED``, or the outcome of a failed solve, before which the path ends."""
    sticking: Array | None = None
    """Torsional stiffness that contacts add before they slide, between neighbouring
    torques (n - 1,) [N·m/rad]; None if it was not computed."""

    @property
    def torque_per_mu(self) -> Array:
        """Friction torque R/mu between neighbouring torques (n - 1,) [N·m]."""
        return np.asarray((self.teeth_work + self.race_work) / np.diff(self.torsion))

    def torsion_at(self, torque: float) -> float:
        """Torsion at a torque [rad], extrapolated linearly below the first torque.

        Args:
            torque: Torque T, from zero to the last torque of the path [N·m].

        Raises:
            InputError: If the path does not reach this torque.
        """
        last = float(self.torque[-1])
        if not 0.0 <= torque <= last * (1.0 + 1e-9):  # the last torque may be rounded
            raise InputError(
                f"torque = {torque:.6g} N·m: outside the loading path; accepted: 0 to"
                f" {last:.6g} N·m"
            )
        if torque <= self.torque[1]:
            slope = np.diff(self.torsion[:2]) / np.diff(self.torque[:2])
            return float(self.torsion[0] + slope[0] * (torque - self.torque[0]))
        return float(np.interp(torque, self.torque, self.torsion))

    def hysteresis_loss(self, mu: float) -> float:
        """Width of the loop at zero load, including the clearance [rad].

        The falling branch crosses zero load where T(x) = R, and the rising branch does
        so where T(x) = -R.

        Args:
            mu: Coefficient of friction [-].

        Raises:
            InputError: If the path does not reach R.
        """
        return 2.0 * self.torsion_at(mu * float(self.torque_per_mu[0]))

    def widths(self, mu: float) -> Array:
        """Width 2 R/K of the loop between neighbouring torques (n - 1,) [rad]."""
        slope = np.diff(self.torsion) / np.diff(self.torque)
        return np.asarray(2.0 * mu * self.torque_per_mu * slope)

    def round_loss(self, mu: float) -> Array:
        """Work of a full cycle between plus and minus each torque (n,) [J]."""
        work = self.teeth_work + self.race_work
        return np.asarray(4.0 * mu * np.concatenate([[0.0], np.cumsum(work)]))


def friction_path(
    design: Design,
    torques: ArrayLike,
    *,
    angles: ArrayLike | None = None,
) -> RubbedPath:
    """Torsion and sliding of a drive that is loaded with its wave generator locked.

    Args:
        design: The drive. Its wave generator must have a ball bearing; its coefficient
            of friction is not used.
        torques: Positive torques T [N·m]. A torque of 1 % of the rated torque is added
            as the first one, and smaller ones are dropped.
        angles: Wave-generator angles [rad]; None chooses :data:`POSITIONS` angles.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks.
    """
    model = thin_ring(design)
    tangential = tangential_stiffness(design, model)
    small = SMALL * ratings_of(design).rated_torque
    wanted = np.unique(np.append(np.asarray(torques, dtype=float).ravel(), small))
    wanted = wanted[wanted >= small]
    at = positions(model, POSITIONS) if angles is None else np.asarray(angles, float)
    tables, outcome = [], Outcome.CONVERGED
    for alpha in at.ravel():
        rows, ended = _along(model, float(alpha), wanted, tangential)
        tables.append(rows)
        outcome = ended if outcome.ok else outcome
    reached = min(len(rows) for rows in tables)
    table = np.mean([rows[:reached] for rows in tables], axis=0)
    table = table.reshape(reached, 7 + len(PARTS))
    series = series_compliance(design, cup=True)
    torsion = table[:, 0] + series * wanted[:reached]
    return RubbedPath(
        torque=wanted[:reached],
        torsion=torsion,
        series=series,
        teeth_work=table[1:, 1],
        race_work=table[1:, 2],
        compliance=table[:, 5] + series,
        shares={
            name: table[:, 7 + k] / (table[:, 5] + series)
            for k, name in enumerate(PARTS)
        },
        balls=table[:, 3],
        tooth_pairs=table[:, 4],
        outcome=outcome,
        sticking=table[1:, 6] / np.diff(torsion) ** 2,
    )


def tangential_stiffness(design: Design, model: ThinRing) -> dict[str, float]:
    r"""Tangential stiffness of sticking contacts [N/m], ``tooth`` and ``race``.

    That of a tooth is the stick spring of the 2D friction law. A contact point of bore
    and race shears the thicknesses whose compression is its normal stiffness k, so that
    its tangential stiffness is :math:`k\,G/E = k / 2(1 + \nu)`.

    Args:
        design: The drive.
        model: Its thin rings.
    """
    steel = design.material_of("flexspline")
    return {
        "tooth": STICK_STIFFNESS
        * steel.youngs_modulus
        * design.drive.face_width_mm
        * mm,
        "race": 0.5 * model.press_per_point / (1.0 + steel.poisson_ratio),
    }


def _along(
    model: ThinRing, alpha: float, torques: Array, tangential: Mapping[str, float]
) -> tuple[list[list[float]], Outcome]:
    """Rows of a loading path at one angle, and the outcome of the last solve.

    A row contains the torsion [rad], the friction work per mu of teeth and race since
    the previous torque [J], the numbers of loaded balls and tooth contacts, the
    compliance [rad/(N·m)], the work of sticking contacts since the previous torque [J],
    and the compliance by part. The springs in series are excluded.
    """
    rest = solve_unloaded(model, alpha)
    if not rest.outcome.ok:
        return [], rest.outcome
    # the torsion counts from the middle between the smallest torque and its opposite
    down = solve_loaded(model, rest, -float(torques[0]))
    if not down.outcome.ok:
        return [], down.outcome
    rows: list[list[float]] = []
    state, middle = rest, 0.0
    for torque in torques.tolist():
        loaded = solve_loaded(model, state, torque)
        if not loaded.outcome.ok:
            return rows, loaded.outcome
        if not rows:
            middle = 0.5 * (loaded.rotation + down.rotation)
        work, stuck = (0.0, 0.0), 0.0
        if rows:
            work = sliding_sums(model, state, loaded)
            stuck = sticking_sum(model, state, loaded, **tangential)
        assert loaded.ball_force is not None
        balls = float((loaded.ball_force > 0.0).sum())
        c = loaded.compliance
        rows.append(
            [
                middle - loaded.rotation,
                *work,
                balls,
                float(loaded.loaded_teeth),
                c,
                stuck,
                *(c * loaded.shares.get(name, 0.0) for name in PARTS),
            ]
        )
        state = loaded
    return rows, Outcome.CONVERGED
