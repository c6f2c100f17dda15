"""Torsion of the 3D drive under torque with a locked wave generator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import Bearing, solid_sector_model
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import mm

SMALL = 0.01
"""Torque that takes up the clearance, relative to the first torque [-]."""


@dataclass(frozen=True, kw_only=True)
class SolidTorsion:
    """Torsion curve of a drive with a lobe of the locked wave generator on a tooth.

    Ball 0, if there is a bearing, is on this lobe too. In this position the drive under
    the opposite torque is the mirror image of the drive. The torsion curve is therefore
    odd, and if the teeth have clearance it begins at half of the play.
    """

    torque: Array
    """Torques T, increasing (n,) [N·m]."""
    torsion: Array
    """Torsion, including that of the springs in series with cup and teeth (n,) [rad].
    """
    compliance: Array
    """Tangent compliance, including the springs in series (n,) [rad/(N·m)]."""
    tooth_centre: Array
    """Axial centre of the normal tooth forces in face widths, positive from mid-face
    towards the closed end (n,) [-]."""
    tooth_force: Array
    """Sum of the normal tooth forces of the whole drive (n,) [N]."""
    bore_centre: Array
    """Axial centre of the forces on the bore in face widths, positive from mid-face
    towards the closed end (n,) [-]."""
    balls: Array
    """Number of loaded balls; zero for a rigid wave generator (n,)."""
    half_play: float
    """Half of the play: torsion at 1 % of the first torque, extrapolated to zero torque
    with the tangent compliance [rad]."""


def solid_torsion(
    design: Design,
    torques: Sequence[float],
    *,
    bearing: Bearing | None = None,
    progress: Progress = silent,
) -> SolidTorsion:
    """Compute the torsion curve of a 3D drive.

    The half model is used if the symmetry of the drive allows it.

    Args:
        design: The drive, with a ``[cup]``.
        torques: Torques T of the output on its load, positive and increasing [N·m].
        bearing: Axial support of the outer race, see
            :func:`swgjoint.fe.solid.drive3d.solid_sector_model`; None for a rigid wave
            generator.
        progress: Called after every torque.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks.
        ComputationError: If a solve fails or the model does not fit in memory.
    """
    model = solid_sector_model(design, half="auto", bearing=bearing)
    follow = SolidContinuation(
        model=model, ratio=design.ratio, layout=design.drive.layout
    )
    state = follow.engage(follow.deflect())
    series = series_compliance(design, cup=False)
    width = design.drive.face_width_mm * mm
    rows = []
    for torque in (SMALL * torques[0], *torques):
        if state.outcome.ok:
            state = follow.to_torque(state, torque)
        if not state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: no equilibrium of the 3d model at {torque:g}"
                f" N·m: {state.outcome.value}"
            )
        forces = state.tooth_force
        rows.append(
            [
                series * torque - follow.output_angle(state),
                state.compliance + series,
                _tooth_centre(state) / width,
                model.copies * float(forces.sum()),
                bore_centre(model, state) / width,
                0 if state.ball_force is None else np.sum(state.ball_force > 0.0),
            ]
        )
        progress(f"{design.drive.name}: torque", len(rows), len(torques) + 1)
    torsion, compliance = rows[0][:2]
    table = np.array(rows[1:], dtype=float).T
    names = ("torsion", "compliance", "tooth_centre", "tooth_force", "bore_centre")
    return SolidTorsion(
        torque=np.asarray(torques, dtype=float),
        half_play=float(torsion - compliance * SMALL * torques[0]),
        **dict(zip((*names, "balls"), table, strict=True)),
    )


def _tooth_centre(state: SolidState) -> float:
    """Axial centre of the tooth forces [m]; NaN without tooth contact."""
    if state.held is None:
        return float("nan")
    return float(state.tooth_force @ state.held.z / state.tooth_force.sum())


def bore_centre(model: SolidSectorModel, state: SolidState) -> float:
    """Axial centre of the wave generator's forces on the bore [m].

    The forces are weighted with their magnitudes.

    Args:
        model: The 3D model.
        state: The equilibrium.
    """
    force = state.bore_force.reshape(model.sectors, -1, 3)
    size = np.linalg.norm(force, axis=2)
    return float(np.sum(size * model.strip.bore[:, 2]) / np.sum(size))
