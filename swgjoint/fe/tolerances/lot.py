"""Output errors of many 2D drives of one design with different manufacturing errors.

The perfect drive is linearised at a few positions within a pitch. The errors of the
teeth and the wave generator of every drive are superposed at these positions, which
takes about a millisecond per equilibrium.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.drive2d import in_plane
from swgjoint.fe.tolerances.cycle import gap_errors, pitch_of, pitches_of
from swgjoint.fe.tolerances.full_solves import full_solves
from swgjoint.fe.tolerances.rest import SMALL, Rest, influences
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import (
    flawed_wave_generator,
    wave_generator_offset,
    with_perfect_teeth,
    without_errors,
)
from swgjoint.gear.mounting import series_compliance
from swgjoint.gear.wave_generators.wave_generator import wave_generator
from swgjoint.typing import Array, Index

PHASES = 4
"""Number of positions within a pitch."""
POSITIONS = 320
"""Number of input positions over one output turn. For six specimens of the drive
reference-2d-tolerances, the transmission accuracy (see ``study``) from these positions
is 0.98 times that from all 29,280 positions, with a standard deviation of 0.012."""
CHECKS = 6
"""Number of positions of one drive that are solved without linearisation to validate
the superposition."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lot:
    """Output errors of n drives at P input angles; NaN where a solve failed."""

    input_angle: Array
    """Random input angles theta over one output turn (P,) [rad]."""
    unloaded: Array
    """Kinematic error psi - theta/i without torque (n, P) [rad]."""
    loaded: Array
    """Transmission error psi - theta/i at rated torque (n, P) [rad]."""
    compliance: Array
    """Compliance -d(psi)/dT at rated torque (n, P) [rad/(N·m)]."""
    whole: NDArray[np.bool_]
    """Whether the positions cover the whole cycle of a drive's errors (n,)."""


def perfect_positions(design: Design, phases: int = PHASES) -> list[Rest]:
    """Linearised positions of the drive without errors, for :func:`sample_lot`.

    Args:
        design: The drive; its errors are ignored.
        phases: Number of positions, equally spaced over a pitch.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks.
        ComputationError: If a position cannot be solved.
    """
    # the outlines of the wave generators differ; these errors are superposed where they
    # touch the bore, from which a bearing would separate them
    return influences(without_errors(design), phases=phases, bearing=False)[1]


def sample_lot(
    drives: Sequence[Design], rests: Sequence[Rest], *, positions: int = POSITIONS
) -> Lot:
    """Output errors of many drives of one design.

    Where clearance leaves the unloaded output free, its error is the mean of the errors
    at +-1 % of the rated torque. The compliance of the springs in series, including the
    cup in closed form, is added.

    Args:
        drives: Drives that differ only in their ``tolerances``. Misalignment of their
            axes is left out.
        rests: Unloaded positions of the perfect drive, see :func:`perfect_positions`.
        positions: Number of input angles. One output turn is divided into as many equal
            parts, and one angle is placed in each of them, at random but with a fixed
            seed. If there are no more positions than this in a turn, all are used.

    Returns:
        Output errors of all drives.
    """
    design, phases = drives[0], len(rests)
    rated = ratings_of(design).rated_torque
    series = series_compliance(design, cup=True)
    # a whole output turn even if the errors repeat sooner: the orders of the two
    # members can be separated only by their beat
    turn = round(2.0 * np.pi * abs(design.ratio) / pitch_of(design))
    pitch, phase = np.divmod(stratified_numbers(turn * phases, positions), phases)
    # theta/i within the first pitch, to which the errors of every pitch are referred
    ideal = pitch_of(design) * phase / phases / design.ratio
    shape = (len(drives), pitch.size)
    unloaded, loaded, compliance = (np.empty(shape) for _ in range(3))
    for k, rest in enumerate(rests):
        here = phase == k
        errors = [gap_errors(drive, pitch[here]) for drive in drives]
        unloaded[:, here] = _unloaded(rest, drives, errors, rated)
        at = rest.sides[0][1]
        response = at.with_supports.respond(_gap_changes(at, drives, errors), rated)
        part = (len(drives), -1)
        loaded[:, here] = (response.output_angle - series * rated).reshape(part)
        compliance[:, here] = (response.compliance + series).reshape(part)
    return Lot(
        input_angle=pitch_of(design) * (pitch + phase / phases),
        unloaded=unloaded - ideal,
        loaded=loaded - ideal,
        compliance=compliance,
        whole=np.array([_is_whole(drive, pitch, phase, phases) for drive in drives]),
    )


def _is_whole(drive: Design, pitch: Index, phase: Index, phases: int) -> bool:
    """Whether the positions include all positions of the cycle of a drive."""
    cycle = pitches_of(drive)
    return np.unique(pitch % cycle * phases + phase).size == cycle * phases


def superposition_error(
    drive: Design, perfect: Sequence[Rest], *, positions: int = CHECKS
) -> float | None:
    """Largest deviation of the superposed kinematic error from full solves.

    It is divided by the peak-to-peak value of the superposed kinematic error.

    Args:
        drive: One drive of a lot.
        perfect: Positions of the perfect drive, see :func:`perfect_positions`.
        positions: Number of input angles, equally spaced over one output turn.

    Returns:
        Relative deviation [-]; None if no full solve succeeds.
    """
    drive = in_plane(drive)
    turn = round(2.0 * np.pi * abs(drive.ratio) / pitch_of(drive))
    pitch = np.arange(positions) * turn // positions
    follow, rests = influences(with_perfect_teeth(drive), phases=1, bearing=False)
    solved = full_solves(drive, follow, rests, pitch, (0.0,))
    at = np.round(solved.input_angle / pitch_of(drive)).astype(np.int64)
    if not at.size:
        return None
    errors = gap_errors(drive, at)
    rated = ratings_of(drive).rated_torque
    superposed = _unloaded(perfect[0], [drive], [errors], rated)
    spread = np.ptp(sample_lot([drive], perfect).unloaded)
    return float(np.abs(superposed[0] - solved.output_error).max() / spread)


def outline_change(at: Influence, drive: Design) -> Array:
    """Changes of the gaps at the wave generator due to its errors (k,) [m].

    Args:
        at: Influence of the 2D drive without errors.
        drive: The drive with errors.

    Raises:
        ValueError: If the influence is not that of a 2D drive.
    """
    if at.supports is None:
        raise ValueError("the change of the outline needs a 2D influence")
    flawed = flawed_wave_generator(drive)
    centred = at.supports - wave_generator_offset(drive)
    recedes = flawed.signed_distance(centred)[0]
    return recedes - wave_generator(drive).signed_distance(at.supports)[0]


def _unloaded(
    rest: Rest,
    drives: Sequence[Design],
    errors: Sequence[tuple[Array, Array, Array]],
    rated: float,
) -> Array:
    """Unloaded psi, or the middle of its range if free (n, n_positions) [rad]."""
    loads = (0.0,) if rest.opposite is None else (SMALL * rated, -SMALL * rated)
    angles = [
        at.with_supports.respond(_gap_changes(at, drives, errors), load).output_angle
        for load, (_, at) in zip(loads, rest.sides, strict=False)
    ]
    return np.asarray(np.mean(angles, axis=0)).reshape(len(drives), -1)


def _gap_changes(
    at: Influence,
    drives: Sequence[Design],
    errors: Sequence[tuple[Array, Array, Array]],
) -> Array:
    """Gap changes of n teeth and k supports on the wave generator (n_sets, n + k) [m].

    The sets of errors are ordered by drive and then by position.
    """
    rows = []
    for drive, shifts in zip(drives, errors, strict=True):
        teeth = at.gap_change(*shifts)
        outline = np.tile(outline_change(at, drive), (len(teeth), 1))
        rows.append(np.concatenate([teeth, outline], axis=1))
    return np.concatenate(rows)


def stratified_numbers(count: int, wanted: int) -> Index:
    """Random numbers from 0 to count - 1, one in each of ``wanted`` equal parts.

    The random choice avoids aliasing. All numbers are used if no more are available.

    Args:
        count: Number of numbers to choose from.
        wanted: Number of parts.
    """
    if wanted >= count:
        return np.arange(count)
    inside = np.random.default_rng(0).uniform(size=wanted)
    return np.asarray((np.arange(wanted) + inside) * count / wanted, dtype=np.int64)
