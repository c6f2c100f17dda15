"""Entities of a recording.

If a recording contains several runs, ``<run>/`` precedes these entity paths:

=====================================  ============================================
``arm/<body>``                         pose in the world, at the scene's pose rate
``arm/<body>/<geom>``                  shape, static
``arm/<body>/drive/<joint>``           disc, coloured by torque over rating
``tool/path``                          commanded path of the tool, static
``joint/<joint>``                      signals of the joint, one component each:
  ``output_torque_Nm``                 torque of the drive on the link
  ``torque_deviation_Nm``              output torque minus that of the rigid arm
  ``motor_torque_Nm``                  torque of the motor within its limits
  ``torsion_arcmin``                   torsion of the drive
  ``transmission_error_arcmin``        output minus ideal output
  ``position_deg``                     link angle
  ``reference_deg``                    commanded link angle
  ``gauge_torque_Nm``                  torque that strain gauges read, if there are any
  ``temperature_C``                    temperature of the drive, if it warms
``joint/<joint>/ripple_orders``        ripple amplitude over order per input turn,
                                       static
``tool/error_mm``                      distance from the commanded path, or from the
                                       rigid arm if its run is in the recording
=====================================  ============================================

Signals are recorded at every step of the scene on the timeline ``time``. Outside the
paths of the runs, a recording contains the drive of one joint (see
:mod:`swgjoint.view.recording.drive_view`) and, below ``phase/<joint>``, a plot of
torque against torsion with a point at the current state of every run.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.sim.figures.metrics import torque_deviation
from swgjoint.typing import Array
from swgjoint.units import arcmin, deg, mm
from swgjoint.view.recording.blueprint import SPACING, has_torsion
from swgjoint.view.recording.columns import Column
from swgjoint.view.recording.drive_markers import log_drives, send_loads
from swgjoint.view.recording.drive_view import frames_of, log_drive, send_drive
from swgjoint.view.recording.geometry import quaternion_xyzw, shape_of
from swgjoint.view.recording.joint_pictures import (
    Scales,
    log_phase_axes,
    log_phase_ends,
    log_phase_path,
    log_phase_point,
    log_ripple,
    phase_points,
    ripple_bars,
    send_phase,
)
from swgjoint.view.recording.paths import (
    body_path,
    drive_path,
    joint_path,
    part_of_path,
    phase_path,
    prefix_of,
)

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.run import Run


TIMELINE = "time"
"""Name of the timeline; its values are simulated times."""
COLORS = ((31, 119, 180), (214, 96, 30), (110, 110, 110), (44, 140, 70))
"""RGB colours of the runs, also used in plots."""
LABEL_COLOR = 0xFAFAFAFF
"""Colour of the names below the arms, 0xRRGGBBAA."""


def signals_of(run: Run, j: int, part: slice = slice(None)) -> dict[str, Array]:
    """Signals of one joint by the names and in the units of the recording.

    Args:
        run: The run.
        j: Index of the joint.
        part: Samples to return; all by default.

    Returns:
        Arrays of shape (n_samples,).
    """
    reading, heat = run.gauge_torque(j), run.heat.get(run.joints[j])
    return {
        "output_torque_Nm": run.output_torque[part, j],
        "torque_deviation_Nm": torque_deviation(run, j, part),
        "motor_torque_Nm": run.motor_torque[part, j],
        "torsion_arcmin": run.torsion[part, j] / arcmin,
        "transmission_error_arcmin": run.transmission_error[part, j] / arcmin,
        "position_deg": run.position[part, j] / deg,
        "reference_deg": run.reference[part, j] / deg,
        **({} if reading is None else {"gauge_torque_Nm": reading[part]}),
        **({} if heat is None else {"temperature_C": heat.celsius_at(run.time[part])}),
    }


def signal(name: str) -> Any:
    """Descriptor of the component that contains one signal of :func:`signals_of`."""
    import rerun as rr

    return rr.ComponentDescriptor(name, component_type="rerun.components.Scalar")


def log_known(
    stream: Any, scenes: Mapping[str, Assembly], *, drives: Mapping[str, str]
) -> None:
    """Log what is known before the runs: labels, shapes, and styles of lines.

    Args:
        stream: Rerun recording stream.
        scenes: Scenes by name of the run.
        drives: Joint with a drawn drive by name of the run, from
            :func:`swgjoint.view.recording.drive_view.drives_shown`.
    """
    import rerun as rr

    for k, (label, assembly) in enumerate(scenes.items()):
        prefix, color = prefix_of(label), color_of_run(k)
        if len(scenes) > 1:
            # side by side, because an overlay would not show the small differences
            place = [0.0, SPACING * (0.5 * (len(scenes) - 1) - k), 0.0]
            stream.log(
                part_of_path(label), rr.Transform3D(translation=place), static=True
            )
            stream.log(
                f"{prefix}label",
                rr.Points3D(
                    [[0.0, 0.0, -0.06]],
                    radii=[0.001],
                    labels=[label],
                    colors=[LABEL_COLOR],
                    show_labels=True,
                ),
                static=True,
            )
        _log_shapes(stream, prefix, assembly)
        for joint, transmission in zip(
            assembly.joints, assembly.transmissions, strict=True
        ):
            style = _style(label or joint, color)
            stream.log(joint_path(joint, label), style, static=True)
            if has_torsion(transmission):
                log_phase_axes(stream, joint)
                log_phase_point(stream, phase_path(joint, label), color)
        if assembly.arm.tool >= 0:
            style = _style(label or "tool", color)
            stream.log(f"{prefix}tool/error_mm", style, static=True)
    for label, joint in drives.items():
        log_drive(stream, drive_path(joint, label), scenes[label], joint)


def log_measured(stream: Any, runs: Mapping[str, Run], scales: Scales) -> None:
    """Log static results of the runs: tool paths, spectra, torque against torsion.

    Args:
        stream: Rerun recording stream.
        runs: Runs by name.
        scales: From :func:`swgjoint.view.recording.joint_pictures.phase_scales`.
    """
    import rerun as rr

    for joint, of_joint in scales.items():
        if of_joint is not None:
            log_phase_ends(stream, joint, of_joint)
    for k, (label, run) in enumerate(runs.items()):
        prefix, color = prefix_of(label), color_of_run(k)
        if run.tool_reference.shape[1]:
            commanded = run.tool_reference[pose_rows(run)]
            strip = rr.LineStrips3D([commanded], colors=[color], radii=[0.0025])
            stream.log(f"{prefix}tool/path", strip, static=True)
        for j, joint in enumerate(run.joints):
            bars = ripple_bars(run, j)
            if bars is not None:
                log_ripple(stream, joint_path(joint, label), bars, color)
            if (of_joint := scales[joint]) is not None:
                path = phase_path(joint, label)
                log_phase_path(stream, path, run, j, of_joint, color)


def log_moving(
    stream: Any,
    runs: Mapping[str, Run],
    scales: Scales,
    *,
    drives: Mapping[str, str],
    rigid: Run | None = None,
    part: slice = slice(None),
) -> None:
    """Send what changes with time: signals, poses, drives, and loads of the joints.

    Args:
        stream: Rerun recording stream.
        runs: Runs by name.
        scales: From :func:`swgjoint.view.recording.joint_pictures.phase_scales`.
        drives: Joint with a drawn drive by name of the run, from
            :func:`swgjoint.view.recording.drive_view.drives_shown`.
        rigid: Run of the rigid arm to which tool errors refer; None for the commanded
            path.
        part: Samples to send; all by default.
    """
    import rerun as rr

    first = next(iter(runs.values()))
    time = rr.TimeColumn(TIMELINE, duration=first.time[part])
    inside = np.zeros(first.time.size, dtype=bool)
    inside[part] = True
    rows = pose_rows(first)
    rows = rows[inside[rows]]
    at_rows = rr.TimeColumn(TIMELINE, duration=first.time[rows])
    # the largest part first: rerun encodes it while the rest is prepared
    for label, run in runs.items():
        for j, joint in enumerate(run.joints):
            columns = [
                Column(signal(name), values, np.float64)
                for name, values in signals_of(run, j, part).items()
            ]
            stream.send_columns(
                joint_path(joint, label), indexes=[time], columns=columns
            )
    for label, joint in drives.items():
        run = runs[label]
        drawn = np.intersect1d(frames_of(run, joint, pose_rows(run)), rows)
        if drawn.size:
            at_drawn = rr.TimeColumn(TIMELINE, duration=run.time[drawn])
            path = drive_path(joint, label)
            send_drive(stream, path, run, joint, at_drawn, drawn)
    for label, run in runs.items():
        prefix = prefix_of(label)
        if rows.size:
            _send_poses(stream, prefix, run, at_rows, rows)
            send_loads(stream, prefix, run, at_rows, rows)
            for j, joint in enumerate(run.joints):
                if (of_joint := scales[joint]) is not None:
                    points = phase_points(run, j, of_joint, rows)
                    send_phase(stream, phase_path(joint, label), points, at_rows)
        if run.tool_position.shape[1]:
            error = run.tool_error(rigid)[part] / mm
            column = Column(rr.Scalars.descriptor_scalars(), error, np.float64)
            stream.send_columns(
                f"{prefix}tool/error_mm", indexes=[time], columns=[column]
            )


def color_of_run(k: int) -> int:
    """Colour of run number ``k`` as 0xRRGGBBAA, the form that rerun reads fastest."""
    return int.from_bytes(bytes((*COLORS[k % len(COLORS)], 255)), "big")


def _style(name: str, color: int) -> Any:
    import rerun as rr

    return rr.SeriesLines(
        names=[name],
        colors=[color],
        widths=[1.2],
        # averaging neighbours in a zoomed-out view would hide the ripple
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )


def _log_shapes(stream: Any, prefix: str, assembly: Assembly) -> None:
    """Log the shapes of the arm and its drives."""
    import rerun as rr

    model = assembly.arm.model
    for geom in range(model.ngeom):
        shape = shape_of(model, geom)
        if shape is None:
            continue
        body = model.body(model.geom_bodyid[geom]).name
        name = part_of_path(model.geom(geom).name or str(geom))
        path = f"{body_path(prefix, body)}/{name}"
        place = rr.Transform3D(
            translation=model.geom_pos[geom],
            quaternion=quaternion_xyzw(model.geom_quat[geom]),
        )
        stream.log(path, shape, place, static=True)
    log_drives(stream, prefix, assembly)


def _send_poses(
    stream: Any, prefix: str, run: Run, time: Any, rows: NDArray[np.intp]
) -> None:
    """Send poses of the bodies at selected samples; fixed bodies are static."""
    import rerun as rr

    arm, model = run.assembly.arm, run.assembly.arm.model
    places, turns = arm.body_poses(run.position[rows])
    for body in range(1, model.nbody):
        path = body_path(prefix, model.body(body).name)
        place, turn = places[:, body], quaternion_xyzw(turns[:, body])
        if model.body_weldid[body] == 0:
            pose = rr.Transform3D(translation=place[0], quaternion=turn[0])
            stream.log(path, pose, static=True)
            continue
        columns = [
            Column(rr.Transform3D.descriptor_translation(), place, np.float32),
            Column(rr.Transform3D.descriptor_quaternion(), turn, np.float32),
        ]
        stream.send_columns(path, indexes=[time], columns=columns)


def pose_rows(run: Run) -> NDArray[np.intp]:
    """Samples whose poses are recorded, with the first and last. Shape (n_poses,)."""
    scene = run.assembly.scene
    stride = round(1.0 / (scene.recording.pose_rate_Hz * scene.simulation.step_s))
    rows = np.arange(0, run.time.size, max(1, stride))
    return np.unique(np.append(rows, run.time.size - 1))
