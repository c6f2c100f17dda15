"""Arms as their owners wrote them: what a drive takes over and what it leaves alone."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.joint.attach import attach, attach_all
from swgjoint.joint.fitting import Fitting
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import deg

TETRAHEDRON = "v 0 0 0\nv .3 0 0\nv 0 .05 0\nv 0 0 .05\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"
ARM = """
<mujoco model="mine">
  <compiler angle="degree" autolimits="true" meshdir="parts"/>
  <option timestep="0.001"/>
  <default>
    <joint damping="2"/>
    <default class="arm">
      <joint axis="0 1 0" range="-120 120" armature="0.4" frictionloss="0.3"/>
      <position kp="3000" kv="90" inheritrange="0.9" forcerange="-200 200"/>
      <default class="wrist"><joint range="-40 80"/><tendon stiffness="9"/></default>
    </default>
  </default>
  <asset><mesh name="link" file="link.obj"/></asset>
  <worldbody>
    <body name="base" pos="0 0 1" euler="0 0 30" childclass="arm">
      <geom name="foot" size=".05" mass="1"/>
      <body name="upper" pos="0 0 .1">
        <joint name="shoulder"/>
        <geom name="upper" type="mesh" mesh="link" mass="3"/>
        <body name="fore" pos=".3 0 0" euler="0 15 0">
          <joint name="elbow" ref="20" range="-100 100"/>
          <geom name="fore" type="mesh" mesh="link" mass="2"/>
          <body name="hand" pos=".3 0 0" childclass="wrist">
            <joint name="wrist" axis="1 0 0" stiffness="3" springref="10"/>
            <geom name="hand" type="box" size=".05 .02 .03" mass=".5"/>
            <site name="tool" pos=".05 0 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="upper" body2="fore"/></contact>
  <tendon>
    <fixed name="balance" stiffness="5"><joint joint="shoulder" coef="1"/>
      <joint joint="elbow" coef="-1"/></fixed>
  </tendon>
  <actuator>
    <position name="a" joint="shoulder" class="arm"/>
    <motor name="b" joint="elbow" gear="2" ctrlrange="-30 30" ctrllimited="true"/>
    <velocity name="c" joint="wrist" kv="4" ctrlrange="-60 60"/>
  </actuator>
  <sensor><jointpos joint="elbow"/><actuatorfrc actuator="b"/><torque site="tool"/>
    <actuatorpos actuator="a"/></sensor>
  <keyframe><key name="home" qpos="0.4 0.9 -0.2" ctrl="0.4 1 0"/></keyframe>
</mujoco>
"""
JOINTS = ("shoulder", "elbow", "wrist")
INERTIA = 1e-4


@pytest.fixture
def arm(tmp_path):
    """A file with a mesh beside it."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "link.obj").write_text(TETRAHEDRON)
    (tmp_path / "arm.xml").write_text(ARM)
    return str(tmp_path / "arm.xml")


def driven(spec, level="linear", joints=JOINTS, stiffness=2e4, **keys):
    drive = DriveMap.linear(stiffness)
    keys = {"rotor_inertia": INERTIA, "level": level, **keys}
    return {name: attach(spec, joint=name, drive=drive, **keys) for name in joints}


def at_rest(model, drives, position):
    """Data with the links at a position and the drives without torsion."""
    data = mujoco.MjData(model)
    for (name, drive), q in zip(drives.items(), position, strict=True):
        data.joint(name).qpos = q
        if drive.rotor:
            data.joint(drive.rotor).qpos = drive.ratio * q
    return data


def link_torque(model, data, drive):
    """Torque of actuators at the link through a drive without losses [N·m]."""
    if drive.rotor is None:
        return float(data.qfrc_actuator[model.joint(drive.joint).dofadr[0]])
    rotor = model.joint(drive.rotor).dofadr[0]
    return drive.ratio * float(data.qfrc_actuator[rotor])


def test_ten_lines_put_drives_on_all_joints(arm, synthetic_map):
    """Everything that the file has is still there, and the arm runs."""
    spec = mujoco.MjSpec.from_file(arm)
    for joint in [joint.name for joint in spec.joints]:
        attach(spec, joint=joint, drive=synthetic_map, rotor_inertia=INERTIA)
    model = spec.compile()

    before = mujoco.MjModel.from_xml_path(arm)
    assert (model.nv, model.nplugin) == (before.nv + 3, 3)
    same = "nu", "nsensor", "nmesh", "nexclude", "nkey", "nsite", "neq", "ngeom"
    assert [getattr(model, k) for k in same] == [getattr(before, k) for k in same]
    assert [model.tendon(k).name for k in range(1)] == ["balance"]
    for k in range(model.nu):
        assert model.actuator(k).name == before.actuator(k).name
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all() and np.abs(data.qvel).max() < 1e3


def test_a_keyframe_means_the_same_pose(arm):
    """All geoms stand where they stood; the drives are without torsion."""
    before = mujoco.MjModel.from_xml_path(arm)
    old = mujoco.MjData(before)
    spec = mujoco.MjSpec.from_file(arm)
    drives = driven(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    for reset in (
        mujoco.mj_resetData,
        lambda m, d: mujoco.mj_resetDataKeyframe(m, d, 0),
    ):
        reset(before, old)
        reset(model, data)
        mujoco.mj_forward(before, old)
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.geom_xpos, old.geom_xpos, atol=1e-14)
        np.testing.assert_array_equal(data.ctrl, old.ctrl)
        for drive in drives.values():
            assert abs(drive.observe(model, data).torsion) < 1e-15
    # and what a servo reads of the motor is what it read of the joint
    np.testing.assert_allclose(data.actuator_length, old.actuator_length, atol=1e-14)


def test_link_keeps_what_is_its_own(arm):
    """Limits, damping, friction loss and spring stay; armature is the rotor's."""
    before = mujoco.MjModel.from_xml_path(arm)
    spec = mujoco.MjSpec.from_file(arm)
    drives = driven(spec)
    model = spec.compile()
    for name in JOINTS:
        old, new = before.joint(name), model.joint(name)
        np.testing.assert_array_equal(new.range, old.range)
        for part in ("damping", "frictionloss", "stiffness", "armature"):
            kept = 0.0 if part == "armature" else getattr(old, part)
            np.testing.assert_array_equal(getattr(new, part), kept)
            rotor = getattr(model.joint(f"{name}_rotor"), part)
            np.testing.assert_array_equal(rotor, 0.0)
        spring = model.qpos_spring[new.qposadr[0]]
        assert spring == before.qpos_spring[old.qposadr[0]]
        assert drives[name].motors == (
            {"shoulder": "a", "elbow": "b", "wrist": "c"}[name],
        )


@pytest.mark.parametrize("ratio_from", [(200, 202), (60, 62)])
@pytest.mark.parametrize("layout", ["circular_spline_fixed", "flexspline_fixed"])
def test_inputs_mean_the_same_at_every_level(arm, ratio_from, layout):
    """A given input turns the link with the same torque with and without a rotor."""
    drive = DriveMap.linear(
        2e4, layout=layout, teeth_flexspline=ratio_from[0],
        teeth_circular_spline=ratio_from[1],
    )  # fmt: skip
    torques = {}
    for level in ("rigid", "linear"):
        spec = mujoco.MjSpec.from_file(arm)
        keys = {"rotor_inertia": INERTIA, "level": level, "drive": drive}
        drives = {name: attach(spec, joint=name, **keys) for name in JOINTS}
        model = spec.compile()
        data = at_rest(model, drives, [0.3, 0.5, -0.4])
        for got in drives.values():
            for joint in filter(None, (got.joint, got.rotor)):
                scale = got.ratio if joint == got.rotor else 1.0
                data.joint(joint).qvel = 0.2 * scale
        data.ctrl = 0.35, 12.0, 0.7
        mujoco.mj_forward(model, data)
        torques[level] = [link_torque(model, data, got) for got in drives.values()]
        np.testing.assert_allclose(
            model.actuator("a").ctrlrange, 0.9 * 120 * deg * np.array([-1, 1])
        )
    np.testing.assert_allclose(torques["linear"], torques["rigid"], rtol=1e-12)
    assert torques["rigid"][1] == pytest.approx(24.0)  # gear 2
    assert torques["rigid"][2] == pytest.approx(4 * 0.5)
    assert torques["rigid"][0] == pytest.approx(3000 * 0.05 - 90 * 0.2)


ONE = """
<mujoco><option gravity="0 0 0"/><worldbody><body name="link"><joint name="j" {joint}/>
  <inertial pos="0 0 0" mass="1" diaginertia=".5 .5 .5"/></body></worldbody>
  <actuator>{actuator}</actuator>{more}</mujoco>
"""


def one_joint(actuator, joint="", more=""):
    return mujoco.MjSpec.from_string(
        ONE.format(actuator=actuator, joint=joint, more=more)
    )


@pytest.mark.parametrize("kind", ["position", "pid"])
def test_a_damping_ratio_is_that_of_rotor_and_link(kind):
    """A servo with dampratio is damped for Jl + i² J, with a rotor as without."""
    for level in ("rigid", "linear"):
        spec = one_joint(
            f'<{kind} joint="j" kp="400" dampratio=".8"/>', joint='armature="3"'
        )
        ratio = driven(spec, level, ["j"])["j"].ratio
        inertia = 0.5 + ratio**2 * INERTIA
        damping = -spec.compile().actuator_biasprm[0, 2]
        assert damping == pytest.approx(2 * 0.8 * np.sqrt(400 * inertia), rel=1e-9)


@pytest.mark.parametrize("speed", [0.5, 3.0, -2.0])
def test_damping_of_an_actuator_is_what_it_was_at_the_link(speed):
    """Linear, quadratic and cubic parts keep their torque; its armature goes."""
    text = '<motor joint="j" gear="2" damping="1 2 3" armature=".7"/>'
    before = one_joint(text).compile()
    old = mujoco.MjData(before)
    old.joint("j").qvel = speed
    mujoco.mj_forward(before, old)
    spec = one_joint(text)
    drives = driven(spec, joints=["j"])
    model = spec.compile()
    assert drives["j"].link_inertia == pytest.approx(0.5)
    data = at_rest(model, drives, [0.0])
    data.joint("j").qvel = speed
    data.joint("j_rotor").qvel = drives["j"].ratio * speed
    mujoco.mj_forward(model, data)
    torque = drives["j"].ratio * data.joint("j_rotor").qfrc_passive
    assert torque == pytest.approx(old.joint("j").qfrc_passive)
    assert model.actuator_armature[0] == 0.0


@pytest.mark.parametrize(
    "actuator",
    [
        '<general joint="j" gainprm="3" biastype="affine" biasprm="1 -2 -.3"/>',
        '<intvelocity joint="j" kp="40" kv="2" actrange="-1 1" class="s"/>',
        '<intvelocity joint="j" kp="40" kv="2" inheritrange="0.5"/>',
        '<position joint="j" kp="40" timeconst=".01" inheritrange="0.5"/>',
        '<pid joint="j" kp="40" kv="2" ki="30" posrange="-1 1" input="pos"/>',
        '<damper joint="j" kv="3" ctrlrange="0 2"/>',
        '<dcmotor joint="j" motorconst=".3 .3" resistance="2"/>',
        '<motor jointinparent="j" gear="-3"/>',
    ],
)
def test_every_kind_of_actuator_moves_the_arm_as_before(actuator):
    """On a very stiff drive the link moves as with the rigid drive for a second."""
    actuator = actuator.replace(' class="s"', "")
    ends = {}
    for level in ("rigid", "linear"):
        spec = one_joint(actuator, joint='range="-60 60" limited="true"')
        spec.option.timestep = 2e-5
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        drives = driven(spec, level, ["j"], stiffness=3e5, rotor_inertia=4e-6)
        model = spec.compile()
        data = at_rest(model, drives, [0.1])
        data.ctrl[:1] = 0.3
        for _ in range(5000):
            mujoco.mj_step(model, data)
        ends[level] = data.joint("j").qpos[0], data.joint("j").qvel[0]
    assert abs(ends["rigid"][0] - 0.1) > 1e-4 or "damper" in actuator
    np.testing.assert_allclose(ends["linear"], ends["rigid"], rtol=2e-3, atol=2e-5)


def test_a_servo_sees_the_motor_and_the_link_sags_by_the_torsion():
    """Under T the motor is off by T/kp and the link by T/K more."""
    spec = one_joint('<position name="servo" joint="j" kp="500"/>', 'damping="5"')
    spec.option.gravity = 0, 0, 0
    drives = driven(spec, joints=["j"])
    model = spec.compile()
    data = at_rest(model, drives, [0.2])
    data.ctrl[0], load = 0.2, 30.0
    data.qfrc_applied[model.joint("j").dofadr[0]] = -load
    for _ in range(20000):
        mujoco.mj_step(model, data)
    encoder = data.joint("j_rotor").qpos[0] / drives["j"].ratio
    assert encoder == pytest.approx(0.2 - load / 500, abs=1e-6)
    sag = data.joint("j").qpos[0] - encoder
    assert sag == pytest.approx(-load / 2e4, abs=1e-7)
    assert data.actuator("servo").force == pytest.approx(load, rel=1e-6)


def test_limit_of_the_joints_actuators_goes_to_the_motor():
    """A joint's actuatorfrcrange clamps the torque that reaches the link."""
    spec = one_joint('<motor joint="j"/>', joint='actuatorfrcrange="-7 11"')
    drives = driven(spec, joints=["j"])
    model = spec.compile()
    data = at_rest(model, drives, [0.0])
    for ctrl, expected in ((3.0, 3.0), (40.0, 11.0), (-40.0, -7.0)):
        data.ctrl[0] = ctrl
        mujoco.mj_forward(model, data)
        assert link_torque(model, data, drives["j"]) == pytest.approx(expected)


SENSOR = '<sensor><jointactuatorfrc name="s" joint="j"/></sensor>'


@pytest.mark.parametrize(
    ("actuator", "joint"),
    [
        ('<motor joint="j"/>', ""),
        ('<motor joint="j"/>', 'actuatorfrcrange="-7 11"'),
        ('<motor joint="j" forcerange="-3 40"/>', 'actuatorfrcrange="-7 11"'),
        ('<position name="a" joint="j" kp="30" kv="2"/>', 'actuatorfrcrange="-7 11"'),
    ],
)
def test_a_torque_sensor_of_the_joint_keeps_its_meaning(actuator, joint):
    """With one actuator of gear 1 it reads the same before and after, limits too."""
    spec = one_joint(actuator, joint=joint, more=SENSOR)
    before = spec.copy().compile()
    drives = driven(spec, joints=["j"])
    model = spec.compile()
    data, bare = at_rest(model, drives, [0.1]), mujoco.MjData(before)
    bare.joint("j").qpos = 0.1
    for ctrl in (3.0, 40.0, -40.0):
        data.ctrl[0] = bare.ctrl[0] = ctrl
        mujoco.mj_forward(model, data)
        mujoco.mj_forward(before, bare)
        assert data.sensor("s").data == pytest.approx(bare.sensor("s").data)
        assert data.sensor("s").data[0] == pytest.approx(
            link_torque(model, data, drives["j"])
        )


@pytest.mark.parametrize(
    ("actuator", "joint", "more"),
    [
        ('<motor joint="j" gear="3"/>', "", SENSOR),
        ('<motor joint="j"/><velocity joint="j" kv="2"/>', "", SENSOR),
        (
            '<motor name="a" joint="j"/>',
            'actuatorfrcrange="-7 11"',
            SENSOR.replace("</", '<actuatorfrc actuator="a"/></'),
        ),
    ],
)
def test_a_torque_sensor_without_an_exact_form_is_listed(actuator, joint, more):
    """It reads the torque at the rotor; one line names it, the factor and what to use.

    A sensor of an actuator's own force keeps its meaning, too.
    """
    spec = one_joint(actuator, joint=joint, more=more)
    before = spec.copy().compile()
    with pytest.warns(
        UserWarning, match=naming("'s'", "-100", "'j'", "JointDrive.observe")
    ):
        drives = driven(spec, joints=["j"])
    model = spec.compile()
    data, bare = at_rest(model, drives, [0.0]), mujoco.MjData(before)
    data.ctrl[:] = bare.ctrl[:] = 9.0
    mujoco.mj_forward(model, data)
    mujoco.mj_forward(before, bare)
    factor = np.array([-100.0, *[1.0] * (model.nsensor - 1)])
    np.testing.assert_allclose(factor * data.sensordata, bare.sensordata, rtol=1e-12)


def test_one_line_lists_all_torque_sensors():
    """Sensors of several joints give one warning; those with an exact form are left."""
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody>
        <body><joint name="a"/><geom size=".1"/></body>
        <body><joint name="b"/><geom size=".1"/></body>
        <body><joint name="c"/><geom size=".1"/></body></worldbody>
        <actuator><motor joint="a" gear="2"/><motor joint="b" gear="3"/>
        <motor joint="c"/></actuator>
        <sensor><jointactuatorfrc name="sa" joint="a"/>
        <jointactuatorfrc name="sb" joint="b"/>
        <jointactuatorfrc name="sc" joint="c"/></sensor></mujoco>"""
    )
    fitting = Fitting(drive=DriveMap.linear(1e4), rotor_inertia=INERTIA, level="linear")
    with pytest.warns(UserWarning, match=naming("'sa'", "'sb'")) as caught:
        attach_all(spec, dict.fromkeys("abc", fitting))
    [line] = caught
    assert "'sc'" not in str(line.message)


LINKS = """
<mujoco>
  <worldbody>
    <body name="a" gravcomp="{gravcomp}"><joint name="a" {joint}/><geom size=".1"/>
      <body name="b"><joint name="b"/><geom size=".1"/>{body}</body></body>
  </worldbody>
  {more}
</mujoco>
"""


@pytest.mark.parametrize(
    ("joint", "keys", "says"),
    [
        (
            "b",
            {"more": '<equality><joint name="e" joint1="b" joint2="a"/></equality>'},
            ("'b'", "'a'", "equality 'e'", "leads", "active"),
        ),
        (
            "b",
            {"more": '<equality><joint name="e" joint1="b"/></equality>'},
            ("'b'", "equality 'e'", "active"),
        ),
        (
            "b",
            {
                "more": '<tendon><fixed name="t"><joint joint="a" coef="1"/><joint '
                'joint="b" coef="1"/></fixed></tendon><equality><tendon name="e" '
                'tendon1="t"/></equality>'
            },
            ("'b'", "equality 'e'", "tendon 't'", "active"),
        ),
        (
            "a",
            {
                "more": '<tendon><fixed name="t"><joint joint="a" coef="1"/><joint '
                'joint="b" coef="1"/></fixed></tendon><actuator><motor name="m" '
                'tendon="t"/></actuator>'
            },
            ("'a'", "actuator 'm'", "tendon 't'", "on the joint"),
        ),
        (
            "a",
            {
                "more": '<actuator><muscle name="m" joint="a" lengthrange="0 1"/>'
                "</actuator>"
            },
            ("'a'", "muscle 'm'", "motor", "none"),
        ),
        (
            "a",
            {"joint": 'actuatorgravcomp="true"', "gravcomp": "1"},
            ("'a'", "actuatorgravcomp", "false"),
        ),
        (
            "a",
            {"body": '<body name="a_rotor"/>'},
            ("'a'", "'a_rotor'", "body", "rename"),
        ),
        (
            "a",
            {"body": '<body><joint name="a_rotor"/><geom size=".1"/></body>'},
            ("'a'", "'a_rotor'", "joint", "rename"),
        ),
        (
            "a",
            {
                "more": '<tendon><fixed name="a_friction"><joint joint="b" coef="1"/>'
                "</fixed></tendon>"
            },
            ("'a'", "'a_friction'", "tendon", "rename"),
        ),
    ],
)
def test_what_holds_a_joint_is_named(joint, keys, says, synthetic_map):
    """One line with the joint, what is in the way and what would do; no change."""
    parts = {"gravcomp": "0", "joint": "", "body": "", "more": "", **keys}
    spec = mujoco.MjSpec.from_string(LINKS.format(**parts))
    before = spec.to_xml()
    with pytest.raises(InputError, match=naming(*says)) as caught:
        attach(spec, joint=joint, drive=synthetic_map, rotor_inertia=INERTIA)
    assert "\n" not in str(caught.value)
    assert spec.to_xml() == before


def test_a_joint_that_leads_takes_a_drive(synthetic_map):
    """Its follower moves with it; an equality that is not active holds nothing."""
    more = '<equality><joint name="e" joint1="b" joint2="a"/></equality>'
    text = LINKS.format(gravcomp="0", joint="", body="", more=more)
    spec = mujoco.MjSpec.from_string(text)
    attach(spec, joint="a", drive=synthetic_map, rotor_inertia=INERTIA)
    assert spec.compile().neq == 1
    spec = mujoco.MjSpec.from_string(text)
    spec.equalities[0].active = False
    attach(spec, joint="b", drive=synthetic_map, rotor_inertia=INERTIA)


def test_a_rotor_takes_no_drive(synthetic_map):
    """The line names the joint of the link."""
    spec = one_joint("")
    attach(spec, joint="j", drive=synthetic_map, rotor_inertia=INERTIA)
    with pytest.raises(InputError, match=naming("'j_rotor'", "'j'", "rotor", "drive")):
        attach(spec, joint="j_rotor", drive=synthetic_map, rotor_inertia=INERTIA)


@pytest.mark.parametrize("angle", ["degree", "radian"])
@pytest.mark.parametrize("first", ["drives", "arms"])
def test_two_arms_in_one_model_move_like_one(arm, angle, first, synthetic_map):
    """Drives before or after MjSpec.attach, whatever angles the outer file uses."""
    keys = {"drive": synthetic_map, "rotor_inertia": INERTIA}
    child = mujoco.MjSpec.from_file(arm)
    alone = child.copy()
    drives = {name: attach(alone, joint=name, **keys) for name in JOINTS}
    outer = mujoco.MjSpec.from_string(
        f"""<mujoco><compiler angle="{angle}"/><option timestep="0.001"
        integrator="discrete"/><worldbody><frame name="left" pos="0 2 0"/>
        <frame name="right" pos="0 -2 0"/></worldbody></mujoco>"""
    )
    both = {}
    for side in ("left", "right"):
        one = alone.copy() if first == "drives" else child.copy()
        outer.attach(one, prefix=f"{side}/", frame=outer.frame(side))
        for name in JOINTS:
            both[side, name] = (
                drives[name].with_prefix(f"{side}/")
                if first == "drives"
                else attach(outer, joint=f"{side}/{name}", **keys)
            )
    model, lone = outer.compile(), alone.compile()
    assert (model.nplugin, model.nu) == (6, 6)
    # a keyframe per arm; each sets the joints of both
    assert model.nkey == 2
    data, single = mujoco.MjData(model), mujoco.MjData(lone)
    for drive in both.values():
        assert abs(drive.observe(model, data).torsion) < 1e-3
        assert model.joint(drive.rotor).qpos0 == pytest.approx(
            drive.ratio * model.joint(drive.joint).qpos0
        )
    for side in ("left", "right"):
        for name in JOINTS:
            for joint in (name, f"{name}_rotor"):
                data.joint(f"{side}/{joint}").qpos = single.joint(joint).qpos
    for _ in range(200):
        mujoco.mj_step(model, data)
        mujoco.mj_step(lone, single)
    for (side, name), drive in both.items():
        there = data.joint(f"{side}/{name}").qpos
        np.testing.assert_allclose(there, single.joint(name).qpos, atol=1e-9)
        own = drives[name].observe(lone, single).torque
        assert drive.observe(model, data).torque == pytest.approx(own, abs=1e-6)


URDF = """
<robot name="two">
  <link name="base"/>
  <link name="mount"/>
  <link name="upper"><inertial><mass value="2"/><origin xyz=".1 0 0"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="flange"/>
  <link name="fore"><inertial><mass value="1"/><origin xyz=".1 0 0"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="fixed" type="fixed"><parent link="base"/><child link="mount"/>
    <origin xyz="0 .1 .3" rpy=".3 .2 .1"/></joint>
  <joint name="lift" type="revolute"><parent link="mount"/><child link="upper"/>
    <origin xyz="0 0 .2" rpy="0 .4 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="50"/></joint>
  <joint name="stiff" type="fixed"><parent link="upper"/><child link="flange"/>
    <origin xyz=".3 0 0" rpy="0 0 .5"/></joint>
  <joint name="elbow" type="continuous"><parent link="flange"/><child link="fore"/>
    <axis xyz="0 0 1"/></joint>
</robot>
"""


@pytest.mark.parametrize("level", ["linear", "full"])
def test_a_urdf_takes_drives_on_links_that_the_compiler_fuses(level):
    """Rotors stand at their joints though links in between vanish; efforts go along."""
    spec = mujoco.MjSpec.from_string(URDF)
    drives = driven(spec, level, ("lift", "elbow"))
    model = spec.compile()
    names = {model.body(k).name for k in range(model.nbody)}
    assert names == {"world", "upper", "lift_rotor", "fore", "elbow_rotor"}
    data = at_rest(model, drives, [0.7, -0.3])
    mujoco.mj_kinematics(model, data)
    for name, drive in drives.items():
        link, rotor = model.joint(name).id, model.joint(drive.rotor).id
        np.testing.assert_allclose(data.xanchor[link], data.xanchor[rotor], atol=1e-12)
        np.testing.assert_allclose(data.xaxis[link], data.xaxis[rotor], atol=1e-12)
    limit = model.jnt_actfrcrange[model.joint("lift_rotor").id]
    np.testing.assert_allclose(limit * abs(drives["lift"].ratio), [-50.0, 50.0])
    assert model.nplugin == (2 if level == "full" else 0)
