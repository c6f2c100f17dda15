"""Output angles of a thin-ring drive with errors over an output turn, for lots.

The rings on their wave generator and bearing are linearised under each torque. The
errors of the teeth are superposed at positions of one output turn, as in
:mod:`swgjoint.fe.rings.tolerances`, which takes about two seconds per drive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.rings.accuracy import transmission_error
from swgjoint.fe.rings.influence import with_shifting_teeth
from swgjoint.fe.rings.loading import SMALL
from swgjoint.fe.rings.model import thin_ring
from swgjoint.fe.rings.passage import ball_passage
from swgjoint.fe.rings.tolerances import RingErrors, superpose
from swgjoint.fe.tolerances.cycle import gap_errors, pitch_of
from swgjoint.fe.tolerances.lot import POSITIONS, stratified_numbers
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import with_perfect_teeth
from swgjoint.gear.mounting import series_compliance
from swgjoint.typing import Array

CHECKS = 6
"""Number of positions of a drive that are solved without linearisation."""


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
    design: Design, torques: tuple[float, ...], *, positions: int = POSITIONS
) -> TurnOfDrive:
    """Output errors of a drive over one output turn, by superposition.

    Args:
        design: Drive with a bearing and errors; its axis is aligned.
        torques: Positive torques, increasing, above 1 % of the rated torque [N·m].
        positions: Number of input angles, see
            :func:`swgjoint.fe.tolerances.lot.sample_lot`.

    Raises:
        DesignError: If the rings lack a feature of the design.
        ComputationError: If an equilibrium of the drive with perfect teeth fails.
    """
    small = SMALL * ratings_of(design).rated_torque
    levels = np.array([small, *torques])
    turn = round(2.0 * np.pi * abs(design.ratio) / pitch_of(design))
    pitch = stratified_numbers(turn, positions)
    errors = gap_errors(design, pitch)
    model = with_shifting_teeth(thin_ring(with_perfect_teeth(design)))
    rings = RingErrors(
        design=design,
        passage=ball_passage(design, model),
        small=small,
        free=True,
    )
    phases = rings.phases.tolist()
    table = np.mean(
        [
            superpose(
                rings.linearise(model, phase, levels, errors), errors, levels, small
            )[0]
            for phase in phases
        ],
        axis=0,
    )
    torque = np.concatenate([-levels[::-1], [0.0], levels])
    series = series_compliance(design, cup=True)
    return TurnOfDrive(
        input_angle=np.asarray(pitch_of(design) * pitch, dtype=np.float64),
        torque=torque,
        output_error=table - series * torque[:, None],
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
    deviations = []
    for k in np.linspace(0, count - 1, min(CHECKS, count)).astype(int).tolist():
        angle = found.input_angle[k : k + 1]
        try:
            solved = [
                transmission_error(design, angle, torque=torque)
                for torque in (small, -small)
            ]
        except ComputationError:
            continue
        deviations.append(abs(np.mean(solved) - found.kinematic_error[k]))
    if not deviations:
        return None
    return float(max(deviations) / np.ptp(found.kinematic_error))
