"""Equilibria of the thin rings over torque and ball passage, for a map.

The pattern of the map is that of the balls passing the lobes. Since the balls roll,
their order per input turn is not an integer; the map uses the nearest integer. The
passage of teeth is not included; its kinematic error under load is a tenth as large.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import pi
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError, DesignError
from swgjoint.fe.common.clearance import across_clearance
from swgjoint.fe.common.stress_state import stress_state_label
from swgjoint.fe.plane.drive2d import can_halve, unmodelled_parts
from swgjoint.fe.rings import model as thin
from swgjoint.fe.rings.contacts import race_on_balls
from swgjoint.fe.rings.equilibrium import RingSolver
from swgjoint.fe.rings.loading import SMALL, solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.state import RingState
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors
from swgjoint.gear.mounting import series_compliance, springs_of
from swgjoint.maps.samples import FullSolves, MapSamples
from swgjoint.maps.unfinished import Unfinished
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array

PHASES = 12
"""Positions of the balls over one passage."""
LEVELS = (0.03, 0.06, 0.1, 0.15, 0.22, 0.31, 0.43, 0.58, 0.78, 1.01)
"""Sampled torques, of both signs, as parts of the repeated peak torque [-]. They are
closer together where balls join the loaded arc, and the last one exceeds the peak so
that every position reaches it."""

UNSEEN = (0.04, 0.12, 0.26, 0.5, 0.9)
"""Torques that validate the map, between the sampled ones, as parts of the repeated
peak torque [-]."""
UNSEEN_PHASES = 3
"""Positions of the balls for every such torque, between the sampled ones."""


def check_modelled(design: Design) -> None:
    """Reject features that a map of the thin rings lacks.

    Raises:
        DesignError: If the design has any.
    """
    thin.check_modelled(design)
    if design.wave_generator.kind == "table":
        raise DesignError(
            f"{design.drive.name}: wave_generator.kind = 'table': a ring map mirrors"
            " its results for negative torques; accepted: 'elliptical', 'cosine'"
        )
    if has_errors(design):
        raise DesignError(
            f"{design.drive.name}: tolerances: a ring map has no manufacturing errors;"
            " accepted: 0, or the 2d model"
        )


@dataclass(frozen=True, kw_only=True)
class BallPassage:
    """Periods of the positions of the balls relative to the lobes."""

    per_cage_turn: int
    """Periods per turn of the cage relative to the cam: the number of balls, or twice
    an odd number, because the two lobes then alternate."""
    per_input_turn: float
    """Periods per input turn of balls that roll without slip."""
    carried_as: int
    """Order per input turn that the map uses."""


def ball_passage(design: Design, model: ThinRing) -> BallPassage:
    """Ball passage of a design.

    Args:
        design: The drive.
        model: Its ring model.
    """
    balls = model.bearing.balls
    count = balls * (2 if balls % 2 and can_halve(design, bearing=False) else 1)
    rate = count * model.bearing.cage_share * (1.0 - 1.0 / model.ratio)
    return BallPassage(
        per_cage_turn=count, per_input_turn=rate, carried_as=max(1, round(rate))
    )


def sample_rings(
    design: Design,
    *,
    angles: int | None = None,
    progress: Progress = silent,
    keep: Unfinished | None = None,
) -> MapSamples:
    """Sample equilibria over the passage of a ball and both signs of torque.

    A torque at which a solve fails and all larger ones are omitted, and the record
    (``truncated``) says so.

    Args:
        design: The drive.
        angles: Positions over one passage; None chooses :data:`PHASES`.
        progress: Called with the stage, the number of finished positions and their
            total.
        keep: Store of the positions of the balls, from which an interrupted run resumes
            with bit-identical samples; None keeps none.

    Raises:
        DesignError: If the design has features that the model lacks.
        ComputationError: If the unloaded drive or small torques cannot be solved.
    """
    check_modelled(design)
    begin, drive, ratings = time.perf_counter(), design.drive, ratings_of(design)
    model = thin_ring(design)
    passage = ball_passage(design, model)
    count = PHASES if angles is None else angles
    torques = [part * ratings.repeated_peak for part in LEVELS]
    small = SMALL * ratings.rated_torque
    theta = 2.0 * pi / passage.carried_as * np.arange(count) / count

    def position(
        name: str, phase: float, torques: list[float]
    ) -> tuple[dict[float, list[float]], bool]:
        found = None if keep is None else keep.read(name, partial(_taken, phase))
        if found is None:
            found = _position(model, phase, passage, torques, small)
            if keep is not None:
                keep.write(name, _arrays(phase, *found))
        return found

    rows: list[dict[float, list[float]]] = []
    free = False
    for k in range(count):
        # the cage lags behind the wave generator
        phase = -2.0 * pi / passage.per_cage_turn * k / count
        row, alone = position(f"position-{k:04d}", phase, torques)
        if not row:
            raise ComputationError(
                f"{drive.name}: no equilibrium of the rings under {small:g} N·m with"
                f" the balls at {phase:g} rad"
            )
        rows.append(row)
        free |= alone
        progress(f"{drive.name}: ball passage", k + 1, count)
    series = series_compliance(design, cup=True)
    others: list[tuple[float, float, float, float]] = []
    for j in range(UNSEEN_PHASES):
        # off the middle of a step, on another place in each
        place = count * (j + 0.381966) / UNSEEN_PHASES
        phase = -2.0 * pi / passage.per_cage_turn * place / count
        levels = [part * ratings.repeated_peak for part in UNSEEN]
        row, _ = position(f"unseen-{j:04d}", phase, levels)
        at = 2.0 * pi / passage.carried_as * place / count
        others += [
            (at, t, v[0] - t * series, v[3])
            for t, v in row.items()
            if t == 0.0 or t in levels
        ]
        progress(f"{drive.name}: unseen positions", j + 1, UNSEEN_PHASES)
    kept = sorted(set.intersection(*(set(row) for row in rows)))
    tables = {t: np.array([row[t] for row in rows]).T for t in kept}
    # the same drive under the opposite torque, seen in a mirror
    sign = np.array([-1.0, 1.0, 1.0, -1.0])[:, None]
    found = tables | {
        -t: np.roll(v[:, ::-1], 1, axis=1) * sign for t, v in tables.items() if t > 0.0
    }
    if free:
        for side in (small, -small):
            start, onset = across_clearance(found[0.0], found[side], side)
            found[start] = onset
        found[0.0][2] = onset[2]
    used = np.array(sorted(found))
    error, energy, compliance, input_torque = np.array(
        [found[t] for t in used]
    ).swapaxes(0, 1)
    angle, torque, errors, moments = np.array(others).reshape(-1, 4).T
    return MapSamples(
        name=drive.name,
        level="ring",
        layout=drive.layout,
        teeth_flexspline=drive.teeth_flexspline,
        teeth_circular_spline=drive.teeth_circular_spline,
        ratings=ratings,
        damping_ratio=design.joint.damping_ratio,
        order=(passage.carried_as, 0),
        input_angle=theta,
        torque=used,
        output_error=error - (used * series)[:, None],
        energy=energy + (0.5 * used**2 * series)[:, None],
        compliance=compliance + series,
        input_torque=input_torque,
        free=free,
        unseen=FullSolves(
            input_angle=angle,
            torque=torque,
            output_error=errors,
            input_torque=moments,
        )
        if others
        else None,
        info={
            "design_hash": design.content_hash(),
            "label": {
                "model": "ring",
                "level": "nonlinear",
                "circular_spline": "rigid but for its teeth",
                "cup": None if design.cup is None else "closed-form torsion in series",
                "stress_state": stress_state_label(design),
                "springs_Nm_rad": springs_of(design),
                "friction": None,
                "tolerances": None,
                "left_out": unmodelled_parts(design, "ring"),
            },
            "ball_passage": {
                "balls": model.bearing.balls,
                "per_input_turn": passage.per_input_turn,
                "carried_as": passage.carried_as,
            },
            "ratings_source": ratings.source,
            "truncated": len(kept) < len(torques) + 3,
            "solves": count * (len(torques) + 4),
            "sampling_wall_s": time.perf_counter() - begin,
        },
    )


def _position(
    model: ThinRing,
    phase: float,
    passage: BallPassage,
    torques: list[float],
    small: float,
) -> tuple[dict[float, list[float]], bool]:
    """Table rows by torque at one position of the balls; whether the output is free.

    The rows are empty if the unloaded drive cannot be solved, and end at the first
    torque at which a solve fails.
    """

    def row(state: RingState, torque: float) -> list[float]:
        race = state.q[model.rim.size :]
        rolled = race_on_balls(model, state, race).cage_torque
        # torque per input speed at the order of the map
        ripple = -rolled * passage.carried_as / passage.per_cage_turn
        return [
            state.rotation,
            state.energy,
            state.compliance,
            torque / model.ratio + ripple,
        ]

    rest = solve_unloaded(model, 0.0, phase)
    if not rest.outcome.ok:
        return {}, False
    sides = [solve_loaded(model, rest, t) for t in (small, -small)]
    if not all(side.outcome.ok for side in sides):
        return {}, False
    solver = RingSolver()
    psi = 0.5 * (sides[0].rotation + sides[1].rotation)
    middle = solver(model, rest, rotation=psi)
    free = not middle.loaded_teeth
    if not free:
        middle = solver(model, middle, torque=0.0)
    if not middle.outcome.ok:
        return {}, False
    rows = {0.0: row(middle, 0.0)}
    rows |= {t: row(s, t) for t, s in zip((small, -small), sides, strict=True)}
    state = sides[0]
    for torque in torques:
        state = solve_loaded(model, state, torque)
        if not state.outcome.ok:
            break
        rows[torque] = row(state, torque)
    return rows, free


def _arrays(
    phase: float, rows: dict[float, list[float]], free: bool
) -> dict[str, float | bool | Array]:
    """Results of :func:`_position` as arrays for a file."""
    return {
        "phase": phase,
        "free": free,
        "torque": np.array(list(rows)),
        "rows": np.array(list(rows.values())),
    }


def _taken(
    phase: float, arrays: Mapping[str, Any]
) -> tuple[dict[float, list[float]], bool]:
    """Results of :func:`_position` from an interrupted run.

    Raises:
        ValueError: If they belong to another position.
    """
    torque, rows = np.asarray(arrays["torque"]), np.asarray(arrays["rows"])
    if float(arrays["phase"]) != phase or not np.isfinite(rows).all():
        raise ValueError("the stored rows belong to another position of the balls")
    rows = rows.reshape(torque.size, 4)
    by_torque = dict(zip(torque.tolist(), rows.tolist(), strict=True))
    return by_torque, bool(arrays["free"])
