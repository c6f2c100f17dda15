"""Strain of the wall of a flexspline on its wave generator, from the 3D model.

The wave generator supports the rim where it touches, near the lobes and at the edges of
the face width, and not along its whole outline. The strain of the wall therefore
differs from that of a wall that follows the outline, see :mod:`swgjoint.gear.gauges`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.stress import flexspline_stresses
from swgjoint.fe.solid.strip.elasticity import COLUMNS, ROWS
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.material import Material
from swgjoint.gear.gauges import FlexsplineWall, WallStrain
from swgjoint.maps.cache import recall
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array, Complex

FIRST = 1e-9
"""Tolerance on positions of nodes [m]."""
HIGHEST = 36
"""Highest order around the flexspline [-]; contact makes higher orders than the outline
of the wave generator has."""


def deflected_strain(
    design: Design, place: float, *, progress: Progress = silent
) -> WallStrain:
    """Strain at the outside of the wall on a rigid wave generator, without torque.

    The shear per torque is that of :meth:`.FlexsplineWall.torsion_strain`. The
    equilibrium is kept in the cache.

    Args:
        design: The drive; it needs a ``[cup]``.
        place: Distance of the section from the outside of the closed end [m].
        progress: Called before, between and after the condensation of the flexspline
            and the search for its equilibrium.

    Raises:
        DesignError: If the 3D model cannot be built.
        ComputationError: If no equilibrium is found.
    """
    parts = {"figure": "deflected_wall", "design": design.content_hash()}
    found = recall("figures", parts, dict[str, Any], lambda: _solve(design, progress))
    rows = np.array(found["real"]) + 1j * np.array(found["imag"])
    x = np.array(found["place_m"])
    strain = np.array(
        [[np.interp(place, x, part) for part in one.T] for one in rows.swapaxes(0, 1)]
    )
    return WallStrain(
        torsion=FlexsplineWall.from_design(design).torsion_strain(),
        orders=np.array(found["orders"], float),
        hoop=strain[:, 0],
        axial=strain[:, 1],
        shear=strain[:, 2],
    )


def _solve(design: Design, progress: Progress) -> dict[str, Any]:
    stage = f"wall strain of {design.drive.name}"
    progress(stage, 0, 2)
    model = solid_sector_model(design, half="auto")
    progress(stage, 1, 2)
    state = SolidContinuation(model=model, ratio=design.ratio).deflect()
    progress(stage, 2, 2)
    orders = np.arange(model.copies, HIGHEST + 1, model.copies, dtype=float)
    x, rows = wall_orders(model, state, design.material_of("flexspline"), orders)
    return {
        "place_m": x.tolist(),
        "orders": orders.tolist(),
        "real": rows.real.tolist(),
        "imag": rows.imag.tolist(),
    }


def wall_orders(
    model: SolidSectorModel, state: SolidState, material: Material, orders: Array
) -> tuple[Array, Complex]:
    """Orders of circumferential, axial and shear strain around the wall.

    Args:
        model: The 3D model.
        state: An equilibrium with a lobe at the angle zero.
        material: Material of the flexspline.
        orders: Orders n around the flexspline, zero for the mean (m,).

    Returns:
        Distances of the rows of nodes from the outside of the closed end, increasing
        (k,) [m], and complex amplitudes (k, m, 3) [-].
    """
    stress = flexspline_stresses(model, state)
    segments = model.strip.segments
    closed = max(float(segment.mesh.mesh.p[2].max()) for segment in segments)
    turn = 2.0 * np.pi / model.strip.sectors * np.arange(model.sectors)
    found: dict[float, Complex] = {}
    for segment in segments[1:]:
        points = np.asarray(segment.mesh.mesh.p).T
        radius = np.hypot(points[:, 0], points[:, 1])
        outside = radius > radius.max() - FIRST
        outside[segment.mesh.last] = False  # the first face of the next sector
        depth = np.round(closed - points[:, 2], 9)
        rows = np.unique(depth[outside])
        if len(rows) < 2:
            continue  # no cylinder
        for x in rows:
            nodes = np.flatnonzero(outside & (depth == x))
            around = np.arctan2(-points[nodes, 0], points[nodes, 1])
            values = np.array(
                [
                    cylindrical_strain(one[nodes].astype(complex), around, material)
                    for one in stress[segment.name]
                ]
            )
            phi = turn[:, None] + around
            wave = np.exp(-1j * np.multiply.outer(orders, phi))
            mean = np.einsum("msk,skc->mc", wave, values) / phi.size
            found[float(x)] = np.where(np.asarray(orders) > 0, 2.0, 1.0)[:, None] * mean
    x = np.array(sorted(found))
    return x, np.array([found[one] for one in x.tolist()])


def cylindrical_strain(stress: Complex, phi: Array, material: Material) -> Complex:
    """Circumferential, axial and shear strain from stress (n, 3) [-].

    The shear is positive for a circumferential displacement that grows towards the
    open end, which is against z.

    Args:
        stress: Stress xx, yy, zz, xy, yz, zx in the frame of a tooth (n, 6) [Pa].
        phi: Angles around the flexspline in this frame (n,) [rad].
        material: Material of the flexspline.

    Returns:
        Circumferential, axial and shear strain (n, 3) [-].
    """
    tensor = np.empty((len(stress), 3, 3), complex)
    for k, (i, j) in enumerate(zip(ROWS, COLUMNS, strict=True)):
        tensor[:, i, j] = tensor[:, j, i] = stress[:, k]
    local = about_z(-phi) @ tensor @ about_z(phi)
    # at angle zero, x is against the circumferential direction and y points outwards
    around, out, along = local[:, 0, 0], local[:, 1, 1], local[:, 2, 2]
    modulus, poisson = material.youngs_modulus, material.poisson_ratio
    shear = 2.0 * (1.0 + poisson) / modulus * local[:, 0, 2]
    hoop = (around - poisson * (out + along)) / modulus
    return np.stack([hoop, (along - poisson * (out + around)) / modulus, shear], -1)
