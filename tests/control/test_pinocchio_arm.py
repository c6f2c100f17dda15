"""The arm in Pinocchio against that in MuJoCo, and in the feed-forward of a run."""

from __future__ import annotations

import builtins

import mujoco
import numpy as np
import pinocchio
import pytest
from messages import naming

from swgjoint.control.motor_side import MotorPID
from swgjoint.control.pinocchio_arm import PinocchioArm
from swgjoint.errors import InputError, MissingExtraError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.models_path import bundled_names
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

SCENE = {
    "name": "known",
    "arm": "two-link",
    "payload": {"mass_kg": 3.0},
    "defaults": {"drive": "map", "level": "linear", "rotor_inertia_kgm2": 1e-4},
    "trajectory": {
        "kind": "sweep",
        "hold_s": 0.05,
        "ramp_s": 0.1,
        "end_deg": {"shoulder": 10.0, "elbow": -8.0},
    },
    "simulation": {"duration_s": 0.5},
}
DRIVE = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
URDF = """<robot name="two">
  <link name="base"/>
  <joint name="one" type="continuous"><parent link="base"/><child link="upper"/>
    <axis xyz="0 1 0"/></joint>
  <link name="upper"><inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="two" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 0.5" rpy="0.3 0 0"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
  <link name="lower"><inertial><origin xyz="0 0.1 0.1"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>"""


@pytest.mark.parametrize("name", bundled_names("arms", ".xml"))
def test_torques_agree_with_the_engine(name):
    """Inverse dynamics of random motions to 1e-9, inertia to 1e-10."""
    arm = RigidArm(name)
    rng = np.random.default_rng(3)
    arm.model.dof_armature[:] = rng.uniform(0.0, 0.5, len(arm.joints))
    mujoco.mj_setConst(arm.model, mujoco.MjData(arm.model))
    other = PinocchioArm(arm.model)
    assert other.joints == arm.joints
    motion = rng.uniform(-2.0, 2.0, (3, 20, len(arm.joints)))
    limited = arm.model.jnt_limited.astype(bool)  # beyond, the engine's limits push
    low, high = arm.model.jnt_range[limited].T
    motion[0][:, limited] = rng.uniform(low, high, (20, low.size))
    expected = arm.torques(*motion)
    np.testing.assert_allclose(other.torques(*motion), expected, rtol=0, atol=1e-9)
    for q in motion[0]:
        np.testing.assert_allclose(other.inertia(q), arm.inertia(q), rtol=0, atol=1e-10)


def test_losses_and_springs_of_joints_are_the_engines():
    """Random damping, dry friction and springs, every joint sliding, to 1e-9 N·m."""
    arm, rng = RigidArm("ur5e"), np.random.default_rng(5)
    model, count = arm.model, len(arm.joints)
    zero = np.zeros(count)
    model.dof_damping[:] = rng.uniform(0.0, 3.0, count)
    # of a light joint the engine's soft law would not slip yet at these speeds
    model.dof_frictionloss[:] = rng.uniform(0.0, 1.0, count) * arm.inertia(zero)
    model.jnt_stiffness[:] = rng.uniform(0.0, 30.0, count)
    model.qpos_spring[:] = rng.uniform(-1.0, 1.0, count)
    motion = rng.uniform(-1.0, 1.0, (3, 20, count))
    motion[1] += np.sign(motion[1])
    got = PinocchioArm(model).torques(*motion)
    np.testing.assert_allclose(got, arm.torques(*motion), rtol=0, atol=1e-9)


@pytest.mark.parametrize("read", ["pinocchio", "mujoco"])
def test_a_hinge_rubs_as_its_file_says(read):
    """Damping 2 and friction 3: 5 N·m at 1 rad/s, -5 N·m back, nothing at rest."""
    text = """<robot name="one"><link name="base"/>
      <joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/>
        <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="9"/>
        <dynamics damping="2" friction="3"/></joint>
      <link name="arm"><inertial><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
      </link></robot>"""
    if read == "pinocchio":
        arm = PinocchioArm(pinocchio.buildModelFromXML(text))
    else:
        arm = PinocchioArm(mujoco.MjSpec.from_string(text).compile())
    zero = np.zeros((3, 1))
    torque = arm.torques(zero, np.array([[1.0], [-1.0], [0.0]]), zero)
    np.testing.assert_allclose(torque[:, 0], [5.0, -5.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("attribute", "what"),
    [("jnt_stiffnesspoly", "spring"), ("dof_dampingpoly", "damping")],
)
def test_curved_springs_and_dampers_are_refused(attribute, what):
    """What Pinocchio cannot follow is named with its joint."""
    model = RigidArm("two-link").model
    getattr(model, attribute)[1, 0] = 0.5
    with pytest.raises(InputError, match=naming(what, "polynomial", "elbow", "linear")):
        PinocchioArm(model)


class Spy(MotorPID):
    """The controller of the scene, which keeps its task."""

    def start(self, task):
        """Keep the task."""
        self.task = task
        super().start(task)


def driven(known_arm=None, **changes):
    scene = Scene.from_data(SCENE, overrides=changes)
    spy = Spy(frequency=8.0)
    run = run_scene(scene, drives={"map": DRIVE}, controller=spy, known_arm=known_arm)
    return run, spy


def test_the_feed_forward_of_a_run_is_that_of_the_known_arm():
    """The loaded arm in Pinocchio drives as the engine's, the bare one as if unknown.

    Torques of the plan to 1e-9 N·m, and the motion of the loaded one with them.
    """
    scene = Scene.from_data(SCENE)
    loaded, unaware = driven(), driven(**{"payload.known": False})
    same = driven(PinocchioArm(loaded[0].assembly.arm.model))
    bare = driven(PinocchioArm(RigidArm(scene.arm).model))
    for (_, spy), (_, expected) in ((same, loaded), (bare, unaware)):
        for got, torque in (
            (spy.task.link_torque, expected.task.link_torque),
            (spy.planned.torque, expected.planned.torque),
        ):
            np.testing.assert_allclose(got, torque, rtol=0, atol=1e-9)
        np.testing.assert_allclose(spy.stiffness, expected.stiffness, rtol=1e-9)
    place = loaded[0].position
    np.testing.assert_allclose(same[0].position, place, rtol=0, atol=1e-9)
    assert np.abs(bare[0].position - place).max() > 1e-3


def test_an_arm_that_pinocchio_read_is_taken_as_it_is(tmp_path):
    """A URDF with a joint without limits, whose place is its cosine and sine."""
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    arm, known = RigidArm(str(path)), pinocchio.buildModelFromUrdf(str(path))
    assert known.nq == 3
    other = PinocchioArm(known)
    motion = np.random.default_rng(4).uniform(-2.0, 2.0, (3, 20, 2))
    np.testing.assert_allclose(
        other.torques(*motion), arm.torques(*motion), rtol=0, atol=1e-9
    )


def test_an_arm_of_other_joints_is_refused():
    """Names, in the order of the scene; and without a controller nobody asks it."""
    other = PinocchioArm(RigidArm("bench").model)
    with pytest.raises(
        InputError, match=naming("known_arm", "joint", "shoulder", "elbow")
    ):
        driven(other)
    with pytest.raises(InputError, match=naming("known_arm", "controller")):
        run_scene(Scene.from_data(SCENE), drives={"map": DRIVE}, known_arm=other)


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ('<joint type="slide"/>', ("hinges",)),
        ("<joint/><joint axis='1 0 0'/>", ("two", "hinges", "body")),
    ],
)
def test_other_trees_are_refused(joints, message):
    """One line that says what is accepted."""
    body = f"<body>{joints}<geom size='0.1'/></body>"
    text = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    with pytest.raises(InputError, match=naming(*message)):
        PinocchioArm(mujoco.MjModel.from_xml_string(text))


def test_a_floating_arm_is_refused():
    """A joint of Pinocchio with six degrees of freedom."""
    model = pinocchio.buildModelFromXML(URDF, pinocchio.JointModelFreeFlyer())
    with pytest.raises(InputError, match=naming("joints", "hinges")):
        PinocchioArm(model)


def test_a_missing_extra_says_how_to_get_it(monkeypatch):
    """The line names the extra that installs it."""
    known = builtins.__import__

    def without(name, *rest, **keys):
        if name == "pinocchio":
            raise ImportError
        return known(name, *rest, **keys)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(
        MissingExtraError, match=naming("pin", "pip install 'swgjoint[control]'")
    ):
        PinocchioArm(RigidArm("bench").model)
