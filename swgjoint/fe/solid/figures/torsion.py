"""Torsion of the 3D drive under torque with the wave generator locked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import Bearing, solid_ring
from swgjoint.fe.solid.ring import SolidRing
from swgjoint.fe.solid.state import SolidState
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import mm

SMALL = 0.01
"""Part of the first torque that takes up the play."""


@dataclass(frozen=True, kw_only=True)
class SolidTorsion:
    """Equilibria over the torque, at one position with a lobe on a tooth.

    There the drive under the opposite torque is its mirror image (ball 0 stands on the
    lobe), so the mid-line of a loop begins at zero; with clearance of the teeth the
    loaded side begins at half the play.
    """

    torque: Array
    """T, increasing (n,) [N·m]."""
    torsion: Array
    """What is in series with cup and teeth included (n,) [rad]."""
    compliance: Array
    """Tangent, the same included (n,) [rad/(N·m)]."""
    tooth_centre: Array
    """Of the normal forces of the teeth along the axis, from the middle of the face
    width to the closed end, in face widths (n,)."""
    tooth_force: Array
    """Sum of these forces (n,) [N]."""
    bore_centre: Array
    """Of the forces of wave generator or race on the bore, as above (n,)."""
    balls: Array
    """Balls that carry load; 0 on a rigid wave generator (n,)."""
    half_play: float
    """Torsion at which the tangent at a hundredth of the first torque meets zero
    torque [rad]."""


def solid_torsion(
    design: Design,
    torques: Sequence[float],
    *,
    bearing: Bearing | None = None,
    progress: Progress = silent,
) -> SolidTorsion:
    """Load a drive in space.

    Args:
        design: The drive, with a cup.
        torques: T, positive and increasing [N·m].
        bearing: As in :func:`swgjoint.fe.solid.drive3d.solid_ring`. Half of the drive
            is solved where its symmetry allows.
        progress: Called after every torque.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
        ComputationError: If a solve fails.
    """
    ring = solid_ring(design, half="auto", bearing=bearing)
    follow = SolidContinuation(
        ring=ring, ratio=design.ratio, layout=design.drive.layout
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
                f"{design.drive.name}: no equilibrium in space at {torque:g} N·m:"
                f" {state.outcome.value}"
            )
        forces = state.tooth_force
        rows.append(
            [
                series * torque - follow.output_angle(state),
                state.compliance + series,
                _tooth_centre(ring, state) / width,
                ring.copies * float(forces.sum()),
                bore_centre(ring, state) / width,
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


def _tooth_centre(ring: SolidRing, state: SolidState) -> float:
    """Where the tooth forces act along the axis, on the average [m]."""
    if state.held is None:
        return float("nan")
    z = ring.strip.mesh.teeth.z[state.held.plane]
    return float(state.tooth_force @ z / state.tooth_force.sum())


def bore_centre(ring: SolidRing, state: SolidState) -> float:
    """Where the forces on the bore act along the axis, on the average [m]."""
    force = state.bore_force.reshape(ring.sectors, -1, 3)
    size = np.linalg.norm(force, axis=2)
    return float(np.sum(size * ring.strip.bore[:, 2]) / np.sum(size))
