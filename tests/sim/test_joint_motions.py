"""Motions given joint by joint: derivatives, limits, ends."""

import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.sim.motion.joint_motions import (
    chirp,
    read_points,
    speed_steps,
    spline_motion,
    trapezoid,
)
from swgjoint.sim.motion.trajectory import time_grid
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

START, END = np.array([0.3, -1.0, 0.5]), np.array([1.3, -1.4, 0.5])


def one_chirp(h: float = 1e-3):
    return chirp(
        time_grid(3.0, h),
        start=START,
        joint=1,
        amplitude=0.1,
        first_frequency=1.0,
        last_frequency=6.0,
        hold=0.2,
        ramp=0.6,
    )


def one_file(h: float = 1e-3):
    t = np.linspace(5.0, 7.0, 21)
    wave = np.sin(0.5 * np.pi * (t - 5.0)) ** 4
    return spline_motion(
        time_grid(3.0, h),
        points_time=t,
        points=START + wave[:, None] * (END - START),
        hold=0.3,
    )


def one_trapezoid(h: float = 1e-3, **limits: float):
    limits = {"max_speed": 1.0, "max_acceleration": 4.0, **limits}
    return trapezoid(time_grid(3.0, h), start=START, end=END, hold=0.3, **limits)


@pytest.mark.parametrize("motion", [one_chirp, one_file])
def test_smooth_motions_are_twice_differentiable(motion):
    """Differences give velocity and acceleration, and the acceleration has no jump."""
    h = 5e-4
    path = motion(h)
    slope = (path.position[2:] - path.position[:-2]) / (2 * h)
    bend = (path.velocity[2:] - path.velocity[:-2]) / (2 * h)
    top = np.abs(path.acceleration).max()
    # h²/6 times the second derivative of what is differentiated, at (2 pi 6/s)²
    np.testing.assert_allclose(slope, path.velocity[1:-1], atol=1e-4 * top)
    np.testing.assert_allclose(bend, path.acceleration[1:-1], atol=1e-3 * top)
    jumps = [np.abs(np.diff(motion(s).acceleration, axis=0)).max() for s in (2 * h, h)]
    assert jumps[1] == pytest.approx(jumps[0] / 2, rel=0.05)
    for ends in (path.velocity, path.acceleration):
        assert not ends[[0, -1]].any()


def test_a_chirp_swings_at_its_frequencies():
    """Zero crossings at full amplitude follow from f0 to f1; the other joints rest."""
    path = one_chirp()
    moved = path.position - START
    assert not moved[:, [0, 2]].any()
    np.testing.assert_allclose(moved[[0, -1]], 0.0, atol=1e-15)
    # at t after the rest the frequency is 1 + 5 t / 2.6; two turns there take 2 / that
    t = path.time - 0.2
    inside = moved[:, 1][path.steady]
    assert np.abs(inside).max() == pytest.approx(0.1, rel=1e-3)
    crossings = np.flatnonzero(np.diff(np.sign(moved[:, 1])) != 0)
    phase = t[crossings] + 2.5 * t[crossings] ** 2 / 2.6
    inner = phase[(t[crossings] > 0.6) & (t[crossings] < 2.0)]
    assert inner.size > 5
    np.testing.assert_allclose(2 * inner, np.round(2 * inner), atol=0.015)


def test_a_trapezoid_runs_at_its_limits_and_not_above():
    """The joint with the longest way reaches both limits; ends are exact."""
    path = one_trapezoid()
    assert np.abs(path.velocity).max() == pytest.approx(1.0, rel=1e-12)
    assert np.abs(path.acceleration).max() == pytest.approx(4.0, rel=1e-12)
    np.testing.assert_allclose(path.position[[0, -1]], [START, END], atol=1e-14)
    # way 1 rad at 1 rad/s and 4 rad/s²: 0.25 + 0.75 + 0.25 s
    assert path.arrival == pytest.approx(0.3 + 1.25)
    window = path.velocity[path.steady]
    np.testing.assert_allclose(window, np.tile(path.steady_velocity, (len(window), 1)))
    assert path.time[path.steady][[0, -1]] == pytest.approx([0.55, 1.3])


def test_a_short_trapezoid_is_a_triangle():
    """A way too short for the speed limit keeps to the acceleration; no steady part."""
    path = one_trapezoid(max_speed=10.0)
    top = np.abs(path.velocity).max()
    assert top == pytest.approx(2.0, rel=1e-3)  # sqrt(a way)
    assert np.abs(path.acceleration).max() == pytest.approx(4.0)
    assert not path.steady_velocity.any()
    assert path.arrival == pytest.approx(0.3 + 1.0)


def test_a_trapezoid_has_velocity_as_its_slope():
    """Differences of the position give the velocity, those of it the acceleration."""
    path, h = one_trapezoid(), 1e-3
    slope = np.diff(path.position, axis=0) / h
    mean = 0.5 * (path.velocity[1:] + path.velocity[:-1])
    np.testing.assert_allclose(slope, mean, atol=4.0 * h)
    jumps = np.abs(np.diff(path.velocity, axis=0)).max()
    assert jumps == pytest.approx(4.0 * h)


def test_a_file_is_passed_through_at_its_points():
    """Every point is met at its time after the rest; afterwards the arm rests there."""
    path = one_file()
    t = np.linspace(0.0, 2.0, 21)
    wave = np.sin(0.5 * np.pi * t) ** 4
    index = np.rint((t + 0.3) / 1e-3).astype(int)
    np.testing.assert_allclose(
        path.position[index], START + wave[:, None] * (END - START), atol=1e-12
    )
    assert path.arrival == pytest.approx(2.3)
    after = path.position[path.time > 2.3]
    np.testing.assert_allclose(after, np.tile(START, (len(after), 1)), atol=1e-12)
    # between its points it is the smooth motion that they were taken from
    between = np.clip(path.time - 0.3, 0.0, 2.0)
    truth = START + np.sin(0.5 * np.pi * between)[:, None] ** 4 * (END - START)
    np.testing.assert_allclose(path.position, truth, atol=3e-5)


def test_speed_steps_rest_ramp_and_hold_each_speed():
    """Equal shares of the run at both speeds; the derivatives agree."""
    time = np.linspace(0.0, 6.0, 6001)
    speeds = np.array([1.0, -0.5])
    path = speed_steps(time, start=START, joint=1, speeds=speeds, hold=0.25, ramp=0.5)
    v, plateau = path.velocity[:, 1], (6.0 - 0.5 - 1.5) / 2
    for k, speed in enumerate(speeds):
        begin = 0.25 + 0.5 + k * (plateau + 0.5)
        inside = (time > begin + 1e-6) & (time < begin + plateau - 1e-6)
        np.testing.assert_allclose(v[inside], speed, atol=1e-12)
    assert not path.velocity[:, ::2].any() and not v[[0, 250, -250, -1]].any()
    np.testing.assert_allclose(np.gradient(path.position[:, 1], time), v, atol=1e-5)
    slope = np.gradient(v, time)
    # h²/6 times the largest third derivative of the speed, 60 * 1.5 / 0.5³ rad/s⁴
    np.testing.assert_allclose(slope, path.acceleration[:, 1], atol=1.3e-4)
    way = float(speeds.sum()) * (plateau + 0.5)  # one ramp counts half at either end
    assert path.position[-1, 1] - START[1] == pytest.approx(way)
    assert path.steady_velocity.tolist() == [0.0, -0.5, 0.0]
    np.testing.assert_allclose(v[path.steady], -0.5, atol=1e-9)


def scene_of(motion: str) -> Scene:
    return Scene.from_toml(
        f"""
        name = "test"
        arm = "bench"
        [defaults]
        rotor_inertia_kgm2 = 1e-4
        linear = {{ stiffness_Nm_rad = 2e4 }}
        {motion}
        [simulation]
        duration_s = 2.0
        """
    )


def test_a_csv_scene_reads_its_file(tmp_path):
    """Degrees and comments are read; the joint starts at the first line's angle."""
    path = tmp_path / "points.csv"
    path.write_text("# recorded\ntime_s,joint_deg\n0,10\n0.5,15\n1.0,20\n")
    scene = scene_of(f"[trajectory]\nkind = 'csv'\nfile = {str(path)!r}\nhold_s = 0.5")
    got = trajectory_of(scene, RigidArm("bench"))
    ends = np.rad2deg(got.position[[0, 500, 1000, 1500, -1], 0])
    np.testing.assert_allclose(ends, [10.0, 10.0, 15.0, 20.0, 20.0], atol=1e-12)


def test_a_csv_lies_beside_its_scene(tmp_path):
    """A file that a scene names is looked for in the folder of that scene."""
    (tmp_path / "points.csv").write_text("time_s,joint_deg\n0,0\n1,5\n")
    scene = scene_of("[trajectory]\nkind = 'csv'\nfile = 'points.csv'")
    text = """
        name = "beside"
        arm = "bench"
        [trajectory]
        kind = "csv"
        file = "points.csv"
        [simulation]
        duration_s = 2.0
        """
    (tmp_path / "beside.toml").write_text(text)
    loaded = Scene.load_file(tmp_path / "beside.toml")
    assert loaded.trajectory.file == str(tmp_path / "points.csv")
    with pytest.raises(InputError, match=naming("points.csv", "No such file")):
        trajectory_of(scene, RigidArm("bench"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "time_s,elbow_deg\n0,1\n1,2\n",
            ("'elbow_deg'", "time_s", "<joint>_deg", "<joint>_rad"),
        ),
        ("time_s\n0\n1\n", ("column", "time_s", "<joint>_deg", "<joint>_rad")),
        ("time_s,joint_deg\n0,1\n0,2\n", ("time_s", "two")),
        ("time_s,joint_deg\n0,1\n", ("time_s", "two")),
        ("time_s,joint_deg\n0,1\n1e-300,2\n", ("time_s", "1e-300 s", "1e-06 s")),
        ("time_s,joint_deg\n0,1\n2e5,2\n", ("time_s", "2e+05 s", "10000 s")),
        ("time_s,joint_rad\n0,1\n1,1e5\n", ("joint", "deg", "5.73e+05 deg")),
        ("time_s,joint_deg\n0,one\n1,2\n", ("line 2", "joint_deg", "'one'", "finite")),
        ("", ("empty", "time_s")),
    ],
)
def test_a_bad_csv_is_one_line(tmp_path, text, message):
    """What is wrong is named with file, line or column."""
    path = tmp_path / "points.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_points(path, ("joint",), np.zeros(1))
    assert names(str(caught.value), "points.csv", *message)
    assert len(str(caught.value).splitlines()) == 1


def test_points_that_do_not_move_are_a_joint_at_rest(tmp_path):
    """The cubed mean of a joint that rests is that over time, as catalogues have it."""
    path = tmp_path / "still.csv"
    path.write_text("time_s,joint_deg\n0,5\n0.1,5\n0.2,5\n")
    scene = scene_of(f"[trajectory]\nkind = 'csv'\nfile = {str(path)!r}\nhold_s = 0.1")
    run = run_scene(scene)
    torque = np.abs(run.output_torque[:, 0])
    found = run.metrics()["joints"]["joint"]["ratings"]["cubed_mean_Nm"]
    assert found == pytest.approx(np.mean(torque**3) ** (1.0 / 3.0), abs=1e-12)


def test_a_motion_between_two_samples_is_refused(tmp_path):
    """Points 0.1 ms apart that no sample of 1 ms meets leave nothing to measure."""
    path = tmp_path / "points.csv"
    path.write_text("time_s,joint_deg\n0,0\n0.0001,0.001\n")
    for hold, met in ((0.5, True), (0.5005, False)):
        scene = scene_of(
            f"[trajectory]\nkind = 'csv'\nfile = {str(path)!r}\nhold_s = {hold}"
        )
        if met:
            assert trajectory_of(scene, RigidArm("bench")).steady.stop == 501
            continue
        with pytest.raises(InputError, match=naming("simulation.step_s", "0.001 s")):
            trajectory_of(scene, RigidArm("bench"))


def test_a_step_jumps_once():
    """Before it the start, from it on the end, no speed is commanded."""
    scene = scene_of("[trajectory]\nkind='step'\nat_s=0.5\nstep_deg={joint=2.0}")
    path = trajectory_of(scene, RigidArm("bench"))
    angle = np.rad2deg(path.position[:, 0])
    np.testing.assert_allclose(angle, np.where(path.time > 0.4999, 2.0, 0.0))
    assert path.arrival == 0.5
    # critically damped at 8 Hz: A w / e
    expected = np.deg2rad(2.0) * 2 * np.pi * 8.0 / np.e
    assert path.top_speed == pytest.approx(expected)


def test_a_trapezoid_must_fit_into_the_run():
    """Its own time is known from way and limits and named."""
    with pytest.raises(
        InputError, match=naming("simulation.duration_s", "2 s", "2.7 s")
    ):
        scene_of(
            "[trajectory]\nkind='trapezoid'\nend_deg={joint=20.0}\n"
            "max_speed_deg_s=10.0\nmax_acceleration_deg_s2=20.0"
        )


def test_a_motion_beyond_numbers_is_refused():
    """A ramp of 1e-300 s divides zero by zero: the line names the key and its value."""
    scene = Scene.load_file("bench-chirp", {"trajectory.ramp_s": 1e-300})
    arm = RigidArm(scene.arm)
    with pytest.raises(InputError, match=naming("ramp_s", "1e-300", "not finite")):
        trajectory_of(scene, arm)
