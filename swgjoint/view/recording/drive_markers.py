"""Markers of the drives on the arm: a disc at every joint, coloured by its torque.

A disc is green at zero torque, yellow at half the repeated peak torque, and red at or
above the repeated peak torque. It is larger than the housing of the joint so that it
remains visible; its size is not that of the drive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.view.recording.columns import Column
from swgjoint.view.recording.geometry import quaternion_xyzw
from swgjoint.view.recording.paths import body_path, part_of_path

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.run import Run

RADIUS = 0.03
"""Smallest radius of a disc, also used if no housing is found [m]."""
PROUD = 1.12
"""Ratio of the radius of a disc to that of the housing [-]."""
WIDTH = 0.35
"""Ratio of the width of a disc to its radius [-]."""
_SCALE = np.array([[44, 160, 44], [240, 200, 30], [214, 39, 40]], dtype=float)


def log_drives(stream: Any, prefix: str, assembly: Assembly) -> None:
    """Log a disc for every driven joint, fixed to the body that the joint moves.

    Args:
        stream: Rerun recording stream.
        prefix: Path of the run with a trailing slash, or empty.
        assembly: The scene of the run.
    """
    import rerun as rr

    model = assembly.arm.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for name, path in zip(assembly.joints, _paths(prefix, assembly), strict=True):
        joint = model.joint(name).id
        radius = PROUD * housing_radius(model, data, joint)
        disc = rr.Cylinders3D(
            lengths=[WIDTH * radius],
            radii=[radius],
            fill_mode=rr.components.FillMode.Solid,
        )
        place = rr.Transform3D(
            translation=model.jnt_pos[joint],
            quaternion=rotation_to(model.jnt_axis[joint]),
        )
        stream.log(path, disc, place, static=True)


def send_loads(
    stream: Any, prefix: str, run: Run, time: Any, rows: NDArray[np.intp]
) -> None:
    """Send the colours of the discs at selected samples.

    Args:
        stream: Rerun recording stream.
        prefix: Path of the run with a trailing slash, or empty.
        run: The run.
        time: Time column of the rows.
        rows: Samples whose colour is recorded, shape (n,).
    """
    import rerun as rr

    for j, path in enumerate(_paths(prefix, run.assembly)):
        peak = run.assembly.transmissions[j].drive.ratings.repeated_peak
        share = np.abs(run.output_torque[rows, j]) / peak
        colors = load_color(share)
        column = Column(rr.Cylinders3D.descriptor_colors(), colors, np.uint32)
        stream.send_columns(path, indexes=[time], columns=[column])


def _paths(prefix: str, assembly: Assembly) -> list[str]:
    model = assembly.arm.model
    bodies = [model.body(model.joint(name).bodyid[0]).name for name in assembly.joints]
    return [
        f"{body_path(prefix, body)}/drive/{part_of_path(name)}"
        for body, name in zip(bodies, assembly.joints, strict=True)
    ]


def housing_radius(model: mujoco.MjModel, data: mujoco.MjData, joint: int) -> float:
    """Radius of the housing around a joint [m], at least ``RADIUS / PROUD``.

    It is the largest radius of the geoms of the moved body and its parent. Only
    cylinders and capsules that are coaxial with the joint and meshes count. The radius
    of a mesh is the median distance from the joint axis, taken over the vertices within
    1 cm of the joint along that axis.

    Args:
        model: Compiled model of the arm.
        data: Data of the model with the kinematics of any pose.
        joint: Index of the joint.
    """
    body = int(model.jnt_bodyid[joint])
    anchor, axis = data.xanchor[joint], data.xaxis[joint]
    radii = [RADIUS / PROUD]
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom] not in (body, model.body_parentid[body]):
            continue
        place, turn = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
        kind = int(model.geom_type[geom])
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            points = place + model.mesh_vert[first : first + count] @ turn.T - anchor
            along = points @ axis
            near = np.abs(along) < 0.01
            away = np.linalg.norm(points[near] - np.outer(along[near], axis), axis=1)
            radii += [float(np.median(away))] if away.size else []
        elif kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE):
            offset = place - anchor
            off = np.linalg.norm(offset - (offset @ axis) * axis)
            if abs(turn[:, 2] @ axis) > 0.99 and off < 0.005:
                radii.append(float(model.geom_size[geom, 0]))
    return max(radii)


def load_color(share: NDArray[np.float64]) -> NDArray[np.uint32]:
    """Colours of torques relative to the repeated peak as 0xRRGGBBAA. Shape (n,)."""
    place = np.clip(share, 0.0, 1.0)
    parts = [np.interp(place, [0.0, 0.5, 1.0], column) for column in _SCALE.T]
    red, green, blue = (np.rint(part).astype(np.uint32) for part in parts)
    return np.asarray((red << 24) | (green << 16) | (blue << 8) | np.uint32(255))


def rotation_to(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion (x, y, z, w) that rotates the z axis onto an axis. Shape (4,)."""
    wxyz = np.zeros(4)
    mujoco.mju_quatZ2Vec(wxyz, np.asarray(axis, dtype=float))
    return quaternion_xyzw(wxyz)
