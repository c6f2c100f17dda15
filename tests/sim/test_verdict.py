"""Verdict of a run, ripple that is a lower bound, ripple that is none."""

import json
from dataclasses import replace

import numpy as np
import pytest
from messages import names
from validation_record import validated_map

from swgjoint.cli.main import main
from swgjoint.cli.run import joint_row, notes, verdict_lines
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.sheet.map_validity import NOT_VALIDATED
from swgjoint.sim.figures.ripple_validity import integration_noise, may_exceed
from swgjoint.sim.figures.verdict import energy_reasons
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene
from swgjoint.view.validity import warnings_of

LINEAR = "defaults.linear={stiffness_Nm_rad=2e4,rated_torque_Nm=50.0}"
SHORT = ["--set", LINEAR, "--set", "simulation.duration_s=1.0"]
ARM = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1"/>
    <body name="upper" pos="0 0 0.3">
      <joint name="lift" axis="0 1 0"/>
      <geom type="capsule" size="0.03" fromto="0.1 0 0 0.5 0 0" mass="2"/>
    </body>
  </worldbody>
</mujoco>
"""
SCENE = """
name = "into the floor"
arm = "{arm}"
defaults = {{ linear = {{ stiffness_Nm_rad = 2e4 }}, rotor_inertia_kgm2 = 1e-4 }}
simulation = {{ duration_s = 1.0 }}
[trajectory]
kind = "sweep"
hold_s = 0.1
ramp_s = 0.2
start_deg = {{ lift = 0.0 }}
end_deg = {{ lift = {end} }}
"""


def loaded(torque: float) -> list[str]:
    """Changes of the bench scene: CSG-25-100 under a torque [N·m]."""
    changes = ("defaults.drive=CSG-25-100", "simulation.duration_s=1.0")
    load = f"load.joint={{torque_Nm={torque}}}"
    return [part for change in (*changes, load) for part in ("--set", change)]


@pytest.mark.filterwarnings("ignore:.*touch")
@pytest.mark.parametrize(("end", "status"), [(60.0, 1), (20.0, 0)])
def test_bodies_that_collide_make_a_run_invalid(tmp_path, capsys, end, status):
    """The link goes into the floor: named in the reasons, exit status 1."""
    (tmp_path / "arm.xml").write_text(ARM)
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format(arm="arm.xml", end=end))
    assert main(["run", str(scene), "--json"]) == status
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"] == ("NOT VALID" if status else "VALID")
    assert bool(found["reasons"]) == bool(status)
    if status:
        assert names(found["reasons"][0], "world", "upper", "mm")
        assert found["collisions"][0]["depth_mm"] > 0.0
        expected = ["--set", "metrics.contacts_expected=true"]
        main(["run", str(scene), *expected, "--json"])
        found = json.loads(capsys.readouterr().out)
        assert found["collisions"]
        assert not any("collide" in reason for reason in found["reasons"])


def test_torque_beyond_the_map_makes_a_run_invalid(bench, synthetic_map):
    """The joint, its torque and the range of the map stand in the reason."""
    _, end = synthetic_map.torque_range
    settled = {"trajectory__settle_s": 0.3}
    fine = bench(synthetic_map, **settled, load__joint__torque_Nm=0.5 * end).metrics()
    assert (fine["verdict"], fine["reasons"]) == ("VALID", [])
    over = bench(synthetic_map, **settled, load__joint__torque_Nm=1.5 * end).metrics()
    assert over["verdict"] == "NOT VALID"
    assert names(over["reasons"][0], "joint", f"{end:.4g} N·m")


def test_missing_energy_makes_a_run_invalid(bench, synthetic_map):
    """A balance that misses a tenth of the works, not one that misses a percent."""
    energy = bench(synthetic_map).metrics()["energy"]
    assert energy_reasons(energy, 50.0) == []
    work = abs(energy["motor_work_J"])
    (line,) = energy_reasons(energy | {"balance_error_J": work}, 50.0)
    assert names(line, f"{work:.3g} J", "simulation.step_s")
    assert energy_reasons(energy | {"balance_error_J": 0.01 * work}, 50.0) == []
    # works of nothing: round-off of it is no reason
    nothing = dict.fromkeys(energy, 0.0) | {"balance_error_J": 1e-6}
    assert energy_reasons(nothing, 50.0) == []


def test_the_verdict_stands_above_the_figures(capsys):
    """First line of the output; teeth that skip turn the exit status."""
    assert main(["run", "bench", *SHORT]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "VALID"
    load = [
        "--set",
        "defaults.drive=CSG-25-100",
        "--set",
        "load.joint={torque_Nm=700.0}",
    ]
    short = ["--set", "simulation.duration_s=1.0"]
    assert main(["run", "bench", *load, *short]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("NOT VALID")
    assert any(names(line, "joint", "skip", "650 N·m") for line in lines[1:3])


def test_strict_turns_the_status_for_an_overloaded_drive(capsys):
    """Above the ratings inside the map: a warning, with --strict exit status 1."""
    load = [
        "--set",
        "defaults.drive=CSG-25-100",
        "--set",
        "load.joint={torque_Nm=200.0}",
    ]
    arguments = ["run", "bench", *load, "--set", "simulation.duration_s=1.0"]
    assert main(arguments) == 0
    assert names(capsys.readouterr().out, "joint", "ratings", "200", "204 N·m")
    assert main([*arguments, "--strict"]) == 1


def test_a_motor_that_does_not_follow_is_told(bench, synthetic_map):
    """Without feed-forward and almost without gains the link lags by degrees."""
    slack = {"stiffness_Nm_rad": 1e-3, "damping_Nms_rad": 1e-3, "feedforward": "none"}
    told = bench(synthetic_map, controller=slack).metrics()["joints"]
    assert told["joint"]["off_command_deg"] > 1.0
    assert any(names(line, "joint", "command", "deg") for line in warnings_of(told))
    fine = bench(synthetic_map).metrics()["joints"]
    assert fine["joint"]["off_command_deg"] < 0.1
    assert not any("command" in line for line in warnings_of(fine))


def test_ripple_without_orders_of_the_drive_is_a_lower_bound(bench, synthetic_map):
    """Too fast for the tooth order: marked; at the named step it is there."""
    fast = {"trajectory__speed_deg_s__joint": 40.0, "simulation__duration_s": 0.25}
    joint = bench(synthetic_map, **fast).metrics()["joints"]["joint"]
    assert [item["order"] for item in joint["unresolved"]] == [122.0]
    assert joint["ripple_is_lower_bound"] and not joint["ripple_missing"]
    faster = fast | {"trajectory__speed_deg_s__joint": 400.0}
    none = bench(synthetic_map, **faster).metrics()["joints"]["joint"]
    assert none["ripple_is_lower_bound"]
    carries = joint["resolving"]
    assert carries["order"] == 122.0
    slow = bench(synthetic_map, trajectory__speed_deg_s__joint=carries["speed_deg_s"])
    assert not slow.metrics()["joints"]["joint"]["unresolved"]
    step = 0.99 * carries["step_s"]
    fine = bench(synthetic_map, **fast, simulation__step_s=step)
    found = fine.metrics()["joints"]["joint"]
    assert not found["unresolved"] and not found["ripple_is_lower_bound"]
    # what was said to be missing is what is there now
    missing = found["ripple_rms_percent"]
    assert joint["ripple_left_out_percent"] == pytest.approx(missing, rel=0.5)


def test_a_drive_without_harmonics_has_no_ripple(bench, plain_map, synthetic_map):
    """A reason instead of vibration and round-off; with harmonics there is none."""
    joint = bench(plain_map).metrics()["joints"]["joint"]
    assert joint["ripple_missing"] and joint["ripple_rms_percent"] >= 0.0
    assert bench(synthetic_map).metrics()["joints"]["joint"]["ripple_missing"] is None
    level = bench(synthetic_map, defaults__level="linear").metrics()
    assert level["joints"]["joint"]["ripple_missing"]


def test_an_assumed_error_is_said(capsys):
    """Its size, orders and seed; none where the scene has none."""
    assert main(["run", "bench", *loaded(20.0)]) == 0
    assert names(capsys.readouterr().out, "assumed", "1 arcmin", "2 and 4", "seed 0")
    none = ["--set", "defaults.kinematic_error_arcmin=0"]
    assert main(["run", "bench", *loaded(20.0), *none]) == 0
    assert "assumed" not in capsys.readouterr().out


def test_ripple_of_a_motion_without_constant_speed_is_explained(capsys):
    """It holds the dynamics of the motion, too."""
    assert main(["run", "bench-chirp", "--set", "simulation.duration_s=9.8"]) == 0
    assert names(capsys.readouterr().out, "ripple", "dynamics")


def test_ripple_that_is_none_is_a_dash(capsys):
    """In the table of the joints, with the reason below."""
    assert main(["run", "bench", *SHORT]) == 0
    row = next(
        line for line in capsys.readouterr().out.splitlines() if "full" in line
    ).split()
    assert row.count("-") >= 2


def test_noise_is_what_jumps_between_samples():
    """White noise keeps its deviation, a wave that the step carries has none."""
    noise = np.random.default_rng(1).normal(scale=0.3, size=20_000)
    assert integration_noise(noise) == pytest.approx(0.3, rel=0.03)
    wave = np.sin(0.1 * np.arange(20_000))
    assert integration_noise(wave) < 0.005
    assert integration_noise(noise[:2]) == 0.0


def test_a_run_of_a_catalogue_drive_in_an_arm_is_valid():
    """The bundled scenes stay inside their models."""
    run = run_scene(
        Scene.load_file("ur5e-catalogue", {"simulation.duration_s": 2.5}),
    )
    assert run.metrics()["reasons"] == []
    assert isinstance(run.assembly.transmissions[0].drive, DriveMap)


def test_a_ripple_that_the_step_cannot_carry_is_unknown_rather_than_none(
    bench, synthetic_map
):
    joints = bench(synthetic_map).metrics()["joints"]
    joints["joint"]["ripple_missing"] = "the step resolves none of its orders"
    (line,) = [text for text in notes(joints) if text.startswith("-:")]
    assert line == (
        "-: no value for the torque ripple: the step resolves none of its orders"
    )


def judged(bench, drive, **changes):
    """Figures of a bench run at 20 N·m that begins at rest under its load."""
    return bench(drive, **{"trajectory__settle_s": 0.3, **changes}).metrics()


def test_ripple_that_the_map_misses_at_these_torques_makes_a_run_invalid(
    bench, synthetic_map
):
    """Joint, drive, quantity, share and torque are named; a row far away is not."""
    bad = validated_map(synthetic_map, {5.0: (0.0, 0.0), 20.0: (0.5, 0.1)})
    found = judged(bench, bad)
    assert found["verdict"] == "NOT VALID"
    (reason,) = found["reasons"]
    assert names(reason, "joint", "synthetic", "input torque", "20 N·m", "30 %")
    assert found["joints"]["joint"]["ripple_valid"] is False
    assert names(reason, "meshing DESIGN", "joints.joint.level=linear")
    ring = replace(bad, level="ring")
    (reason,) = judged(bench, ring)["reasons"]
    assert names(reason, "--set joints.joint.model=2d", "CPU minutes")
    far = {10.0: (0.0, 0.0), 40.0: (0.05, 0.05), 80.0: (0.9, 0.9)}
    found = judged(bench, validated_map(synthetic_map, far))
    joint = found["joints"]["joint"]
    assert (found["verdict"], joint["ripple_valid"]) == ("VALID", True)
    low, high = joint["map_difference"]["torque_range_Nm"]
    assert 15.0 < low < high < 25.0
    assert not warnings_of(found["joints"])


def test_joints_of_one_map_share_a_remedy():
    """Every fault has its line; the same advice for two joints is one line."""
    reasons = [f"{j}: bad; next: --set joints.{j}.model=2d" for j in ("a", "b")]
    lines = verdict_lines({"verdict": "NOT VALID", "reasons": reasons})
    assert lines[1:] == ["  a: bad", "  b: bad", "  next: --set joints.JOINT.model=2d"]
    lines = verdict_lines({"verdict": "NOT VALID", "reasons": [*reasons[:1], "c: far"]})
    assert lines[1:] == ["  a: bad", "  c: far", "  next: --set joints.a.model=2d"]


def test_the_torque_from_which_a_map_is_valid(bench, synthetic_map):
    """Where the line between the last bad row and the next one crosses the limit."""
    rows = {0.0: (0.0, 0.0), 20.0: (0.5, 0.1), 30.0: (0.1, 0.2), 40.0: (0.0, 0.0)}
    found = judged(bench, validated_map(synthetic_map, rows))
    assert found["joints"]["joint"]["map_difference"]["valid_from_Nm"] == 25.0
    assert names(found["reasons"][0], "at least 25 N·m")


def test_only_the_torques_of_the_figures_count(bench, synthetic_map):
    """The same bad row near 30 N·m: valid under 10 N·m of load, not under 30 N·m."""
    rows = {0.0: (0.0, 0.0), 20.0: (0.0, 0.0), 30.0: (0.6, 0.0), 40.0: (0.0, 0.0)}
    drive = validated_map(synthetic_map, rows)
    light = judged(bench, drive, load__joint__torque_Nm=10.0)
    heavy = judged(bench, drive, load__joint__torque_Nm=30.0)
    assert (light["verdict"], heavy["verdict"]) == ("VALID", "NOT VALID")


def test_uncertain_ripple_is_a_warning_at_its_figures(bench, synthetic_map):
    """Above 10 %: valid, a line with the torque, ~ at ripple, orders and error."""
    drive = validated_map(synthetic_map, {20.0: (0.05, 0.2)})
    long = {"simulation__duration_s": 2.0}
    found = judged(bench, drive, **long)
    assert (found["verdict"], found["reasons"]) == ("VALID", [])
    (line,) = warnings_of(found["joints"])
    assert names(line, "joint", "synthetic", "output error", "20 %", "N·m")
    # joints with the same reason share its line
    both = dict.fromkeys(("first", "second"), found["joints"]["joint"])
    (shared,) = warnings_of(both)
    assert shared.startswith("first (") and ", second (" in shared
    assert shared.partition(":")[2] == line.partition(":")[2]
    cells = joint_row(("joint", found["joints"]["joint"]))
    assert [k for k, cell in enumerate(cells) if cell.startswith("~ ")] == [5, 6, 7, 8]
    # a difference of 1e-6 rad is nothing of an error that is mostly torsion
    drive = validated_map(synthetic_map, {20.0: (0.05, 0.2)}, error=5e-6)
    cells = joint_row(("joint", judged(bench, drive, **long)["joints"]["joint"]))
    assert [k for k, cell in enumerate(cells) if cell.startswith("~ ")] == [6, 7, 8]
    # the input torque says nothing of the transmission error
    drive = validated_map(synthetic_map, {20.0: (0.4, 0.05)})
    cells = joint_row(("joint", judged(bench, drive, **long)["joints"]["joint"]))
    assert [k for k, cell in enumerate(cells) if cell.startswith("! ")] == [6, 7, 8]


@pytest.mark.parametrize("level", ["rigid", "linear", "native", "kinematic"])
def test_levels_without_ripple_of_the_map_are_not_judged(bench, synthetic_map, level):
    """A useless map under load does not matter where its ripple is not used."""
    drive = validated_map(synthetic_map, {20.0: (0.9, 0.9)})
    joint = judged(bench, drive, defaults__level=level)["joints"]["joint"]
    assert joint["ripple_valid"] is None and joint["map_difference"] is None
    assert names(joint["map_difference_missing"], level)
    cells = joint_row(("joint", joint))
    assert not any(cell.startswith(("!", "~")) for cell in cells)


def test_a_joint_too_fast_for_every_order_of_its_map_is_not_judged(
    bench, synthetic_map
):
    """None of the map's ripple is in the run: a useless map cannot spoil it."""
    drive = synthetic_map.with_harmonics(synthetic_map.orders[:, 0] == 122)
    drive = validated_map(drive, {20.0: (0.9, 0.9)})
    slow, fast = (
        judged(bench, drive, trajectory__speed_deg_s__joint=speed)["joints"]["joint"]
        for speed in (2.0, 40.0)
    )
    assert slow["ripple_valid"] is False and fast["ripple_valid"] is None
    assert names(fast["map_difference_missing"], "step")


def test_maps_without_validation_run_as_before(bench, synthetic_map):
    """No warning and no mark; the reason stands in the figures of the joint."""
    found = judged(bench, synthetic_map)
    assert found["verdict"] == "VALID" and not warnings_of(found["joints"])
    joint = found["joints"]["joint"]
    assert joint["ripple_valid"] is None
    assert names(joint["map_difference_missing"], NOT_VALIDATED)


def test_run_prints_the_judgement_and_turns_the_status(synthetic_map, tmp_path, capsys):
    """Exit status 1 above 30 %, with --strict above 10 %; the signs are explained."""
    path = tmp_path / "a.swg"
    load = ["--set", "load.joint={torque_Nm=20.0}", "--drive", str(path)]
    short = ["--set", "simulation.duration_s=0.5", "--set", "trajectory.settle_s=0.2"]
    arguments = ["run", "bench", *load, *short]
    validated_map(synthetic_map, {20.0: (0.5, 0.1)}).save(path)
    assert main(arguments) == 1
    first, reason, then, *lines = capsys.readouterr().out.splitlines()
    assert first.startswith("NOT VALID") and names(reason, "joint", "50 %", "20 N·m")
    assert then.startswith("  next: ")
    assert any(line.startswith("! not valid") for line in lines)
    validated_map(synthetic_map, {20.0: (0.2, 0.1)}).save(path)
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("~ uncertain") for line in lines)
    assert main([*arguments, "--strict"]) == 1


@pytest.mark.parametrize(
    ("rms", "left_out", "exceeds"),
    [(0.1, 3.0, True), (0.1, 0.5, False), (1.0, 0.5, True), (2.0, 0.0, False)],
)
def test_a_ripple_is_a_bound_if_left_out_orders_of_any_joint_may_exceed_it(
    rms, left_out, exceeds
):
    """Largest ripple 1 %: the joint with its left-out orders has more by 5 % or not."""
    joint = {"ripple_rms_percent": rms, "ripple_left_out_percent": left_out}
    assert may_exceed(joint, 1.0) == exceeds
