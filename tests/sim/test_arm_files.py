"""Arms of any owner in a scene: MJCF and URDF, and scenes made around them."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from messages import names, naming

from swgjoint.cli.main import main
from swgjoint.errors import InputError
from swgjoint.sim.arm.gentle_sweep import MARGIN, SWEEP, gentle_sweep
from swgjoint.sim.arm.reading import ArmReading
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import assumed_rotor_inertia, is_arm, scene_of_arm
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import deg
from swgjoint.view.run import run_scene

LINK = """
  <link name="{name}"><inertial><origin xyz="0.2 0 0"/><mass value="{mass}"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.06" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0.2 0 0" rpy="0 1.5708 0"/>{shape}</collision></link>
"""
CYLINDER = '<geometry><cylinder radius="0.08" length="0.6"/></geometry>'
URDF = """<?xml version="1.0"?>
<robot name="two">
  <link name="base"/>
  {upper}{fore}{hand}
  <joint name="lift" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="-0.5" effort="60" velocity="2"/>
    <dynamics damping="0.4" friction="0.2"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>{mimic}</joint>
  <joint name="flange" type="fixed"><parent link="fore"/><child link="hand"/>
    <origin xyz="0.35 0 0"/></joint>
  <link name="finger"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4"
    izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="finger" type="prismatic"><parent link="hand"/><child link="finger"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="20"/></joint>
</robot>
"""
STEADY = "defaults.linear={stiffness_Nm_rad=2e4,rated_torque_Nm=50.0}"
QUICK = ["--set", "simulation.duration_s=2.0"]


def urdf(folder: Path, *, shape: str = CYLINDER, mimic: str = "") -> str:
    """A two-link arm with a gripper finger; neighbours overlap."""
    parts = {
        name: LINK.format(name=name, mass=mass, shape=shape)
        for name, mass in (("upper", 3.0), ("fore", 2.0), ("hand", 0.5))
    }
    file = folder / "two.urdf"
    file.write_text(URDF.format(**parts, mimic=mimic))
    return str(file)


def quiet_arm(reference: str) -> RigidArm:
    with pytest.warns(
        UserWarning, match=naming("two.urdf", "hinge", "finger", "slide")
    ):
        return RigidArm(reference)


def test_a_urdf_moves_as_the_same_arm_in_mjcf(tmp_path):
    """Torques agree with an MJCF of the same numbers; friction is the link's."""
    arm = quiet_arm(urdf(tmp_path))
    body = '<inertial pos=".2 0 0" mass="{}" diaginertia=".01 .05 .06"/>'
    (tmp_path / "twin.xml").write_text(
        f"""<mujoco><worldbody><body pos="0 0 .3">
        <joint name="lift" axis="0 1 0" damping=".4" frictionloss=".2"/>{body.format(3)}
        <body pos=".4 0 0"><joint name="elbow" axis="0 1 0"/>{body.format(2)}
        <body pos=".35 0 0">{body.format(0.5)}<body><inertial pos="0 0 0" mass=".1"
        diaginertia="1e-4 1e-4 1e-4"/></body></body></body></body></worldbody>
        </mujoco>"""
    )
    twin = RigidArm(str(tmp_path / "twin.xml"))
    assert arm.joints == twin.joints == ("lift", "elbow")
    q, v, a = np.random.default_rng(5).uniform(-1.0, 1.0, (3, 8, 2))
    q[:, 0] -= 1.7  # inside the limits: a limit pushes
    np.testing.assert_allclose(arm.torques(q, v, a), twin.torques(q, v, a), atol=1e-9)


def test_what_a_urdf_says_of_its_joints(tmp_path):
    """Limits, efforts, fixed links by name, a held finger, no collisions."""
    arm = quiet_arm(urdf(tmp_path))
    assert arm.held == {"finger": "slide"}
    assert arm.effort == {"lift": 60.0}
    np.testing.assert_array_equal(arm.model.jnt_limited, [1, 0])
    np.testing.assert_allclose(arm.model.joint("lift").range, [-3.0, -0.5])
    assert not arm.model.jnt_actfrclimited.any()
    assert not arm.model.geom_contype.any()
    with pytest.warns(UserWarning, match=naming("two.urdf", "hinge", "finger")):
        tool = RigidArm(arm.path.as_posix(), tool_site="hand")
    place = tool.tool_positions(np.zeros((1, 2)))[0]
    np.testing.assert_allclose(place, [0.75, 0.0, 0.3], atol=1e-12)


def test_meshes_of_a_urdf_are_found_or_named(tmp_path):
    """A package is a folder above or beside; what is missing is left out, one line."""
    package = tmp_path / "my_arm"
    (package / "urdf").mkdir(parents=True)
    (package / "meshes").mkdir()
    tetrahedron = "v 0 0 0\nv .3 0 0\nv 0 .05 0\nv 0 0 .05\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"
    (package / "meshes" / "link.obj").write_text(tetrahedron + "f 2 3 4\n")
    for reference in (
        "package://my_arm/meshes/link.obj",
        "package://robots/arms/first/meshes/link.obj",  # a part of a package
        "../meshes/link.obj",
    ):
        shape = f'<geometry><mesh filename="{reference}"/></geometry>'
        assert quiet_arm(urdf(package / "urdf", shape=shape)).model.nmesh == 1
    for reference in ("package://my_arm/meshes/link.dae", "package://other/link.obj"):
        shape = f'<geometry><mesh filename="{reference}"/></geometry>'
        file = urdf(package / "urdf", shape=shape)
        with (
            pytest.warns(UserWarning, match=naming("two.urdf", "hinge", "finger")),
            pytest.warns(UserWarning, match=naming("two.urdf", "1", reference)) as got,
        ):
            arm = RigidArm(file)
        assert arm.model.ngeom == 0
        assert arm.model.body_mass.sum() == pytest.approx(5.6)
        assert all("\n" not in str(w.message) for w in got)


def test_a_mesh_of_another_kind_is_told_from_one_that_is_not_there(tmp_path):
    """A file that lies there and cannot be read names its kind and those that can."""
    (tmp_path / "link.dae").write_text("<COLLADA/>")
    for reference, says in (
        ("link.dae", ("two.urdf", ".dae", ".stl", ".obj", "link.dae")),
        ("gone.stl", ("two.urdf", "1", "not found", "gone.stl")),
    ):
        shape = f'<geometry><mesh filename="package://any/{reference}"/></geometry>'
        with (
            pytest.warns(UserWarning, match=naming("finger", "slide")),
            pytest.warns(UserWarning, match=naming(*says)),
        ):
            RigidArm(urdf(tmp_path, shape=shape))


def test_shapes_of_one_name_are_read_in_silence(tmp_path, capfd):
    """The engine would print a line for each of them, and one in Latin-1 is read."""
    plain = quiet_arm(urdf(tmp_path)).model
    path = tmp_path / "two.urdf"
    named = path.read_text().replace("<collision>", "<collision\n name='part > 1'>")
    assert named.count("part > 1") == 3
    path.write_bytes(named.replace("<robot", "<!-- \xe9 --><robot").encode("latin-1"))
    model = quiet_arm(str(path)).model
    assert capfd.readouterr() == ("", "")
    assert model.ngeom == plain.ngeom == 3
    assert np.array_equal(model.body_mass, plain.body_mass)
    assert np.array_equal(model.geom_pos, plain.geom_pos)


def test_a_suffix_in_upper_case_is_read(tmp_path):
    """As the same file in lower case, with what it includes and meshes beside it."""
    lower = quiet_arm(urdf(tmp_path))
    upper = tmp_path / "TWO.URDF"
    upper.write_text(lower.path.read_text())
    mesh = (
        "v 0 0 0\nv .3 0 0\nv 0 .05 0\nv 0 0 .05\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "link.obj").write_text(mesh)
    asset = '<asset><mesh name="link" file="link.obj"/></asset>'
    mjcf = tmp_path / "OWN.XML"
    own(tmp_path, asset=asset, more='<geom type="mesh" mesh="link"/>')
    mjcf.write_text((tmp_path / "own.xml").read_text())
    with pytest.warns(UserWarning, match=naming("TWO.URDF", "finger")):
        same = RigidArm(str(upper))
    assert same.joints == lower.joints and is_arm(str(upper))
    np.testing.assert_array_equal(same.model.body_mass, lower.model.body_mass)
    assert RigidArm(str(mjcf)).model.nmesh == 1


@pytest.mark.parametrize(
    "moments",
    [
        'ixx="0.01" iyy="0.05" izz="0.5" ixy="0" ixz="0" iyz="0"',
        'ixx="0.01" iyy="0.05" izz="0.06" ixy="0.2" ixz="0" iyz="0"',
    ],
)
def test_inertias_that_no_body_has_are_repaired_when_asked(moments, tmp_path, capsys):
    """The line names the option; with it the trace stays and the arm runs."""
    path = Path(urdf(tmp_path))
    good = 'ixx="0.01" iyy="0.05" izz="0.06" ixy="0" ixz="0" iyz="0"'
    path.write_text(path.read_text().replace(good, moments, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert main(["run", str(path)]) == 2
        err = capsys.readouterr().err
        assert names(err, "two.urdf", "inertia", "--balance-inertia", "balance_inertia")
        assert len(err.splitlines()) == 1
        scene = scene_of_arm(str(path), balance_inertia=True)
        arm = RigidArm(str(path), reading=scene.reading)
    inertia = arm.model.body("upper").inertia
    np.testing.assert_allclose(inertia, inertia.mean())
    expected = {"0.5": 0.56, "0.06": 0.12}[moments.split('"')[5]]
    assert inertia.sum() == pytest.approx(expected)


@pytest.mark.filterwarnings("ignore:.*two.urdf")
@pytest.mark.parametrize("kind", ["urdf", "mjcf"])
def test_a_body_with_a_mass_alone_becomes_a_sphere_when_asked(kind, tmp_path):
    """Zero moments are refused with a hint; the repair gives 2/5 m r² of water."""
    if kind == "urdf":
        path = Path(urdf(tmp_path))
        good = 'ixx="0.01" iyy="0.05" izz="0.06" ixy="0" ixz="0" iyz="0"'
        text = path.read_text().replace(good, re.sub(r"0\.\d+", "0", good), 1)
    else:
        path = tmp_path / "one.xml"
        text = (
            '<mujoco><worldbody><body name="upper"><joint name="hinge" axis="0 1 0"/>'
            '<inertial pos="0 0 .1" mass="2" diaginertia="0 0 0"/>'
            '<geom size=".01"/></body></worldbody></mujoco>'
        )
    path.write_text(text)
    with pytest.raises(InputError, match=naming("mjMINVAL", "--balance-inertia")):
        RigidArm(str(path))
    with pytest.warns(UserWarning, match=naming("water", "upper", "kg·m²")):
        arm = RigidArm(str(path), reading=ArmReading(balance_inertia=True))
    body = arm.model.body("upper")
    radius = (3.0 * body.mass[0] / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0)
    np.testing.assert_allclose(body.inertia, 0.4 * body.mass[0] * radius**2)


@pytest.mark.filterwarnings("ignore:.*two.urdf")
def test_the_line_on_a_file_that_lacks_something_says_what(tmp_path):
    """A link without inertia, and an MJCF file without one of its meshes."""
    path = Path(urdf(tmp_path))
    bare = re.sub(r"<(visual|collision)>.*?</\1>", "", path.read_text(), flags=re.S)
    path.write_text(re.sub("<inertial>.*?</inertial>", "", bare, count=1, flags=re.S))
    with pytest.raises(InputError, match=naming("mjMINVAL", "accepted", "<inertial>")):
        RigidArm(str(path))
    own(
        tmp_path,
        asset='<asset><mesh name="link" file="gone.stl"/></asset>',
        more='<geom type="mesh" mesh="link"/>',
    )
    with pytest.raises(InputError, match=naming("gone.stl", "accepted", "meshes")):
        RigidArm(str(tmp_path / "own.xml"))


def test_a_joint_that_mimics_another_is_refused(tmp_path):
    """Where no joint is left that moves on its own the line names both."""
    with pytest.raises(
        InputError, match=naming("two.urdf", "'joint'", "elbow", "lift", "scene")
    ):
        RigidArm(urdf(tmp_path, mimic='<mimic joint="lift" multiplier="2"/>'))


OWN = """
<mujoco>
  <compiler angle="degree" {compiler}/>
  <default><joint armature="0.5" damping="0.3"/></default>
  {asset}
  <worldbody>
    <body name="upper"><joint name="lift" axis="0 1 0" actuatorfrcrange="-9 9"/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="3"/>
      <body pos=".4 0 0"><joint axis="0 1 0" range="10 60" limited="true"/>
        <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/>{more}</body>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="lift" kp="100" forcerange="-40 40"/>
  </actuator>
  <sensor><actuatorfrc actuator="servo"/></sensor>
  <keyframe><key qpos="0.1 0.5" ctrl="0.1"/></keyframe>
</mujoco>
"""


def own(folder: Path, **parts: str) -> str:
    file = folder / "own.xml"
    file.write_text(OWN.format(**{"compiler": "", "asset": "", "more": "", **parts}))
    return str(file)


SHORT = {"simulation.duration_s": 2.0, "controller.kind": "pd"}


def test_a_scene_takes_the_mechanics_of_a_file_and_no_more(tmp_path):
    """Motors, sensors, keyframes, armature go; the model has those of the scene."""
    arm = RigidArm(own(tmp_path))
    assert arm.joints == ("lift", "joint_1")
    assert arm.effort == {"lift": 9.0}
    assert not arm.model.dof_armature.any()
    np.testing.assert_array_equal(arm.model.dof_damping, 0.3)
    scene = scene_of_arm(str(arm.path), overrides=[STEADY])
    scene = scene.with_friction(False).with_kinematic_error(0.0)
    run = run_scene(scene, overrides=SHORT)
    model = run.assembly.model
    assert (model.nu, model.nsensor, model.nkey) == (2, 0, 0)
    needed = run.assembly.link_torque[run.steady]
    assert np.abs(run.output_torque[run.steady] - needed).max() < 0.05


CLASSES = """<default><motor ctrlrange="-1 1" ctrllimited="true" forcerange="-2 2"
  forcelimited="true" gear="7 1"/></default>"""


def test_classes_of_a_file_do_not_reach_the_motors_of_the_scene(tmp_path):
    """A main class that limits motors of the file leaves those of the scene free."""
    runs = []
    for k, classes in enumerate(("", CLASSES)):
        folder = tmp_path / str(k)
        folder.mkdir()
        scene = scene_of_arm(own(folder, asset=classes), overrides=[STEADY])
        runs.append(run_scene(scene, overrides={"simulation.duration_s": 2.0}))
    np.testing.assert_array_equal(runs[0].position, runs[1].position)
    for name in ("ctrllimited", "forcelimited", "gear", "gainprm", "biasprm"):
        first, second = (getattr(r.assembly.model, f"actuator_{name}") for r in runs)
        np.testing.assert_array_equal(first, second)


def test_the_sweep_keeps_to_the_limits(tmp_path):
    """Joints that may not be at the reference start in the middle of their range."""
    arm = RigidArm(own(tmp_path))
    start, end = gentle_sweep(arm)
    np.testing.assert_allclose(start, [0.0, 35.0 * deg])
    np.testing.assert_allclose(np.abs(end - start), SWEEP)
    panda = RigidArm("panda")
    low, high = panda.model.jnt_range.T
    room = MARGIN * (high - low)
    for position in gentle_sweep(panda):
        assert (position >= low + room - 1e-12).all()
        assert (position <= high - room + 1e-12).all()


def test_drives_by_rule_are_the_smallest_that_carry_the_arm(tmp_path):
    """Rated torque covers the weight on the sweep, or repeated peak the effort.

    Every drive has the rotor inertia assumed for it, unless one is stated.
    """
    rated = {"CSG-14-100": 10, "CSG-17-100": 31, "CSG-20-100": 52, "CSG-25-100": 87}
    arm, scene = RigidArm("ur5e"), scene_of_arm("ur5e")
    assert arm.effort == {}
    path = np.linspace(*gentle_sweep(arm), 50)
    for name, needed in zip(
        arm.joints, np.abs(arm.gravity(path)).max(axis=0), strict=True
    ):
        fits = [drive for drive, torque in rated.items() if torque >= needed]
        assert scene.joint_settings(name).drive == fits[0]
    lift = scene.joint_settings("shoulder_lift_joint")
    assert (lift.drive, lift.rotor_inertia_kgm2) == ("CSG-25-100", 8.26e-5)
    scene = scene_of_arm(urdf(tmp_path))
    assert scene.joint_settings("lift").drive == "CSG-17-100"  # 60 of 70 N·m
    changed = scene_of_arm(
        "ur5e",
        overrides=[
            "joints.elbow_joint.drive=CSG-25-100",
            "joints.wrist_1_joint.rotor_inertia_kgm2=2e-4",
        ],
    )
    rotors = [changed.joint_settings(name).rotor_inertia_kgm2 for name in arm.joints]
    assert rotors == [6.6e-6, 8.26e-5, 8.26e-5, 2e-4, 6.6e-6, 6.6e-6]
    for stated in (
        {"drive": "CSG-20-100"},
        {"overrides": ["defaults.drive=CSG-20-100"]},
    ):
        chosen = scene_of_arm("ur5e", **stated)
        sections = [chosen.joint_settings(name) for name in arm.joints]
        assert {one.drive for one in sections} == {"CSG-20-100"}
        (rotor,) = {one.rotor_inertia_kgm2 for one in sections}
        assert rotor == assumed_rotor_inertia("CSG-20-100")


def test_run_takes_an_arm_and_leaves_its_scene(tmp_path, capsys):
    """The scene file that it writes runs to the same figures from any folder."""
    file = urdf(tmp_path)
    set_drive = ["--set", "joints.elbow.drive=CSG-20-100", "--set", "tool_site=hand"]
    out = tmp_path / "out"
    arguments = ["run", file, "--drive", "CSG-17-100", *set_drive, *QUICK]
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        assert main([*arguments, "--out", str(out), "--json"]) == 0
        first = capsys.readouterr()
        assert main(["run", str(out / "scene.toml"), "--json"]) == 0
        again = json.loads(capsys.readouterr().out)
    result = json.loads(first.out)
    assert first.err.count("held at the reference position") == 1
    names = {k: v["drive"] for k, v in result["contains"]["joints"].items()}
    assert names == {"lift": "CSG-17-100", "elbow": "CSG-20-100"}
    names = [Path(f).name for f in result["files"]]
    assert names == ["run.rrd", "run.png", "scene.toml"]
    assert result["arm"]["held"] == {"finger": "slide"}
    assert result["tool"]["path_rms_mm"] > 0
    assert again["joints"] == result["joints"]
    assert again["tool"] == result["tool"]


def test_one_of_two_hands_is_named_as_the_tool(tmp_path, capsys):
    """The fingers of one hand are one end of an arm, two hands are two."""
    arm = """<body name="{0}" pos="0 {1} 1"><joint name="{0}" axis="0 1 0"/>
      <geom size="0.05" mass="1"/><body name="{0}_hand" pos="0.3 0 0">
      <geom size="0.03" mass="0.2"/>{2}</body></body>"""
    fingers = "".join(
        f'<body name="{{0}}_{k}" pos="0.1 {k} 0"><geom size="0.01" mass="0.01"/></body>'
        for k in (0, 1)
    )
    sides = [
        arm.format(name, y, fingers.format(name)) for name, y in (("l", 1), ("r", -1))
    ]
    file, told = tmp_path / "hands.xml", []
    own = ["--set", "tool_site=r_0"]
    for count, options in ((1, []), (2, []), (2, own)):
        text = "".join(sides[:count])
        file.write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            assert main(["run", str(file), "--set", STEADY, *QUICK, *options]) == 0
        out, err = capsys.readouterr()
        told.append("those of l_0; other ends: r_0;" in err)
        tool = options[-1].removeprefix("tool_site=") if options else "l_0"
        assert f"\ntool {tool}: deviation" in out
    assert told == [False, True, False]


def test_a_chain_of_fixed_links_on_a_column_is_no_tool(tmp_path, capsys):
    """A camera on the first link or on the stand changes neither tool nor figures."""
    names = ("mount", "box", "plate", "camera", "lens")
    camera = "".join(f'<body name="{name}">' for name in names) + 5 * "</body>"
    arm = """<mujoco><worldbody><body name="stand">{0}
      <body name="column"><joint name="turn" axis="0 0 1"/>
      <geom size="0.05" mass="1"/>{1}<body name="upper" pos="0 0 0.3">
      <joint name="lift" axis="0 1 0"/><geom size="0.05" mass="1"/>
      <body name="fore" pos="0.3 0 0"><joint name="bend" axis="0 1 0"/>
      <geom size="0.05" mass="1"/><body name="flange" pos="0.3 0 0"/>
      </body></body></body></body></worldbody></mujoco>"""
    file, found = tmp_path / "camera.xml", []
    for on_stand, on_column in (("", ""), ("", camera), (camera, "")):
        file.write_text(arm.format(on_stand, on_column))
        assert main(["run", str(file), "--set", STEADY, *QUICK, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["tool"])
    assert found[0]["site"] == "flange"
    assert found[0]["path_rms_mm"] > 0.01
    assert found[1:] == found[:1] * 2


def test_only_assumed_values_are_called_assumed(tmp_path, capsys):
    """A stated rotor inertia and the stated size of an error are not."""
    file = urdf(tmp_path)

    def assumed(*changes):
        stated = [word for change in changes for word in ("--set", change)]
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            assert main(["run", file, *QUICK, *stated]) == 0
        return [
            line for line in capsys.readouterr().out.splitlines() if "assumed" in line
        ]

    rotor, *errors = assumed()
    assert names(rotor, "rotor inertia", "lift", "elbow")
    assert all(line.startswith("kinematic error assumed: ") for line in errors)
    rotor, *errors = assumed(
        "joints.lift.rotor_inertia_kgm2=1e-4", "joints.lift.kinematic_error_arcmin=0.5"
    )
    assert names(rotor, "elbow") and not names(rotor, "lift")
    (stated,) = [line for line in errors if "lift" in line]
    assert names(stated, "0.5 arcmin stated", "assumed: at 2 and 4 per turn")
    first, *_ = assumed("defaults.rotor_inertia_kgm2=1e-4")
    assert not names(first, "rotor inertia")


def test_a_drive_for_all_joints_of_a_scene(capsys):
    """Option --drive replaces that of a scene, too."""
    keys = ["--set", "simulation.duration_s=1.0", "--set", "defaults.level=linear"]
    assert main(["run", "bench", "--drive", "CSG-14-100", *keys, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["contains"]["joints"]["joint"]["drive"] == "CSG-14-100"


def test_a_bundled_name_is_a_scene_before_it_is_an_arm():
    """The bench is both; a file is what its suffix says."""
    assert not is_arm("bench") and is_arm("panda") and is_arm("my/arm.URDF")
    assert not is_arm("panda-sweep") and not is_arm("my/scene.toml")


@pytest.mark.parametrize(
    ("parts", "arguments", "says"),
    [
        ({}, ["--drive", "CSG-99-100"], ("'CSG-99-100'", "ratings.csv", "CSG-32-100")),
        ({}, ["--set", "joints.knee.drive=CSG-17-100"],
         ("own.xml", "joints.knee", "lift", "joint_1")),
        ({}, ["--set", "tool_site=hook"], ("own.xml", "'hook'", "upper", "body_2")),
        ({}, ["--report"], ("--report", "--out DIR")),
        (
            {"asset": '<asset><mesh name="m" file="gone.stl"/></asset>'},
            [],
            ("own.xml", "MuJoCo", "'gone.stl'"),
        ),
        (
            {"more": '</body><body><joint name="s"/><joint name="t" axis="1 0 0"/>'
             '<geom size=".1"/>'},
            [],
            ("'t'", "first", "'body_3'"),
        ),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(parts, arguments, says, tmp_path, capsys):
    """Status 2, one line that says what would do."""
    assert main(["run", own(tmp_path, **parts), *arguments]) == 2
    err = capsys.readouterr().err
    assert names(err, *says)
    assert len(err.splitlines()) == 1


def test_an_arm_without_a_hinge_is_named(tmp_path, capsys):
    """What it has instead is said."""
    file = tmp_path / "lift.xml"
    file.write_text(
        "<mujoco><worldbody><body><joint name='lift' type='slide'/>"
        "<geom size='1'/></body></worldbody></mujoco>"
    )
    assert main(["run", str(file)]) == 2
    err = capsys.readouterr().err
    assert names(err, "lift.xml", "hinge", "lift", "slide")
    assert len(err.splitlines()) == 1


def test_shapes_that_push_each_other_are_named(tmp_path):
    """Overlapping bodies of an MJCF arm give one line; neighbours may overlap."""
    hand = '<body name="hand" pos="-.3 0 0"><joint/><geom size=".08"/></body>'
    arm = RigidArm(own(tmp_path, more=hand))
    zero = np.zeros((3, 3))
    with pytest.warns(
        UserWarning,
        match=naming("own.xml", "'hand'", "'upper'", "<exclude>", "contype"),
    ) as got:
        arm.gravity(zero)
    assert len(got) == 1
    RigidArm(own(tmp_path)).gravity(zero[:, :2])


def test_a_template_is_named(tmp_path, capsys):
    """A xacro file says what makes a URDF of it, and its output is no template."""
    file = tmp_path / "arm.urdf.xacro"
    file.write_text("<robot/>")
    assert main(["run", str(file)]) == 2
    assert names(capsys.readouterr().err, "'xacro arm.urdf.xacro'", "URDF", ".urdf")
    plain = tmp_path / "arm.urdf"
    plain.write_text(
        '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="l"/>'
        '<joint name="j" type="revolute"><parent link="l"/><child link="m"/>'
        '<origin xyz="0 0 ${r}"/></joint><link name="m"/></robot>'
    )
    assert main(["run", str(plain)]) == 2
    assert names(capsys.readouterr().err, "arm.urdf", "xyz", "template", "'xacro")
    made = "<!-- autogenerated by xacro from ${x}.xacro -->"
    plain.write_text(made + plain.read_text().replace("${r}", "0.3 0"))
    assert main(["run", str(plain)]) == 2
    error = capsys.readouterr().err
    assert names(error, "arm.urdf", "xyz") and "URDF template" not in error


def test_a_scene_names_a_urdf_beside_it(tmp_path, monkeypatch):
    """The path is relative to the scene file."""
    urdf(tmp_path)
    (tmp_path / "mine.toml").write_text(
        f"""name = "mine"\narm = "two.urdf"
        [defaults]\n{STEADY.removeprefix("defaults.")}
        rotor_inertia_kgm2 = 1e-4\nlevel = "linear"
        [trajectory]\nkind = "constant_speed"\nstart_deg = {{lift = -90.0}}
        speed_deg_s = {{elbow = 3.0}}\n[simulation]\nduration_s = 0.2\n"""
    )
    monkeypatch.chdir("/")
    with pytest.warns(UserWarning, match=naming("two.urdf", "hinge", "finger")):
        run = run_scene(Scene.load_file(tmp_path / "mine.toml"))
    assert run.joints == ("lift", "elbow")
    assert run.assembly.model.nv == 4
    assert mujoco.mj_name2id(run.assembly.model, mujoco.mjtObj.mjOBJ_BODY, "hand") > 0


def test_names_that_are_made_up_are_free(tmp_path):
    """A joint without a name beside one that has the next name in line."""
    path = tmp_path / "named.xml"
    path.write_text(
        """<mujoco><worldbody><body name="body_1"><joint name="joint_1" axis="0 0 1"/>
        <geom size="0.1"/><body><joint axis="0 1 0"/><geom size="0.1"/>
        </body></body></worldbody></mujoco>"""
    )
    arm = RigidArm(str(path))
    assert len(set(arm.joints)) == 2
    assert "joint_1" in arm.joints


def test_few_iterations_of_a_file_do_not_reach_a_scene(tmp_path):
    """The same motion whatever limits the file sets for other solvers."""
    text = RigidArm("two-link").path.read_text()
    found = []
    for limits in ("", 'iterations="1" ls_iterations="1"'):
        arm = tmp_path / "arm.xml"
        arm.write_text(text.replace("<option", f"<option {limits}"))
        scene = scene_of_arm(str(arm), drive="CSG-25-100")
        run = run_scene(scene.with_changes({"simulation.duration_s": 2.0}))
        assert run.assembly.model.opt.iterations == 100
        found.append(run.position)
    np.testing.assert_array_equal(*found)


BENT = """<mujoco>{head}<worldbody><body name="link">
  <joint name="j" axis="{axis}" damping="{damping}"/><geom size=".1" pos="{at} 0 0"/>
  </body></worldbody>{tail}</mujoco>"""
SOUND = {"head": "", "axis": "0 1 0", "damping": "0", "at": "0", "tail": ""}


@pytest.mark.filterwarnings("ignore:Inertia matrix:UserWarning")  # of the engine
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"head": '<option gravity="nan 0 0"/>'}, ("gravity", "nan", "1e+10")),
        ({"head": '<option gravity="0 0 1e300"/>'}, ("gravity", "1e+300")),
        ({"damping": "nan"}, ("joint 'j'", "damping", "nan")),
        ({"damping": "inf"}, ("joint 'j'", "damping", "inf")),
        ({"axis": "0 1e300 0"}, ("joint 'j'", "axis")),
        ({"at": "1e200"}, ("body 'link'", "1e+10")),
        (
            {"tail": '<actuator><motor joint="j" forcerange="nan nan"/></actuator>'},
            ("joint 'j'", "torque limit", "nan"),
        ),
        (
            {"tail": '<keyframe><key name="k" qpos="nan"/></keyframe>'},
            ("key 'k'", "qpos", "nan"),
        ),
        (
            {"tail": '<tendon><fixed name="t"><joint joint="x" coef="1"/></fixed>'
             "</tendon>"},
            ("tendon 't'", "not in the file"),
        ),
        (
            {"tail": '<equality><weld name="w" body1="link" body2="x"/></equality>'},
            ("equality 'w'", "not in the file"),
        ),
        (
            {"tail": '<contact><pair name="p" geom1="x" geom2="y"/></contact>'},
            ("contact pair 'p'", "not in the file"),
        ),
    ],
)  # fmt: skip
def test_numbers_and_names_that_no_arm_has_are_named(change, says, tmp_path, capfd):
    """Element and attribute of what is not finite, huge, or refers to nothing."""
    file = tmp_path / "bent.xml"
    file.write_text(BENT.format(**SOUND | change))
    with pytest.raises(InputError) as caught:
        RigidArm(str(file))
    assert names(str(caught.value), "bent.xml", *says)
    file.write_text(BENT.format(**SOUND))
    assert RigidArm(str(file)).joints == ("j",)


@pytest.mark.filterwarnings("ignore:.*held at the reference position:UserWarning")
def test_numbers_of_a_urdf_are_named(tmp_path, capfd):
    """A damping that is no number is refused; an effort without end is no limit."""
    file = Path(urdf(tmp_path))
    sound = file.read_text()
    file.write_text(sound.replace('damping="0.4"', 'damping="nan"'))
    with pytest.raises(InputError, match=naming("joint 'lift'", "damping", "nan")):
        RigidArm(str(file))
    file.write_text(sound.replace('effort="60"', 'effort="inf"'))
    assert "lift" not in RigidArm(str(file)).effort


def test_names_that_are_no_text_are_refused(tmp_path):
    """The engine takes any bytes as a name; the line names the file and the byte."""
    path = tmp_path / "arm.xml"
    path.write_bytes(
        b'<mujoco><worldbody><body name="lin\xb5"><joint name="j"/><geom size=".1"/>'
        b"</body></worldbody></mujoco>"
    )
    with pytest.raises(InputError, match=naming("arm.xml", "0xb5", "UTF-8")):
        scene_of_arm(path)


@pytest.mark.parametrize("where", ["file", "include", "entity"])
def test_a_class_is_no_format(tmp_path, where):
    """A name with which the engine would end the process is refused by its file."""
    name = "a%s%n" if where != "entity" else "a&#37;n"
    joint = f'<joint name="elbow" class="{name}" axis="0 1 0"/>'
    part = tmp_path / "part.xml"
    part.write_text(f'<mujoco><worldbody><body name="b">{joint}</body></worldbody>')
    body = "<worldbody><body>" + joint + '<geom size="0.1"/></body></worldbody>'
    inside = '<include file="part.xml"/>' if where == "include" else body
    path = tmp_path / "arm.xml"
    path.write_text(f"<mujoco>{inside}</mujoco>")
    file = "part.xml" if where == "include" else "arm.xml"
    with pytest.raises(InputError, match=naming(file, "a%", "percent")):
        scene_of_arm(path)
