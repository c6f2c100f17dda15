"""Two opposite pads in the bore that prescribe the lobe height with teeth in contact.

If forces were prescribed instead, contact of the teeth would reduce the deflection.
Each pad covers one pitch of the bore and prescribes in every plane the deflection that
the forces of two lobes cause without tooth contact. The solver of the drive then finds
the contacts. The force that the teeth carry is the difference between the forces of a
pad with and without tooth contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.solid.across import spread_forces
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.wave_generator.surface import WaveGeneratorSurface
from swgjoint.typing import Array

NEAR = 0.49
"""Half of the width of a pad [pitches]; the pad covers the bore nodes of one tooth."""
AWAY = 1.0
"""Gap of points outside the pads [m]; any value that prevents contact would do."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LobePads(WaveGeneratorSurface):
    """Two cylindrical pads on the y axis, in the mesh planes that carry a load."""

    planes: Array
    """Coordinates z of the loaded planes (n,) [m]."""
    radius: Array
    """Radii of the pads in these planes, from the axis of the drive (n,) [m]."""
    half: float
    """Half of the width of a pad along x [m]."""
    reach: float
    """Half of the length of a pad along z on either side of each plane [m]."""

    def gap(self, points: Array, alpha: float) -> tuple[Array, Array, Array]:
        """Gap, its gradient and curvature, as in :meth:`WaveGeneratorSurface.gap`.

        Args:
            points: Positions in the global frame (n, 3) [m].
            alpha: Angle of the wave generator [rad]; unused, the pads do not rotate.
        """
        x, y, z = points.T
        radius = np.hypot(x, y)
        away = np.abs(z[:, None] - self.planes)
        on = (away.min(axis=1) < self.reach) & (np.abs(x) < self.half)
        normal = np.stack([x / radius, y / radius, np.zeros(len(x))], axis=-1)
        gap = np.where(on, radius - self.radius[away.argmin(axis=1)], AWAY)
        return gap, normal, np.where(on, 1.0 / radius, 0.0)


def with_pads(
    model: SolidSectorModel, share: Array, deflection: Array
) -> SolidSectorModel:
    """The same model with pads instead of its wave generator.

    Args:
        model: Half model of the drive.
        share: Share of the load in every plane (n_planes,) [-], see
            :meth:`swgjoint.fe.solid.figures.pinched_cup.PinchedCup.share`.
        deflection: Deflection of the lobe in every plane (n_planes,) [m].
    """
    bore = float(np.hypot(model.strip.bore[:, 0], model.strip.bore[:, 1]).min())
    z, loaded = model.strip.mesh.teeth.z, share > 0.0
    # contact acts on displacements that are averaged over patches
    deflection = spread_forces(z, 1).T @ deflection
    pads = LobePads(
        outline=model.wave_generator.outline,
        width=model.wave_generator.width,
        planes=z[loaded],
        radius=bore + deflection[loaded],
        half=NEAR * 2.0 * np.pi * bore / model.strip.sectors,
        reach=0.25 * float(np.diff(z).min()),
    )
    height = float(share @ deflection)
    return replace(model, wave_generator=pads, lobe_height=height)


def force_on_teeth(
    model: SolidSectorModel, ratio: float, share: Array, deflection: Array
) -> float:
    """Part of the force of a lobe that the teeth carry [N].

    Args:
        model: Half model of the drive.
        ratio: Signed ratio i [-].
        share: Share of the load in every plane (n_planes,) [-].
        deflection: Deflection of the lobe in every plane (n_planes,) [m].

    Raises:
        ComputationError: If a solve fails.
    """
    padded = with_pads(model, share, deflection)
    follow = SolidContinuation(model=padded, ratio=ratio)
    alone = _checked(follow.deflect(), padded.lobe_height)
    meshed = _checked(follow.engage(alone), padded.lobe_height)
    return pad_force(padded, meshed) - pad_force(padded, alone)


def pad_force(model: SolidSectorModel, state: SolidState) -> float:
    """Outward force of one pad on the flexspline [N].

    Args:
        model: Half model with pads, which contains one pad.
        state: Its equilibrium.
    """
    turn = model.frames(state)[0].turn
    force = state.bore_force.reshape(model.sectors, -1, 3)
    return float(np.einsum("sj,spj->", turn[:, 1], force))


def _checked(state: SolidState, height: float) -> SolidState:
    if not state.outcome.ok:
        raise ComputationError(
            f"lobe height = {1e3 * height:.4g} mm: {state.outcome.value}"
        )
    return state
