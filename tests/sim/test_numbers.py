"""A scene's drive of stated figures: ``[joints.NAME.numbers]``."""

import numpy as np
import pytest
from messages import names, naming

from swgjoint.cli.main import main
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.text import scene_toml
from swgjoint.sim.step_choice import STEPS, resolving_step
from swgjoint.units import arcmin, deg
from swgjoint.view.run import run_scene

STATED = {
    "K1_Nm_rad": 2e4,
    "rated_torque_Nm": 50.0,
    "ratio": 80,
    "lost_motion_arcmin": 1.2,
}
SHORT = {"trajectory.speed_deg_s.joint": 30.0, "simulation.duration_s": 0.8,
         "simulation.step_s": 5e-4, "trajectory.settle_s": 0.2}  # fmt: skip


def bench(numbers: dict, **changes) -> Scene:
    """The bundled bench with a drive of stated figures."""
    return Scene.load_file("bench", {"defaults.numbers": numbers, **changes})


def test_a_scene_runs_the_drive_that_python_makes():
    """The map of the table is that of the same figures in Python."""
    run = run_scene(bench({**STATED, "K2_Nm_rad": 3e4}, **SHORT))
    drive = run.assembly.transmissions[0].drive
    own = DriveMap.from_numbers(
        stiffness=[2e4, 3e4, 3e4], rated_torque=50.0, ratio=80, lost_motion_arcmin=1.2
    )
    assert drive.ratio == own.ratio == -80.0
    assert np.array_equal(drive.torsion_knots, own.torsion_knots)
    assert np.array_equal(drive.potential, own.potential)


def test_a_link_turns_by_the_lost_motion():
    """Weak torques of both signs: the torsion differs by the stated lost motion."""
    torsion = []
    for sign in (-1.0, 1.0):
        load = {"load.joint": {"torque_Nm": sign * 0.04 * 50.0}}
        run = run_scene(bench(STATED, **SHORT, **load))
        torsion.append(run.metrics()["joints"]["joint"]["torsion_arcmin"]["mean"])
    assert abs(torsion[1] - torsion[0]) == pytest.approx(1.2, rel=0.01)


def test_a_stated_order_is_the_transmission_error():
    """Unloaded, the output deviates by the stated amplitude, peak to peak twice."""
    numbers = {"K1_Nm_rad": 2e4, "rated_torque_Nm": 50.0, "ratio": 80,
               "kinematic_error_arcmin": {"2": 0.4}}  # fmt: skip
    slow = {**SHORT, "trajectory.speed_deg_s.joint": 6.0, "simulation.duration_s": 2.0}
    run = run_scene(bench(numbers, **slow, **{"load.joint": {"torque_Nm": 0.0}}))
    joint = run.metrics()["joints"]["joint"]
    assert joint["transmission_error_arcmin"]["pp"] == pytest.approx(0.8, rel=0.02)
    assert joint["orders"][0]["order"] == pytest.approx(2.0, rel=0.01)


def test_joints_may_share_and_replace_stated_figures():
    """Defaults apply to every joint; a drive of a joint's own takes their place."""
    scene = Scene.load_file("bench", {"defaults.numbers": STATED})
    assert scene.defaults.drive is None
    assert scene.joint_settings("joint").numbers.ratio == 80
    other = scene.with_changes({"joints.joint.drive": "CSG-25-100"})
    assert other.joint_settings("joint").numbers is None
    assert scene.with_drive("CSG-25-100").joint_settings("joint").numbers is None
    linear = scene.with_changes({"defaults.linear.stiffness_Nm_rad": 1e4})
    assert linear.defaults.numbers is None


def test_the_text_of_the_scene_reads_back():
    """Orders are keys of a table; the written scene has the same drive."""
    scene = bench({**STATED, "kinematic_error_arcmin": {"2": 0.4, "9": 0.1}})
    again = Scene.from_toml(scene_toml(scene))
    assert again.defaults.numbers == scene.defaults.numbers


def test_the_step_of_an_arm_resolves_the_stated_orders():
    """A high order needs a shorter step than a drive without error."""
    scene = Scene.load_file("bench", {"trajectory.speed_deg_s.joint": 60.0,
                                      "defaults.numbers": STATED})  # fmt: skip
    arm = RigidArm("bench")
    assert resolving_step(scene, arm) == STEPS[0]
    high = scene.with_changes({"defaults.numbers.kinematic_error_arcmin": {"60": 0.4}})
    speed = 60.0 * deg * 80.0 * 60.0  # phase of the order [rad/s]
    assert resolving_step(high, arm) * speed < 1.0


def test_compare_shows_stated_figures_beside_a_catalogue_drive(tmp_path, capsys):
    """A scene of stated figures runs at two levels; the lost motion counts at full."""
    path = tmp_path / "scene.toml"
    path.write_text(scene_toml(bench(STATED, **SHORT)))
    assert main(["compare", "full", "CSG-20-80", "--scene", str(path)]) == 0
    rows = capsys.readouterr().out
    assert "full" in rows and "CSG-20-80" in rows


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"K1_Nm_rad": -1.0}, ("defaults.numbers.K1_Nm_rad", "-1 N·m/rad", "> 0")),
        ({"ratio": 7}, ("defaults.numbers.ratio", "7", ">= 30")),
        ({"kinematic_error_arcmin": {"0.5": 1.0}},
         ("defaults.numbers.kinematic_error_arcmin.0.5", "1 to 1000")),
        ({"kinematic_error_arcmin": {"2": -1.0}}, ("kinematic_error_arcmin.2", "-1")),
        ({"lost_motion": 1.0}, ("lost_motion", "lost_motion_arcmin")),
    ],
)  # fmt: skip
def test_a_wrong_figure_is_one_line(change, message):
    """The file is refused with the key, its value, its unit and what is accepted."""
    with pytest.raises(InputError) as caught:
        bench({**STATED, **change})
    assert names(str(caught.value), *message)
    assert len(str(caught.value).splitlines()) == 1


def test_figures_that_contradict_each_other_name_their_joint():
    """A lost motion below that of the stiffness: joint, table and what is accepted."""
    scene = bench({**STATED, "lost_motion_arcmin": 0.2})
    with pytest.raises(InputError, match=naming("joints.joint", "numbers", "0.6875")):
        run_scene(scene)
    assert pytest.approx(0.6875, rel=1e-3) == 0.08 * 50.0 / 2e4 / arcmin


def test_a_command_refuses_them_with_status_2(capsys, tmp_path):
    """One line, status 2, nothing written."""
    folder = tmp_path / "out"
    change = "defaults.numbers={K1_Nm_rad=2e4,rated_torque_Nm=50.0,T1_Nm=60.0}"
    assert main(["run", "bench", "--set", change, "--out", str(folder)]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert names(line, "joints.joint", "numbers", "T1 = 60 N·m", "T2 = 30 N·m")
    assert not list(tmp_path.glob("out/*"))
