r"""Tangent of the contact forces on the bore as far as the wave generator is curved.

Where the bore slides over a curved wave generator, or a race turns under it, the
contact forces follow the normal. A ring that rotates on a round wave generator meets no
resistance; without this term, its tangent has a rotational stiffness of minus the
moment sum :math:`\sum F \cdot a` of the forces F at their arms a.
"""

from __future__ import annotations

import numpy as np

from swgjoint.fe.solid.corotation import SolidFrames, spin
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.typing import Array


def sliding_tangent(
    model: SolidSectorModel,
    state: SolidState,
    frame: SolidFrames,
    place: Array,
    weight: Array,
    size: Array,
) -> Array:
    """Tangent of contact forces that follow the normals of the wave generator.

    Args:
        model: The 3D model.
        state: The state.
        frame: Frames of the toothed segments.
        place: Positions of the bore nodes in the frames, relative to the mean of the
            masters (N, b, 3) [m].
        weight: Weights of the bore nodes at the contact points, at least one (N, a,
            b) [-].
        size: Contact forces at these points (N, a) [N].

    Returns:
        Second derivatives of the potential of the forces by ``contact_dofs`` of the
        model (N, k, k) [N/m].
    """
    n, m = frame.position.shape[:2]
    teeth, count = model.strip.teeth, size.shape[1]
    carry = teeth.loaded_from_masters[model.strip.flank_dofs :]
    local = place + (frame.centre[:, None] + teeth.position.mean(axis=0))
    points = np.einsum("sij,spj->spi", frame.turn, local)
    # second derivative of the gaps by sliding, and by the turn of a race
    if model.race is not None and state.race is not None:
        form, along, by_race = model.race.bend_gap(
            state.race, points, model.bore_places
        )
    else:
        _, normal, curvature = model.wave_generator.gap(
            points.reshape(-1, 3), state.wave_generator_angle
        )
        form, by_race = curvature[:, None, None], np.zeros((n, place.shape[1], 1, 0))
        along = np.stack([-normal[:, 1], normal[:, 0], 0.0 * normal[:, 2]], axis=-1)
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
    kinds = form.shape[-1]
    form = weight @ form.reshape(n, -1, kinds**2)
    form = -size[..., None] * form
    # sliding by the masters: deformation and rotation of the frames
    along = along.reshape(place.shape) @ frame.turn
    push = (weight[..., None] * along[:, None]).reshape(n * count, -1)
    carried = (push @ carry).reshape(n, count, 3 * m)
    spun = spin(frame.position).reshape(n, 3 * m, 3)
    rows = carried + (weight @ np.cross(place, along) + carried @ spun) @ frame.gradient
    rows = rows.reshape(n, count * m, 3) @ frame.turn.transpose(0, 2, 1)
    moved = np.zeros((n, count, kinds, 3 * m + by_race.shape[-1]))
    moved[:, :, 0, : 3 * m] = rows.reshape(n, count, 3 * m)
    moved[..., 3 * m :] = (weight @ by_race.reshape(n, place.shape[1], -1)).reshape(
        n, count, kinds, -1
    )
    form = form.reshape(n, count, kinds, kinds, 1)
    weighted = (form * moved[:, :, None]).sum(axis=3)
    flat = (n, count * kinds, moved.shape[-1])
    return np.asarray(moved.reshape(flat).transpose(0, 2, 1) @ weighted.reshape(flat))
