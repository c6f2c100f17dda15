"""Runs by pickle, as between processes: the same figures, and the same model."""

from __future__ import annotations

import pickle
import subprocess
import sys
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

import swgjoint
from swgjoint.sim.arm.rigid_arm import RigidArm

SHORT = {"defaults.drive": "CSG-25-100", "simulation.duration_s": 1.0}
READER = """
import pickle, sys
run = pickle.loads(open(sys.argv[1], "rb").read())
print(run.metrics()["verdict"])
import mujoco
model = run.assembly.model
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
"""


@pytest.fixture(scope="module")
def run() -> swgjoint.SceneRun:
    """A short run of the bench at level full."""
    return swgjoint.run_scene("bench", overrides=SHORT)


@pytest.mark.parametrize("copied", [deepcopy, lambda r: pickle.loads(pickle.dumps(r))])
def test_a_copy_of_a_run_has_its_figures(run, copied):
    """All of them, with the joint's states bit by bit."""
    other = copied(run)
    assert type(other) is type(run) and other.metrics() == run.metrics()
    np.testing.assert_array_equal(other.position, run.position)
    assert other.assembly.model.nplugin == run.assembly.model.nplugin == 1


def test_a_process_that_reads_a_run_needs_no_plugin_of_its_own(run, tmp_path):
    """MuJoCo crashes on an unpickled model whose plugin is not registered."""
    path = tmp_path / "run.pkl"
    path.write_bytes(pickle.dumps(run))
    done = subprocess.run(
        [sys.executable, "-P", "-c", READER, str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip() == run.metrics()["verdict"]


def test_an_unpickled_arm_can_be_edited(tmp_path):
    """Its editable model is that of the file, with the tool that was asked for."""
    arm = RigidArm("two-link")
    other = pickle.loads(pickle.dumps(arm))
    for one in (other.without_tool(), other, arm.without_tool()):
        assert one.spec().to_xml() == arm.spec().to_xml()
    angles = np.full((2, len(arm.joints)), 0.3)
    np.testing.assert_array_equal(other.gravity(angles), arm.gravity(angles))
    assert Path(other.path) == arm.path
