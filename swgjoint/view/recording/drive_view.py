"""Drawing of a drive during a run: flexspline with stress and contact forces.

The fields of the map are interpolated to the recorded angles and torque; no finite
elements are solved. The deflection is drawn to scale. At most :data:`FRAMES` frames
cover a run of any length, so that a recording stays small.

=================================  ================================================
``drive/<joint>/<run>/flexspline``  surface, coloured by the von Mises stress
``.../tooth``                       dot on one tooth that shows the rotation
``.../circular_spline``             outline
``.../wave_generator``              outline
``.../scale``                       label with the stress range of the colours
``.../tooth_forces``                forces of the circular spline on the flexspline
``.../bore_forces``                 forces of the wave generator on the flexspline
=================================  ================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.fields import DriveFields, FlexsplineShape, Table
from swgjoint.typing import Array
from swgjoint.units import MPa
from swgjoint.view.recording.columns import Column

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.run import Run


FRAMES = 100
"""Largest number of frames of one drive in a recording."""
BYTES = 6_000_000
"""Approximate upper bound of the size of one drive in a recording [bytes]. A drive with
two identical lobes takes half of it."""
ARROW = 0.2
"""Ratio of the length of the largest force arrow to the radius of the flexspline [-].
"""
LIFT = 0.004
"""Distance by which outlines and forces are drawn in front of the flexspline, relative
to its radius [-]."""


def drives_shown(scenes: Mapping[str, Assembly], joints: list[str]) -> dict[str, str]:
    """Select the joint whose drive is drawn: the first one whose map has fields.

    Args:
        scenes: Scenes by name of the run.
        joints: Names of the joints in order of preference.

    Returns:
        That joint, by name of every run in which its map has fields; empty if no map
        has fields.
    """
    for joint in joints:
        shown = {
            label: joint
            for label, assembly in scenes.items()
            if fields_of(assembly, joint) is not None
        }
        if shown:
            return shown
    return {}


def fields_of(assembly: Assembly, joint: str) -> DriveFields | None:
    """Fields of the drive of a joint.

    Args:
        assembly: The scene.
        joint: Name of the joint.

    Returns:
        The fields; None if the map has no fields or the joint is rigid.
    """
    transmission = assembly.transmissions[assembly.joints.index(joint)]
    return None if transmission.level == "rigid" else transmission.drive.fields


def frames_of(run: Run, joint: str, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Select the samples at which the drive is drawn.

    Args:
        run: The run.
        joint: Name of a joint whose drive has fields.
        rows: Samples at which the arm is drawn, shape (n,).

    Returns:
        Equally spaced elements of ``rows``, at most :data:`FRAMES`; fewer if the
        recording would otherwise exceed :data:`BYTES`.
    """
    fields = fields_of(run.assembly, joint)
    assert fields is not None
    teeth = run.assembly.transmissions[run.joints.index(joint)].drive.teeth_flexspline
    each = teeth * (16 * len(fields.points) + 48)
    count = max(2, min(FRAMES, BYTES // each))
    every = -(-len(rows) // count)
    return rows[::every]


def angles(layout: str, theta: Array, psi: Array) -> tuple[Array, Array, Array]:
    """Rotations of flexspline, circular spline and wave generator, in this sequence.

    Args:
        layout: Layout of the drive, which names the fixed member.
        theta: Rotation of the input relative to the fixed member [rad].
        psi: Rotation of the output relative to the fixed member [rad].

    Returns:
        Rotations relative to the fixed member [rad], each of the shape of ``theta``.
    """
    still = np.zeros_like(theta)
    return {
        "circular_spline_fixed": (psi, still, theta),
        "flexspline_fixed": (still, psi, theta),
        "wave_generator_fixed": (theta, psi, still),
    }[layout]


def log_drive(stream: Any, path: str, assembly: Assembly, joint: str) -> None:
    """Log the static entities of a drive: mesh, outlines, colours and styles.

    Args:
        stream: Rerun recording stream.
        path: Entity path of the drive, from
            :func:`swgjoint.view.recording.paths.drive_path`.
        assembly: The scene.
        joint: Name of a joint whose drive has fields.
    """
    import rerun as rr

    _turbo()  # load the colour map while the engine is still computing
    drive = assembly.transmissions[assembly.joints.index(joint)].drive
    fields = drive.fields
    assert fields is not None
    parts, n = fields.repeats(drive.teeth_flexspline), len(fields.points)
    turns = 2.0 * np.pi / parts * np.arange(parts, dtype=float)
    teeth = drive.teeth_flexspline // parts
    triangles = (fields.triangles + n * np.arange(teeth)[:, None, None]).reshape(-1, 3)
    z = front_planes(fields)
    stream.log(
        f"{path}/flexspline",
        rr.Mesh3D.from_fields(triangle_indices=triangles.astype(np.uint32)),
        rr.InstancePoses3D(quaternions=about_z(turns)),
        static=True,
    )
    top = float(fields.von_mises.max()) / MPa
    stream.log(
        f"{path}/scale",
        rr.Points3D(
            [[0.0, 0.0, z]],
            radii=[rr.Radius.ui_points(0.5)],
            colors=[0xFAFAFAFF],
            labels=[f"von Mises stress: blue 0, red {top:.0f} MPa"],
            show_labels=True,
        ),
        static=True,
    )
    count = drive.teeth_circular_spline
    around = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    ring = np.concatenate([rotate_points(fields.circular_spline, a) for a in around])
    white = 0xFFFFFFFF
    tooth = rr.Points3D.from_fields(radii=[0.015 * radius(fields)], colors=[white])
    stream.log(f"{path}/tooth", tooth, static=True)
    for name, arrow in (("tooth_forces", 0xFFC832FF), ("bore_forces", 0x50DCA0FF)):
        style = rr.Arrows3D.from_fields(colors=[arrow])
        stream.log(f"{path}/{name}", style, static=True)
    for name, outline, color in (
        ("circular_spline", ring, 0x6E96E6FF),
        ("wave_generator", fields.wave_generator, 0xE6E6E6FF),
    ):
        closed = np.concatenate([outline, outline[:1]])
        points = np.concatenate([closed, np.full((len(closed), 1), z)], axis=1)
        stream.log(
            f"{path}/{name}",
            rr.LineStrips3D([points], colors=[color], radii=[rr.Radius.ui_points(0.5)]),
            static=True,
        )


def send_drive(
    stream: Any,
    path: str,
    run: Run,
    joint: str,
    time: Any,
    rows: NDArray[np.intp],
) -> None:
    """Send the parts of a drive that change with time.

    Args:
        stream: Rerun recording stream.
        path: Entity path of the drive, from
            :func:`swgjoint.view.recording.paths.drive_path`.
        run: The run.
        joint: Name of a joint whose drive has fields.
        time: Time column of the rows.
        rows: Samples from :func:`frames_of`.
    """
    import rerun as rr

    j = run.joints.index(joint)
    drive = run.assembly.transmissions[j].drive
    fields = drive.fields
    assert fields is not None
    theta, psi = run.motor_position[rows, j], run.position[rows, j]
    flexspline, circular, wave = angles(drive.layout, theta, psi)
    torque = run.output_torque[rows, j]
    parts = fields.repeats(drive.teeth_flexspline)
    shape = fields.flexspline(
        drive.teeth_flexspline, flexspline, wave, torque, parts=parts
    )
    colors = stress_color(shape.von_mises / np.float32(fields.von_mises.max()))
    each = colors[0].size
    positions = rr.Mesh3D.descriptor_vertex_positions()
    stream.send_columns(
        f"{path}/flexspline",
        indexes=[time],
        columns=[
            Column(positions, shape.points.reshape(-1, 3), np.float32, each=each),
            Column(
                rr.Mesh3D.descriptor_vertex_colors(),
                colors.ravel(),
                np.uint32,
                each=each,
            ),
        ],
    )
    # the tip of the tooth that is on the +y axis at rest
    tip = int(np.hypot(*fields.points[:, :2].T).argmax())
    place = Column(
        rr.Points3D.descriptor_positions(), shape.points[:, 0, tip], np.float32
    )
    stream.send_columns(f"{path}/tooth", indexes=[time], columns=[place])
    for name, turn in (("circular_spline", circular), ("wave_generator", wave)):
        column = Column(
            rr.Transform3D.descriptor_quaternion(), about_z(turn), np.float32
        )
        stream.send_columns(f"{path}/{name}", indexes=[time], columns=[column])
    _send_forces(stream, path, fields, shape, time, parts)


def _send_forces(
    stream: Any,
    path: str,
    fields: DriveFields,
    shape: FlexsplineShape,
    time: Any,
    parts: int,
) -> None:
    """Send force arrows at tooth tips and bore, to one scale, without axial parts."""
    import rerun as rr

    largest = max(
        float(np.linalg.norm(part, axis=-1).max())
        for part in (fields.tooth_force, fields.wave_generator_force)
    )
    scale = ARROW * radius(fields) / max(largest, 1e-9)
    distance, z = np.hypot(*fields.points[:, :2].T), front_planes(fields)
    edge = fields.points[:, 2] == fields.points[:, 2].min()
    outer = np.where(edge, distance, -np.inf).argmax()
    inner = np.where(edge, distance, np.inf).argmin()
    for name, node, forces in (
        ("tooth_forces", outer, shape.tooth_force),
        ("bore_forces", inner, shape.wave_generator_force),
    ):
        vectors = all_around(np.float32(scale) * forces, parts)
        vectors[..., 2] = 0.0
        # the tip of an arrow is at the point of application
        origins = all_around(shape.points[:, :, node], parts) - vectors
        origins[..., 2] = z
        teeth = vectors.shape[1]
        stream.send_columns(
            f"{path}/{name}",
            indexes=[time],
            columns=[
                Column(descriptor, values.reshape(-1, 3), np.float32, each=teeth)
                for descriptor, values in (
                    (rr.Arrows3D.descriptor_origins(), origins),
                    (rr.Arrows3D.descriptor_vectors(), vectors),
                )
            ],
        )


def eye(fields: DriveFields) -> Any:
    """Camera that looks along the axis, or obliquely into the open end of a cup."""
    import rerun.blueprint as rrb

    side, r = float(np.sign(front_planes(fields))), radius(fields)
    # oblique for a cup, to show its depth
    down = -0.6 * r if side < 0.0 else 0.0
    return rrb.EyeControls3D(
        position=[0.0, down, side * 1.9 * r],
        look_target=[0.0, 0.0, 0.0],
        eye_up=[0.0, 1.0, 0.0],
    )


def front_planes(fields: DriveFields) -> float:
    """Coordinate z of the plane in which outlines and forces are drawn [m].

    The plane is slightly in front of the open edge of a cup, or slightly above a 2D
    model. The distance is so small that no visible offset appears in an oblique view.
    """
    z = fields.points[:, 2]
    flat = float(np.ptp(z)) == 0.0
    return float(LIFT * radius(fields) if flat else z.min() - LIFT * radius(fields))


def radius(fields: DriveFields) -> float:
    """Largest radius of the flexspline at rest [m]."""
    return float(np.hypot(*fields.points[:, :2].T).max())


def rotate_points(points: Array, angle: float) -> Array:
    """Rotate points in the x-y plane about the z axis.

    Args:
        points: Points of shape (..., 2), in any unit.
        angle: Angle of rotation, counter-clockwise positive [rad].
    """
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))


def all_around(vectors: Table, parts: int) -> Table:
    """Repeat the vectors of one sector in all sectors of the full circle.

    Args:
        vectors: Vectors of the first sector, shape (n, n_teeth / parts, 3).
        parts: Number of identical sectors.

    Returns:
        Vectors of all sectors, shape (n, n_teeth, 3).
    """
    turns = 2.0 * np.pi / parts * np.arange(parts, dtype=float)
    around = [vectors.copy() for _ in turns]
    for part, angle in zip(around, turns, strict=True):
        part[..., :2] = rotate_points(part[..., :2].astype(float), angle)
    return np.concatenate(around, axis=1)


def about_z(angle: Array) -> Array:
    """Quaternions (x, y, z, w) of rotations about the z axis [rad]. Shape (n, 4)."""
    half, still = 0.5 * angle, np.zeros_like(angle)
    return np.stack([still, still, np.sin(half), np.cos(half)], axis=-1)


def stress_color(share: NDArray[np.floating[Any]]) -> NDArray[np.uint32]:
    """Colours of stresses relative to the largest one as 0xRRGGBBAA.

    The result has the shape of ``share``, the ratio of stress to largest stress [-].
    """
    return np.asarray(_turbo()[np.clip(256.0 * share, 0.0, 255.0).astype(np.uint8)])


@cache
def _turbo() -> NDArray[np.uint32]:
    """Colour map ``turbo`` from the smallest to the largest value. Shape (256,)."""
    from matplotlib import colormaps

    rgba = colormaps["turbo"](np.arange(256) / 255.0, bytes=True).astype(np.uint32)
    return np.asarray((rgba[:, 0] << 24) | (rgba[:, 1] << 16) | (rgba[:, 2] << 8) | 255)
