"""Equilibria of a drive with manufacturing errors over the whole cycle of its teeth.

Errors of the circular spline repeat with alpha, those of the flexspline with beta; both
together after as many pitches as the least common multiple of the tooth counts, a turn
of the output or a part of it. Full solves would take hours: the drive is linearised at
a few positions within one pitch, and the errors of all pitches are superposed there.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import lcm, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.fe.continuation import Continuation
from swgjoint.fe.corotation import rotate
from swgjoint.fe.drive2d import ring_model
from swgjoint.fe.following import Follower
from swgjoint.fe.influence import Influence, Response
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_ring
from swgjoint.gear.design import Design, MemberName
from swgjoint.gear.kinematics import periodicity
from swgjoint.gear.tolerances import (
    ToothErrors,
    axis_tilt,
    has_errors,
    tooth_errors,
    with_perfect_teeth,
    without_errors,
)
from swgjoint.maps.samples import FullSolves, ToleranceSamples
from swgjoint.progress import Progress, silent

Array = NDArray[np.float64]
Index = NDArray[np.int64]

PHASES = 4
"""Positions within a pitch: what the errors add varies slowly within one."""
ALONE = 24
"""The same without errors of the teeth, where one pitch is all there is."""
POSITIONS = 40_000
"""Positions of the cycle, if that leaves two in a pitch: what two minutes allow."""
LEVELS = (0.15, 0.45, 1.0)
"""Sampled torques, of both signs, as parts of the repeated peak torque."""
SMALL = 0.01
"""Part of the rated torque of either sign between whose positions an output without
torque stands where clearance leaves it free."""
CHECKS = {"2d": 12, "3d": 3}
"""Positions that are solved without linearisation, too, to judge the map; in space one
takes half a minute."""
MEMBERS: tuple[MemberName, MemberName] = ("flexspline", "circular_spline")
FREE = 100.0
"""Compliance, in the median of all positions, from which the output counts as free."""


def pitches_of(design: Design) -> int:
    """Pitches after which errors of teeth and axis repeat; 1 without such errors."""
    shifts = [tooth_errors(design, member).shift for member in MEMBERS]
    counts = [len(shift) for shift in shifts if shift.any()]
    if axis_tilt(design).any() and design.drive.layout != "wave_generator_fixed":
        counts.append(round(2.0 * pi / pitch_of(design)))
    return lcm(*counts)


def pitch_of(design: Design) -> float:
    """Input angle after which the teeth stand alike [rad]."""
    drive = design.drive
    cycles = periodicity(
        drive.layout, drive.teeth_flexspline, drive.teeth_circular_spline
    )
    return 2.0 * pi / cycles


def shifted(errors: ToothErrors, pitches: Index, layout: str) -> Array:
    """Shifts of the teeth that stand where those of the first pitch stood.

    Args:
        errors: Of one member.
        pitches: Whole pitches that the input has moved on (n,).
        layout: Which member is fixed.

    Returns:
        In the frames of the teeth (n, n_teeth, 2) [m].
    """
    count = len(errors.shift)
    # the lobes move on to the next teeth; a wave generator that stands still sees the
    # teeth come from behind
    onwards = -pitches if layout == "wave_generator_fixed" else pitches
    return np.asarray(errors.shift[(np.arange(count) + onwards[:, None]) % count])


def gap_errors(design: Design, pitches: Index) -> tuple[Array, Array, Array]:
    """Shifts of both members' teeth and slope of the axis after whole pitches.

    As the first pitch sees them: (n, N, 2), (n, N_c, 2) [m], (n, 2) [rad].
    """
    own, other = (
        shifted(tooth_errors(design, member), pitches, design.drive.layout)
        for member in MEMBERS
    )
    return own, other, tilted(design, pitches)


def tilted(design: Design, pitches: Index) -> Array:
    """Slope of the axis, turned back with the wave generator to the first pitch.

    Args:
        design: The drive.
        pitches: Whole pitches that the input has moved on (n,).

    Returns:
        Shape (n, 2) [rad].
    """
    stands = design.drive.layout == "wave_generator_fixed"
    angle = np.asarray((0.0 if stands else -pitch_of(design)) * pitches, dtype=float)
    return rotate(axis_tilt(design), angle)


def perfect_drive(design: Design, model: str = "2d") -> Follower[Any]:
    """All of the drive, its teeth and its axis perfect, without friction."""
    perfect, layout = with_perfect_teeth(design), design.drive.layout
    if model == "3d":
        ring = solid_ring(perfect)
        return SolidContinuation(ring=ring, ratio=design.ratio, layout=layout)
    plane = ring_model(perfect, friction=False)
    return Continuation(model=plane, ratio=design.ratio, layout=layout)


def influences(
    design: Design, *, phases: int = PHASES, model: str = "2d"
) -> tuple[Follower[Any], list[tuple[Any, Influence]]]:
    """The drive with perfect teeth, unloaded and linearised at positions in a pitch.

    Errors of its wave generator turn with it, so that all pitches are alike.

    Args:
        design: The drive; errors of its wave generator are kept.
        phases: Positions, equally spaced.
        model: Fidelity, ``2d`` or ``3d``.

    Raises:
        ComputationError: If the unloaded drive cannot be solved.
    """
    drive, period = design.drive, pitch_of(design)
    follow = perfect_drive(design, model)
    state = follow.meshed(follow.deflected())
    if state.outcome.ok:
        state = follow.to_torque(state, 0.0)
    found = []
    for k in range(phases):
        if k:
            state = follow.to_angle(state, period * k / phases)
        if not state.outcome.ok:
            raise ComputationError(
                f"{drive.name}: no equilibrium without torque and errors:"
                f" {state.outcome.value}"
            )
        found.append((state, follow.influence(state)))
    return follow, found


def sample_tolerances(
    design: Design,
    *,
    repeated_peak: float,
    rated_torque: float,
    phases: int | None = None,
    model: str = "2d",
    progress: Progress = silent,
) -> ToleranceSamples:
    """Superposed equilibria over the cycle of the teeth.

    Args:
        design: A drive with errors of its teeth.
        repeated_peak: Largest torque [N·m].
        rated_torque: [N·m].
        phases: Positions within a pitch; fewer than usual for many pitches if None.
        model: Fidelity, ``2d`` or ``3d``.
        progress: Called with the stage, the positions done and their number.

    Raises:
        ComputationError: If the drive without errors or without torque, or a torque
            with errors cannot be solved.
    """
    drive = design.drive
    if phases is None:
        most = PHASES if pitches_of(design) > 1 else ALONE
        phases = int(np.clip(POSITIONS // pitches_of(design), 2, most))
    follow, linear = influences(design, phases=phases, model=model)
    reference = linear
    if has_errors(with_perfect_teeth(design)):
        perfect_design = without_errors(design)
        reference = influences(perfect_design, phases=phases, model=model)[1]
    pitches = np.arange(pitches_of(design), dtype=np.int64)
    errors = gap_errors(design, pitches)
    levels = np.array([part * repeated_peak for part in LEVELS])
    tables, perfect, free = [], [], 0
    for k, ((state, at), (still, flawless)) in enumerate(
        zip(linear, reference, strict=True)
    ):
        gaps, none = at.gap_change(*errors), np.zeros((1, len(flawless.sector)))
        found, count = _over_torque(at, gaps, levels, SMALL * rated_torque)
        if not np.isfinite(found).all():
            lost = np.isnan(found).any(axis=(0, 1)).sum()
            raise ComputationError(
                f"{drive.name}: no equilibrium with the errors of the teeth at {lost}"
                f" of {pitches.size} pitches; try smaller tolerances"
            )
        alone, _ = _over_torque(flawless, none, levels, SMALL * rated_torque)
        ideal = pitch_of(design) * k / phases / design.ratio
        for rows, energy in ((found, state.energy), (alone, still.energy)):
            rows[0] -= ideal
            rows[1] += energy
        tables.append(found)
        perfect.append(alone[:, :, 0])
        free += count
        progress(f"{drive.name}: tolerances", k + 1, phases)
    # (3, n_torques, n_pitches, n_phases)
    table = np.stack(tables, axis=-1)
    # spread over the cycle and the phases of a pitch
    count = pitches.size * phases
    checks = CHECKS[model]
    chosen = np.arange(checks) * (count // checks) + np.arange(checks) % phases
    states = [state for state, _ in linear]
    solved = full_solves(design, follow, states, chosen % count, (0.0, rated_torque))
    return ToleranceSamples(
        pitches=pitches.size,
        phases=phases,
        torque=np.concatenate([-levels[::-1], [0.0], levels]),
        table=table.reshape(*table.shape[:2], -1),
        perfect=np.stack(perfect, axis=-1),
        free=free,
        solved=solved,
    )


def full_solves(
    design: Design,
    follow: Follower[Any],
    states: list[Any],
    positions: Index,
    torques: Sequence[float],
) -> FullSolves:
    """Equilibria with errors at some positions of the cycle, without linearisation.

    Args:
        design: A drive with errors of its teeth.
        follow: The same without them.
        states: Its unloaded states at positions in a pitch.
        positions: Numbers of positions in the cycle, ``len(states)`` a pitch.
        torques: T at each of them [N·m].
    """
    rows = []
    step = pitch_of(design) / len(states)
    pitch, phase = np.divmod(positions, len(states))
    for k, errors in enumerate(zip(*gap_errors(design, pitch), strict=True)):
        flawed, state = follow.with_errors(*errors), states[phase[k]]
        for torque in torques:
            state = flawed.to_torque(state, torque)
            angle = flawed.output_angle(state) if state.outcome.ok else np.nan
            error = angle - step * phase[k] / follow.ratio
            rows.append(
                (step * positions[k], torque, error, follow.input_torque(state))
            )
    table = np.array(rows).T
    table = table[:, np.isfinite(table[2])]
    return FullSolves(
        input_angle=table[0],
        torque=table[1],
        output_error=table[2],
        input_torque=table[3],
    )


def _over_torque(
    at: Influence, gaps: Array, levels: Array, small: float
) -> tuple[Array, int]:
    """Output angle, strain energy, compliance at all torques (3, n_torques, n_sets).

    And the number of sets whose unloaded output is free.
    """

    def row(torque: float, response: Response) -> Array:
        energy = response.potential - torque * response.output_angle
        return np.stack([response.output_angle, energy, response.compliance])

    rest = at.respond(gaps, 0.0)
    unloaded = row(0.0, rest)
    # a few free positions leave the median as it is
    free = ~(rest.compliance < FREE * np.nanmedian(rest.compliance))
    if free.any():
        ends = [row(t, at.respond(gaps[free], t)) for t in (small, -small)]
        middle = 0.5 * (ends[0] + ends[1])
        middle[2] = 0.5 * (ends[1][0] - ends[0][0]) / small
        unloaded[:, free] = middle
    sides = []
    for sign in (-1.0, 1.0):
        active, rows = rest.active, []
        for level in levels:
            response = at.respond(gaps, sign * level, active)
            active = response.active
            rows.append(row(sign * level, response))
        sides.append(rows)
    table = [*sides[0][::-1], unloaded, *sides[1]]
    return np.stack(table, axis=1), int(free.sum())
