"""Drawn paths of ArmTracking-v0: within their limits, smooth, and those of the seed."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from messages import naming

from swgjoint.envs import plans
from swgjoint.envs.arm.paths import ArmPaths
from swgjoint.envs.arm_tracking import ArmTrackingEnv, ArmTrackingVectorEnv
from swgjoint.errors import InputError
from swgjoint.models_path import models_path
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.units import mm

JOINT = ("sinusoid", "multisine", "point_to_point")
TOOL = ("line", "arc", "spline")
LIMITS = {"max_speed_rad_s": 0.4, "max_angle_rad": 0.3, "max_distance_mm": 60.0}
ROUND_OFF = 1.0 + 1e-9


def drawn(**keys):
    """Batch of 6 episodes on drawn paths, after a reset."""
    keys = {**LIMITS, "episode_s": 1.0, "friction": False, **keys}
    env = ArmTrackingVectorEnv(6, threads=1, **keys)
    env.reset(seed=3)
    return env


@pytest.mark.parametrize("kind", JOINT + TOOL)
def test_paths_keep_their_limits(kind):
    """Speed, angle from the start and, on tool paths, distance; some of it is used."""
    task = drawn(reference=kind).task
    q, v = task.position, task.velocity
    angle, speed = np.abs(q - q[0]).max(), np.abs(v).max()
    assert 0.02 < angle <= 0.3 * ROUND_OFF
    assert 0.05 < speed <= 0.4 * ROUND_OFF
    assert not v[0].any() and not task.acceleration[0].any()
    arm = RigidArm("ur5e")
    for k in range(q.shape[1]):
        tool = arm.tool_positions(q[:, k])
        distance = np.linalg.norm(tool - tool[0], axis=1)
        if kind in TOOL:
            assert distance.max() <= 60.0 * mm * ROUND_OFF
        assert distance.max() > 2.0 * mm


@pytest.mark.parametrize(
    "limit", [{"max_angle_rad": 0.03}, {"max_speed_rad_s": 0.03}], ids=str
)
def test_curves_are_cut_off_at_the_limits_of_the_joints(limit):
    """In either direction, and close to the limit, because more would fit."""
    found = []
    for seed in range(4):
        env = drawn(reference=TOOL, **limit)
        env.reset(seed=10 * seed)
        q, v = env.task.position, env.task.velocity
        # shape (directions, instants, episodes, joints)
        found.append([q - q[0], q[0] - q] if "max_angle_rad" in limit else [v, -v])
    top = np.max(found, axis=(0, 2, 3, 4))
    (bound,) = limit.values()
    assert (top <= bound * ROUND_OFF).all() and (top > 0.8 * bound).all()


@pytest.mark.parametrize("kind", JOINT + TOOL)
def test_speeds_and_accelerations_are_derivatives(kind):
    """Central differences of position and speed over two periods."""
    task = drawn(reference=kind).task
    for value, slope in (
        (task.position, task.velocity),
        (task.velocity, task.acceleration),
    ):
        found = (value[2:] - value[:-2]) / (2.0 * task.period)
        # a quarter of the change of the slope over one period
        bound = 0.26 * np.abs(np.diff(slope, n=2, axis=0)).max() + 1e-9
        assert np.abs(found - slope[1:-1]).max() <= bound


@pytest.mark.parametrize("kind", ["line", "arc"])
def test_tool_paths_are_lines_and_arcs(kind):
    """Points of a line have one direction; those of an arc lie on a circle."""
    task, arm = drawn(reference=kind).task, RigidArm("ur5e")
    for k in range(task.position.shape[1]):
        tool = arm.tool_positions(task.position[::20, k])
        moved = tool - tool[0]
        sizes = np.linalg.svd(moved, compute_uv=False)
        flat = 1 if kind == "line" else 2
        np.testing.assert_allclose(sizes[flat:], 0.0, atol=1e-8)
        if kind == "arc":
            assert sizes[1] > 1e-5
            # circle through the start: |x|² = 2 c·x
            centre, *_ = np.linalg.lstsq(2.0 * moved, (moved**2).sum(1), rcond=1e-6)
            radius = np.linalg.norm(moved - centre, axis=1)
            np.testing.assert_allclose(radius, radius[0], rtol=1e-5)


def test_the_tool_keeps_its_orientation_on_tool_paths():
    """An arm with six joints only shifts its tool."""
    task, arm = drawn(reference="spline").task, RigidArm("ur5e")
    body = arm.model.site_bodyid[arm.tool]
    _, turns = arm.body_poses(task.position[::100, 0])
    np.testing.assert_allclose(np.abs(turns[:, body] @ turns[0, body]), 1.0, atol=1e-9)


@pytest.mark.parametrize("reference", [JOINT, TOOL])
def test_torques_and_errors_are_those_of_the_path(reference):
    """Inverse dynamics of the rigid arm; the tool errs as its links do."""
    env = drawn(reference=reference)
    task, arm = env.task, RigidArm("ur5e")
    motion = (task.position[:, 2], task.velocity[:, 2], task.acceleration[:, 2])
    np.testing.assert_array_equal(task.link_torque[:, 2], arm.torques(*motion))
    for _ in range(600):
        *_, info = env.step(np.zeros((6, 6)))
    q, at = task.position[600], info["link_angle_rad"]
    offset = arm.tool_positions(at) - arm.tool_positions(q)
    want = np.linalg.norm(offset, axis=1) / mm
    np.testing.assert_allclose(info["tool_error_mm"], want, rtol=0.02, atol=1e-3)
    assert want.max() < 3.0  # the loop follows the path


def test_paths_differ_between_seeds_and_repeat_with_them():
    """Every episode of a generator has a new path; the same seed gives the same."""
    env = ArmTrackingEnv(reference=("multisine", "arc"), episode_s=0.5)
    paths = []
    for seed in (5, None, 5, None, 6):
        env.reset(seed=seed)
        paths.append(env.task.position)
    np.testing.assert_array_equal(paths[0], paths[2])
    np.testing.assert_array_equal(paths[1], paths[3])
    for a, b in ((0, 1), (0, 4), (1, 4)):
        assert np.abs(paths[a] - paths[b]).max() > 1e-3


def test_all_kinds_are_drawn():
    """Of the six kinds, whose draws are equally likely, each within 60 episodes."""
    env = ArmTrackingEnv(reference=JOINT + TOOL, episode_s=0.5)
    rng, kinds = np.random.default_rng(0), set()
    for _ in range(60):
        path, _ = env.core.draw(rng)
        kinds.add(path.kind)
    assert kinds == set(JOINT + TOOL)


def test_an_episode_is_not_limited_by_the_motion_of_the_scene():
    """The path of the scene takes 10.5 s, that of an arm 2.25 s."""
    env = ArmTrackingEnv(scene="two-link", reference="sinusoid", episode_s=4.0)
    assert env.core.steps == 4000


def test_the_scene_is_one_path():
    """Which cannot be one of several kinds, because its limits are not the stated."""
    found = naming("reference", "('scene', 'line')", "scene", "line, arc, spline")
    with pytest.raises(InputError, match=found):
        ArmTrackingEnv(reference=("scene", "line"))


@pytest.mark.parametrize("payload", [None, (1.0, 2.0)])
def test_drawn_paths_start_without_the_motion_of_the_scene(payload, tmp_path):
    """The path of the scene accelerates at once; drawn paths begin with the weight."""
    text = (models_path() / "scenes" / "ur5e-catalogue.toml").read_text("utf-8")
    head, tail = text.split("[trajectory]\n")
    rest = tail[tail.index("[controller]") :]
    motion = """[trajectory]
kind = "trapezoid"
hold_s = 0.0
max_speed_deg_s = 30.0
max_acceleration_deg_s2 = 200.0
start_deg = { shoulder_lift_joint = -60.0, elbow_joint = 80.0 }
end_deg = { shoulder_lift_joint = -40.0 }

"""
    path = tmp_path / "scene.toml"
    path.write_text(head + motion + rest, "utf-8")
    keys = {"friction": False, "kinematic_error_arcmin": 0.0, "payload_kg": payload}
    env = ArmTrackingEnv(scene=str(path), reference="multisine", **keys)
    _, first = env.reset(seed=0)
    assert env.core._assembly.scene.trajectory.hold_s == 0.0
    if payload is None:
        weight = env.task.link_torque[0]
        # links sag by some 1e-4 rad
        np.testing.assert_allclose(first["output_torque_Nm"], weight, atol=0.02)
    for _ in range(15):  # the multisine has hardly begun
        *_, info = env.step(np.zeros(6))
    moved = info["link_angle_rad"] - first["link_angle_rad"]
    assert np.abs(moved).max() < 1e-6


TOUCHING = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <geom name="wall" type="box" pos="0 0 {wall}" size="1 1 0.01"/>
    <body name="link" pos="0 0 0.5">
      <joint name="joint" axis="0 1 0" range="-1.5 0.2"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="2"/>
      <site name="tool" pos="0.4 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("reference", ["sinusoid", "line"])
def test_paths_avoid_contacts_and_ends_of_joints(reference, tmp_path):
    """A wall 0.05 m below the link, and a joint that ends 0.2 rad below."""
    path, paths = tmp_path / "arm.xml", []
    for wall in (0.42, -5.0):
        path.write_text(TOUCHING.format(wall=wall), encoding="utf-8")
        keys = {"scene": str(path), "reference": reference, "episode_s": 1.0}
        keys |= {"max_speed_rad_s": 5.0, "max_angle_rad": 0.5, "max_distance_mm": 300.0}
        if reference == "line":  # one joint cannot follow a line
            with pytest.raises(InputError, match=naming("arm", "line", "reference")):
                ArmTrackingVectorEnv(1, threads=1, **keys)
            return
        env = ArmTrackingVectorEnv(8, threads=1, **keys)
        env.reset(seed=0)
        paths.append(env.task.position)
    near, far = paths
    # the end of the link is 0.05 m above the wall and has a radius of 0.02 m
    assert 0.4 * np.sin(near.max()) < 0.05
    assert 0.13 < far.max() <= 0.2 * ROUND_OFF
    # a path that meets no wall is the same without one
    assert any((near[:, k] == far[:, k]).all() for k in range(8))


PLANAR = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper" pos="0 0 0.5">
      <joint name="first" axis="0 1 0" range="{low} 2"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="second" axis="0 1 0" range="-2 2" ref="0.6"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/>
        <site name="tool" pos="0.3 0 0"/>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="upper" body2="lower"/></contact>
</mujoco>
"""


def planar(folder, low):
    """Scene of an arm of two links whose first joint starts at -0.4 rad."""
    (folder / "arm.xml").write_text(PLANAR.format(low=low), encoding="utf-8")
    path = folder / "scene.toml"
    path.write_text(
        """name = "planar"
arm = "arm.xml"
[defaults]
drive = "CSG-25-100"
rotor_inertia_kgm2 = 1e-4
[trajectory]
kind = "sweep"
hold_s = 0.2
ramp_s = 0.3
settle_s = 0.2
start_deg = {first = -22.918311805232928, second = 60.0}
end_deg = {first = 0.0, second = 70.0}
[controller]
kind = "pd"
natural_frequency_Hz = 8.0
damping_ratio = 1.0
[simulation]
duration_s = 1.5
step_s = 0.001
""",
        encoding="utf-8",
    )
    return {"scene": str(path), "episode_s": 0.5}


def test_a_joint_without_room_is_named(tmp_path):
    """Instead of motions in which it stands still: 1 % of max_angle_rad is needed."""
    keys = {"reference": "sinusoid", "max_angle_rad": 0.5}
    match = naming("reference", "first", "0.0049 rad", "0.005 rad", "max_angle_rad")
    with pytest.raises(InputError, match=match):
        ArmTrackingEnv(**keys, **planar(tmp_path, -0.4049))
    env = ArmTrackingVectorEnv(4, threads=1, **keys, **planar(tmp_path, -0.4052))
    env.reset(seed=1)
    moved = np.abs(env.task.position - env.task.position[0]).max(axis=0)
    assert (moved[:, 0] > 0.002).all() and (moved[:, 0] <= 0.0052 * ROUND_OFF).all()


def test_curves_at_the_end_of_a_joint_neither_fail_nor_vanish(tmp_path):
    """Of such curves about three in four leave the range of the joint."""
    keys = {"reference": "arc", "max_distance_mm": 100.0}
    env = ArmTrackingEnv(**keys, **planar(tmp_path, -0.4))
    rng, moved = np.random.default_rng(5), []
    for _ in range(60):
        _, (position, *_) = env.core._paths.draw(rng)
        moved.append(np.ptp(position, axis=0).max())
        assert position[:, 0].min() >= -0.4 - 1e-9
    # a tenth of an arc of 40 mm times 0.7^10 on an arm of 0.6 m
    assert min(moved) > 1e-4 and np.median(moved) > 0.01


def test_the_first_path_is_used_where_no_other_fits(tmp_path, monkeypatch):
    """So that training does not end in an error."""
    env = ArmTrackingEnv(reference="arc", **planar(tmp_path, -0.4))
    paths = env.core._paths

    def fail(*_):
        raise InputError("no")

    monkeypatch.setattr(paths, "_attempt", fail)
    drawn, motion = paths.draw(np.random.default_rng(5))
    assert drawn.kind == "arc" and np.ptp(motion[0], axis=0).max() > 1e-4


def test_paths_next_to_a_wall_do_not_vanish(tmp_path, monkeypatch):
    """A wall 0.2 mm below the link leaves only motions upwards, or no path at all."""
    path = tmp_path / "arm.xml"
    path.write_text(TOUCHING.format(wall=0.4698), encoding="utf-8")
    keys = {"scene": str(path), "reference": "point_to_point", "episode_s": 1.0}
    env = ArmTrackingVectorEnv(8, threads=1, **keys)
    env.reset(seed=0)
    assert (np.ptp(env.task.position, axis=0) > 0.02).all()
    monkeypatch.setattr(ArmPaths, "_is_used", lambda *_: False)
    with pytest.raises(InputError, match=naming("point_to_point", "touch", "start")):
        ArmTrackingVectorEnv(1, threads=1, **keys)


@pytest.mark.parametrize("reference", ["scene", "line", "sinusoid"])
def test_a_tool_that_cannot_move_is_rejected(reference, tmp_path):
    """On the axis of the only joint, every reward would be that of no error."""
    path = tmp_path / "arm.xml"
    text = TOUCHING.format(wall=-5.0)
    path.write_text(text.replace('pos="0.4 0 0"', 'pos="0 0.1 0"'), encoding="utf-8")
    with pytest.raises(InputError, match=naming("arm", "no joint moves the tool")):
        ArmTrackingEnv(scene=str(path), reference=reference)


@pytest.mark.parametrize(
    ("keys", "match"),
    [
        ({"reference": "circle"}, ("reference", "'circle'", "scene", "arc")),
        ({"reference": ()}, ("reference", "()", "scene", "arc")),
        ({"reference": 3}, ("reference", "3", "scene", "arc")),
        ({"max_speed_rad_s": 0.0}, ("max_speed_rad_s", "0.0 rad/s", "> 0")),
        ({"max_angle_rad": -1.0}, ("max_angle_rad", "-1.0 rad", "> 0")),
        ({"max_distance_mm": np.nan}, ("max_distance_mm", "nan mm", "> 0")),
    ],
)
def test_what_is_no_path_gives_one_line(keys, match):
    """What, where, and what is accepted."""
    with pytest.raises(InputError, match=naming(*match)):
        ArmTrackingEnv(**keys)


def test_windows_change_nothing(monkeypatch):
    """Little memory gives the same observations and tasks, bit by bit."""
    keys = {"reference": JOINT + TOOL, "episode_s": 0.5, "payload_kg": (0.0, 2.0)}
    runs = []
    for memory in (plans.MEMORY, 1):
        monkeypatch.setattr(plans, "MEMORY", memory)
        env = ArmTrackingVectorEnv(4, threads=1, **keys)
        run = [env.reset(seed=4)[0]]
        run += [env.step(np.full((4, 6), 0.1))[0] for _ in range(60)]
        runs.append([*run, env.task.position, env.task.link_torque])
    for a, b in zip(*runs, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_batch_equals_single_environments():
    """A batch with drawn paths and payloads, with restarts, bit by bit."""
    keys = {
        "scene": "two-link",
        "reference": ("multisine", "point_to_point"),
        "payload_kg": (0.0, 2.0),
        "randomise": True,
        "episode_s": 0.5,
    }
    runs = []
    for mode in ("sync", "vector_entry_point"):
        env = gymnasium.make_vec(
            "swgjoint.envs:swgjoint/ArmTracking-v0", 3, vectorization_mode=mode, **keys
        )
        run, rng = [env.reset(seed=2)[0]], np.random.default_rng(0)
        for _ in range(550):  # with restarts
            *got, info = env.step(rng.uniform(-0.2, 0.2, (3, 2)))
            run += [*got, info["payload_kg"], info["tool_error_mm"]]
        runs.append(run)
    for a, b in zip(*runs, strict=True):
        np.testing.assert_array_equal(a, b)
