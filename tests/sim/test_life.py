"""Life over a duty cycle: hand calculations, integrals of recordings, rainflow."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.gear.bearing_life import RatedLife, catalogue_life
from swgjoint.gear.fatigue_life import (
    StressCycles,
    StressLife,
    count_cycles,
    equivalent_amplitude,
    goodman_safety,
    miner_damage,
    turning_points,
)
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.root_stress import root_points, root_stress
from swgjoint.models_path import models_path
from swgjoint.sim.life.loads import TaskLoads, mean_load
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.text import scene_toml
from swgjoint.units import MPa, hour, rpm
from swgjoint.view.run import run_scene

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
STEEL = StressLife(
    endurance_limit=400 * MPa, ultimate_strength=1200 * MPa, exponent=9.0, knee=1e6
)
CURVE = {
    "endurance_limit_MPa": 400.0,
    "ultimate_strength_MPa": 1200.0,
    "sn_exponent": 9.0,
    "sn_knee_cycles": 1e6,
}
EXTRA = "the package rainflow, extra 'life', is not installed"


def loads(torque, speed, *, duration=1.0, times=1, ratio=-60.0):
    """One joint at constant torque [N·m] and output speed [rad/s]."""
    one = np.ones((11, 1))
    return TaskLoads(
        name="task",
        duration=duration,
        times=times,
        torque=torque * one,
        speed=speed * one,
        input_speed=ratio * speed * one,
        place=np.zeros((11, 1)),
    )


def rest(duration):
    none = np.empty((0, 1))
    return TaskLoads(
        name="rest",
        duration=duration,
        times=1,
        torque=none,
        speed=none,
        input_speed=none,
        place=none,
    )


def test_rated_load_gives_the_rated_life():
    """At rated torque and speed the life is that of the catalogue."""
    rated = catalogue_life("CSG")
    assert (rated.L50, rated.L10) == (50_000 * hour, 10_000 * hour)
    assert rated.factor(87.0, 87.0, 2000 * rpm) == pytest.approx(1.0, rel=1e-12)
    # half the torque: eight times the life; half the speed: twice the life
    assert rated.factor(87.0, 43.5, 1000 * rpm) == pytest.approx(16.0, rel=1e-12)
    assert catalogue_life("CHA") is None


def test_two_loads_and_a_pause_by_hand():
    """100 N·m for 2 s, three times -50 N·m at twice the speed for 1 s, 5 s rest."""
    cycle = [loads(100.0, 0.5, duration=2.0), loads(-50.0, -1.0, times=3), rest(5.0)]
    found = mean_load(cycle, 0)
    # sum of |n| t |T|^3: 1e6 + 3 x 125000; of |n| t: 1 + 3 rad; of t: 10 s
    assert found.torque == pytest.approx((1.375e6 / 4.0) ** (1 / 3), rel=1e-12)
    assert found.input_speed == pytest.approx(60.0 * 4.0 / 10.0, rel=1e-12)
    assert found.input_turns == pytest.approx(60.0 * 4.0 / (2 * np.pi), rel=1e-12)
    assert found.peak == 100.0
    # by hand: T_av = 70.05 N·m, n_av = 24 rad/s = 229.2 rpm
    rated = RatedLife(L50=50_000 * hour, L10=10_000 * hour)
    life = rated.L10 * rated.factor(87.0, found.torque, found.input_speed) / hour
    assert life == pytest.approx(10_000 * 658_503 / 343_750 * 2000 / 229.183, rel=1e-5)


def test_order_of_the_tasks_does_not_matter():
    """The bearing has no memory."""
    cycle = [loads(100.0, 0.5, duration=2.0), loads(-50.0, -1.0, times=3), rest(5.0)]
    assert mean_load(cycle, 0).torque == pytest.approx(mean_load(cycle[::-1], 0).torque)


def test_astm_example_of_a_repeating_history():
    """ASTM E1049-85, 5.4.5, figure 7: ranges 3, 4, 7 and 9, each once."""
    pytest.importorskip("rainflow", reason=EXTRA)
    history = np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])
    for begin in range(len(history) - 1):  # a cycle has no first point
        shifted = np.roll(history[:-1], begin)
        found = count_cycles(shifted)
        counts = {span: 0.0 for span in (3.0, 4.0, 7.0, 9.0)}
        for amplitude, count in zip(found.amplitude, found.count, strict=True):
            counts[2.0 * amplitude] += count
        assert counts == dict.fromkeys(counts, 1.0)


def test_astm_example_of_the_library():
    """ASTM E1049-85, 5.4.4, figure 6: cycle counts of the ranges 3, 4, 6, 8 and 9."""
    rainflow = pytest.importorskip("rainflow", reason=EXTRA)
    history = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
    assert rainflow.count_cycles(history) == [
        (3.0, 0.5),
        (4.0, 1.5),
        (6.0, 0.5),
        (8.0, 1.0),
        (9.0, 0.5),
    ]


def test_a_sine_counts_its_periods():
    """Ten periods of 100 MPa about 50 MPa are ten cycles, whatever the phase."""
    pytest.importorskip("rainflow", reason=EXTRA)
    for phase in (0.0, 0.7, 2.0):
        x = np.arange(4000) * 2 * np.pi / 400 + phase
        found = count_cycles(50.0 + 100.0 * np.sin(x))
        assert found.count.sum() == pytest.approx(10.0)
        assert found.amplitude == pytest.approx(100.0, rel=1e-4)
        assert found.mean == pytest.approx(50.0, abs=0.01)


def test_turning_points_lose_nothing():
    """Between two turning points the signal is monotonic, and plateaus count once."""
    x = np.random.default_rng(1).normal(size=500).round(1)
    points = turning_points(x)
    assert (points[0], points[-1]) == (x[0], x[-1])
    assert np.abs(np.diff(points)).sum() == pytest.approx(np.abs(np.diff(x)).sum())
    assert turning_points(np.array([1.0, 2.0, 2.0, 1.0])).tolist() == [1.0, 2.0, 1.0]
    assert turning_points(np.array([3.0])).tolist() == [3.0]


def test_goodman_and_miner_by_hand():
    """600 MPa about 300 MPa is 800 MPa reversed: 2^9 times the rate of the knee."""
    cycles = StressCycles(
        amplitude=np.array([600.0, 300.0, 600.0]) * MPa,
        mean=np.array([300.0, 0.0, -300.0]) * MPa,
        count=np.array([1.0, 5.0, 2.0]),
    )
    stress = equivalent_amplitude(cycles.amplitude, cycles.mean, 1200 * MPa)
    assert stress / MPa == pytest.approx([800.0, 300.0, 600.0])
    # 300 MPa is below the limit; compression is given no credit
    expected = (2.0**9 + 2 * 1.5**9) / 1e6
    assert miner_damage(cycles, STEEL) == pytest.approx(expected, rel=1e-12)
    assert goodman_safety(cycles, STEEL) == pytest.approx(1 / (600 / 400 + 300 / 1200))
    broken = replace(cycles, mean=np.full(3, 1300.0) * MPa)
    assert miner_damage(broken, STEEL) == np.inf


def test_root_stress_has_the_sign_of_the_surface(fields):
    """On an oval ring of one triangle, the stress has the sign of its area change."""
    points = root_points(fields)
    assert points.size
    table = root_stress(fields).stress
    assert np.abs(table) == pytest.approx(fields.von_mises[:, :, points], rel=1e-6)


def bending_fields(fields, *, swing=200.0, mean=50.0, per_Nm=2.0):
    """Fields whose root point is strained like its stress: a sine plus the torque."""
    place = np.pi * np.arange(120) / 120
    wave = mean + swing * np.cos(2.0 * place)
    stress = (wave[None] + per_Nm * np.abs(fields.torque)[:, None]) * MPa
    rest_points = np.array(
        [[-0.03, 1.0, 0.0], [0.0, 1.0, 0.0], [0.03, 1.0, 0.0], [0.0, 0.9, 0.0]]
    )
    points = 0.06 * rest_points
    u = np.zeros((2, 120, 4, 3))
    u[..., 0] = points[:, 0] * (stress / 210e9)[..., None]
    shape = (2, 120, 3)
    return replace(
        fields,
        points=points,
        triangles=np.array([[0, 1, 3], [1, 2, 3]]),
        displacement=u,
        von_mises=np.abs(np.broadcast_to(stress[..., None], (2, 120, 4))),
        tooth_force=np.zeros(shape),
        wave_generator_force=np.zeros(shape),
    )


def test_signed_root_stress_follows_its_strain(fields):
    """The stress comes back with its sign, compressed places included."""
    own = bending_fields(fields)
    stress = root_stress(own)
    place = np.pi * np.arange(120) / 120
    expected = (50.0 + 200.0 * np.cos(2 * place) + 2.0 * 100.0) * MPa
    assert expected.min() > 0  # under torque all of it is tension
    assert stress.stress[0, :, 0] == pytest.approx(expected, rel=1e-5)
    free = bending_fields(fields, per_Nm=0.0)
    table = root_stress(free).stress[0, :, 0] / MPa
    assert table == pytest.approx(50.0 + 200.0 * np.cos(2 * place), abs=0.1)
    assert table.min() == pytest.approx(-150.0, abs=0.1)


CYCLE = [
    {},
    {
        "name": "slow",
        "trajectory": {"kind": "constant_speed", "speed_deg_s": {"joint": 1.5}},
    },
    {"name": "light", "load": {"joint": {"torque_Nm": 5.0}}, "times": 4},
    {"rest": True, "duration_s": 2.0},
]
LIFE = {"L50_h": 35_000.0, "rated_speed_rpm": 2000.0}


def test_mean_of_a_scene_is_the_integral_of_its_recordings(bench):
    """Every task is its own scene; the means integrate torque and speed of the four."""
    run = bench(LINEAR, cycle=CYCLE, defaults__life=LIFE)
    figures = run.metrics()["joints"]["joint"]["life"]
    alone = [
        bench(LINEAR),
        bench(LINEAR, trajectory__speed_deg_s__joint=1.5),
        bench(LINEAR, load__joint__torque_Nm=5.0),
    ]
    weighted = turned = turns = 0.0
    for one, times in zip(alone, (1, 1, 4), strict=True):
        speed, torque = np.abs(one.velocity[:, 0]), np.abs(one.output_torque[:, 0])
        weighted += times * np.trapezoid(speed * torque**3, one.time)
        turned += times * np.trapezoid(speed, one.time)
        turns += times * np.trapezoid(np.abs(one.motor_velocity[:, 0]), one.time)
    duration = 6 * 0.5 + 2.0
    # 0.2 %: means of samples against the trapezoidal rule over 500 steps
    assert figures["cubed_mean_Nm"] == pytest.approx(
        (weighted / turned) ** (1 / 3), rel=2e-3
    )
    assert figures["mean_input_speed_rpm"] * rpm == pytest.approx(
        turns / duration, rel=2e-3
    )
    assert run.metrics()["cycle"]["duration_s"] == pytest.approx(duration)
    factor = (figures["bearing"]["rated_torque_Nm"] / figures["cubed_mean_Nm"]) ** 3
    factor *= 2000.0 / figures["mean_input_speed_rpm"]
    assert figures["bearing"]["L50_h"] == pytest.approx(35_000 * factor, rel=1e-9)
    assert figures["bearing"]["L10_h"] == pytest.approx(7_000 * factor, rel=1e-9)


def test_own_motion_repeated_has_the_mean_of_the_ratings(bench):
    """An empty task is the run itself, without a second simulation."""
    run = bench(LINEAR, cycle=[{}], defaults__life=LIFE)
    joint = run.metrics()["joints"]["joint"]
    assert joint["life"]["cubed_mean_Nm"] == joint["ratings"]["cubed_mean_Nm"]
    assert run.cycle[0].torque is run.output_torque


def test_a_scene_without_a_cycle_has_no_life(bench):
    """No key, no task, and the figures of the motion are the same bit by bit."""
    plain, with_cycle = bench(LINEAR), bench(LINEAR, cycle=CYCLE)
    metrics, other = plain.metrics(), with_cycle.metrics()
    assert "cycle" not in metrics
    assert "life" not in metrics["joints"]["joint"]
    assert np.array_equal(plain.output_torque, with_cycle.output_torque)
    del other["cycle"], other["joints"]["joint"]["life"]
    for one in (metrics, other):
        del one["steps_per_s"]
    assert metrics == other


def test_life_that_is_not_known_says_why(bench):
    """No rated life, no fields: dashes with the reason."""
    life = bench(LINEAR, cycle=[{}]).metrics()["joints"]["joint"]["life"]
    assert life["bearing"]["L10_h"] is None
    assert "L50_h" in life["bearing"]["missing"]
    assert life["flexspline"]["life_h"] is None
    assert "no stress fields" in life["flexspline"]["missing"]
    assert life["margins"]["buckling"] is None
    assert life["margins"]["momentary_peak"] > 0.0


def test_catalogue_drive_has_life_and_margins():
    """Rated life and buckling torque come from the tables of the maker."""
    run = run_scene(
        "bench",
        overrides={
            "defaults.drive": "CSG-20-100",
            "simulation.duration_s": 1.0,
            "cycle": [{}],
        },
    )
    life = run.metrics()["joints"]["joint"]["life"]
    assert life["bearing"]["source"] == "catalogue CSG"
    assert life["bearing"]["L50_h"] == pytest.approx(5 * life["bearing"]["L10_h"])
    for key, limit in (
        ("momentary_peak", 191.0),
        ("ratcheting", 330.0),
        ("buckling", 800.0),
    ):
        assert life["margins"][key] == pytest.approx(limit / life["peak_Nm"])


def fast(bench, drive, **changes):
    """The bench at ten lobes a second."""
    return bench(
        drive,
        trajectory__speed_deg_s__joint=30.0,
        cycle=[{"times": 3}],
        **changes,
    ).metrics()["joints"]["joint"]["life"]["flexspline"]


def test_flexspline_counts_the_lobes(bench, fields):
    """At constant torque every lobe is one cycle of the stress of the fields."""
    pytest.importorskip("rainflow", reason=EXTRA)
    drive = replace(LINEAR, fields=bending_fields(fields))
    found = fast(bench, drive, defaults__life=CURVE)
    # 200 MPa about 50 MPa plus 2 MPa per N·m at 20 N·m, but the fields have only -100
    # and 100 N·m, between which the stress is that of 100 N·m
    assert found["stress_amplitude_MPa"] == pytest.approx(200.0, rel=2e-3)
    assert found["stress_mean_MPa"] == pytest.approx(250.0, rel=2e-3)
    use = 200 / 400 + 250 / 1200
    assert found["goodman_safety"] == pytest.approx(1 / use, rel=2e-3)
    assert found["unlimited"] and found["life_h"] is None
    weak = CURVE | {"endurance_limit_MPa": 100.0}
    found = fast(bench, drive, defaults__life=weak)
    each = (200.0 / (1 - 250 / 1200) / 100.0) ** 9 / 1e6
    # 61 / 60 turns of the flexspline below the lobes per input turn, two lobes, 7.5 deg
    # of the output in each of three occurrences
    lobes = found["damage_per_cycle"] / each
    assert lobes == pytest.approx(3 * 2 * 61 * 15 / 360, abs=3 * 0.6)
    assert found["life_h"] == pytest.approx(3 * 0.5 / found["damage_per_cycle"] / hour)


def test_torque_beyond_the_fields_has_no_fatigue_figure(bench, fields):
    """Fields are not extrapolated."""
    own = replace(bending_fields(fields), torque=np.array([-10.0, 10.0]))
    found = fast(bench, replace(LINEAR, fields=own), defaults__life=CURVE)
    assert found["life_h"] is None
    assert "leaves the stress fields" in found["missing"]


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"cycle": [{"rest": True, "duration_s": 1.0}]}, "cycle"),
        ({"cycle": [{"rest": True}]}, "cycle[0].duration_s"),
        ({"cycle": [{}, {"duration_s": -1.0}]}, "cycle[1].duration_s"),
        ({"cycle": [{"times": 0}]}, "cycle[0].times"),
        ({"cycle": [{"task": "x"}]}, "cycle[0].task"),
        ({"cycle": [{}, {"load": {"elbow": {"torque_Nm": 1.0}}}]}, "cycle[1]: load"),
        (
            {"cycle": [{"rest": True, "duration_s": 1, "load": {}}, {}]},
            "cycle[0].load",
        ),
        ({"defaults.life": {"L10_h": 5.0}}, "L10_h"),
        ({"defaults.life": {"L50_h": 5.0, "L10_h": 6.0}}, "L10_h"),
        ({"defaults.life": {"sn_exponent": 5.0}}, "endurance_limit_MPa"),
        (
            {"defaults.life": CURVE | {"ultimate_strength_MPa": 300.0}},
            "endurance_limit_MPa",
        ),
    ],
)
def test_faults_name_their_key(changes, key):
    """One line that names the key, before anything runs."""
    with pytest.raises(InputError, match=naming(key)) as error:
        run_scene("bench", overrides={"defaults.drive": "CSG-20-100"} | changes)
    assert "\n" not in str(error.value)


def test_a_bad_task_writes_nothing(tmp_path, capsys):
    """The command ends with status 2 and one line, and its folder stays empty."""
    from swgjoint.cli.main import main

    out = tmp_path / "out"
    arguments = ["run", "bench", "--drive", "CSG-20-100", "--out", str(out)]
    bad = "cycle=[{load={elbow={torque_Nm=1.0}}}]"
    assert main([*arguments, "--set", bad]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and "cycle[0]" in lines[0]
    assert not out.exists() or not list(out.iterdir())


def test_rainflow_that_is_not_installed_is_the_reason(bench, fields, monkeypatch):
    """The bearing has its life nevertheless; the reason names the extra."""
    monkeypatch.setitem(sys.modules, "rainflow", None)
    drive = replace(LINEAR, fields=bending_fields(fields))
    run = bench(drive, cycle=[{}], defaults__life=CURVE | LIFE)
    life = run.metrics()["joints"]["joint"]["life"]
    assert "swgjoint[life]" in life["flexspline"]["missing"]
    assert life["bearing"]["L10_h"] > 0.0


def test_text_of_a_scene_keeps_its_cycle(tmp_path):
    """Tasks come back from the text, with absolute paths of their files."""
    (tmp_path / "motion.csv").write_text("time_s,joint_deg\n0,0\n1,5\n")
    task = '[[cycle]]\n[cycle.trajectory]\nkind = "csv"\nfile = "motion.csv"\n'
    path = tmp_path / "own.toml"
    text = (models_path() / "scenes" / "bench.toml").read_text(encoding="utf-8")
    path.write_text(text + "\n" + task)
    scene = Scene.load_file(path)
    again = Scene.from_toml(scene_toml(scene))
    assert again.cycle == scene.cycle
    assert again.cycle[0].trajectory.file == str(tmp_path / "motion.csv")


def test_commands_show_the_life(tmp_path, capsys):
    """``run`` prints and reports it, ``compare`` has a column and accepts a limit."""
    from swgjoint.cli.main import main

    short = ["--set", "simulation.duration_s=1.0", "--set", "cycle=[{}]"]
    out = tmp_path / "out"
    arguments = ["run", "bench", "--drive", "CSG-20-100", "--report", "--out", str(out)]
    assert main([*arguments, *short]) == 0
    text = capsys.readouterr().out
    assert "Duty cycle of 1 s: task 1 1 s" in text
    assert "L10" in text
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Life of bench" in page
    assert "Duty cycle of bench" in page
    drives = ["compare", "CSG-20-100", "CSG-25-100", "--json", *short]
    assert main([*drives, "--limit", "L10_h=1", "--sort", "L10_h"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["design"] for row in rows] == ["CSG-25-100", "CSG-20-100"]
    assert main(["compare", "CSG-20-100", "--limit", "L10_h=1"]) == 2
    assert "[[cycle]]" in capsys.readouterr().err
