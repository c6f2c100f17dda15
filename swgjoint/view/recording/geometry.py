"""Geometry of an arm: geoms of the compiled MuJoCo model as rerun archetypes."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

_GEOM = mujoco.mjtGeom


def shape_of(model: mujoco.MjModel, geom: int) -> Any | None:
    """Convert a geom to a rerun archetype in the frame of the geom.

    Cylinders, capsules, spheres, ellipsoids, boxes and meshes are converted. Planes and
    height fields belong to the surroundings and are not drawn.

    Args:
        model: Compiled model of the arm.
        geom: Index of the geom.

    Returns:
        The archetype; None for any other kind of geom.
    """
    import rerun as rr

    size, color = model.geom_size[geom], color_of(model, geom)
    solid = {"colors": [color], "fill_mode": rr.components.FillMode.Solid}
    match int(model.geom_type[geom]):
        case _GEOM.mjGEOM_CYLINDER:
            return rr.Cylinders3D(lengths=[2.0 * size[1]], radii=[size[0]], **solid)
        case _GEOM.mjGEOM_CAPSULE:
            # a rerun capsule starts at its origin, a MuJoCo capsule is centred on it
            return rr.Capsules3D(
                lengths=[2.0 * size[1]],
                radii=[size[0]],
                translations=[[0.0, 0.0, -size[1]]],
                **solid,
            )
        case _GEOM.mjGEOM_BOX:
            return rr.Boxes3D(half_sizes=[size], **solid)
        case _GEOM.mjGEOM_SPHERE:
            return rr.Ellipsoids3D(half_sizes=[[size[0]] * 3], **solid)
        case _GEOM.mjGEOM_ELLIPSOID:
            return rr.Ellipsoids3D(half_sizes=[size], **solid)
        case _GEOM.mjGEOM_MESH:
            return _mesh(model, int(model.geom_dataid[geom]), color)
    return None


def color_of(model: mujoco.MjModel, geom: int) -> int:
    """Colour of a geom as 0xRRGGBBAA, taken from its material if it has one.

    Args:
        model: Compiled model of the arm.
        geom: Index of the geom.
    """
    material = int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    parts = np.rint(255.0 * np.clip(rgba, 0.0, 1.0)).astype(np.uint8)
    return int.from_bytes(parts.tobytes(), "big")


def quaternion_xyzw(wxyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reorder MuJoCo quaternions (w, x, y, z) to (x, y, z, w). Shape (..., 4)."""
    return np.roll(wxyz, -1, axis=-1)


def _mesh(model: mujoco.MjModel, mesh: int, color: int) -> Any:
    import rerun as rr

    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return rr.Mesh3D(
        vertex_positions=model.mesh_vert[first : first + count],
        triangle_indices=model.mesh_face[face : face + faces],
        albedo_factor=color,
    )
