"""Joints that an arm does not move: where they are held, and what that changes."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.sim.arm.reading import ArmReading, patterns_of
from swgjoint.sim.arm.rigid_arm import RigidArm

EVERY_KIND = """
<mujoco>
  <compiler angle="degree" eulerseq="zyx"/><size nkey="3"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <frame pos=".1 0 .3" euler="20 0 0">
      <body name="base" pos="0 .2 1" euler="0 30 10"><freejoint name="float"/>
        <geom size=".1"/>
        <body name="carriage" pos=".2 0 .1" axisangle="0 1 1 40">
          <joint name="first" axis="0 1 0" pos=".1 0 0" ref="10"/>
          <joint name="x" type="slide" axis="1 .5 0" ref=".02"/>
          <joint name="turn" axis="1 1 0" pos="0 .05 0" ref="25"/>
          <geom size=".05"/>
          <frame euler="0 0 50">
            <body name="shoulder" pos="0 0 .3" zaxis="1 0 1">
              <joint name="ball" type="ball" pos="0 0 .02"/><geom size=".05"/>
              <body name="hand" pos="0 .1 .3"><joint name="wrist" axis="0 0 1"/>
                <geom size=".04" pos=".05 0 0"/></body>
            </body>
          </frame>
        </body>
      </body>
    </frame>
  </worldbody>
  <keyframe>
    <key name="away" qpos=".4 -.2 .9 .8 .6 0 0  .3 .11 -.4  .5 .5 .5 .5  .7"/>
    <key qpos="0 0 1 1 0 0 0  0 0 0  1 0 0 0  0"/>
  </keyframe>
</mujoco>
"""


def quiet(path: Path | str, **reading: object) -> RigidArm:
    """An arm without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return RigidArm(str(path), reading=ArmReading(**reading))


@pytest.mark.parametrize("pose", [None, "away", "key_1", "key_2"])
@pytest.mark.parametrize("driven", [("first", "wrist"), ("turn",), ("wrist",)])
def test_what_is_held_stays_where_the_file_has_it(driven, pose, tmp_path):
    """All bodies are where the file's own model puts them, for any kind of joint."""
    path = tmp_path / "all.xml"
    path.write_text(EVERY_KIND)
    arm = quiet(path, driven=driven, pose=pose, angles={"turn": 0.35})
    assert set(arm.joints) == set(driven)
    whole = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(whole)
    keys = zip(("away", "key_1", "key_2"), whole.key_qpos, strict=True)
    named = {None: whole.qpos0, **dict(keys)}
    for q in np.random.default_rng(2).uniform(-2.0, 2.0, (4, len(arm.joints))):
        data.qpos[:] = named[pose]
        data.joint("turn").qpos = 0.35
        for name, angle in zip(arm.joints, q, strict=True):
            data.joint(name).qpos = angle
        mujoco.mj_kinematics(whole, data)
        places, turns = arm.body_poses(q[None])
        np.testing.assert_allclose(places[0], data.xpos, atol=1e-12)
        same = np.abs(np.sum(turns[0] * data.xquat, axis=1))
        np.testing.assert_allclose(same, 1.0, atol=1e-12)


LEGGED = """
<mujoco><contact><pair geom1="floor" geom2="foot"/></contact>
  <worldbody><geom name="floor" type="plane" size="2 2 .1"/>
  <body name="pelvis" pos="0 0 .5"><freejoint name="float"/><geom size=".1"/>
    <body name="plate"><geom size=".09" pos=".05 0 0"/></body>
    <body name="thigh" pos=".12 0 0"><joint name="hip" axis="0 1 0"/>
      <geom size=".08"/>
      <body name="shank" pos=".2 0 0"><joint name="knee" axis="0 1 0"/>
        <geom type="capsule" size=".03" fromto="0 0 0 0 0 -.6"/>
        <geom name="foot" size=".05" pos="0 0 -.6" contype="0" conaffinity="0"/>
      </body></body>
  </body></worldbody></mujoco>
"""


def touching(model: mujoco.MjModel, data: mujoco.MjData) -> set[tuple[str, ...]]:
    """Pairs of bodies that the engine finds in contact."""
    mujoco.mj_forward(model, data)
    pairs = model.geom_bodyid[data.contact.geom]
    return {tuple(sorted(model.body(b).name for b in pair)) for pair in pairs}


def test_holding_a_base_adds_no_contacts(tmp_path):
    """Pairs that the engine filters for the free robot stay filtered; no floor."""
    path = tmp_path / "legged.xml"
    path.write_text(LEGGED)
    whole = mujoco.MjModel.from_xml_path(str(path))
    assert touching(whole, mujoco.MjData(whole)) == {("shank", "world")}
    with pytest.warns(
        UserWarning, match=naming("legged.xml", "float", "free", "floor")
    ):
        arm = RigidArm(str(path))
    assert arm.contacts(np.zeros((1, 2))) == []
    # what the file lets collide still does
    folded = np.array([[0.0, 1.57]])
    data = mujoco.MjData(whole)
    data.qpos[-2:] = folded
    data.qpos[2] = 5.0
    found = {tuple(sorted(pair[:2])) for pair in arm.contacts(folded)}
    assert found == touching(whole, data) == {("pelvis", "shank"), ("plate", "shank")}


GRIPPER = """
<mujoco><worldbody><body name="arm"><joint name="lift" axis="0 1 0"/>
  <geom size=".1" pos=".2 0 0"/>
  <body name="driver_l" pos=".3 .05 0"><joint name="driver_l" axis="0 0 1"/>
    <geom size=".02" pos=".05 0 0"/>
    <body name="finger_l" pos=".1 0 0"><joint name="finger_l" axis="0 0 1"/>
      <geom size=".02" pos=".05 0 0"/></body></body>
  <body name="knuckle_l" pos=".3 .1 0"><joint name="knuckle_l" axis="0 0 1"/>
    <geom size=".01" pos=".05 0 0"/></body>
  <body name="driver_r" pos=".3 -.1 0"><joint name="driver_r" axis="0 0 1"/>
    <geom size=".02" pos=".05 0 0"/></body>
  <body name="spring" pos=".3 0 .1"><joint name="spring" axis="0 0 1"/>
    <geom size=".02" pos=".05 0 0"/></body></body>
  <body name="target" mocap="true"/>
  </worldbody>
  <tendon><fixed name="split"><joint joint="driver_r" coef="1"/>
    <joint joint="spring" coef="1"/></fixed></tendon>
  <equality>{equalities}</equality>
  <actuator><position tendon="split" kp="1"/><position joint="lift" kp="1"/></actuator>
</mujoco>
"""
LINKAGE = '<connect name="loop" body1="finger_l" body2="knuckle_l" anchor="0 0 0"/>'


@pytest.mark.parametrize(
    ("equalities", "held"),
    [
        (LINKAGE, {"driver_l", "finger_l", "knuckle_l"}),
        ('<joint joint1="driver_l" joint2="driver_r"/>', {"driver_l", "driver_r"}),
        ('<joint joint1="driver_r"/>', {"driver_r"}),
        ('<weld body1="knuckle_l" body2="arm"/>', {"knuckle_l"}),
        ('<tendon tendon1="split"/>', {"driver_r", "spring"}),
        ('<weld body1="target" body2="finger_l"/>', set()),
        (LINKAGE.replace("<connect", '<connect active="false"'), set()),
    ],
)
def test_joints_that_an_equality_ties_are_held(equalities, held, tmp_path):
    """The joints of the loop, those of the joint, of the tendon; a line lists them."""
    path = tmp_path / "gripper.xml"
    path.write_text(GRIPPER.format(equalities=equalities))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        arm = RigidArm(str(path))
    assert set(arm.held) == held
    assert "lift" in arm.joints
    lines = [str(one.message) for one in said]
    assert len(lines) == bool(held)
    for line in lines:
        assert "\n" not in line
        assert all(name in line for name in held)


def test_an_arm_whose_joints_are_all_tied_is_refused(tmp_path):
    """The equality and its joints are named."""
    path = tmp_path / "gripper.xml"
    path.write_text(
        GRIPPER.format(equalities='<weld name="fixed" body1="finger_l"/>')
        .replace('<joint name="driver_r" axis="0 0 1"/>', "")
        .replace('<joint name="knuckle_l" axis="0 0 1"/>', "")
        .replace('<joint name="spring" axis="0 0 1"/>', "")
        .split("<tendon>")[0]
        + '<equality><weld name="fixed" body1="finger_l"/></equality></mujoco>'
    )
    with pytest.raises(InputError, match=naming("gripper.xml", "'fixed'", "lift")):
        RigidArm(str(path))


def test_hinges_by_pattern(tmp_path):
    """Commas and stars; a pattern that names no hinge says which there are."""
    assert patterns_of(["a*, b", "c", ""]) == ("a*", "b", "c")
    path = tmp_path / "gripper.xml"
    path.write_text(GRIPPER.format(equalities=LINKAGE))
    assert quiet(path, driven=("l*", "driver_r")).joints == ("lift", "driver_r")
    for wrong in ("knee*", "finger_l"):
        match = naming("gripper.xml", f"'{wrong}'", "lift", "driver_r", "spring")
        with pytest.raises(InputError, match=match):
            quiet(path, driven=("lift", wrong))


def test_the_drives_carry_what_a_file_lets_float(tmp_path):
    """A body with gravcomp weighs, and a line says so."""
    path = tmp_path / "light.xml"
    path.write_text(
        """<mujoco><worldbody><body name="arm" gravcomp="1">
        <joint name="lift" axis="0 1 0"/>
        <inertial mass="2" pos=".5 0 0" diaginertia="1 1 1"/></body></worldbody>
        </mujoco>"""
    )
    with pytest.warns(UserWarning, match=naming("light.xml", "gravcomp", "arm")):
        arm = RigidArm(str(path))
    np.testing.assert_allclose(arm.gravity(np.zeros((1, 1))), [[-9.81]])


def test_a_pose_or_angle_that_does_not_fit_is_named(tmp_path):
    """Unknown keyframe with those there are; an angle for what is no hinge."""
    path = tmp_path / "all.xml"
    path.write_text(EVERY_KIND)
    with pytest.raises(InputError, match=naming("all.xml", "'home'", "away", "key_1")):
        quiet(path, pose="home")
    with pytest.raises(InputError, match=naming("all.xml", "'x'", "slide", "hinges")):
        quiet(path, angles={"x": 0.1})
