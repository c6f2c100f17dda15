"""The arm in Pinocchio against that in MuJoCo."""

from __future__ import annotations

import builtins

import mujoco
import numpy as np
import pytest

from swgjoint.control.pinocchio_arm import PinocchioArm
from swgjoint.errors import InputError, MissingExtraError
from swgjoint.models_path import bundled_names
from swgjoint.sim.rigid_arm import RigidArm


@pytest.mark.parametrize("name", bundled_names("arms", ".xml"))
def test_torques_agree_with_the_engine(name):
    """Inverse dynamics of random motions to 1e-9, weight and inertia too."""
    arm = RigidArm(name)
    rng = np.random.default_rng(3)
    arm.model.dof_armature[:] = rng.uniform(0.0, 0.5, len(arm.joints))
    mujoco.mj_setConst(arm.model, mujoco.MjData(arm.model))
    other = PinocchioArm(arm.model)
    motion = rng.uniform(-2.0, 2.0, (3, 20, len(arm.joints)))
    limited = arm.model.jnt_limited.astype(bool)  # beyond, the engine's limits push
    low, high = arm.model.jnt_range[limited].T
    motion[0][:, limited] = rng.uniform(low, high, (20, low.size))
    expected = arm.torques(*motion)
    np.testing.assert_allclose(other.torques(*motion), expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        other.gravity(motion[0]), arm.gravity(motion[0]), rtol=0, atol=1e-9
    )
    diagonal = np.diagonal(other.inertia(motion[0]), axis1=-2, axis2=-1)
    for q, row in zip(motion[0], diagonal, strict=True):
        np.testing.assert_allclose(row, arm.inertia(q), rtol=0, atol=1e-10)


def test_motions_side_by_side_keep_their_places():
    """Leading axes go through."""
    arm = RigidArm("two-link")
    other = PinocchioArm(arm.model)
    motion = np.random.default_rng(4).uniform(-1.0, 1.0, (3, 5, 4, 2))
    got = other.torques(*motion)
    np.testing.assert_array_equal(got[3, 1], other.torques(*motion[:, 3, 1]))


@pytest.mark.parametrize(
    ("joints", "message"),
    [('<joint type="slide"/>', "no hinges"), ("<joint/><joint axis='1 0 0'/>", "two")],
)
def test_other_trees_are_refused(joints, message):
    """One line that says what is accepted."""
    body = f"<body>{joints}<geom size='0.1'/></body>"
    text = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    with pytest.raises(InputError, match=message):
        PinocchioArm(mujoco.MjModel.from_xml_string(text))


def test_a_missing_extra_says_how_to_get_it(monkeypatch):
    """The line names the extra that installs it."""
    known = builtins.__import__

    def without(name, *rest, **keys):
        if name == "pinocchio":
            raise ImportError
        return known(name, *rest, **keys)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"swgjoint\[control\]"):
        PinocchioArm(RigidArm("bench").model)
