"""Recordings of episodes for the rerun viewer.

Entity paths are ``arm/<body>`` for shapes and poses of the bodies at 50 Hz,
``<figure>/<joint>`` for the values of ``info`` at every step (``<figure>`` for values
that are not per joint), and ``reward``. The timeline is ``time``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

from swgjoint.envs.api import SingleEnv
from swgjoint.errors import InputError
from swgjoint.typing import Array
from swgjoint.view.recording.columns import Column
from swgjoint.view.recording.geometry import quaternion_xyzw, shape_of
from swgjoint.view.recording.recording import (
    begin_stream,
    end_stream,
    recording_file,
)

SHOWN = (
    "reward",
    "tool_error_mm",
    "link_error_arcmin",
    "transmission_error_arcmin",
    "output_torque_Nm",
    "motor_torque_Nm",
)
"""Quantities that are plotted when a recording is opened. The recording contains all
others as well."""
POSE_RATE = 50.0
"""Rate of the recorded poses [Hz]."""


class EpisodeRecorder(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Wrapper that writes every episode to a file ``episode-<number>.rrd``.

    ::

        env = EpisodeRecorder(gymnasium.make("swgjoint/JointTracking-v0"), "episodes")

    A file is written when the episode ends, or when the environment is reset or closed.
    ``files`` lists the written files. The numbers continue those of the files in the
    folder, so that existing files are kept.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], folder: str | Path) -> None:
        """Record an environment of this package.

        Args:
            env: Single environment of ``swgjoint.envs``.
            folder: Folder of the recordings; it is created if it does not exist.

        Raises:
            InputError: If the environment is not one of ``swgjoint.envs``.
        """
        super().__init__(env)
        if not isinstance(env.unwrapped, SingleEnv):
            raise InputError(
                f"EpisodeRecorder of {type(env.unwrapped).__name__}; accepted: a single"
                " environment of swgjoint.envs"
            )
        self._plant = env.unwrapped.core.plant
        self._joints = env.unwrapped.core.joints.names
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.files: list[Path] = []
        self._rows: list[tuple[Array, float, dict[str, Any]]] = []

    def reset(self, **keys: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode and its recording."""
        self._write()
        observation, info = super().reset(**keys)
        self._take(0.0, info)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take a step and record the resulting state."""
        result = super().step(action)
        self._take(float(result[1]), result[-1])
        if result[2] or result[3]:
            self._write()
        return result

    def close(self) -> None:
        """Write the recording of an unfinished episode and close the environment."""
        self._write()
        super().close()

    def _take(self, reward: float, info: dict[str, Any]) -> None:
        self._rows.append((self._plant.batch.qpos[0].copy(), reward, info))

    def _free_number(self) -> int:
        """Number above those of all recordings in the folder."""
        names = [file.name for file in self.folder.iterdir()]
        matches = [re.fullmatch(r"episode-(\d+)\.rrd", name) for name in names]
        return max((int(one[1]) + 1 for one in matches if one), default=0)

    def _write(self) -> None:
        rows, self._rows = self._rows, []
        if len(rows) < 2:
            return
        path = self.folder / f"episode-{self._free_number()}.rrd"
        positions = np.array([row[0] for row in rows])
        figures = {"reward": np.array([row[1] for row in rows])}
        for key in rows[0][2]:
            values = np.array([row[2][key] for row in rows], float)
            if values.ndim == 1:
                figures[key] = values
            else:
                for name, column in zip(self._joints, values.T, strict=True):
                    figures[f"{key}/{name}"] = column
        time = figures.pop("time_s")
        write_episode(path, self._plant.model, time, positions, figures)
        self.files.append(path)


def write_episode(
    path: Path,
    model: mujoco.MjModel,
    time: Array,
    positions: Array,
    figures: dict[str, Array],
) -> None:
    """Write one recording; the file is either complete or absent.

    Args:
        path: File to write.
        model: Model of the simulation.
        time: Times of the steps [s]. Shape (n,).
        positions: Positions qpos of the model at these times. Shape (n, nq).
        figures: Values at these times by entity path. Shapes (n,).
    """
    import rerun as rr
    import rerun.blueprint as rrb

    curves = [c for c in SHOWN if any(key.split("/")[0] == c for key in figures)]
    plots = [rrb.TimeSeriesView(origin=key, name=key) for key in curves]
    layout = rrb.Horizontal(
        rrb.Spatial3DView(origin="arm"), rrb.Vertical(*plots), column_shares=[2, 3]
    )
    with recording_file(path) as beside:
        stream = rr.RecordingStream("swgjoint episode")
        begin_stream(stream, beside, rrb.Blueprint(layout, collapse_panels=True))
        _log_arm(stream, model, time, positions)
        at = rr.TimeColumn("time", duration=time)
        for key, values in figures.items():
            column = Column(rr.Scalars.descriptor_scalars(), values, np.float64)
            stream.send_columns(key, indexes=[at], columns=[column])
        end_stream(stream, path)


def _log_arm(stream: Any, model: mujoco.MjModel, time: Array, positions: Array) -> None:
    """Log the shapes once, and the poses of all bodies that have shapes."""
    import rerun as rr

    bodies = set()
    for geom in range(model.ngeom):
        shape, body = shape_of(model, geom), int(model.geom_bodyid[geom])
        if shape is None:
            continue
        bodies.add(body)
        place = rr.Transform3D(
            translation=model.geom_pos[geom],
            quaternion=quaternion_xyzw(model.geom_quat[geom]),
        )
        path = f"arm/{model.body(body).name}/{model.geom(geom).name or geom}"
        stream.log(path, shape, place, static=True)
    taken = np.unique(np.searchsorted(time, np.arange(0.0, time[-1], 1.0 / POSE_RATE)))
    data = mujoco.MjData(model)
    places = np.empty((taken.size, model.nbody, 3))
    turns = np.empty((taken.size, model.nbody, 4))
    for k, row in enumerate(taken):
        data.qpos[:] = positions[row]
        mujoco.mj_kinematics(model, data)
        places[k], turns[k] = data.xpos, data.xquat
    at = rr.TimeColumn("time", duration=time[taken])
    for body in sorted(bodies):
        turn = quaternion_xyzw(turns[:, body])
        columns = [
            Column(
                rr.Transform3D.descriptor_translation(), places[:, body], np.float32
            ),
            Column(rr.Transform3D.descriptor_quaternion(), turn, np.float32),
        ]
        stream.send_columns(
            f"arm/{model.body(body).name}", indexes=[at], columns=columns
        )
