"""A user's file type-checks against the package as it is installed."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

import swgjoint

USER = """
from typing import Any, assert_type

import mujoco  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

import swgjoint

design = swgjoint.Design.load("reference-2d")
assert_type(design, swgjoint.Design)
drive = swgjoint.build_map(design, model="2d")
assert_type(drive, swgjoint.DriveMap)
assert_type(drive.mean_stiffness, float)
assert_type(drive.ratings, swgjoint.Ratings)
assert_type(swgjoint.DriveMap.from_catalogue("CSG-25-100"), swgjoint.DriveMap)
assert_type(swgjoint.spec_sheet(design, only=["K1_Nm_rad"]), dict[str, Any])
assert_type(swgjoint.load_drive("CSG-25-100"), swgjoint.DriveMap)
spec = mujoco.MjSpec.from_file("arm.xml")
joint = swgjoint.attach(spec, joint="elbow", drive=drive, rotor_inertia=4e-5)
assert_type(joint, swgjoint.JointDrive)
joints = swgjoint.attach(spec, {"*": "CSG-17-100"})
assert_type(joints, dict[str, swgjoint.JointDrive])
run = swgjoint.run_scene("bench", overrides={"simulation.step_s": 5e-4})
assert_type(run, swgjoint.SceneRun)
assert_type(run.output_torque, NDArray[np.float64])
mesh_run = swgjoint.simulate_meshing(design, torque=20.0)
assert_type(mesh_run, swgjoint.MeshingRun | swgjoint.SolidRun)
try:
    swgjoint.load_plugin()
except swgjoint.SwgError:
    pass
"""
WRONG = {
    "swgjoint.build_map('reference-2d')": "arg-type",
    "swgjoint.spec_sheet(design, fidelity='2d')": "call-arg",
    "swgjoint.no_such_name": "attr-defined",
    "drive.mean_stiffness + 'x'": "operator",
}


@pytest.mark.slow
def test_a_file_of_a_user(tmp_path):
    """Type checkers know all public names and find the mistakes of a caller."""
    pytest.importorskip("mypy", reason="mypy is not installed")
    file = tmp_path / "user.py"
    file.write_text(USER + "\n".join(WRONG) + "\n", encoding="utf-8")
    done = subprocess.run(
        [
            sys.executable,
            "-P",
            "-m",
            "mypy",
            "--strict",
            "--no-error-summary",
            "user.py",
        ],
        cwd=tmp_path,
        env={**os.environ, "MYPY_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        check=False,
    )
    first = USER.count("\n") + 1
    wanted = [(first + k, code) for k, code in enumerate(WRONG.values())]
    lines = [line for line in done.stdout.splitlines() if ": error: " in line]
    found = [(int(line.split(":")[1]), line.rsplit("[", 1)[1][:-1]) for line in lines]
    assert found == wanted, done.stdout + done.stderr


def test_types_and_names_are_the_same():
    """What a type checker sees is what is imported on first use."""
    with open(swgjoint.__file__, encoding="utf-8") as file:
        source = file.read()
    for name, module in swgjoint._PUBLIC.items():
        assert f"    from {module} import {name} as {name}\n" in source
