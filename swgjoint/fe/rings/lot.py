"""Output angles of a thin-ring drive with errors over an output turn, for lots.

The rings on their wave generator and bearing are linearised under each torque. The
errors of the teeth are superposed at positions of one output turn, as in
:mod:`swgjoint.fe.rings.tolerances`, which takes about 0.4 CPU seconds per drive. The
search for the equilibria of a drive starts from those of the drive without errors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from swgjoint.fe.rings.influence import with_shifting_teeth
from swgjoint.fe.rings.loading import (
    SMALL,
    solve_loaded,
    solve_over_torque,
    solve_unloaded,
)
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.passage import ball_passage
from swgjoint.fe.rings.race_on_balls import RaceOnBalls
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.fe.rings.tolerances import RingErrors, superpose
from swgjoint.fe.tolerances.cycle import gap_changes, pitch_of
from swgjoint.fe.tolerances.lot import POSITIONS, stratified_numbers
from swgjoint.gear.bearing.checks import bearing_checks
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.check import raise_faults
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import with_perfect_teeth, without_errors
from swgjoint.gear.mounting import series_compliance
from swgjoint.typing import Array

CHECKS = 6
"""Number of positions of a drive that are solved without linearisation."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PerfectRings:
    """Equilibria without errors, from which the search for those of a lot starts."""

    model: ThinRing
    """Rings without errors."""
    loaded: Mapping[float, Mapping[float, ThinRingState]]
    """Equilibria by angle of ball 0 from the major axis [rad] and by torque [N·m]."""

    def with_errors(self, design: Design) -> ThinRing:
        """Rings of a drive of the lot with perfect teeth.

        Args:
            design: Drive that differs only in its tolerances and its bearing clearance,
                so that the stiffness of its rim and teeth is the same.

        Raises:
            DesignError: If the bearing cannot be built.
        """
        raise_faults(bearing_checks(design))
        bearing = RaceOnBalls.from_design(design, self.model.rim.elements)
        return replace(self.model, **vars(bearing))


def perfect_rings(design: Design, torques: tuple[float, ...]) -> PerfectRings:
    """Equilibria of a drive without errors under torques of both signs.

    Args:
        design: Design of the lot, with its errors; they determine the positions of the
            balls.
        torques: Positive torques of :func:`sample_turn`, increasing [N·m].

    Raises:
        DesignError: If the rings lack a feature of the design.
    """
    model = with_shifting_teeth(thin_ring(without_errors(design)))
    levels = _levels(design, torques)
    loaded = {}
    for phase in _rings_of(design, model, levels).phases.tolist():
        states = solve_over_torque(model, phase, levels)
        loaded[phase] = {
            torque: state
            for torque, state in states.items()
            if torque and state.outcome.ok
        }
    return PerfectRings(model=model, loaded=loaded)


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnOfDrive:
    """Output errors of one drive at P input angles of an output turn."""

    input_angle: Array
    """Input angles theta (P,) [rad]."""
    torque: Array
    """Torques of both signs and zero, increasing (n,) [N·m]."""
    output_error: Array
    """psi - theta/i, including the springs in series (n, P) [rad]; at zero torque the
    middle of the clearance, NaN where superposition finds no equilibrium."""

    @property
    def kinematic_error(self) -> Array:
        """Output error without torque (P,) [rad]."""
        return np.asarray(self.output_error[self.torque.size // 2])

    def torsion(self, torque: float) -> Array:
        """Half of the torsion between a torque and its opposite (P,) [rad].

        Args:
            torque: One of the positive torques [N·m].
        """
        n = int(np.argmin(np.abs(self.torque - torque)))
        return 0.5 * np.asarray(self.output_error[-1 - n] - self.output_error[n])


def sample_turn(
    design: Design,
    torques: tuple[float, ...],
    perfect: PerfectRings | None = None,
    *,
    positions: int = POSITIONS,
) -> TurnOfDrive:
    """Output errors of a drive over one output turn, by superposition.

    Args:
        design: Drive with a bearing and errors; its axis is aligned.
        torques: Positive torques, increasing, above 1 % of the rated torque [N·m].
        perfect: Drive without errors, from which the search for the equilibria starts.
            They are the same within the tolerance of the solver. None starts from
            undeformed rings.
        positions: Number of input angles, see
            :func:`swgjoint.fe.tolerances.lot.sample_lot`.

    Raises:
        DesignError: If the rings lack a feature of the design.
        ComputationError: If an equilibrium of the drive with perfect teeth fails.
    """
    levels = _levels(design, torques)
    turn = round(2.0 * np.pi * abs(design.ratio) / pitch_of(design))
    pitch = stratified_numbers(turn, positions)
    changes = partial(gap_changes, design=design, pitches=pitch)
    if perfect is None:
        model = with_shifting_teeth(thin_ring(with_perfect_teeth(design)))
    else:
        model = perfect.with_errors(design)
    nearby = {} if perfect is None else perfect.loaded
    rings = _rings_of(design, model, levels)
    tables = []
    for phase in rings.phases.tolist():
        rest = rings.linearise(model, phase, levels, nearby.get(phase))
        tables.append(superpose(rest, changes, levels, rings.small)[0])
    table = np.mean(tables, axis=0)
    torque = np.concatenate([-levels[::-1], [0.0], levels])
    series = series_compliance(design, cup=True)
    return TurnOfDrive(
        input_angle=np.asarray(pitch_of(design) * pitch, dtype=np.float64),
        torque=torque,
        output_error=table - series * torque[:, None],
    )


def _levels(design: Design, torques: tuple[float, ...]) -> Array:
    """Torque that takes up the clearance, and the others (n,) [N·m]."""
    return np.array([SMALL * ratings_of(design).rated_torque, *torques])


def _rings_of(design: Design, model: ThinRing, levels: Array) -> RingErrors:
    """Superposition of the errors of a drive."""
    return RingErrors(
        design=design,
        passage=ball_passage(design, model),
        small=float(levels[0]),
        free=True,
    )


def turn_superposition_error(design: Design, found: TurnOfDrive) -> float | None:
    """Largest deviation of the superposed kinematic error from solves of the rings.

    Args:
        design: The drive.
        found: Its superposed output errors.

    Returns:
        Deviation divided by the peak-to-peak kinematic error [-]; None if no position
        can be solved.
    """
    small = SMALL * ratings_of(design).rated_torque
    count = found.input_angle.size
    model, deviations = thin_ring(design), []
    for k in np.linspace(0, count - 1, min(CHECKS, count)).astype(int).tolist():
        theta = float(found.input_angle[k])
        rest = solve_unloaded(model, theta)
        sides = [solve_loaded(model, rest, torque) for torque in (small, -small)]
        if not all(side.outcome.ok for side in sides):
            continue
        error = np.mean([side.rotation for side in sides]) - theta / model.ratio
        deviations.append(abs(error - found.kinematic_error[k]))
    if not deviations:
        return None
    return float(max(deviations) / np.ptp(found.kinematic_error))
