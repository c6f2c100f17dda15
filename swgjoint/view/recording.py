"""Runs as a recording for the rerun viewer.

Entity paths, below ``<run>/`` where a recording holds several runs:

=====================================  ============================================
``arm/<body>``                         pose in the world, at the scene's pose rate
``arm/<body>/<geom>``                  shape, once
``tool/path``                          commanded path of the tool, once
``joint/<joint>/output_torque_Nm``     torque of the drive on the link
``joint/<joint>/torque_deviation_Nm``  the same less that of the rigid arm
``joint/<joint>/motor_torque_Nm``
``joint/<joint>/torsion_arcmin``
``joint/<joint>/transmission_error_arcmin``
``joint/<joint>/position_deg``         link
``joint/<joint>/reference_deg``        commanded
``tool/error_mm``                      distance from the commanded path, or from the
                                       rigid arm where the recording holds its run
=====================================  ============================================

Signals are at every step, on the timeline ``time``.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.sim.metrics import torque_deviation
from swgjoint.units import arcmin, deg, mm
from swgjoint.view.blueprint import SPACING, blueprint_of
from swgjoint.view.geometry import quaternion_xyzw, shape_of

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

Array = NDArray[np.float64]

TIMELINE = "time"
COLORS = ((31, 119, 180), (214, 96, 30), (110, 110, 110), (44, 140, 70))
"""One for each run, in pictures too."""
LABEL_COLOR = (250, 250, 250)


def write_recording(
    runs: Mapping[str, Run], path: str | Path, *, rigid: Run | None = None
) -> Path:
    """Write runs of one motion into one ``.rrd`` file, whole or not at all.

    Args:
        runs: Runs by the name that the viewer shows; a lone run may be called ``""``.
        path: File to write; its folder is made.
        rigid: The run that tool errors refer to; None for the commanded path.

    Returns:
        The path.
    """
    import rerun as rr

    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".rrd.part")
    os.close(handle)
    beside = Path(name)
    try:
        first = next(iter(runs.values()))
        stream = rr.RecordingStream(f"swgjoint {first.assembly.scene.name}")
        stream.save(beside, default_blueprint=blueprint_of(runs))
        for k, (label, run) in enumerate(runs.items()):
            _log_run(stream, label, run, k, len(runs), rigid)
        stream.flush()
        stream.disconnect()
        beside.chmod(0o644)
        os.replace(beside, path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            beside.unlink()
    return path


def signals_of(run: Run, j: int) -> dict[str, Array]:
    """Signals of one joint under the names and in the units of the recording."""
    return {
        "output_torque_Nm": run.output_torque[:, j],
        "torque_deviation_Nm": torque_deviation(run, j),
        "motor_torque_Nm": run.motor_torque[:, j],
        "torsion_arcmin": run.torsion[:, j] / arcmin,
        "transmission_error_arcmin": run.transmission_error[:, j] / arcmin,
        "position_deg": run.position[:, j] / deg,
        "reference_deg": run.reference[:, j] / deg,
    }


def _log_run(
    stream: Any, label: str, run: Run, k: int, count: int, rigid: Run | None
) -> None:
    import rerun as rr

    prefix = f"{label}/" if label else ""
    color = COLORS[k % len(COLORS)]
    if count > 1:
        # side by side: their differences are far below what an overlay could show
        place = [0.0, SPACING * (0.5 * (count - 1) - k), 0.0]
        stream.log(label, rr.Transform3D(translation=place), static=True)
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
    _log_arm(stream, prefix, run, color)
    for j, joint in enumerate(run.joints):
        for name, values in signals_of(run, j).items():
            path = f"{prefix}joint/{joint}/{name}"
            _send_scalars(stream, path, run.time, values, label or name, color)
    if run.tool_position.shape[1]:
        error = run.tool_error(rigid) / mm
        path = f"{prefix}tool/error_mm"
        _send_scalars(stream, path, run.time, error, label or "error_mm", color)


def _send_scalars(
    stream: Any,
    path: str,
    time: Array,
    values: Array,
    name: str,
    color: tuple[int, int, int],
) -> None:
    import rerun as rr

    line = rr.SeriesLines(
        names=[name],
        colors=[color],
        widths=[1.2],
        # zoomed out, a mean of neighbours would hide the ripple
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    stream.log(path, line, static=True)
    stream.send_columns(
        path,
        indexes=[rr.TimeColumn(TIMELINE, duration=time)],
        columns=rr.Scalars.columns(scalars=values),
    )


def _log_arm(stream: Any, prefix: str, run: Run, color: tuple[int, int, int]) -> None:
    """Shapes once, body poses over time, path of the tool."""
    import rerun as rr

    arm, model = run.assembly.arm, run.assembly.arm.model
    for geom in range(model.ngeom):
        shape = shape_of(model, geom)
        if shape is None:
            continue
        body = model.body(model.geom_bodyid[geom]).name
        path = f"{prefix}arm/{body}/{model.geom(geom).name or geom}"
        stream.log(path, shape, static=True)
        stream.log(
            path,
            rr.Transform3D(
                translation=model.geom_pos[geom],
                quaternion=quaternion_xyzw(model.geom_quat[geom]),
            ),
            static=True,
        )
    rows = pose_rows(run)
    places, turns = arm.body_poses(run.position[rows])
    for body in range(1, model.nbody):
        path = f"{prefix}arm/{model.body(body).name}"
        place, turn = places[:, body], quaternion_xyzw(turns[:, body])
        if model.body_weldid[body] == 0:  # fixed to the world
            pose = rr.Transform3D(translation=place[0], quaternion=turn[0])
            stream.log(path, pose, static=True)
            continue
        stream.send_columns(
            path,
            indexes=[rr.TimeColumn(TIMELINE, duration=run.time[rows])],
            columns=rr.Transform3D.columns(translation=place, quaternion=turn),
        )
    if run.tool_reference.shape[1]:
        stream.log(
            f"{prefix}tool/path",
            rr.LineStrips3D([run.tool_reference[rows]], colors=[color], radii=[0.0025]),
            static=True,
        )


def pose_rows(run: Run) -> NDArray[np.intp]:
    """Samples whose poses are recorded, first and last included. Shape (n_poses,)."""
    scene = run.assembly.scene
    stride = round(1.0 / (scene.recording.pose_rate_Hz * scene.simulation.step_s))
    rows = np.arange(0, run.time.size, max(1, stride))
    return np.unique(np.append(rows, run.time.size - 1))
