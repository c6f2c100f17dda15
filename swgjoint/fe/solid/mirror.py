"""Mirror image of a state: wave-generator angle and torque with opposite signs.

The mirror plane contains the axis of the drive and the middle of the first tooth of the
flexspline, so that sector s becomes sector -s. A half model continues as its first
sector rotated by 180 deg.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.tooth_rows import ToothRows
from swgjoint.typing import Array, Index

Kind = TypeVar("Kind", np.float64, np.bool_)

FLIP = np.array([-1.0, 1.0, 1.0])
"""Factors on x, y, z of mirrored vectors, in the frames of teeth and in the global
frame."""
CLOSE = 1e-6
"""Largest distance between masters and the mirror images of others, relative to the
radius [-]."""


def mirror_state(model: SolidSectorModel, state: SolidState) -> SolidState:
    """Mirror image of a state on a rigid wave generator.

    It is an equilibrium if the state is one and the wave generator has mirror symmetry.

    Args:
        model: The 3D model, without manufacturing errors and without a race.
        state: The state.
    """
    strip, n = model.strip, model.sectors
    sector, tooth = -np.arange(n) % n, -np.arange(model.teeth.circular_spline_teeth) - 1
    # masters: both faces of a sector swap, and a half model is rotated
    x = (model.masters(state) * FLIP)[sector][:, _mirror_masters(model)]
    x[1:] *= model.closure
    size, last = strip.masters.face_size, strip.masters.size - strip.masters.face_size
    # bore nodes and lines around the sector, plane after plane
    lines = state.shared.shape[1]

    def mirror_bore(values: NDArray[Kind]) -> NDArray[Kind]:
        return values.reshape(n, -1, lines)[sector, :, ::-1].reshape(n, -1)

    bore = state.bore_force.reshape(n, -1, lines, 3)[sector, :, ::-1] * FLIP
    held = None if state.held is None else _mirror_rows(model, state.held)
    return replace(
        state,
        faces=x[:, :size],
        inside=x[:, size:last],
        pressure=mirror_bore(state.pressure),
        touching=mirror_bore(state.touching),
        shared=mirror_bore(state.shared),
        bore_force=bore.reshape(n, -1),
        flank_force=_swap_flanks(state.flank_force[sector], strip.planes, 3),
        circular_spline_force=_swap_flanks(
            state.circular_spline_force[tooth], strip.planes, 2
        ),
        held=held,
        wave_generator_angle=-state.wave_generator_angle,
        rotation=-state.rotation,
        circular_spline_rotation=-state.circular_spline_rotation,
        torque=-state.torque,
        holding_torque=-state.holding_torque,
        wave_generator_torque=-state.wave_generator_torque,
        tooth_moment=-state.tooth_moment,
    )


def _mirror_masters(model: SolidSectorModel) -> Index:
    """Number of the master of a sector whose mirror image is at each master (n,)."""
    position = model.strip.masters.position
    apart = np.linalg.norm(position[:, None] * FLIP - position, axis=2)
    assert apart.min(axis=0).max() < CLOSE * np.abs(position).max()
    return np.asarray(apart.argmin(axis=0), dtype=np.int64)


def _swap_flanks(values: Array, planes: int, components: int) -> Array:
    """Mirrored vectors at flank nodes, the right flank before the left one (k, n_b).

    Args:
        values: The vectors, plane after plane (k, n_b).
        planes: Number of planes.
        components: Number of components of a vector.
    """
    apart = values.reshape(len(values), planes, 2, -1, components)
    return np.asarray((apart[:, :, ::-1] * FLIP[:components]).reshape(values.shape))


def _mirror_rows(model: SolidSectorModel, held: ToothRows) -> ToothRows:
    """Mirror images of tooth contacts."""
    contacts, planes = held.contacts, model.strip.planes
    sector = -contacts.sector % model.sectors
    masters = model.strip.teeth.masters
    place = np.searchsorted(masters, _mirror_masters(model)[masters])
    rows = held.rows.reshape(len(held), -1, 3)[:, place] * FLIP
    rows[sector != 0] *= model.closure
    flip = FLIP[:2]
    mirrored: Contacts = replace(
        contacts,
        sector=sector,
        side=1 - contacts.side,
        tooth=-(contacts.tooth + 1) % model.teeth.circular_spline_teeth,
        normal=contacts.normal * flip,
        point=contacts.point * flip,
        tangent=contacts.tangent * flip,
        weight=_swap_flanks(contacts.weight, 1, 2),
        circular_spline_weight=_swap_flanks(contacts.circular_spline_weight, 1, 2),
    )
    return replace(
        held,
        contacts=mirrored,
        weight=_swap_flanks(held.weight, planes, 3),
        circular_spline_weight=_swap_flanks(held.circular_spline_weight, planes, 2),
        rows=rows.reshape(held.rows.shape),
        arm=-held.arm,
        circular_spline_arm=-held.circular_spline_arm,
    )
