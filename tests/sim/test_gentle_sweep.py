"""Where an arm of any owner starts, and that its sweep runs into nothing."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.sim.arm.gentle_sweep import CLEARANCE, SWEEP, gentle_sweep, place_arm
from swgjoint.sim.arm.reading import ArmReading
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import arm_scene, rigid_arm_of, scene_of_arm
from swgjoint.sim.assembly import assemble
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.units import deg

STEADY = "defaults.linear={stiffness_Nm_rad=2e4,rated_torque_Nm=50.0}"

TABLE = """
<mujoco>
  <compiler angle="degree"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    {wall}
    <body name="upper" pos="0 0 .3"><joint name="lift" axis="0 1 0" {lift}/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="3"/>
      <body name="fore" pos=".4 0 0"><joint name="elbow" axis="0 1 0" {elbow}/>
        <geom type="capsule" fromto=".1 0 0 .4 0 0" size=".03" mass="1"/>
        <body name="finger" pos=".45 0 0"><joint name="grip" type="slide"/>
          <geom size=".01" mass=".1"/></body></body>
    </body>
  </worldbody>
  {keys}
</mujoco>
"""
KEYS = """<keyframe><key name="home" qpos="-1.2 1.5 .01"/>
  <key name="up" qpos="-1.5 0 0"/></keyframe>"""


def written(folder: Path, name: str = "arm.xml", **parts: str) -> str:
    file = folder / name
    blank = {"wall": "", "lift": "", "elbow": "", "keys": ""}
    file.write_text(TABLE.format(**blank | parts))
    return str(file)


def placed(reference: str, pose: str | None = None, **reading: object):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return place_arm(reference, reading=ArmReading(**reading), pose=pose)


def nearest(arm: RigidArm, path: np.ndarray) -> float:
    """Smallest distance of two bodies on a motion, up to 20 mm [m]."""
    return -max((d for _, _, d in arm.contacts(path, within=0.02)), default=-0.02)


def test_contacts_are_those_of_the_engine(tmp_path):
    """Bodies and depth of a pose in the floor; a distance where one is asked for."""
    arm, _ = placed(written(tmp_path))
    low = np.array([[0.0, 0.0], [0.5, 0.0], [0.6, -0.2]])
    data = mujoco.MjData(arm.model)
    data.qpos[:] = low[1]
    mujoco.mj_forward(arm.model, data)
    (a, b, depth), *_ = arm.contacts(low)
    assert (a, b) == ("world", "finger")
    assert depth == pytest.approx(-data.contact.dist.min())
    assert arm.contacts(low[:1]) == []
    # level, the thicker upper arm is 260 mm above the floor, the other 270 mm
    ((*near, depth),) = arm.contacts(low[:1], within=0.265)
    assert near == ["world", "upper"]
    assert depth == pytest.approx(-0.26)


@pytest.mark.parametrize(
    ("parts", "pose", "start"),
    [
        ({"keys": KEYS}, None, (-1.2, 1.5)),
        ({"keys": KEYS}, "home", (-1.2, 1.5)),
        ({"keys": KEYS}, "up", (-1.5, 0.0)),
        ({"keys": KEYS}, "reference", (0.0, 0.0)),
        ({"keys": KEYS.replace("home", "rest")}, "home", (-1.2, 1.5)),
        ({}, None, (0.0, 0.0)),
        ({}, "home", (0.0, 0.0)),
        # the keyframe lies in the floor
        ({"keys": KEYS.replace("-1.2 1.5", ".9 .2")}, None, (0.0, 0.0)),
        # zero is no place for the elbow, or for both
        ({"elbow": 'range="-100 -20"'}, None, (0.0, -60 * deg)),
        ({"lift": 'range="-90 30"'}, "middle", (-30 * deg, 0.0)),
        # the reference runs into a wall, the middle does not
        (
            {
                "wall": '<geom type="sphere" size=".1" pos=".7 0 .3"/>',
                "lift": 'range="-130 30"',
                "elbow": 'range="-60 60"',
            },
            None,
            (-50 * deg, 0.0),
        ),
    ],
)  # fmt: skip
def test_an_arm_starts_where_nothing_touches(parts, pose, start, tmp_path):
    """First keyframe, reference or middle of its range, then the middle of all."""
    arm, found = placed(written(tmp_path, **parts), pose)
    np.testing.assert_allclose(found, start, atol=1e-9)
    assert arm.contacts(found[None]) == []


def test_what_is_held_is_held_in_the_start_pose(tmp_path):
    """The finger and a hinge without drive are where the keyframe has them."""
    arm, start = placed(written(tmp_path, keys=KEYS), driven=("lift",))
    whole = mujoco.MjModel.from_xml_path(str(arm.path))
    data = mujoco.MjData(whole)
    mujoco.mj_resetDataKeyframe(whole, data, 0)
    mujoco.mj_kinematics(whole, data)
    np.testing.assert_allclose(arm.body_poses(start[None])[0][0], data.xpos, atol=1e-9)


@pytest.mark.parametrize(
    "wall",
    [
        '<geom type="box" size=".1 .1 .02" pos=".7 0 .2"/>',
        '<geom type="box" size=".1 .1 .02" pos=".7 0 .4"/>',
        '<geom type="box" size=".1 .1 .02" pos=".7 0 .4"/>'
        '<geom type="box" size=".1 .1 .02" pos=".7 0 .15"/>',
    ],
)
def test_a_sweep_keeps_its_distance(wall, tmp_path):
    """Below, above or between boards: no body comes nearer than the clearance."""
    arm, start = placed(written(tmp_path, wall=wall))
    _, end = gentle_sweep(arm, start)
    assert (end != start).any()
    assert (np.abs(end - start) <= SWEEP + 1e-12).all()
    assert nearest(arm, np.linspace(start, end, 200)) >= 0.9 * CLEARANCE
    # the board or two is in the way of both joints together
    assert nearest(arm, np.linspace(start, start + SWEEP, 50)) < CLEARANCE


def test_an_arm_that_cannot_move_says_what_is_in_the_way(tmp_path):
    """Boards on both sides: bodies, and other ways to start."""
    board = '<geom type="box" size=".4 .1 .01" pos=".5 0 {}"/>'
    walls = board.format(0.356) + board.format(0.244)
    arm, start = placed(written(tmp_path, wall=walls))
    with pytest.raises(
        InputError, match=naming("arm.xml", "'world'", "'fore'", "--pose", "--motion")
    ):
        gentle_sweep(arm, start)


def test_bodies_that_touch_at_the_start_are_named(tmp_path):
    """Where no pose is free: one line with bodies, depth, poses; the sweep starts."""
    wall = '<geom type="sphere" size=".2" pos="0 0 .3"/>'
    path = written(tmp_path, wall=wall, keys=KEYS)
    with pytest.warns(
        UserWarning,
        match=naming("arm.xml", "'world'", "'upper'", "mm", "home", "reference"),
    ) as said:
        scene = arm_scene(path).scene
    assert len(said) == 1
    assert scene.trajectory.start_deg["lift"] == pytest.approx(-1.2 / deg)


def test_a_named_pose_or_a_kind_that_does_not_exist(tmp_path):
    """The accepted ones are listed."""
    path = written(tmp_path, keys=KEYS)
    with pytest.raises(
        InputError,
        match=naming("arm.xml", "'rest'", "home", "up", "reference", "middle"),
    ):
        scene_of_arm(path, pose="rest")
    with pytest.raises(InputError, match=naming("'zigzag'", "'sweep'", "'circle'")):
        scene_of_arm(path, motion="zigzag")


@pytest.mark.parametrize(
    "kind",
    ["sweep", "step", "trapezoid", "constant_speed", "chirp", "line", "circle"],
)
@pytest.mark.parametrize("how", ["motion", "key"])
def test_every_kind_of_motion_suits_an_arm(kind, how, tmp_path):
    """Asked for by option or key, without a word of the sweep, without contact."""
    options = (
        {"motion": kind}
        if how == "motion"
        else {"overrides": [f"trajectory.kind={kind}"]}
    )
    # the fewest joints of a tool motion in a plane
    axis = '<joint name="turn" axis="0 0 1"/>'
    path = Path(written(tmp_path, keys=KEYS.replace('qpos="', 'qpos="0 ')))
    path.write_text(
        path.read_text().replace('<joint name="lift"', f'{axis}<joint name="lift"')
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = scene_of_arm(str(path), **options)
        arm = rigid_arm_of(scene)
    assert scene.trajectory.kind == kind
    motion = trajectory_of(scene, arm)
    assert np.ptp(motion.position, axis=0).max() > 0.5 * deg
    assert arm.contacts(motion.position[::50]) == []


@pytest.mark.parametrize("name", ["ur5e", "kinova", "iiwa14"])
def test_a_stretched_arm_is_bent_before_its_tool_moves(name):
    """An arm that points straight out or up makes a circle; its own start stays."""
    scene = scene_of_arm(name, motion="circle")
    path = trajectory_of(scene, rigid_arm_of(scene))
    assert np.ptp(path.position, axis=0).max() > 0.5 * deg
    with pytest.raises(InputError, match=naming("--pose", "start_deg")):
        scene_of_arm(name, motion="circle", pose="reference")


def test_another_kind_of_motion_takes_the_place_of_the_first():
    """Keys that only the old motion has go; those of the user count in any order."""
    scene = scene_of_arm("two-link")
    changes = ["trajectory.speed_deg_s.shoulder=3", "trajectory.kind=constant_speed"]
    changed = scene.with_changes(changes)
    assert changed.trajectory.speed_deg_s == {"shoulder": 3}
    assert changed.trajectory.start_deg == scene.trajectory.start_deg
    with pytest.raises(InputError, match=naming("trajectory.radius_mm", "missing")):
        scene.with_changes(["trajectory.kind=circle"])


def test_the_start_of_a_user_is_where_the_sweep_starts(tmp_path):
    """Changed angles count before the way is chosen."""
    path = written(tmp_path, keys=KEYS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = scene_of_arm(path, overrides=["trajectory.start_deg.lift=-20"])
    start, end = scene.trajectory.start_deg, scene.trajectory.end_deg
    assert start["lift"] == -20
    assert abs(end["lift"] - start["lift"]) <= SWEEP / deg + 1e-9


def test_a_scene_file_takes_the_name_of_its_folder(tmp_path):
    """The name scene says nothing; another does."""
    folder = tmp_path / "my_robot"
    folder.mkdir()
    for file, name in (("scene.xml", "my_robot"), ("arm.xml", "arm")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert scene_of_arm(written(folder, file)).name == name


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"trajectory.start_deg.lift": 950.0}, ("lift", "starts", "950 deg", "30 deg")),
        ({"trajectory.end_deg.lift": -200.0}, ("lift", "ends", "-200 deg", "-90")),
        (
            {"trajectory.kind": "chirp", "trajectory.joint": "lift",
             "trajectory.amplitude_deg": 60.0, "trajectory.from_Hz": 0.5,
             "trajectory.to_Hz": 1.0},
            ("lift", "reaches", "deg", "-90 to 30"),
        ),
    ],
)  # fmt: skip
def test_a_motion_beyond_a_range_is_refused_before_it_is_solved(keys, says, tmp_path):
    """Joint, angle, range."""
    path = written(tmp_path, lift='range="-90 30"', keys=KEYS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = scene_of_arm(path).with_changes(
            [STEADY, *(f"{k}={v}" for k, v in keys.items())]
        )
        with pytest.raises(InputError, match=naming("trajectory", *says)):
            assemble(scene)


def test_a_link_without_inertia_is_named(tmp_path):
    """Link, inertia, mass and what is needed."""
    path = tmp_path / "light.xml"
    path.write_text(
        """<mujoco><worldbody><body name="speck"><joint name="lift"/>
        <inertial mass="1e-9" pos="0 0 0" diaginertia="1e-12 1e-12 1e-12"/></body>
        </worldbody></mujoco>"""
    )
    with pytest.raises(
        InputError, match=naming("'lift'", "'speck'", "1e-12 kg·m²", "1e-09 kg", "N·m")
    ):
        assemble(scene_of_arm(str(path)))


def test_a_start_in_contact_names_the_bodies(tmp_path):
    """Not the torque that no drive could hold."""
    from swgjoint.view.run import run_scene

    path = written(tmp_path, keys=KEYS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = scene_of_arm(path, drive="CSG-25-100")
        low = ["trajectory.start_deg.lift=80", "trajectory.end_deg.lift=81"]
        with pytest.raises(
            InputError,
            match=naming("start_deg", "'world'", "'fore'", "mm", "<exclude>"),
        ):
            run_scene(scene.with_changes(low))


@pytest.mark.parametrize("motion", ["line", "circle"])
def test_tool_motions_begin_away_from_singular_poses(motion):
    """The UR5e of the models folder is stretched at its reference position."""
    made = arm_scene("ur5e", motion=motion)
    assert not np.allclose(list(made.scene.trajectory.start_deg.values()), 0.0)
