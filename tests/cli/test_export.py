"""``swgjoint export``: files for other simulators, or one line and no file."""

from __future__ import annotations

import json

import mujoco
import pytest
from messages import names

from swgjoint.cli.main import main
from swgjoint.cli.shared.drive_option import drives_of
from swgjoint.sim.arm.scene import arm_scene


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_an_arm_is_written(here, capsys):
    """The JSON object has the drives, the differences and the file."""
    options = ["--drive", "CSG-25-100", "--drive", "wrist_*=CSG-14-50", "--json"]
    step = ["--step", "0.0005", "--motors"]
    assert main(["export", "mjcf", "ur5e", "-o", "arm.xml", *options, *step]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["format"], result["arm"], result["step_s"]) == ("mjcf", "ur5e", 5e-4)
    assert result["files"] == ["arm.xml"] and not result["drives_by_rule"]
    joints = result["joints"]
    assert [joint["drive"] for joint in joints.values()] == [
        *3 * ["CSG-25-100"],
        *3 * ["CSG-14-50"],
    ]
    elbow = joints["elbow_joint"]
    assert elbow["ratio"] == -100.0 and 0.0 < elbow["torsion_arcmin"] < 0.01
    assert elbow["left_out_error_pp_arcmin"] == pytest.approx(1.0, rel=0.01)
    assert elbow["resonance"]["native"]["damping_ratio"] > 0.05
    model = mujoco.MjModel.from_xml_path("arm.xml")
    assert (model.nu, model.nplugin, model.opt.timestep) == (6, 0, 5e-4)


def test_drives_by_rule_are_those_of_run(capsys):
    """Without ``--drive``; the table names joints, drives and the file."""
    assert main(["export", "mjcf", "ur5e", "-o", "arm.xml", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    chosen = {name: one.drive for name, one in arm_scene("ur5e").drive_choice.items()}
    assert result["drives_by_rule"]
    assert {name: j["drive"] for name, j in result["joints"].items()} == chosen
    assert main(["export", "mjcf", "ur5e", "-o", "arm.xml"]) == 0
    out = capsys.readouterr().out
    assert names(out, "elbow_joint", chosen["elbow_joint"], "arm.xml", "--drive")


def test_hinges_without_a_drive_are_named(capsys):
    """Unlike ``run``, a drive of some joints leaves the others as in the file."""
    command = ["export", "mjcf", "ur5e", "-o", "arm.xml", "--drive"]
    assert main([*command, "*pan*=CSG-25-100", "--json"]) == 0
    bare = json.loads(capsys.readouterr().out)["without_drive"]
    assert bare[0] == "shoulder_lift_joint" and len(bare) == 5
    assert main([*command, "*pan*=CSG-25-100"]) == 0
    assert names(capsys.readouterr().out, "without a drive", *bare, "--drive NAME")
    assert main([*command, "CSG-25-100"]) == 0
    assert "without a drive" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["ur5e", "-o", "arm.txt"], ["arm.txt", ".xml"]),
        (["ur5e", "-o", "no/arm.xml"], ["no", "exist"]),
        (["ur6", "-o", "arm.xml"], ["ur6", "ur5e"]),
        (["ur5e", "-o", "arm.xml", "--drive", "CSG-25-101"], ["CSG-25-101"]),
        (["ur5e", "-o", "arm.xml", "--drive", "=CSG-25-100"], ["JOINT=NAME"]),
        (["ur5e", "-o", "arm.xml", "--drive", "elbow="], ["elbow=", "JOINT=NAME"]),
        (["ur5e", "-o", "arm.xml", "--drive", "elbo=CSG-25-100"], ["elbow_joint"]),
        (
            ["ur5e", "-o", "arm.xml", *2 * ["--drive", "CSG-25-100"]],
            ["all joints", "CSG-25-100"],
        ),
        (
            [
                *("ur5e", "-o", "arm.xml", "--drive", "elbow=CSG-25-100"),
                *("--drive", "elbow_joint=CSG-17-100"),
            ],
            ["'elbow_joint'", "already"],
        ),
        (["ur5e", "-o", "arm.xml", "--step", "nan"], ["nan s", "accepted"]),
        (["ur5e", "-o", "arm.xml", "--fmi", "3.0"], ["--fmi", "fmu"]),
        (
            ["ur5e", "-o", "arm.xml", "--drive", "CSG-25-100", "--rotor-inertia", "0"],
            ["rotor_inertia", "kg·m²", "> 0"],
        ),
    ],
)
def test_bad_input_is_refused(here, capsys, arguments, parts):
    """In one line, with exit status 2 and without a file."""
    assert main(["export", "mjcf", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1 and names(err, *parts)
    assert list(here.iterdir()) == []


@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_a_drive_is_written_as_an_fmu(here, capsys, version):
    """The JSON object lists its variables with units and start values."""
    options = ["--fmi", version, "--load-inertia", "0.5", "--step", "0.0005"]
    assert main(["export", "fmu", "CSG-25-100", "-o", "a.fmu", *options, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["fmi"], result["drive"]) == (version, "CSG-25-100")
    starts = {one["name"]: (one["unit"], one["start"]) for one in result["variables"]}
    assert starts["load_inertia"] == ("kg.m2", 0.5)
    assert starts["internal_step"] == ("s", 5e-4)
    assert starts["ratio"] == ("1", -100.0)
    assert starts["friction.coulomb"][1] > 0.0
    assert [file.name for file in here.iterdir()] == result["files"] == ["a.fmu"]
    assert main(["export", "fmu", "CSG-25-100", "-o", "a.fmu"]) == 0
    assert names(capsys.readouterr().out, "motor_torque", "N.m", "a.fmu")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["CSG-25-101", "-o", "a.fmu"], ["CSG-25-101"]),
        (["CSG-25-100", "-o", "a.xml"], ["a.xml", ".fmu"]),
        (["CSG-25-100", "-o", "a.fmu", "--fmi", "1.0"], ["1.0", "3.0, 2.0"]),
        (["CSG-25-100", "-o", "a.fmu", "--motors"], ["--motors", "mjcf"]),
        (["CSG-25-100", "-o", "a.fmu", "--drive", "x"], ["--drive", "mjcf"]),
        (
            ["CSG-25-100", "-o", "a.fmu", "--load-inertia", "0"],
            ["load_inertia", "1e-30"],
        ),
    ],
)
def test_bad_fmu_input_is_refused(here, capsys, arguments, parts):
    """In one line, with exit status 2 and without a file."""
    assert main(["export", "fmu", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1 and names(err, *parts)
    assert list(here.iterdir()) == []


def test_the_drive_of_all_joints_applies_last(here):
    """Wherever its option stands; the name of a file may contain a sign of equality."""
    found = drives_of(["CSG-25-100", "b=CSG-17-100", "a*=CSG-14-100"])
    assert list(found) == ["b", "a*", "*"]
    (here / "a=b.swg").touch()
    assert drives_of(["a=b.swg"]) == {"*": "a=b.swg"}
