"""Pictures and recordings of episodes."""

from __future__ import annotations

import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from messages import names, naming
from rerun.chunk import RrdReader

from swgjoint.envs import ENVIRONMENTS
from swgjoint.envs.picture import Picture
from swgjoint.envs.recording import EpisodeRecorder
from swgjoint.errors import ComputationError, InputError


def make(name, **keys):
    return gymnasium.make(f"swgjoint.envs:{name}", **keys)


def can_draw(env) -> bool:
    """Whether this machine has OpenGL off screen; if not, the line says what to do."""
    try:
        Picture(env.unwrapped.core.plant.model).close()
    except ComputationError as error:
        assert names(str(error), "render_mode", "'rgb_array'", "OpenGL")
        assert names(str(error), "EGL") and "\n" not in str(error)
        return False
    return True


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_pictures_show_that_the_arm_moves(name):
    """Pictures pass gymnasium's checks and change when links turn."""
    env = make(name, render_mode="rgb_array")
    env.reset(seed=0)
    if not can_draw(env):
        with pytest.raises(
            ComputationError, match=naming("'rgb_array'", "OpenGL", "EGL")
        ):
            env.render()
        return
    check_env(env.unwrapped)
    env.reset(seed=0)
    first = env.render()
    assert first.shape == (480, 640, 3) and first.dtype == np.uint8
    assert first.std() > 5.0
    plant = env.unwrapped.core.plant
    plant.batch.qpos[0] += 0.5
    assert (env.render() != first).any(axis=-1).mean() > 0.005
    env.close()


def test_without_opengl_one_line_says_what_to_do(tmp_path):
    """A kind of context that does not exist is named with what can be installed."""
    code = (
        "import gymnasium, swgjoint.envs\n"
        "env = gymnasium.make('swgjoint/JointTracking-v0', render_mode='rgb_array')\n"
        "env.reset()\nenv.unwrapped.render()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "MUJOCO_GL": "disabled"},
        cwd=tmp_path,  # the installed package, not the sources beside the tests
    )
    assert done.returncode == 1
    assert names(done.stderr, "'rgb_array'", "OpenGL", "MUJOCO_GL=disabled", "EGL")


def test_other_render_modes_are_refused():
    """The rerun viewer has a recorder of its own."""
    with pytest.raises(
        InputError,
        match=naming("render_mode", "'rerun'", "'rgb_array'", "EpisodeRecorder"),
    ):
        make("swgjoint/JointTracking-v0", disable_env_checker=True).unwrapped.__class__(
            render_mode="rerun"
        )


def columns(path, entity):
    """Values of one scalar entity of a recording."""
    got = []
    for chunk in RrdReader(path).stream():
        if chunk.entity_path == f"/{entity}":
            table = chunk.to_record_batch()
            name = next(n for n in table.schema.names if "Scalars:scalars" in n)
            got += [row[0] for row in table.column(name).to_pylist()]
    return np.array(got)


RECORDED = ("swgjoint/JointTracking-v0", "swgjoint/ArmTracking-v0")


@pytest.mark.parametrize("name", RECORDED)
def test_a_recording_reads_back_what_info_said(name, tmp_path):
    """Every episode is a file of its own, whole, with the figures bit by bit."""
    env = EpisodeRecorder(make(name, episode_s=0.5), tmp_path)
    infos = []
    for seed in (0, 1):
        _, info = env.reset(seed=seed)
        infos.append([info])
        for _ in range(env.unwrapped.core.steps if seed else 40):
            *_, info = env.step(np.zeros(env.action_space.shape))
            infos[-1].append(info)
    env.close()
    assert [f.name for f in env.files] == ["episode-0.rrd", "episode-1.rrd"]
    assert sorted(f.name for f in tmp_path.iterdir()) == [f.name for f in env.files]
    joints = env.unwrapped.task.joints.names
    for file, rows in zip(env.files, infos, strict=True):
        want = np.array([row["link_error_arcmin"] for row in rows])
        for j, joint in enumerate(joints):
            several = len(joints) > 1
            entity = f"link_error_arcmin/{joint}" if several else "link_error_arcmin"
            got = columns(file, entity)
            np.testing.assert_array_equal(got, want[:, j] if several else want)


def test_recordings_in_the_folder_stay(tmp_path):
    """Another recorder goes on counting after the last file, gaps or not."""
    (tmp_path / "episode-7.rrd").write_bytes(b"of another day")
    (tmp_path / "episode-x.rrd").write_bytes(b"not counted")
    names = []
    for _ in range(2):
        env = EpisodeRecorder(make(RECORDED[0]), tmp_path)
        for _ in range(2):
            env.reset(seed=0)
            env.step(np.zeros(1))
        env.close()
        names += [f.name for f in env.files]
    assert names == [f"episode-{k}.rrd" for k in (8, 9, 10, 11)]
    assert (tmp_path / "episode-7.rrd").read_bytes() == b"of another day"


def test_only_environments_of_the_package_are_recorded(tmp_path):
    """Others have no arm to show."""
    with pytest.raises(
        InputError, match=naming("CartPoleEnv", "single", "swgjoint.envs")
    ):
        EpisodeRecorder(gymnasium.make("CartPole-v1"), tmp_path)
