"""The rule that gives an arm its drives, and what decided."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from messages import names

from swgjoint.cli.main import main
from swgjoint.cli.shared.arm_arguments import choice_lines
from swgjoint.gear.catalogue import catalogue_rows
from swgjoint.sim.arm.drive_choice import choose_drive
from swgjoint.sim.arm.scene import arm_scene, rigid_arm_of
from swgjoint.sim.motion.commanded import trajectory_of

ROWS = sorted(
    (row for row in catalogue_rows() if row.ratio == 100),
    key=lambda row: row.rated_torque,
)
QUICK = ["--set", "simulation.duration_s=2.0"]
TORQUE = st.floats(0.0, 1e4)

ARM = """
<mujoco><worldbody><body name="arm"><joint name="lift" axis="0 1 0" {joint}/>
  <inertial mass="{mass}" pos=".5 0 0" diaginertia="{inertia} {inertia} {inertia}"/>
  </body></worldbody></mujoco>
"""


def chosen(folder, *, mass=2.0, inertia=0.1, joint="", **options):
    path = folder / "arm.xml"
    path.write_text(ARM.format(mass=mass, inertia=inertia, joint=joint))
    return arm_scene(str(path), **options).drive_choice["lift"]


@given(effort=st.none() | TORQUE, weight=TORQUE, more=TORQUE)
def test_the_drive_is_the_smallest_that_carries_everything(effort, weight, more):
    """It carries all that is asked, the next smaller one does not; or none does."""
    choice = choose_drive(effort=effort, weight=weight, motion=weight + more)

    def carries(row):
        return (
            row.repeated_peak >= max(effort or 0.0, weight + more)
            and row.rated_torque >= weight
        )

    fits = [row.name for row in ROWS if carries(row)]
    assert choice.fits == bool(fits)
    assert choice.drive == (fits or [ROWS[-1].name])[0]
    assert choice.fits == (choice.available >= choice.needed)
    assert choice.needed == choice.asked[choice.decided_by]


@pytest.mark.parametrize(
    ("effort", "weight", "motion", "drive", "decided_by"),
    [
        (330.0, 60.0, 80.0, "CSG-32-100", "effort"),
        (28.0, 12.0, 13.0, "CSG-17-100", "weight"),
        (None, 12.0, 150.0, "CSG-25-100", "motion"),
        (None, 45e3, 46e3, "CSG-32-100", "weight"),
        (1000.0, 2.0, 2.5, "CSG-32-100", "effort"),
    ],
)
def test_what_decides_is_named(effort, weight, motion, drive, decided_by):
    """Effort of the file, weight, or the motion with its acceleration."""
    choice = choose_drive(effort=effort, weight=weight, motion=motion)
    assert (choice.drive, choice.decided_by) == (drive, decided_by)


def test_acceleration_of_the_motion_counts(tmp_path):
    """Torques are those of weight and inertia; a faster motion needs a larger size."""
    slow = chosen(tmp_path, inertia=20.0)
    assert (slow.decided_by, slow.drive) == ("weight", "CSG-14-100")
    fast = chosen(
        tmp_path,
        inertia=20.0,
        motion="trapezoid",
        overrides=["trajectory.max_acceleration_deg_s2=400"],
    )
    assert (fast.decided_by, fast.drive) == ("motion", "CSG-25-100")
    by_hand = (20.0 + 2.0 * 0.5**2) * np.deg2rad(400)
    assert fast.needed == pytest.approx(by_hand, abs=9.81)


def test_the_payload_of_a_scene_counts(tmp_path):
    """Ten kilograms at the tool, 0.5 m out, ask for 49 N·m more."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(mass=2.0, inertia=0.1, joint=""))
    load = ["payload={mass_kg=10.0,centre_mm=[500,0,0]}", "tool_site=arm"]
    bare, loaded = arm_scene(str(path)), arm_scene(str(path), overrides=load)
    asked = [one.drive_choice["lift"].asked["weight"] for one in (bare, loaded)]
    assert asked[1] - asked[0] == pytest.approx(9.81 * 10 * 0.5, rel=1e-6)
    assert loaded.drive_choice["lift"].drive == "CSG-25-100"


def test_the_choice_is_that_of_the_motion_that_runs():
    """Weight and motion are the largest on the scene's own trajectory."""
    made = arm_scene("kinova")
    arm = rigid_arm_of(made.scene)
    path = trajectory_of(made.scene, arm)
    weight = np.abs(arm.gravity(path.position[::20])).max(axis=0)
    asked = [made.drive_choice[joint].asked["weight"] for joint in arm.joints]
    np.testing.assert_allclose(asked, weight, rtol=1e-6)
    assert all(one.fits for one in made.drive_choice.values())


def test_a_run_says_what_decided_and_what_does_not_fit(tmp_path, capsys):
    """A placeholder of the file is named as its effort; JSON has every joint."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(mass=2, inertia=1, joint='actuatorfrcrange="-1e3 1e3"'))
    assert main(["run", str(path), *QUICK, "--json"]) in (0, 1)
    choice = json.loads(capsys.readouterr().out)["drive_choice"]
    assert choice["lift"]["fits"] is False
    assert choice["lift"]["needed_Nm"] == 1000
    text = "\n".join(choice_lines(choice))
    assert names(text, "lift", "effort", "1000 N·m", "CSG-32-100", "433")
    # 0.02 N·m of weight in the smallest drive
    small = chosen(tmp_path, mass=0.004, inertia=1e-3).as_json()
    assert small["larger_than_needed"]
    assert names("\n".join(choice_lines({"lift": small})), "lift", "smallest", "larger")


def test_a_drive_of_the_user_is_not_the_rules(tmp_path, capsys):
    """Neither --drive nor a joint's own drive is reported as chosen by rule."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(mass=2, inertia=1, joint=""))
    for option in (
        ["--drive", "CSG-20-100"],
        ["--set", "joints.lift.drive=CSG-20-100"],
    ):
        assert main(["run", str(path), *option, *QUICK, "--json"]) in (0, 1)
        assert json.loads(capsys.readouterr().out)["drive_choice"] == {}


def test_only_chosen_joints_have_drives(tmp_path, capsys):
    """The scene that a run writes moves the same joints to the same figures."""
    out = tmp_path / "out"
    options = ["--joints", "shoulder*,elbow", "--out", str(out), *QUICK]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert main(["run", "ur5e", *options, "--json"]) in (0, 1)
        first = json.loads(capsys.readouterr().out)
        assert main(["run", str(out / "scene.toml"), "--json"]) in (0, 1)
        again = json.loads(capsys.readouterr().out)
    moving = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]
    assert list(first["joints"]) == list(first["drive_choice"]) == moving
    assert again["joints"] == first["joints"]
    assert set(first["arm"]["held"]) == {f"wrist_{k}_joint" for k in (1, 2, 3)}


def test_options_of_an_arm_with_a_scene_are_refused(capsys):
    """Which, and what they are for."""
    for option in (["--joints", "elbow*"], ["--pose", "home"], ["--balance-inertia"]):
        assert main(["run", "ur5e-catalogue", *option]) == 2
        assert names(capsys.readouterr().err, option[0], "'ur5e-catalogue'", "URDF")
        assert main(["advise", "ur5e-catalogue", "--error", "1arcmin", *option]) == 2
        assert names(capsys.readouterr().err, option[0], "'ur5e-catalogue'", "URDF")


def test_the_table_has_the_names_that_keys_need(capsys):
    """A joint is called as in --set."""
    assert main(["run", "ur5e", "--joints", "elbow_joint", *QUICK]) in (0, 1)
    rows = capsys.readouterr().out.splitlines()
    assert sum(row.startswith("elbow_joint") for row in rows) >= 2


@pytest.mark.parametrize("reference", ["ur5e", "ur5e-catalogue"])
def test_drives_of_single_joints(reference, capsys):
    """Names and patterns replace those of an arm's rule or of a scene, no others."""
    own = ["--drive", "elbow=CSG-32-100", "--drive", "wrist_*=CSG-14-50"]
    options = [*QUICK, "--json"]

    def drives_of_run(*more):
        assert main(["run", reference, *more, *options]) in (0, 1)
        result = json.loads(capsys.readouterr().out)
        joints = result["contains"]["joints"]
        names = {joint: one["drive"] for joint, one in joints.items()}
        return names, set(result["drive_choice"])

    shoulder = {"shoulder_pan_joint", "shoulder_lift_joint"}
    wrist = {f"wrist_{k}_joint": "CSG-14-50" for k in (1, 2, 3)}
    before, rule = drives_of_run()
    after, kept = drives_of_run(*own)
    assert after == before | {"elbow_joint": "CSG-32-100"} | wrist
    assert kept == rule & shoulder
    change = ["--set", "joints.wrist_1_joint.drive=CSG-17-100"]
    after, kept = drives_of_run("--drive", "CSG-20-100", *own, *change)
    assert not kept and after == dict.fromkeys(shoulder, "CSG-20-100") | {
        "elbow_joint": "CSG-32-100",
        **wrist,
        "wrist_1_joint": "CSG-17-100",
    }


@pytest.mark.parametrize("reference", ["ur5e", "ur5e-catalogue"])
@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (["CSG-14-50", "CSG-17-50"], ["all joints", "CSG-14-50", "CSG-17-50"]),
        (["CSG-14-50", "CSG-14-50"], ["all joints", "CSG-14-50"]),
        (["elbow=CSG-14-50", "elbow=CSG-17-50"], ["'elbow'", "CSG-14-50"]),
        (["elbow=CSG-14-50", "elbow_joint=CSG-17-50"], ["'elbow_joint'"]),
        (["elbow="], ["'elbow='", "JOINT=NAME"]),
        (["elbo=CSG-14-50"], ["'elbo'", "elbow_joint"]),
        (["knee_*=CSG-14-50"], ["'knee_*'", "elbow_joint"]),
        (["elb*=CSG-14-50", "elbow=CSG-17-50"], ["'elb*'", "more specific"]),
    ],
)
def test_contradicting_drives_are_refused(reference, options, parts, capsys):
    """In one line, for an arm and for a scene."""
    arguments = [word for text in options for word in ("--drive", text)]
    assert main(["run", reference, *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1 and names(err, *parts)


@pytest.mark.parametrize("reference", ["ur5e", "ur5e-catalogue"])
@pytest.mark.parametrize(
    ("drive", "change", "parts"),
    [
        ("CSG-14-50", "defaults.drive=CSG-17-50", ["all joints", "defaults"]),
        ("elbow=CSG-14-50", "joints.elbow_joint.drive=CSG-17-50", ["'elbow_joint'"]),
        ("elbow=CSG-14-50", "joints={}", ["'elbow_joint'"]),
        ("elb*=CSG-14-50", "joints={}", ["'elbow_joint'"]),
    ],
)
def test_a_change_that_contradicts_a_drive_is_refused(
    reference, drive, change, parts, capsys
):
    """Option --set does not silently replace what --drive states for the same key."""
    assert main(["run", reference, "--drive", drive, "--set", change]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1 and names(err, "CSG-14-50", *parts)


def test_a_joint_without_a_drive_takes_none(capsys):
    """The reason why it is held, and the joints that have drives."""
    held = ["--joints", "elbow", "--drive", "wrist_1=CSG-14-50"]
    assert main(["run", "ur5e", *held]) == 2
    assert names(capsys.readouterr().err, "'wrist_1_joint'", "driven", "elbow_joint")
