"""Motions of the tool: where it goes, how smoothly, and what it cannot reach."""

import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.sim.motion.inverse_kinematics import ToolKinematics
from swgjoint.sim.motion.tool_motions import POSE_SHARE, cube_poses
from swgjoint.sim.motion.trajectory import Trajectory
from swgjoint.sim.scene.scene import Scene

UR5E = {
    "shoulder_lift_joint": -100.0,
    "elbow_joint": 100.0,
    "wrist_1_joint": -90.0,
    "wrist_2_joint": -90.0,
}
PANDA = {"joint_2": -30.0, "joint_4": -120.0, "joint_6": 90.0}


def motion(
    arm: str, start: dict[str, float], duration: float = 4.0, **keys: object
) -> tuple[Trajectory, RigidArm]:
    scene = Scene.from_data(
        {
            "name": "test",
            "arm": arm,
            "trajectory": {"start_deg": start, **keys},
            "simulation": {"duration_s": duration, "step_s": 1e-3},
        }
    )
    rigid = RigidArm(arm)
    return trajectory_of(scene, rigid), rigid


def orientations(arm: RigidArm, position: np.ndarray) -> np.ndarray:
    kinematics = ToolKinematics(arm, hold_orientation=True, where="test")
    return np.array([kinematics.pose(q)[1] for q in position])


@pytest.mark.parametrize(("arm", "start"), [("ur5e", UR5E), ("panda", PANDA)])
def test_the_tool_runs_round_the_circle(arm, start):
    """Every sample lies on the circle within 1e-9 m, with the tool's orientation."""
    path, rigid = motion(
        arm, start, kind="circle", radius_mm=50.0, normal=[0.0, 1.0, 1.0], cycles=2
    )
    tool = rigid.tool_positions(path.position)
    axis = np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)
    centre = tool[0] + [0.05, 0.0, 0.0]  # x is square to the axis
    out = tool - centre
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 0.05, atol=1e-9)
    np.testing.assert_allclose(out @ axis, 0.0, atol=1e-9)
    np.testing.assert_allclose(tool[-1], tool[0], atol=1e-9)
    turned = orientations(rigid, path.position[::50])
    np.testing.assert_allclose(turned, turned[:1].repeat(len(turned), 0), atol=1e-8)
    # two turns, right-handed about the axis
    angle = np.unwrap(np.arctan2(out @ np.cross(axis, out[0]), out @ out[0]))
    assert angle[-1] == pytest.approx(4 * np.pi)


def test_the_tool_runs_along_the_line_and_back():
    """It stays on the line, reaches both ends, and its runs are at constant speed."""
    path, rigid = motion(
        "ur5e",
        UR5E,
        duration=6.0,
        kind="line",
        displacement_mm=[60.0, 20.0, -30.0],
        cycles=2,
    )
    way = np.array([0.06, 0.02, -0.03])
    tool = rigid.tool_positions(path.position)
    share = (tool - tool[0]) @ way / (way @ way)
    np.testing.assert_allclose(tool - tool[0], share[:, None] * way, atol=1e-9)
    assert share.max() == pytest.approx(1.0, abs=1e-7)
    assert share[-1] == pytest.approx(0.0, abs=1e-7)
    assert np.count_nonzero(np.diff(np.sign(share - 0.5))) == 4
    assert len(path.passes) == 2
    for begin in path.passes:
        inside = (path.time > begin) & (path.time < begin + path.pass_time)
        speed = np.diff(share[inside]) / 1e-3
        np.testing.assert_allclose(speed, speed[0], rtol=1e-5)
        assert speed[0] > 0.0


@pytest.mark.parametrize(
    "keys",
    [
        {"kind": "circle", "radius_mm": 50.0},
        {"kind": "line", "displacement_mm": [60.0, 0.0, 30.0]},
        {"kind": "iso9283", "edge_mm": 100.0, "cycles": 1, "rest_s": 0.2},
    ],
)
def test_joint_motions_are_twice_differentiable(keys):
    """Differences give velocity and acceleration, which shrink in steps with h."""
    path, _ = motion("ur5e", UR5E, **keys)
    h = 1e-3
    slope = (path.position[2:] - path.position[:-2]) / (2 * h)
    bend = (path.velocity[2:] - path.velocity[:-2]) / (2 * h)
    top = np.abs(path.acceleration).max()
    np.testing.assert_allclose(slope, path.velocity[1:-1], atol=1e-5 * top)
    # where a rest ends the jerk jumps to 60 way / T³ against a top of 5.8 way / T²: a
    # quarter of it times h is 5e-3 of the top for the moves of T = 0.56 s
    np.testing.assert_allclose(bend, path.acceleration[1:-1], atol=5e-3 * top)
    assert np.abs(np.diff(path.acceleration, axis=0)).max() < 0.05 * top
    assert not path.velocity[[0, -1]].any()


def test_the_iso_poses_lie_in_the_diagonal_plane():
    """P2 to P5 lie on the space diagonals, a tenth of them inside the corners."""
    centre = np.array([0.4, 0.1, 0.3])
    planes = []
    for plane in ("+x", "-x", "+y", "-y"):
        poses = cube_poses(centre, 0.25, plane)
        np.testing.assert_array_equal(poses[0], centre)
        off = (poses[1:] - centre) / 0.125
        np.testing.assert_allclose(np.abs(off), POSE_SHARE)
        # inside the corner by 10 % of the diagonal
        diagonal = 0.25 * np.sqrt(3.0)
        to_corner = np.linalg.norm(np.sign(off) * 0.125 - off * 0.125, axis=1)
        np.testing.assert_allclose(to_corner, 0.1 * diagonal)
        # four corners of one rectangle: neighbours, then opposite ones
        np.testing.assert_allclose(off[0] + off[2], 0.0, atol=1e-12)
        np.testing.assert_allclose(off[1] + off[3], 0.0, atol=1e-12)
        assert np.linalg.matrix_rank(off, tol=1e-9) == 2
        normal = np.cross(off[0], off[1])
        planes.append(normal / np.linalg.norm(normal))
    # the four planes are different ones
    cosines = np.abs(np.array(planes) @ np.array(planes).T) - np.eye(4)
    assert cosines.max() < 0.99


@pytest.mark.parametrize(("arm", "start"), [("ur5e", UR5E), ("panda", PANDA)])
def test_the_iso_cycle_visits_its_poses_in_order(arm, start):
    """At the end of each rest the tool stands at the pose, after P5, P4, P3, P2, P1."""
    path, rigid = motion(
        arm, start, 6.0, kind="iso9283", edge_mm=100.0, cycles=2, rest_s=0.2
    )
    assert [number for number, _ in path.visits] == [5, 4, 3, 2, 1] * 2
    samples = [round(end / 1e-3) for _, end in path.visits]
    assert samples[-1] == path.time.size - 1
    tool = rigid.tool_positions(path.position)
    poses = cube_poses(tool[0], 0.1, "+x")
    for (number, _), sample in zip(path.visits, samples, strict=True):
        np.testing.assert_allclose(tool[sample], poses[number - 1], atol=1e-9)
        resting = path.velocity[sample - 195 : sample + 1]
        np.testing.assert_allclose(resting, 0.0, atol=1e-20)
    turned = orientations(rigid, path.position[samples])
    np.testing.assert_allclose(turned, turned[:1].repeat(10, 0), atol=1e-9)


@pytest.mark.parametrize(
    ("arm", "keys", "message"),
    [
        ("ur5e", {"kind": "circle", "radius_mm": 900.0}, ("orientation",)),
        (
            "bench",
            {"kind": "line", "displacement_mm": [10.0, 0, 0]},
            ("(500.3, 0, 300) mm",),
        ),
        ("ur5e", {"kind": "iso9283", "edge_mm": 2000.0}, ("orientation",)),
    ],
)
def test_what_the_tool_cannot_reach_is_one_line(arm, keys, message):
    """Point, how far it is short, and what would do."""
    start = UR5E if arm == "ur5e" else {}
    duration = 100.0
    with pytest.raises(InputError) as caught:
        motion(arm, start, duration, **keys)
    assert names(str(caught.value), "trajectory", "mm", "start_deg", *message)
    assert len(str(caught.value).splitlines()) == 1
    assert "nan" not in str(caught.value)


def test_a_joint_that_would_leave_its_range_is_one_line(tmp_path):
    """The joint, the angles of the path and its range."""
    arm = tmp_path / "planar.xml"
    arm.write_text("""<mujoco><worldbody><body>
        <geom size=".1"/><joint name="a" axis="0 0 1"/>
        <body pos=".5 0 0"><geom size=".1"/>
        <joint name="b" axis="0 0 1" limited="true" range="0 100"/>
        <site name="tool" pos=".4 0 0"/></body></body></worldbody></mujoco>""")
    with pytest.raises(
        InputError, match=naming("trajectory", "b", "90", "119.6 deg", "0", "100 deg")
    ):
        motion(str(arm), {"b": 90.0}, kind="line", displacement_mm=[-200.0, -50.0, 0.0])


def test_a_direction_along_the_normal_spans_no_circle():
    """A scene fault with its key."""
    with pytest.raises(InputError, match=naming("trajectory.towards", "normal")):
        motion("ur5e", UR5E, kind="circle", radius_mm=5.0, towards=[0.0, 0.0, 2.0])
