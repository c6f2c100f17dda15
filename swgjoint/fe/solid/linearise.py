r"""Tangent of the ring with the wave generator's contact eliminated in every sector.

Contact points of a sector touch each other and the masters through the compliance C of
the toothed segment alone, so their forces are condensed sector by sector:

.. math:: \lambda = -W^{-1}(g + B\,\delta q + D F), \quad W = n^T C n,

with g the gaps as if the old forces were gone, B their derivative by the masters, F the
tooth forces. What remains is a ring of small matrices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.solid.corotation import (
    Frames,
    in_global,
    matrices_in_global,
    projected,
    spin,
    tangent,
)
from swgjoint.fe.solid.ring import SolidRing
from swgjoint.fe.solid.state import SolidState

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class BoreContact:
    """Contact points on the bore at one state; p of them in each sector."""

    gap: Array
    """(N, p) [m]."""
    normal: Array
    """Gradient of the gap in the frames of the teeth (N, p, 3)."""
    active: NDArray[np.bool_]
    """(N, p)."""
    rows: Array
    """B, by the masters of the teeth in the global frame (N, p, 3 m)."""
    free_gap: Array
    """g, gaps as if the old forces were gone (N, p) [m]."""
    compliance: Array
    """W of all points (N, p, p) [m/N]."""
    inverse: Array
    """W^-1 of the active points, zero elsewhere (N, p, p) [N/m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """Ring at one state; n = 3 masters."""

    frames: tuple[Frames, ...]
    gradient: Array
    """Derivative of the strain energy (N, n) [N]."""
    hessian: Array
    """With the condensed contact of the wave generator (N, n, n) [N/m]."""
    pushed: Array
    """B^T W^-1 g, forces of the wave generator on undisplaced masters (N, n) [N]."""
    bore: BoreContact


def linearise(ring: SolidRing, state: SolidState) -> Linearised:
    """Linearise a ring."""
    frames = ring.frames(state)
    n = 3 * ring.strip.masters.size
    gradient, pushed = np.zeros((2, ring.sectors, n))
    hessian = np.zeros((ring.sectors, n, n))
    bore = bore_contact(ring, state, frames[0])
    loads = ring.loads(state)
    for number, (segment, frame) in enumerate(
        zip(ring.strip.segments, frames, strict=True)
    ):
        dofs = (3 * segment.masters[:, None] + np.arange(3)).ravel()
        elastic = frame.deformation @ segment.stiffness
        total = elastic
        if number == 0:
            total = elastic - loads @ segment.loaded_from_masters
        gradient[:, dofs] += in_global(frame, projected(frame, elastic))
        local = matrices_in_global(frame, tangent(segment, frame, total))
        if number == 0:
            held = bore.inverse @ bore.rows
            local += bore.rows.transpose(0, 2, 1) @ held
            pushed[:, dofs] += np.einsum("spi,sp->si", held, bore.free_gap)
        hessian[:, dofs[:, None], dofs] += local
    return Linearised(
        frames=frames, gradient=gradient, hessian=hessian, pushed=pushed, bore=bore
    )


def bore_contact(ring: SolidRing, state: SolidState, frame: Frames) -> BoreContact:
    """Contact points of all sectors."""
    teeth, first = ring.strip.teeth, ring.strip.flank_dofs
    n, p = state.touching.shape
    local = ring.bore_positions(frame, state)
    points = np.einsum("sij,spj->spi", frame.turn, local)
    gap, normal, _ = ring.wave_generator.gap(
        points.reshape(-1, 3), state.wave_generator_angle
    )
    gap = gap.reshape(n, p)
    normal = np.einsum("sji,spj->spi", frame.turn, normal.reshape(n, p, 3))
    # by masters in the frame: carried by the teeth, and turned with the frame
    carry = teeth.loaded_from_masters[first:].reshape(p, 3, -1)
    carried = np.einsum("spi,pim->spm", normal, carry)
    m = frame.position.shape[1]
    middle = local - frame.centre[:, None] - teeth.position.mean(axis=0)
    turning = np.cross(middle, normal)
    s = -spin(frame.position).reshape(n, 3 * m, 3)
    turning -= np.einsum("spm,smw->spw", carried, s)
    rows = carried + np.einsum("spw,swm->spm", turning, frame.gradient)
    rows = np.einsum("sij,spaj->spai", frame.turn, rows.reshape(n, p, m, 3))
    compliance = teeth.compliance[first:, first:].reshape(p, 3, p, 3)
    seen = np.einsum("iajb,sjb->siaj", compliance, normal)
    w = np.einsum("sia,siaj->sij", normal, seen)
    moved = ring.loads(state) @ teeth.compliance[:, first:]
    old = np.einsum("spi,spi->sp", normal, moved.reshape(n, p, 3))
    active = state.touching
    on = active[:, :, None] & active[:, None, :]
    size = np.mean(np.einsum("spp->sp", w))
    safe = np.where(on, w, 0.0) + np.where(active, 0.0, size)[:, :, None] * np.eye(p)
    inverse = np.where(on, np.linalg.inv(safe), 0.0)
    return BoreContact(
        gap=gap,
        normal=normal,
        active=active,
        rows=rows.reshape(n, p, 3 * m),
        free_gap=gap - old,
        compliance=w,
        inverse=inverse,
    )
