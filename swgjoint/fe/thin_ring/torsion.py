"""Torsion of a design under torque, wave generator locked, by the thin rings."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swgjoint.errors import Outcome
from swgjoint.fe.thin_ring.equilibrium import RingSolver, RingState, at_rest
from swgjoint.fe.thin_ring.model import ThinRing, thin_ring
from swgjoint.gear.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.maps.catalogue import ratings_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

POSITIONS = 4
"""Wave-generator angles of a mean."""
SMALL = 0.01
"""Part of the rated torque that takes up a clearance of the teeth."""
PARTS = ("rim", "race", "balls", "bore", "teeth")
"""Of the compliance, in the plane."""
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
HALVINGS = 5
"""How often a step of the torque that fails is halved."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RingTorsion:
    """Output torque against torsion at several wave-generator angles."""

    torque: Array
    """T, as given [N·m]. Shape (n,)."""
    torsion: Array
    """Mean over the positions, what is in series included [rad]. Shape (n,)."""
    position_torsion: Array
    """At every position, from the middle of its play (n_positions, n) [rad]."""
    angles: Array
    """Wave-generator angles (n_positions,) [rad]."""
    play: Array
    """Rotation of the output between +1 % and -1 % of rated torque, in the middle of
    which torsion is zero; most of it the clearance of teeth that no torque holds
    (n_positions,) [rad]."""
    balls: Index
    """Balls that carry load (n_positions, n)."""
    tooth_pairs: Index
    """Tooth contacts that do (n_positions, n)."""
    largest_ball_force: Array
    """Shape (n_positions, n) [N]."""
    compliance: Array
    """Tangent, mean over the positions, what is in series included [rad/(N·m)]."""
    shares: dict[str, Array]
    """Of that compliance by part (n,): ``rim``, ``race``, ``balls``, ``bore`` (pressed
    together with the race), ``teeth``, ``series`` (cup and springs of the design)."""
    outcome: Outcome
    """The first that is not converged, if any; its torques and those beyond are NaN."""


def torsion_curve(
    design: Design, torques: ArrayLike, *, angles: ArrayLike | None = None
) -> RingTorsion:
    """Torsion under torques with the wave generator locked, frictionless.

    The curve is single-valued: loading and unloading coincide. Cup, boss, housing
    and coupling count as springs in series.

    Args:
        design: The drive; :func:`swgjoint.fe.thin_ring.model.check_modelled` says what
            the model takes.
        torques: T on the output, any signs (n,) [N·m].
        angles: Wave-generator angles to average over; by default :data:`POSITIONS`
            over the passage of the balls and the pitch of the teeth.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
    """
    model = thin_ring(design)
    wanted = np.asarray(torques, dtype=float).ravel()
    at = positions(model) if angles is None else np.asarray(angles, float).ravel()
    small = SMALL * ratings_of(design).rated_torque
    rows = [_one(model, wanted, float(alpha), small) for alpha in at]
    found, outcomes = (np.array([row[k] for row in rows]) for k in (0, 2))
    series = series_compliance(design, cup=True)
    torsion = found[:, 0] + series * wanted
    plane = found[:, 4]
    compliance = plane.mean(axis=0) + series
    by_part = (found[:, 5:] * plane[:, None]).mean(axis=0) / compliance
    worst = [o for o in outcomes if not o.ok]
    return RingTorsion(
        torque=wanted,
        torsion=torsion.mean(axis=0),
        position_torsion=torsion,
        angles=at,
        play=np.array([row[1] for row in rows]),
        balls=np.nan_to_num(found[:, 1]).astype(np.int64),
        tooth_pairs=np.nan_to_num(found[:, 2]).astype(np.int64),
        largest_ball_force=found[:, 3],
        compliance=compliance,
        shares=dict(zip(PARTS, by_part, strict=True)) | {"series": series / compliance},
        outcome=worst[0] if worst else Outcome.CONVERGED,
    )


def positions(model: ThinRing, count: int = POSITIONS) -> Array:
    """Wave-generator angles spread over ball passage and tooth pitch [rad]."""
    k = np.arange(count)
    passage = 2.0 * pi / model.bearing.balls / model.bearing.cage_share
    pitch = 2.0 * pi / model.teeth.circular_spline.teeth
    return np.asarray(passage * (k + 0.5) / count + pitch * np.mod(k * GOLDEN, 1.0))


def unloaded(model: ThinRing, alpha: float, phase: float = 0.0) -> RingState:
    """The drive without torque: rings on the balls, output at the ideal ratio.

    Args:
        model: The rings.
        alpha: Wave-generator angle, of any number of turns [rad].
        phase: Angle of ball 0 from the major axis at alpha = 0 [rad].
    """
    start = at_rest(model, alpha, phase)
    solver, psi = RingSolver(), start.rotation
    state = solver(model, start, rotation=psi, teeth=False)
    return solver(model, state, rotation=psi) if state.outcome.ok else state


def loaded(model: ThinRing, state: RingState, torque: float) -> RingState:
    """Equilibrium under a torque; on failure in halved steps.

    Args:
        model: The rings.
        state: Where to begin; one that holds no tooth counts as free of torque, and
            finds the teeth fastest under a small one.
        torque: T, not zero [N·m].
    """
    solver = RingSolver()
    begin = state.torque if state.loaded_teeth else 0.0
    done, step, halved = 0.0, 1.0, 0
    while done < 1.0:
        goal = min(1.0, done + step)
        found = solver(model, state, torque=begin + goal * (torque - begin))
        if found.outcome.ok:
            state, done = found, goal
            continue
        halved += 1
        step *= 0.5
        if halved > HALVINGS:
            return found
    return state


def _one(
    model: ThinRing, torques: Array, alpha: float, small: float
) -> tuple[Array, float, Outcome]:
    """Torsion, loaded balls, tooth contacts, largest ball force, compliance, shares.

    Also the play and the outcome.
    """
    table = np.full((5 + len(PARTS), torques.size), np.nan)
    rest = unloaded(model, alpha)
    if not rest.outcome.ok:
        return table, 0.0, rest.outcome
    sides = {sign: loaded(model, rest, sign * small) for sign in (1.0, -1.0)}
    for side in sides.values():
        if not side.outcome.ok:
            return table, 0.0, side.outcome
    psi0 = 0.5 * (sides[1.0].rotation + sides[-1.0].rotation)
    play = sides[-1.0].rotation - sides[1.0].rotation
    outcome = Outcome.CONVERGED
    for sign in (1.0, -1.0):
        state = sides[sign]
        chosen = np.flatnonzero(torques * sign > 0.0)
        for k in chosen[np.argsort(np.abs(torques[chosen]))]:
            state = loaded(model, state, float(torques[k]))
            if not state.outcome.ok:
                outcome = state.outcome
                break
            table[:, k] = _row(state, psi0)
    for k in np.flatnonzero(torques == 0.0):
        table[:, k] = _row(rest, rest.rotation)
    return table, play, outcome


def _row(state: RingState, psi0: float) -> list[float]:
    assert state.ball_force is not None
    return [
        psi0 - state.rotation,
        float((state.ball_force > 0.0).sum()),
        float(state.loaded_teeth),
        float(state.ball_force.max()),
        state.compliance,
        *(state.shares.get(name, 0.0) for name in PARTS),
    ]
