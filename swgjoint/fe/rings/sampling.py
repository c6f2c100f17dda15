"""Sampling of thin-ring equilibria over torque and ball passage, for a map.

The pattern of the map is due to the balls that pass the lobes. Since the balls roll,
the number of passages per input turn is not an integer; the map uses the nearest one.
The passage of teeth is not included; its kinematic error under load is a tenth as
large.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import pi
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError, DesignError
from swgjoint.fe.common.clearance import FAINT, HELD, across_clearance, spring_energy
from swgjoint.fe.common.stress_state import stress_state_label
from swgjoint.fe.plane.drive2d import in_plane, unmodelled_parts
from swgjoint.fe.rings import model as thin
from swgjoint.fe.rings.contacts import race_on_balls
from swgjoint.fe.rings.equilibrium import ThinRingSolver
from swgjoint.fe.rings.loading import SMALL, solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.passage import BallPassage, ball_passage
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.fe.rings.tolerances import RingErrors, named_errors
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors, without_errors
from swgjoint.gear.mounting import series_compliance, springs_of
from swgjoint.maps.samples import FullSolves, MapSamples
from swgjoint.maps.unfinished import Unfinished
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array

PHASES = 12
"""Number of positions of the balls over one passage."""
FLAWED_PHASES = 6
"""The same number for a drive with manufacturing errors, which outweigh the passage of
the balls."""
LEVELS = (0.03, 0.06, 0.1, 0.15, 0.22, 0.31, 0.43, 0.58, 0.78, 1.01)
"""Sampled torques, of both signs, as fractions of the repeated peak torque [-]. They
are closer together where additional balls become loaded. The last one exceeds the peak
so that every position reaches the peak."""

UNSEEN = (0.04, 0.12, 0.26, 0.5, 0.9)
"""Validation torques between the sampled ones, as fractions of the repeated peak torque
[-]."""
UNSEEN_PHASES = 3
"""Number of validation positions of the balls, between the sampled positions."""

_Rows = dict[float, list[float]]
"""Rotation [rad], strain energy [J], compliance [rad/(N·m)] and input torque [N·m] at
one position of the balls, by torque [N·m]."""
_BallPosition = tuple[_Rows, bool]
"""Rows of a position of the balls, and whether the unloaded output is free there."""


def check_modelled(design: Design) -> None:
    """Reject features that a map of the thin rings lacks.

    Raises:
        DesignError: If the design has any of them.
    """
    thin.check_modelled(design)
    if design.wave_generator.kind == "table":
        raise DesignError(
            f"{design.drive.name}: wave_generator.kind = 'table': a ring map mirrors"
            " its results for negative torques; accepted: 'elliptical', 'cosine'"
        )


def sample_thin_rings(
    design: Design,
    *,
    angles: int | None = None,
    progress: Progress = silent,
    keep: Unfinished | None = None,
    perfect_keep: Unfinished | None = None,
) -> MapSamples:
    """Samples of a map over the passage of a ball and both signs of torque.

    They are those of a drive without errors and friction. Manufacturing errors are
    sampled over the cycle of the teeth as well, see
    :mod:`swgjoint.fe.rings.tolerances`.

    If a solve fails, its torque and all larger ones are omitted, and ``truncated`` in
    the record of the samples is true.

    Args:
        design: The drive.
        angles: Number of positions over one passage; None chooses :data:`PHASES`, or
            :data:`FLAWED_PHASES` with manufacturing errors.
        progress: Called with the stage, the number of finished positions and their
            total.
        keep: Store of the results by position, from which an interrupted run resumes
            with bit-identical samples; None stores none.
        perfect_keep: Store of the results without errors, which drives with other
            errors share; None stores them in ``keep``.

    Returns:
        Samples of the map.

    Raises:
        DesignError: If the design has features that the model lacks.
        ComputationError: If the unloaded drive or small torques cannot be solved.
    """
    check_modelled(design)
    begin, ratings = time.perf_counter(), ratings_of(design)
    perfect, flawed = without_errors(design), in_plane(design)
    if angles is None:
        angles = FLAWED_PHASES if has_errors(flawed) else PHASES
    model = thin_ring(perfect)
    sampler = _Sampler(
        design=design,
        model=model,
        passage=ball_passage(perfect, model),
        count=angles,
        small=SMALL * ratings.rated_torque,
        series=series_compliance(design, cup=True),
        keep=keep if perfect_keep is None else perfect_keep,
        progress=progress,
    )
    torques = [part * ratings.repeated_peak for part in LEVELS]
    rows, free = sampler.sampled_positions(torques)
    unseen = None
    if not has_errors(flawed):  # otherwise full solves with errors validate the map
        unseen = sampler.unseen_positions([p * ratings.repeated_peak for p in UNSEEN])
    reached = sorted(set.intersection(*(set(row) for row in rows)))
    tables = _both_signs({t: np.array([row[t] for row in rows]).T for t in reached})
    if free:
        _add_onsets(tables, sampler.small, HELD if has_errors(flawed) else FAINT)
    record = sampler.record(torques, truncated=len(reached) < len(torques) + 3)
    tolerances = None
    if has_errors(flawed):
        errors = RingErrors(
            design=flawed,
            passage=sampler.passage,
            small=sampler.small,
            free=free,
            keep=keep,
            progress=progress,
        )
        tolerances = errors.sample(tables).in_series(sampler.series)
    record["sampling_wall_s"] = time.perf_counter() - begin
    samples = sampler.map_samples(tables, free=free, unseen=unseen, info=record)
    return replace(samples, tolerances=tolerances)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sampler:
    """Positions of the balls of one drive, solved or read from a store."""

    design: Design
    model: ThinRing
    passage: BallPassage
    count: int
    """Number of sampled positions over one passage."""
    small: float
    """Torque that takes up the clearance [N·m]."""
    series: float
    """Compliance of the springs in series, including the cup [rad/(N·m)]."""
    keep: Unfinished | None
    progress: Progress

    @property
    def period(self) -> float:
        """Change of the input angle over one passage, as the map uses it [rad]."""
        return 2.0 * pi / self.passage.carried_as

    def cage_phase(self, place: float) -> float:
        """Angle of ball 0 from the major axis [rad] at a place from 0 to ``count``."""
        # the cage lags behind the wave generator
        return -2.0 * pi / self.passage.per_cage_turn * place / self.count

    def position(self, name: str, phase: float, torques: list[float]) -> _BallPosition:
        """Rows of a position, read from the store or solved and stored."""
        if self.keep is None:
            return _position(self.model, phase, self.passage, torques, self.small)
        stored = self.keep.read(name, partial(_taken, phase))
        if stored is not None:
            return stored
        solved = _position(self.model, phase, self.passage, torques, self.small)
        self.keep.write(name, _arrays(phase, *solved))
        return solved

    def sampled_positions(self, torques: list[float]) -> tuple[list[_Rows], bool]:
        """Rows of all sampled positions, and whether the output is free at any of them.

        Raises:
            ComputationError: If a position has no rows.
        """
        name, positions, any_free = self.design.drive.name, list[_Rows](), False
        for k in range(self.count):
            phase = self.cage_phase(k)
            rows, free = self.position(f"position-{k:04d}", phase, torques)
            if not rows:
                raise ComputationError(
                    f"{name}: no equilibrium of the thin rings under"
                    f" +-{self.small:g} N·m with ball 0 at {phase:g} rad from the major"
                    " axis"
                )
            positions.append(rows)
            any_free |= free
            self.progress(f"{name}: ball passage", k + 1, self.count)
        return positions, any_free

    def unseen_positions(self, torques: list[float]) -> FullSolves | None:
        """Results between sampled positions and torques; None if all solves fail."""
        name = self.design.drive.name
        solves: list[tuple[float, float, float, float]] = []
        for j in range(UNSEEN_PHASES):
            # not at a sampled position and not midway between two of them
            place = self.count * (j + 0.381966) / UNSEEN_PHASES
            phase = self.cage_phase(place)
            rows, _ = self.position(f"unseen-{j:04d}", phase, torques)
            angle = self.period * place / self.count
            solves += [
                (angle, torque, row[0] - torque * self.series, row[3])
                for torque, row in rows.items()
                if torque == 0.0 or torque in torques
            ]
            self.progress(f"{name}: unseen positions", j + 1, UNSEEN_PHASES)
        return FullSolves.from_rows(solves) if solves else None

    def record(self, torques: list[float], *, truncated: bool) -> dict[str, Any]:
        """Record of the sampling, for the map."""
        design, passage = self.design, self.passage
        return {
            "design_hash": design.content_hash(),
            "label": {
                "model": "ring",
                "level": "nonlinear",
                "circular_spline": "rigid except for its teeth",
                "cup": None if design.cup is None else "closed-form torsion in series",
                "stress_state": stress_state_label(design),
                "springs_Nm_rad": springs_of(design),
                "friction": "left out of the potential"
                if design.friction.tooth_coefficient
                else None,
                "tolerances": named_errors(design),
                "left_out": unmodelled_parts(design, "ring"),
            },
            "ball_passage": {
                "balls": self.model.bearing.balls,
                "per_input_turn": passage.per_input_turn,
                "carried_as": passage.carried_as,
            },
            "ratings_source": ratings_of(design).source,
            "truncated": truncated,
            "solves": self.count * (len(torques) + 4),
        }

    def map_samples(
        self,
        tables: Mapping[float, Array],
        *,
        free: bool,
        unseen: FullSolves | None,
        info: dict[str, Any],
    ) -> MapSamples:
        """Samples of the map from tables by torque, plus the springs in series."""
        design, series = self.design, self.series
        torque = np.array(sorted(tables))
        error, energy, compliance, input_torque = np.array(
            [tables[t] for t in torque]
        ).swapaxes(0, 1)
        return MapSamples(
            name=design.drive.name,
            level="ring",
            layout=design.drive.layout,
            teeth_flexspline=design.drive.teeth_flexspline,
            teeth_circular_spline=design.drive.teeth_circular_spline,
            ratings=ratings_of(design),
            damping_ratio=design.joint.damping_ratio,
            order=(self.passage.carried_as, 0),
            input_angle=self.period * np.arange(self.count) / self.count,
            torque=torque,
            output_error=error - (torque * series)[:, None],
            energy=energy + (0.5 * torque**2 * series)[:, None],
            compliance=compliance + series,
            input_torque=input_torque,
            free=free,
            unseen=unseen,
            info=info,
        )


def _both_signs(tables: dict[float, Array]) -> dict[float, Array]:
    """Tables for both signs of torque; those of negative torques are mirror images.

    Args:
        tables: Rotation, strain energy, compliance and input torque (4, count), by
            torque that is not negative.
    """
    sign = np.array([-1.0, 1.0, 1.0, -1.0])[:, None]
    return tables | {
        -t: np.roll(v[:, ::-1], 1, axis=1) * sign for t, v in tables.items() if t > 0.0
    }


def _add_onsets(tables: dict[float, Array], small: float, faint: float) -> None:
    """Add the torques at which the teeth begin to hold the output, in place."""
    starts = []
    for side in (small, -small):
        start, onset = across_clearance(tables[0.0], tables[side], side, faint)
        tables[start] = onset
        starts.append(start)
    if faint != FAINT:
        stored = spring_energy(tables[small][0], tables[-small][0], small)
        for torque in (0.0, *starts):
            tables[torque][1] -= stored
    tables[0.0][2] = onset[2]  # compliance at the ends of the clearance


def _position(
    model: ThinRing,
    phase: float,
    passage: BallPassage,
    torques: list[float],
    small: float,
) -> _BallPosition:
    """Rows at one position of the balls, and whether the unloaded output is free there.

    There are no rows if the drive cannot be solved without torque or under the torques
    +-``small``. The rows end before the first torque at which a solve fails.
    """

    def row(state: ThinRingState, torque: float) -> list[float]:
        race = state.q[model.rim.size :]
        rolled = race_on_balls(model, state, race).cage_torque
        # power per input speed, with the number of passages that the map uses
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
    solver = ThinRingSolver()
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


def _arrays(phase: float, rows: _Rows, free: bool) -> dict[str, float | bool | Array]:
    """Results of :func:`_position` as arrays for a file."""
    return {
        "phase": phase,
        "free": free,
        "torque": np.array(list(rows)),
        "rows": np.array(list(rows.values())),
    }


def _taken(phase: float, arrays: Mapping[str, Any]) -> _BallPosition:
    """Results of :func:`_position` from an interrupted run.

    Raises:
        ValueError: If they belong to another position or are not finite.
    """
    torque, rows = np.asarray(arrays["torque"]), np.asarray(arrays["rows"])
    if float(arrays["phase"]) != phase or not np.isfinite(rows).all():
        raise ValueError("stored rows belong to another position or are not finite")
    rows = rows.reshape(torque.size, 4)
    by_torque = dict(zip(torque.tolist(), rows.tolist(), strict=True))
    return by_torque, bool(arrays["free"])
