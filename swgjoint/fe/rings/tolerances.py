"""Thin rings with manufacturing errors over the whole cycle of their teeth.

The errors of all pitches are superposed on rings that are linearised under load, as in
:mod:`swgjoint.fe.tolerances.sampling`: a gap may close or open, so that other teeth
carry load with errors than without. Errors of the wave generator turn with it and
belong to the linearised rings. Balls and teeth keep their positions relative to the
lobes, because the map contains the passage of balls separately.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.common.clearance import with_mean_clearance
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.drive2d import in_plane
from swgjoint.fe.rings.contacts import race_on_balls
from swgjoint.fe.rings.influence import tooth_influence, with_shifting_teeth
from swgjoint.fe.rings.loading import (
    GOLDEN,
    recall_over_torque,
    solve_loaded,
    solve_over_torque,
    solve_unloaded,
)
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.passage import BallPassage
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.fe.tolerances.cycle import MEMBERS, gap_changes, pitch_of, pitches_of
from swgjoint.fe.tolerances.main_harmonics import main_harmonics
from swgjoint.fe.tolerances.rest import Rest
from swgjoint.fe.tolerances.sampling import respond_over_torque
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import (
    has_errors,
    tooth_errors,
    with_perfect_teeth,
)
from swgjoint.maps.samples import FullSolves, ToleranceSamples
from swgjoint.maps.unfinished import Unfinished
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array, Index

STRIDE = 3
"""Every third sampled torque, counted from the largest one, is also sampled with
errors, whose effect varies slowly with the torque."""
CHECKS = 4
"""Number of positions that are also solved without linearisation to validate the map.
"""
CHECK_TORQUE = 0.26
"""Torque of these solves as a fraction of the repeated peak torque, between the sampled
ones [-]; zero and the rated torque are solved as well."""
_POSITION, _CHECK = "errors-{:04d}", "error-check-{:04d}"


def named_errors(design: Design) -> dict[str, float] | None:
    """Nonzero errors that the rings contain, with their seed; None without any."""
    aligned = in_plane(design)
    values = aligned.tolerances.model_dump()
    return {k: v for k, v in values.items() if v} if has_errors(aligned) else None


@dataclass(frozen=True, kw_only=True, eq=False)
class RingErrors:
    """Superposition of the errors of one drive."""

    design: Design
    """The drive with its manufacturing errors."""
    passage: BallPassage
    """Passage of the balls without errors."""
    small: float
    """Torque that takes up the clearance [N·m]."""
    free: bool
    """Whether clearance leaves the unloaded output free without errors."""
    keep: Unfinished | None = None
    """Store of finished positions, which a resumed run reads; None stores none."""
    progress: Progress = silent
    """Called with the stage, the number of finished parts and their total."""

    @property
    def phases(self) -> Array:
        """Angles of ball 0 from the major axis at which the rings are linearised [rad].

        Without errors all of them are equivalent: an odd number of balls reaches both
        lobes alternately, and errors of the wave generator make the lobes unequal.
        """
        count = self.passage.per_cage_turn // self.passage.balls
        step = 2.0 * np.pi / self.passage.per_cage_turn
        return np.asarray(-step * np.arange(count), dtype=np.float64)

    def sample(self, perfect: Mapping[float, Array]) -> ToleranceSamples:
        """Equilibria with errors over the cycle of the teeth, springs not included.

        Args:
            perfect: Rotation [rad], strain energy [J], compliance [rad/(N·m)] and input
                torque [N·m] without errors by torque of both signs (4, n); the first
                column is used, with ball 0 on the major axis.

        Raises:
            ComputationError: If an equilibrium cannot be found.
        """
        positive = sorted(t for t in perfect if t > self.small)
        levels = np.array([self.small, *positive[::-1][::STRIDE][::-1]])
        name, phases = self.design.drive.name, self.phases
        stage = f"{name}: manufacturing errors"
        pitches = np.arange(pitches_of(self.design), dtype=np.int64)
        model = with_shifting_teeth(thin_ring(with_perfect_teeth(self.design)))
        total = len(phases) + CHECKS
        # positions of the balls alternate from pitch to pitch if the cycle permits:
        # each is then sampled at every other pitch, which resolves half the harmonics
        shares = len(phases) if pitches.size % len(phases) == 0 else 1
        spectra = []
        for k, phase in enumerate(phases.tolist()):
            first = k if shares > 1 else 0
            found = self._over_cycle(k, model, phase, levels, pitches[first::shares])
            spectra.append(_spectrum(found, first, pitches.size))
            self.progress(stage, k + 1, total)
        turns = pitches.size / self.design.drive.teeth_circular_spline
        passages = 0.5 * self.passage.carried_as * turns
        torque = np.concatenate([-levels[::-1], [0.0], levels])
        table, waves, dropped = self._main_part(
            _over_passage(spectra, passages, pitches.size), torque, pitches.size, shares
        )
        if self.free:
            table, torque = with_mean_clearance(table, levels)
        rows, solved = [], thin_ring(self.design)
        for k in range(CHECKS):
            rows += self._checked(k, solved, pitches.size, max(positive))
            self.progress(stage, len(phases) + k + 1, total)
        input_angle, load, error, input_torque = np.array(rows).reshape(-1, 4).T
        return ToleranceSamples(
            pitches=pitches.size,
            phases=1,
            torque=torque,
            table=table,
            waves=waves,
            dropped=dropped,
            perfect=np.stack([perfect[t][:3, :1] for t in torque.tolist()], axis=1),
            order=(self.design.periodicity, 0),
            onsets=self.free,
            free=pitches.size if self.free else 0,
            solved=FullSolves(
                input_angle=input_angle,
                torque=load,
                output_error=error,
                input_torque=input_torque,
            ),
        )

    def _main_part(
        self, spectrum: Array, torque: Array, count: int, shares: int
    ) -> tuple[Array, Index, float]:
        """Table of the resolved waves, the numbers of the main ones, and the others.

        Args:
            spectrum: Harmonics of output angle, energy and compliance over the cycle
                (3, n_torques, count // 2 + 1).
            torque: Torques (n_torques,) [N·m].
            count: Number of pitches of the cycle.
            shares: Number of positions of the balls among which the pitches are shared.

        Returns:
            Table (3, n_torques, count); waves and rms of :func:`main_harmonics`.
        """
        # faster waves come from the passage of balls times others: they are not in the
        # full solves (regression on them gives 0.1 +- 0.1 instead of 1)
        resolved = (count + shares) // (2 * shares)
        orders = np.arange(resolved) * (self.design.periodicity / count)
        waves, dropped = main_harmonics(
            spectrum[:2, :, :resolved] * (2.0 / count),
            torque,
            np.asarray(orders, dtype=np.float64),
            free=self.free,
        )
        return np.fft.irfft(spectrum[..., :resolved], count), waves, dropped

    def _over_cycle(
        self,
        number: int,
        model: ThinRing,
        phase: float,
        levels: Array,
        pitches: Index,
    ) -> Array:
        """Output angle, energy and compliance at some pitches (3, n_torques, n).

        Args:
            number: Number of the position of the balls.
            model: Rings with perfect teeth and with errors of the wave generator.
            phase: Angle of ball 0 from the major axis [rad].
            levels: Torques of both signs, increasing (n_levels,) [N·m].
            pitches: Numbers of the pitches (n,).
        """
        name, shape = _POSITION.format(number), (3, 2 * levels.size + 1, pitches.size)
        if self.keep is not None:
            stored = self.keep.read(name, partial(_stored_table, shape))
            if stored is not None:
                return stored
        rest = self.linearise(model, phase, levels)
        changes = partial(gap_changes, design=self.design, pitches=pitches)
        table = superpose(rest, changes, levels, self.small)
        if not np.isfinite(table).all():
            lost = int(np.isnan(table).any(axis=(0, 1)).sum())
            raise ComputationError(
                f"{self.design.drive.name}: no equilibrium of the thin rings with the"
                f" errors of the teeth at {lost} of {pitches.size} pitches; try"
                " smaller tolerances"
            )
        if self.keep is not None:
            self.keep.write(name, {"table": table})
        return table

    def linearise(
        self,
        model: ThinRing,
        phase: float,
        levels: Array,
        nearby: Mapping[float, ThinRingState] | None = None,
    ) -> Rest:
        """The rings at a position of the balls, linearised under torques of both signs.

        Args:
            model: Rings with perfect teeth and with errors of the wave generator.
            phase: Angle of ball 0 from the major axis [rad].
            levels: Torques of both signs, increasing (n_levels,) [N·m].
            nearby: Equilibria of the drive without errors at this position by torque
                [N·m], see :func:`swgjoint.fe.rings.loading.solve_over_torque`.

        Raises:
            ComputationError: If an equilibrium cannot be found.
        """
        reach = _largest_change(self.design)
        loaded = {}
        found: Mapping[float, ThinRingState]
        if nearby:
            found = solve_over_torque(model, phase, levels, nearby)
        else:
            design = with_perfect_teeth(self.design).content_hash()
            found = recall_over_torque(design, model, phase, levels)
        for torque, state in found.items():
            solved = self._solved(state, torque, 0.0)
            if torque:
                loaded[torque] = solved, tooth_influence(model, solved, reach)
        up, down = loaded[self.small], loaded[-self.small]
        return Rest(state=up[0], at=up[1], opposite=down, loaded=loaded)

    def _checked(
        self, number: int, model: ThinRing, pitches: int, largest: float
    ) -> list[list[float]]:
        """Full solves at one position: input angle, torque, error, input torque."""
        ratings = ratings_of(self.design)
        torques = sorted([CHECK_TORQUE * ratings.repeated_peak, ratings.rated_torque])
        torques = [torque for torque in torques if torque < largest]
        # spread over the cycle and over the passages of teeth and balls
        part = (number + 0.5) * GOLDEN % 1.0
        theta = pitch_of(self.design) * pitches * part
        at = np.array([[theta, t] for t in (0.0, *torques)])
        name = _CHECK.format(number)
        if self.keep is not None:
            stored = self.keep.read(name, partial(_stored_check, at))
            if stored is not None:
                return stored
        # the balls have the positions that the map assumes at this input angle
        cage = -self.passage.carried_as / self.passage.per_cage_turn
        phase = cage * theta

        def row(state: ThinRingState) -> list[float]:
            rolled = race_on_balls(model, state, state.q[model.rim.size :])
            lag = model.cage_lag
            moment = rolled.input_torque + (cage - lag) * rolled.cage_torque
            return [state.rotation - theta / model.ratio, moment]

        start = solve_unloaded(model, theta, phase - model.cage_lag * theta)
        rest = self._solved(start, 0.0, theta)
        sides = [
            self._solved(solve_loaded(model, rest, t), t, theta)
            for t in (-self.small, self.small)
        ]
        results = [np.mean([row(side) for side in sides], axis=0).tolist()]
        state = sides[1]
        for torque in torques:
            state = self._solved(solve_loaded(model, state, torque), torque, theta)
            results.append(row(state))
        table = np.concatenate([at, np.array(results)], axis=1)
        if self.keep is not None:
            self.keep.write(name, {"table": table})
        return [list(one) for one in table.tolist()]

    def _solved(
        self, state: ThinRingState, torque: float, theta: float
    ) -> ThinRingState:
        """The state, unless its solve failed."""
        if not state.outcome.ok:
            raise ComputationError(
                f"{self.design.drive.name}: no equilibrium of the thin rings with"
                f" manufacturing errors at {torque:.4g} N·m and input angle"
                f" {theta:.4g} rad: {state.outcome.value}"
            )
        return state


def superpose(
    rest: Rest, changes_of: Callable[[Influence], Array], levels: Array, small: float
) -> Array:
    """Output angle, energy and compliance with errors (3, n_torques, n_sets).

    All three are NaN if the compliance is not positive: the tangent under load with the
    contacts that carry load is then not stable, so its solution is no equilibrium.

    Args:
        rest: Rings linearised under torques of both signs.
        changes_of: Changes of the gaps of linearised rings, one set of errors per row
            (n_sets, n) [m].
        levels: Magnitudes of the torques, increasing (n_levels,) [N·m].
        small: Torque that takes up the clearance [N·m].
    """
    table, _ = respond_over_torque(rest, changes_of, levels, small)
    return np.where(table[2] > 0.0, table, np.nan)


def _spectrum(table: Array, first: int, count: int) -> Array:
    """Harmonics of a table that is sampled at equally spaced pitches of the cycle.

    Args:
        table: Output angle, energy and compliance (3, n_torques, n).
        first: Number of the first sampled pitch.
        count: Number of pitches of the cycle, a multiple of n.

    Returns:
        Harmonics as those of :func:`numpy.fft.rfft` over all pitches, zero where the
        sampled pitches do not resolve them (3, n_torques, count // 2 + 1).
    """
    n = table.shape[-1]
    # the phase of half as many waves as samples is undetermined
    known = (n + 1) // 2
    spectrum = np.zeros((*table.shape[:-1], count // 2 + 1), dtype=complex)
    shift = np.exp(-2j * np.pi * first / count * np.arange(known))
    spectrum[..., :known] = np.fft.rfft(table)[..., :known] * shift * (count / n)
    return spectrum


def _over_passage(spectra: Sequence[Array], passages: float, count: int) -> Array:
    r"""Harmonics while the balls pass the lobes.

    With one position of the balls, theirs. With two, at which a ball is on the one lobe
    and on the other, the quantities f and g change between them like a cosine,

    .. math:: \tfrac12 (f + g) + \tfrac12 (f - g) \cos(n \alpha) ,

    with n balls passing a lobe per turn of the wave generator. Errors of the teeth move
    the output more where a ball supports them.

    Args:
        spectra: Harmonics at each position of the balls, see :func:`_spectrum`.
        passages: Number of balls that pass a lobe over the cycle [-].
        count: Number of pitches of the cycle.
    """
    if len(spectra) == 1:
        return spectra[0]
    first, second = spectra
    change = np.fft.irfft(0.5 * (first - second), count)
    wave = np.cos(2.0 * np.pi * round(passages) * np.arange(count) / count)
    return np.asarray(0.5 * (first + second) + np.fft.rfft(change * wave))


def _largest_change(design: Design) -> float:
    """Upper bound of the gap that errors of the teeth close [m]."""
    shifts = (tooth_errors(design, member).shift for member in MEMBERS)
    return float(sum(np.hypot(*shift.T).max() for shift in shifts))


def _stored_table(shape: tuple[int, ...], arrays: Mapping[str, Any]) -> Array:
    """Table of an interrupted run.

    Raises:
        ValueError: If its shape differs or it is not finite.
    """
    table = np.asarray(arrays["table"], float)
    if table.shape != shape or not np.isfinite(table).all():
        raise ValueError(f"table of shape {table.shape}: expected {shape}, finite")
    return table


def _stored_check(at: Array, arrays: Mapping[str, Any]) -> list[list[float]]:
    """Full solves of an interrupted run.

    Raises:
        ValueError: If they belong to another position or torque.
    """
    table = np.asarray(arrays["table"], float)
    if table.shape != (len(at), 4) or not np.array_equal(table[:, :2], at):
        raise ValueError("stored rows belong to another position of the cycle")
    return [list(one) for one in table.tolist()]
