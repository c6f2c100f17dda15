"""The commands run and demo, from the command line."""

import json
from pathlib import Path

import numpy as np
import pytest
from messages import names

from swgjoint.cli.main import main
from swgjoint.cli.run import tool_line
from swgjoint.cli.shared.load_text import design_line, load_line, loss_line
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.scene import scene_of_arm
from swgjoint.view.run import run_scene
from swgjoint.view.words import NOISE_NOTE

LINEAR = "defaults.linear={stiffness_Nm_rad=2e4,rated_torque_Nm=50.0}"
SHORT = ["--set", LINEAR, "--set", "simulation.duration_s=1.0"]


def test_run_gives_one_json_object_and_a_recording(tmp_path, capsys):
    """All keys of the contract; torsion of a linear drive is T/K."""
    assert main(["run", "bench", *SHORT, "--out", str(tmp_path / "new"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    joint = result["joints"]["joint"]
    wanted = (
        "level", "ripple_rms_percent", "ripple_pp_percent", "orders", "unresolved",
        "transmission_error_arcmin", "torsion_arcmin", "ratings",
    )  # fmt: skip
    assert set(wanted) <= set(joint)
    assert {"ap_mm", "rp_mm", "path_rms_mm"} <= set(result["tool"])
    assert {"steps_per_s", "contains", "files"} <= set(result)
    assert joint["torsion_arcmin"]["mean"] == pytest.approx(
        50 / 2e4 * 10800 / 3.14159265
    )
    assert [Path(f).name for f in result["files"]] == ["run.rrd", "run.png"]
    assert all(Path(f).is_file() for f in result["files"])


def test_run_prints_a_table(tmp_path, capsys):
    """Without a folder nothing is written and the table names the joint."""
    assert main(["run", "bench", *SHORT]) == 0
    text = capsys.readouterr().out
    assert "torsion" in text
    assert "\njoint " in text
    assert "wrote" not in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "nope"], ("'nope'", "models/scenes", "bench", "swgjoint list scenes")),
        (["run", "bench", "--set", "simulation.step=1"],
         ("bench.toml", "simulation.step", "step_s", "duration_s", "integrator")),
        (["run", "bench", "--set", "defaults.drive=x.swg"], ("x.swg", "No such file")),
        (["run", "bench", "--set", "defaults.drive=nope"],
         ("'nope'", "models/drives", "swgjoint list drives", "size-NN-RRR")),
        (["run", "bench", "--set", "arm=nope"],
         ("arm", "'nope'", "models/arms", "bench", "panda", "ur5e")),
        (["run", "bench", "--set", LINEAR, "--set", "load.elbow.torque_Nm=1.0"],
         ("bench.toml", "load.elbow", "arm 'bench'", "joint")),
        (["run", "bench", "--set", "simulation.step_s=-1.0"],
         ("simulation.step_s", "-1 s", ">= 1e-06 s", "<= 0.02 s")),
        (["view", "missing.rrd"], ("'missing.rrd'", "No such file")),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_nothing_is_written(
    arguments, message, tmp_path, capsys, monkeypatch
):
    """Status 2, one line on stderr, no folder."""
    monkeypatch.chdir(tmp_path)
    extra = ["--out", "out"] if arguments[0] == "run" else []
    assert main([*arguments, *extra]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert names(captured.err, *message)
    assert len(captured.err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_the_demo_compares_two_drives_with_the_rigid_arm(
    synthetic_map: DriveMap, tmp_path, capsys, monkeypatch
):
    """Maps, figures of three runs, files; the rigid arm has no error of its own.

    The picture of the demo is drawn; those of its report have tests of their own.
    """
    report, png = "swgjoint.view.report.", b"\x89PNG"
    monkeypatch.setattr(report + "report.joint_pngs", lambda _, all: [png for _ in all])
    monkeypatch.setattr(report + "tables.spec_picture", lambda *_: png)
    soft = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
    maps = {"size-25-100-bought": synthetic_map, "size-25-100-bought-coarse": soft}

    def load(name: str, *, model: str, progress: object) -> DriveMap:
        assert model == "ring"
        return maps[name]

    monkeypatch.setattr("swgjoint.drives.references.load_drive", load)
    assert main(["demo", "--out", str(tmp_path / "demo"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert set(result["map"]) == {"bought", "coarse"}
    metrics = result["metrics"]
    assert set(metrics) == {"bought", "coarse", "rigid"}
    assert metrics["rigid"]["tool_against_rigid"]["max_mm"] == 0.0
    assert metrics["coarse"]["tool_against_rigid"]["mean_mm"] > 0.1
    lift = metrics["bought"]["joints"]["shoulder_lift_joint"]
    assert lift["unresolved"] == []
    assert lift["orders"][0]["order"] == pytest.approx(122.0, abs=0.2)
    pan = metrics["bought"]["joints"]["shoulder_pan_joint"]
    assert [item["order"] for item in pan["unresolved"]] == [122.0]
    assert {Path(f).name for f in result["files"]} == {
        "run.rrd",
        "demo.png",
        "report.html",
    }
    assert result["wall_s"] > 0.0

    from swgjoint.cli.demo import report

    text = report(result)
    assert "tool position relative to the rigid arm" in text
    assert "shoulder_lift" in text


def test_run_goes_to_a_viewer_on_this_machine_only(capsys, monkeypatch):
    """At the pace of a clock; an address elsewhere is refused."""
    sent = {}

    def stream(runs, **options):
        sent.update(options, runs=list(runs))
        return "rerun+http://127.0.0.1:9876/proxy"

    with monkeypatch.context() as patch:
        patch.setattr("swgjoint.view.recording.live.stream_runs", stream)
        assert main(["run", "bench", *SHORT, "--live", "--json"]) == 0
    assert sent == {"runs": [""], "url": None, "pace": 1.0}
    assert json.loads(capsys.readouterr().out)["live"].startswith("rerun+http://127.")
    # before anything is simulated
    monkeypatch.setattr("swgjoint.view.run.run_scene", None)
    elsewhere = "rerun+http://192.0.2.1:9876/proxy"
    assert main(["run", "bench", *SHORT, "--live", elsewhere]) == 2
    assert names(capsys.readouterr().err, f"'{elsewhere}'", "127.0.0.1")


def test_the_fidelity_of_designs_is_an_option(capsys, monkeypatch, synthetic_map):
    """``--model`` reaches the map of every design; a catalogue drive has none."""
    asked = []

    def load(name: str, *, model: str | None, progress: object) -> DriveMap:
        asked.append((name, model))
        return synthetic_map

    monkeypatch.setattr("swgjoint.drives.references.load_drive", load)
    short = ["--set", "simulation.duration_s=1.0"]
    assert main(["run", "bench", "--model", "ring", *short]) == 0
    assert asked == [("reference-2d", "ring")]
    single = ["--set", "joints.joint.model=2d"]
    assert main(["run", "bench", *single, "--model", "ring", *short]) == 0
    assert asked[1:] == [("reference-2d", "2d")]
    capsys.readouterr()
    arguments = ["run", "bench", "--drive", "CSG-25-100", "--model", "ring", *short]
    assert main(arguments) == 2
    assert names(capsys.readouterr().err, "'ring'", "'CSG-25-100'", "design")


def test_repeatability_of_a_scene_without_chance_is_a_dash():
    """What never differs has no spread to tell; accuracy stays."""
    tool = {"site": "tool", "path_rms_mm": None, "rp_mm": 1e-12, "ap_mm": 0.58}
    assert names(tool_line(tool, random=False), "AP 0.5800 mm", "RP -", "random")
    assert names(tool_line(tool | {"rp_mm": 0.01}, random=True), "RP 0.0100 mm")
    assert NOISE_NOTE not in tool_line(tool, random=False)
    # a tool on the axis of the joint
    still = {"path_rms_mm": 0.0, "path_max_mm": 1e-9}
    assert names(tool_line(tool | still, random=False), "- rms", NOISE_NOTE)


def joint_at(peak: float, rated: float) -> dict:
    return {"ratings": {"peak_Nm": peak, "rated_Nm": rated}}


def test_the_most_loaded_joint_and_the_designs_of_its_size_are_named():
    """Relative to the rated torque; a design has the size and ratio of its drive."""
    joints = {"a": joint_at(5.0, 50.0), "b": joint_at(4.0, 10.0), "c": joint_at(1, 40)}
    line = load_line(joints)
    assert names(line, "b", "4 N·m", "40 %", "a 10 %", "c 2.5 %")
    assert line.index("b ") < line.index("a 10") < line.index("c 2.5")
    assert load_line({"a": joint_at(5.0, 50.0)}) == ""
    choice = {"a": "CSG-20-100", "b": "CSG-14-100", "c": "CSG-20-100"}
    line = design_line({joint: {"drive": drive} for joint, drive in choice.items()})
    assert names(line, "design new", "size-20-100 (a, c)", "size-14-100 (b)")


def test_losses_in_the_file_of_an_arm_are_named(tmp_path):
    """A level link at constant speed: the drive carries exactly its damping."""
    path = tmp_path / "arm.xml"
    path.write_text(
        """<mujoco><worldbody><body name="base">
        <body name="link"><geom size=".1" mass="2" contype="0"/>
        <joint name="pan" axis="0 0 1" damping="350" frictionloss="2"/>
        </body></body></worldbody></mujoco>"""
    )
    scene = scene_of_arm(
        str(path), drive="CSG-32-100", overrides=["defaults.level=linear"]
    )
    run = run_scene(scene)
    joints = run.metrics()["joints"]
    use = joints["pan"]["ratings"]
    speed = run.assembly.trajectory.steady_velocity[0]
    wanted = 2.0 + 350.0 * abs(speed)
    assert np.abs(run.output_torque[run.steady, 0]).mean() == pytest.approx(
        wanted,
        rel=1e-3,  # the motor's lag varies the speed
    )
    fastest = np.abs(run.velocity).max()
    assert use["arm_losses_Nm"] == pytest.approx(2.0 + 350.0 * fastest)
    assert names(loss_line(joints), "pan", "damping", "frictionloss")
    without = {"pan": joints["pan"] | {"ratings": use | {"arm_losses_Nm": 0.0}}}
    assert loss_line(without) == ""
