"""Equilibria of a drive with manufacturing errors over the whole cycle of its teeth.

Errors of the circular spline repeat with alpha, the rotation of the wave generator
relative to the circular spline; errors of the flexspline repeat with beta, the rotation
relative to the flexspline. Both together repeat after a number of pitches equal to the
least common multiple of the tooth counts, which is one output turn or a part of it.
Full solves would take hours. Instead, the drive is linearised at a few positions within
one pitch, and the errors of all pitches are superposed there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.common.clearance import with_mean_clearance
from swgjoint.fe.common.columns.angle_columns import SolvedColumns
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.tolerances.cycle import gap_changes, pitch_of, pitches_of
from swgjoint.fe.tolerances.full_solves import full_solves
from swgjoint.fe.tolerances.perfect import PerfectSolid, midway
from swgjoint.fe.tolerances.rest import SMALL, Rest, influences
from swgjoint.fe.tolerances.state_guess import Features, NearbyPositions
from swgjoint.fe.tolerances.superposition import superpose_many, superpose_plainly
from swgjoint.fe.tolerances.unseen import (
    spread_positions,
    unseen_positions,
    unseen_torques,
)
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import (
    has_errors,
    with_perfect_teeth,
    without_errors,
)
from swgjoint.maps.samples import ToleranceSamples
from swgjoint.maps.unfinished import Unfinished
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array

PHASES = {"2d": 6, "3d": 4}
"""Number of positions within a pitch if :data:`POSITIONS` allows it; the effect of
errors varies slowly over a pitch. With four instead of five positions, the input torque
of the map of the reference drive deviates from full solves by 9 instead of 8 %."""
ALONE = 24
"""Number of positions if the cycle is a single pitch: no errors of teeth and axis."""
POSITIONS = 40_000
"""Largest number of positions of the cycle, about two minutes of computation. It may be
exceeded because every pitch has at least two positions."""
LEVELS = {"2d": (0.05, 0.15, 0.3, 0.45, 0.575, 0.7, 1.0), "3d": (0.15, 0.45, 1.0)}
"""Sampled torques, of both signs, as fractions of the repeated peak torque [-]. In the
reference drive, what errors change varies slowly with the torque at most positions.
With the simplified wave generator and without 0.3 and 0.7, the input torque was off by
9.7 instead of 3.6 % of its peak to peak (rms 4.6 instead of 1.5 %). Where few teeth
carry the load, the stiffness changes fivefold between 0.45 and 0.7: without 0.575 the
output error of the reference drive was off by 9.1 instead of 5.0 % at 0.51."""
CHECKS = {"2d": 24, "3d": 3}
"""Number of positions that are also solved without linearisation to validate the map.
In 2D they lie between the sampled positions, half of them under negative torques, see
:mod:`swgjoint.fe.tolerances.unseen`. Each of them takes half a minute in 3D."""
STAGES = (
    "first equilibria",
    "linearised positions",
    "superposition",
    "full solves",
    "equilibria",
)
"""Stages of the sampling of a drive with errors, as reported by the progress."""
FREE = 100.0
"""Multiple of the median compliance of all positions above which the output counts as
free [-]."""
CHUNK = 2048
"""Number of sets of errors that are superposed between two progress reports: a few
seconds. Among many sets, more are similar."""
_PHASE = "superposition-{:04d}"


def sample_tolerances(
    design: Design,
    *,
    repeated_peak: float,
    rated_torque: float,
    phases: int | None = None,
    model: str = "2d",
    progress: Progress = silent,
    keep: Unfinished | None = None,
    solved: SolvedColumns[Any] | None = None,
) -> ToleranceSamples:
    """Equilibria with superposed errors over the cycle of the teeth.

    Args:
        design: A drive with manufacturing errors.
        repeated_peak: Largest torque to sample, normally the repeated peak torque
            [N·m].
        rated_torque: Rated torque, at which the superposition is validated [N·m].
        phases: Number of positions within a pitch. None chooses :data:`PHASES`, fewer
            for a cycle of many pitches, or up to :data:`ALONE` for a single pitch.
        model: Fidelity, ``2d`` or ``3d``.
        progress: Called with the stage, the number of finished parts and their total.
        keep: Store of finished positions, which a resumed run reads; None stores none.
        solved: Equilibria of the 3D drive without errors, as
            :func:`swgjoint.fe.common.sampling.sample_map` has them; None for none.

    Returns:
        Samples with errors and, for reference, those of the drive without errors.

    Raises:
        ComputationError: If no equilibrium is found without load, or with errors at
            one of the torques.
    """
    drive = design.drive
    if phases is None:
        most = PHASES[model] if pitches_of(design) > 1 else ALONE
        phases = int(np.clip(POSITIONS // pitches_of(design), 2, most))
    own_reference = has_errors(with_perfect_teeth(design))
    tick = _stage(progress, design, 1, phases * (2 if own_reference else 1))
    options: dict[str, Any] = {"phases": phases, "model": model, "tick": tick}
    solid: PerfectSolid | None = None
    if own_reference and model == "3d":
        if solved is not None:
            solid = PerfectSolid.from_columns(solved, phases, tick)
        solid = solid or PerfectSolid.from_design(design, phases, tick)
        options["start"] = solid.whole(solid.positions[0].state)
        options["like"] = solid.follow.model
    follow, linear = influences(design, **options)
    ideal_drive, reference = follow, linear
    if own_reference and model == "2d":
        # bore contacts of linearised 2D drives are coarser than those of equilibria
        ideal_drive, reference = influences(without_errors(design), **options)
    pitches = np.arange(pitches_of(design), dtype=np.int64)

    by_errors = partial(gap_changes, design=design, pitches=pitches)
    levels = np.array([part * repeated_peak for part in LEVELS[model]])
    small = SMALL * rated_torque
    has_play = any(rest.opposite is not None for rest in (*linear, *reference))
    if solid is not None:
        has_play |= any(position.sides is not None for position in solid.positions)
    if has_play:
        levels = np.append(small, levels)
    tables, perfect, free = [], [], 0
    loads = 2 * levels.size + 1
    steps = loads * -(-pitches.size // CHUNK)  # number of chunks, rounded up
    # a linearisation under load takes about as long as a chunk
    linearised = 2 * levels.size * (2 if own_reference else 1)
    tick = _stage(progress, design, 2, phases * (steps + linearised))
    before, under_load, nearby = None, list[Rest](), NearbyPositions()
    if solid is not None:
        perfect_states = solid.under_both_signs(levels, tick)
        perfect = list(solid.table(perfect_states, levels).transpose(2, 0, 1))
        # the first position starts from these states, the others from the one before
        before = {t: solid.whole(state) for t, state in perfect_states[0].items()}
    for k, rest in enumerate(linear):
        there = _kept(keep, k, (3, loads, pitches.size))
        loaded = rest
        # a resumed run turns the same states as an uninterrupted one
        if there is None or model == "3d" or not own_reference:
            loaded = rest.under_both_signs(follow, levels, tick, before)
        if model == "3d":
            before = {t: state for t, (state, _) in loaded.loaded.items()}
            under_load.append(loaded)
        flawless = loaded
        if own_reference and solid is None:
            flawless = reference[k].under_both_signs(ideal_drive, levels, tick)
        if there is None:
            phase_table, count = respond_over_torque(
                loaded, by_errors, levels, small, tick, nearby
            )
        else:
            phase_table, count = there
            skipped = own_reference and model != "3d"
            tick(steps + (linearised // 2 if skipped else 0))
        if not np.isfinite(phase_table).all():
            lost = np.isnan(phase_table).any(axis=(0, 1)).sum()
            raise ComputationError(
                f"{drive.name}: no equilibrium with the errors of the teeth at {lost}"
                f" of {pitches.size} pitches; try smaller tolerances"
            )
        if keep is not None and there is None:
            keep.write(_PHASE.format(k), {"table": phase_table, "free": count})
        if solid is None:
            alone, _ = respond_over_torque(
                flawless, lambda at: np.zeros((1, len(at.sector))), levels, small
            )
            perfect.append(alone[:, :, 0])
        tables.append(phase_table)
        free += count
    # (3, n_torques, n_pitches, n_phases) and (3, n_torques, n_phases)
    table, flawless_table = np.stack(tables, axis=-1), np.stack(perfect, axis=-1)
    ideal_angle = pitch_of(design) * np.arange(phases) / phases / design.ratio
    table[0] -= ideal_angle
    flawless_table[0] -= ideal_angle
    table = table.reshape(*table.shape[:2], -1)
    torque = np.concatenate([-levels[::-1], [0.0], levels])
    tick = _stage(progress, design, 3, CHECKS[model])
    chosen = spread_positions(pitches.size, phases, CHECKS[model])
    torques, signs = np.array([0.0, rated_torque]), np.ones(chosen.size)
    if model == "2d":
        chosen, signs = unseen_positions(table[0], torque, chosen)
        torques = unseen_torques(levels, rated_torque, has_play=has_play)
    checks = full_solves(
        design,
        follow,
        linear if model == "2d" else under_load,
        chosen,
        torques,
        signs,
        # half way to the next positions
        offset=0.5 * pitch_of(design) / phases if model == "2d" else 0.0,
        tick=tick,
        keep=keep,
    )
    if has_play:
        table, torque = with_mean_clearance(table, levels)
        flawless_table, _ = with_mean_clearance(flawless_table, levels)
    return ToleranceSamples(
        pitches=pitches.size,
        phases=phases,
        torque=torque,
        table=table,
        perfect=flawless_table,
        onsets=has_play,
        free=free,
        solved=checks,
    )


def respond_over_torque(
    rest: Rest,
    changes_of: Callable[[Influence], Array],
    levels: Array,
    small: float,
    tick: Callable[..., None] = lambda parts=1: None,
    nearby: NearbyPositions | None = None,
) -> tuple[Array, int]:
    """Output angle, strain energy and compliance at all torques of both signs.

    Args:
        rest: Linearised drive with perfect teeth.
        changes_of: Changes of the gaps of a linearised drive, one set of errors per
            row (n_sets, n) [m].
        levels: Magnitudes of the torques, increasing (n_levels,) [N·m].
        small: Torque that takes up the clearance [N·m].
        tick: Called with the number of chunks that are done, one by default, of
            :data:`CHUNK` sets of errors at a torque.
        nearby: What is known of the same sets at positions before, to which this one is
            added; None for nothing.

    Returns:
        Output angle [rad], strain energy [J] and compliance [rad/(N·m)]
        (3, n_torques, n_sets), and the number of sets whose unloaded output is free.
    """
    latest: dict[int, Array] = {}
    nearby = NearbyPositions() if nearby is None else nearby
    features: dict[bool, Features] = {}  # under the torque before of either sign

    def changes(at: Influence) -> Array:
        """Gap changes, kept for the latest linearisation only: they fill 50 MB."""
        if id(at) not in latest:
            latest.clear()
            latest[id(at)] = changes_of(at)
        return latest[id(at)]

    def row(
        torque: float, chosen: Any, start: Any, tick: Callable[..., None]
    ) -> tuple[Array, Any]:
        state, at = rest.near(torque)
        change, sign = changes(at)[chosen], torque < 0.0
        options: dict[str, Any] = {"chunk": CHUNK, "tick": tick}
        if start is None and len(change) > CHUNK:
            known = nearby.features(torque)
            if sign in features:
                known.append(features[sign])
            # those of the free sets tell nothing about all of them
            known = [one for one in known if len(one) == len(change)]
            found = superpose_many(at, change, torque, known, **options)
            assert found.features is not None
            features[sign] = found.features
            nearby.store(torque, found.features)
        else:
            found = superpose_plainly(at, change, torque, start, **options)
        # the potential of a response is relative to the linearised equilibrium
        potential = found.potential + state.energy + at.torque * at.angle
        energy = potential - torque * found.output_angle
        table = np.stack([found.output_angle, energy, found.compliance])
        return table, found.active

    count = len(changes(rest.near(0.0)[1]))
    unloaded, at_rest = np.zeros((3, count)), None
    free = np.ones(count, dtype=bool)
    if rest.opposite is None:
        unloaded, at_rest = row(0.0, slice(None), None, tick)
        # a few free positions do not change the median much
        free = ~(unloaded[2] < FREE * np.nanmedian(unloaded[2]))
    ends: dict[float, tuple[Array, Any]] = {}
    if free.any():
        some = slice(None) if free.all() else free
        ends = {t: row(t, some, None, lambda: None) for t in (small, -small)}
        up, down = ends[small][0], ends[-small][0]
        unloaded[:, free] = midway(up, down, small)
    chunks = -(-count // CHUNK)
    if rest.opposite is not None:
        tick(chunks)
    sides = []
    for sign in (-1.0, 1.0):
        active, before, rows = at_rest, rest.near(0.0)[1], []
        for level in levels:
            at = rest.near(sign * level)[1]
            if rest.opposite is not None and sign * level in ends:
                # all sets are free, so that these problems are solved already
                level_row, active = ends[sign * level]
                tick(chunks)
            else:
                # a guess is of use only for the same contacts
                known = active if at is before else None
                level_row, active = row(sign * level, slice(None), known, tick)
            before = at
            rows.append(level_row)
        sides.append(rows)
    table = [*sides[0][::-1], unloaded, *sides[1]]
    return np.stack(table, axis=1), int(free.sum())


def stage_name(design: Design, number: int) -> str:
    """Name of a stage of the sampling with errors, as reported by the progress.

    Args:
        design: The drive.
        number: Index in :data:`STAGES`.
    """
    part = range(len(STAGES))[number] + 1
    return f"{design.drive.name}: {STAGES[number]}, part {part} of {len(STAGES)}"


def _stage(
    progress: Progress, design: Design, number: int, total: int
) -> Callable[..., None]:
    """Function that counts and reports the finished parts of one sampling stage."""
    done = 0
    name = stage_name(design, number)
    progress(name, 0, total)

    def tick(parts: int = 1) -> None:
        nonlocal done
        done += parts
        progress(name, done, total)

    return tick


def _kept(
    keep: Unfinished | None, phase: int, shape: tuple[int, ...]
) -> tuple[Array, int] | None:
    """Table and number of free sets that an interrupted run stored for a phase."""

    def taken(arrays: Mapping[str, Any]) -> tuple[Array, int]:
        table = np.asarray(arrays["table"], float)
        if table.shape != shape:
            raise ValueError(f"table of shape {table.shape}: expected {shape}")
        return table, int(arrays["free"])

    return None if keep is None else keep.read(_PHASE.format(phase), taken)
