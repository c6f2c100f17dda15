"""Selection of drives: search against enumeration, loads by hand, laws, command."""

from __future__ import annotations

import itertools
import json
from decimal import Decimal
from functools import cache
from math import inf, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from messages import names, naming

from swgjoint.cli.main import main
from swgjoint.errors import ComputationError, InputError
from swgjoint.explore.compare.compare import compare
from swgjoint.explore.select import search, select
from swgjoint.explore.select.evaluation import (
    SimulatedSet,
    evaluate_set,
    scene_of_set,
    tool_shares,
)
from swgjoint.explore.select.loads import MARGIN, RATINGS, check_loads, rigid_tasks
from swgjoint.explore.select.options import DriveOption, read_options
from swgjoint.explore.select.prediction import PATH, ToolPrediction
from swgjoint.explore.select.search import QuadraticBound, SetSearch, predict_squared
from swgjoint.explore.select.select import select_drives
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.scene import scene_of_arm
from swgjoint.sim.figures.resonance import lowest_resonance
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import mm, rpm
from swgjoint.view.run import run_scene

ROBOTS = Path(__file__).parents[1] / "robots" / "models"
SMALL = ("CSG-14-100", "CSG-17-100", "CSG-20-100")
"""Three drives, for two joints nine sets."""


@cache
def options() -> tuple[DriveOption, ...]:
    """The drives of the catalogue."""
    return read_options()


@cache
def small() -> tuple[DriveOption, ...]:
    return tuple(one for one in options() if one.drive in SMALL)


@cache
def ratio_100() -> tuple[DriveOption, ...]:
    """One drive of every size."""
    return tuple(one for one in options() if one.drive.endswith("-100"))


@cache
def scene(payload: float = 3.0) -> Scene:
    """A sweep of two links with a payload."""
    return scene_of_arm("two-link", overrides={"payload.mass_kg": payload})


# ---- search


@pytest.mark.parametrize("seed", range(30))
def test_the_search_finds_what_enumeration_finds(seed):
    """Random costs with equal ones, two quadratic bounds with terms of both signs."""
    random = np.random.default_rng(seed)
    sizes = random.integers(1, 5, size=random.integers(1, 5))
    costs = [
        [
            (Decimal(int(c)), Decimal(int(t)))
            for c, t in random.integers(0, 4, size=(n, 2))
        ]
        for n in sizes
    ]
    count = int(sizes.sum())
    forms = []
    for columns in (1, 3):
        rows = random.normal(size=(count, columns))
        forms.append(rows @ rows.T)
    first = np.cumsum([0, *sizes])[:-1]
    found = {}
    for chosen in itertools.product(*map(range, sizes)):
        rows = first + np.array(chosen)
        values = [form[np.ix_(rows, rows)].sum() for form in forms]
        total = tuple(
            sum(costs[j][k][part] for j, k in enumerate(chosen)) for part in (0, 1)
        )
        found[chosen] = (total, values)
    # not exactly the value of a set, whose sum depends on the order of its terms
    limits = [
        (1.0 + 1e-9) * np.quantile([v[i] for _, v in found.values()], 0.5)
        for i in (0, 1)
    ]
    bounds = [
        QuadraticBound(form=form, largest=limit)
        for form, limit in zip(forms, limits, strict=True)
    ]
    good = {
        chosen: total
        for chosen, (total, values) in found.items()
        if all(v <= limit for v, limit in zip(values, limits, strict=True))
    }
    skipped: set[tuple[int, ...]] = set()
    finder = SetSearch(costs, bounds)
    while good:
        chosen = finder.find_cheapest(skipped)
        assert chosen in good and good.pop(chosen) == min(
            [*good.values(), found[chosen][0]]
        )
        assert predict_squared(forms[1], sizes, chosen) == pytest.approx(
            found[chosen][1][1]
        )
        skipped.add(chosen)
    assert finder.find_cheapest(skipped) is None


def test_a_joint_without_a_drive_has_no_set():
    assert SetSearch([[(Decimal(1), Decimal(0))], []]).find_cheapest() is None


def test_a_search_that_is_too_long_says_so(monkeypatch):
    monkeypatch.setattr(search, "MOST_NODES", 3)
    costs = [[(Decimal(1), Decimal(k)) for k in range(4)]] * 6
    with pytest.raises(ComputationError, match=naming("3 partial sets")):
        SetSearch(costs).find_cheapest()


# ---- loads and prediction


def test_loads_follow_the_formulas_by_hand():
    """Torque, speed and life of one joint from its trajectory and inverse dynamics."""
    own, cycle = rigid_tasks(scene())
    assert cycle == (own,)
    (option,) = [one for one in options() if one.drive == "CSG-17-120"]
    spec = {**RATINGS, "L10_h": 1e4, "K1_Nm_rad": 1.0}
    for j in range(2):
        checks = check_loads(own, cycle, j, option, spec, None)
        value = {check.key: check.value for check in checks}
        torque, speed = own.torque[:, j], np.abs(own.trajectory.velocity[:, j])
        mean = (np.sum(np.abs(torque) ** 3 * speed) / speed.sum()) ** (1 / 3)
        turns = 120.0 * speed.mean() / rpm
        assert value["peak_torque_of_rating"] == pytest.approx(
            np.abs(torque).max() / 70.0
        )
        assert value["cubed_mean_torque_of_rating"] == pytest.approx(mean / 31.0)
        assert value["max_input_speed_rpm"] == pytest.approx(120 * speed.max() / rpm)
        assert value["average_input_speed_rpm"] == pytest.approx(turns)
        assert value["L10_h"] == pytest.approx(
            1e4 * (31.0 / mean) ** 3 * 2000.0 / turns
        )
        assert value["K1_Nm_rad"] == pytest.approx(1e4, rel=0.01)
        (life,) = [check for check in checks if check.key == "L10_h"]
        assert life.use == pytest.approx(1e4 / life.value)


def test_simulated_loads_are_those_of_the_rigid_arm():
    """Their difference is within the margin for which drives are kept."""
    margin = {"cubed_mean_torque_of_rating": 0.05, "L10_h": 0.15}
    spec = {"L10_h": 1.0}
    found = select_drives(scene(), small(), spec=spec)
    assert found.winner is not None
    for name, drives in found.drives.items():
        (chosen,) = [
            one for one in drives if one.option.drive == found.winner.drives[name]
        ]
        for check in chosen.checks:
            if check.key in found.spec and check.use > 0.01:
                simulated = found.winner.figures[name][check.key]
                assert simulated == pytest.approx(
                    check.value, rel=margin.get(check.key, MARGIN - 1.0)
                ), check.key


def linear_option(name: str, stiffness: float, cost: int) -> DriveOption:
    drive = DriveMap.linear(stiffness, rated_torque=200.0, name=name)
    return DriveOption(
        drive=name, cost=Decimal(cost), mass=None, max_input_speed=inf,
        average_input_speed=inf, rotor_inertia=1e-4, life=None, map=drive,
    )  # fmt: skip


def test_the_prediction_of_linear_drives_is_the_simulation():
    """Torsion under the weight moves the tool; then the simulated set replaces it."""
    soft, stiff = linear_option("soft", 4e3, 1), linear_option("stiff", 4e4, 2)
    own, _ = rigid_tasks(scene())
    prediction = ToolPrediction(own, [[soft, stiff]] * 2)
    changed = scene_of_set(scene(), own.arm.joints, (soft, stiff))
    run = run_scene(changed, drives={"soft": soft.map, "stiff": stiff.map})
    simulated = run.metrics()["tool"]["path_rms_mm"]

    def predicted() -> float:
        return sqrt(predict_squared(prediction.form_of(PATH), (2, 2), (0, 1))) / mm

    assert simulated > 1.0
    assert predicted() == pytest.approx(0.97 * simulated, rel=0.02)
    prediction.learn((0, 1), run)
    assert predicted() == pytest.approx(0.995 * simulated, rel=0.003)
    shares = tool_shares(run)
    assert sum(shares.values()) == pytest.approx(1.0, abs=0.01)
    first, second = own.arm.joints
    assert shares[first] > 5.0 * abs(shares[second])


def test_deviations_are_predicted_with_their_sign():
    """Torsion and kinematic error of catalogue drives: parallel to the simulated."""
    own, _ = rigid_tasks(scene())
    drives = [one for one in options() if one.drive in ("CSG-25-100", "CSG-32-100")]
    prediction = ToolPrediction(own, [[one, one] for one in drives])
    run = run_scene(scene_of_set(scene(), own.arm.joints, drives))
    prediction.learn((0, 0), run)  # the second option of each joint stays predicted
    form = prediction.form_of(PATH)
    for simulated, predicted in ((0, 1), (2, 3)):
        both = form[simulated, predicted]
        norm = sqrt(form[simulated, simulated] * form[predicted, predicted])
        assert both > 0.9 * norm


# ---- laws of the selection


@cache
def runs_of_all(payload: float) -> list[tuple[SimulatedSet, Run]]:
    """All nine sets of two joints, by exhaustive simulation."""
    found = []
    arm = rigid_tasks(scene(payload))[0].arm
    for pair in itertools.product(small(), repeat=2):
        task = scene(payload).with_changes({"cycle": [{"name": "task"}]})
        one = SimulatedSet(
            drives=dict(zip(arm.joints, (o.drive for o in pair), strict=True)),
            cost=float(sum(o.cost for o in pair)),
            predicted={},
        )
        found.append((one, run_scene(scene_of_set(task, arm.joints, pair))))
    return found


def simulate_all(payload: float, spec: dict[str, float]) -> list[SimulatedSet]:
    """These sets with the figures and missed limits of a spec."""
    limits = {**RATINGS, **spec}
    return [evaluate_set(one, run, limits) for one, run in runs_of_all(payload)]


SPECS = [
    ({}, ("17", "14")),
    ({"tool_path_rms_mm": 1.411}, ("17", "17")),  # the cheaper set misses it by 0.3 %
    ({"tool_path_rms_mm": 1.25}, ("20", "14")),
    ({"tool_path_rms_mm": 1.0, "L10_h": 2e5}, ("20", "17")),
    ({"tool_ap_mm": 0.78}, ("20", "20")),
    ({"torsion_arcmin": 3.2, "K1_Nm_rad": 1e4}, ("20", "17")),
    ({"ripple_rms_percent": 0.8}, ("20", "17")),
    ({"transmission_error_arcmin": 2.0, "tool_path_rms_mm": 2.0}, ("20", "17")),
    ({"resonance_Hz": 19.0}, ("20", "14")),
    ({"torsion_arcmin": 2.5}, ()),
    ({"tool_path_rms_mm": 0.1}, ()),
]


def test_the_resonance_of_two_links_is_the_closed_form():
    """det(K - w² M) = 0 at the pose of the run's motion that gives the least w."""
    stiffness = np.array([9e4, 8e3])
    soft = [linear_option(f"{k:g}", k, 1) for k in stiffness]
    arm = rigid_tasks(scene())[0].arm
    changed = scene_of_set(scene(), arm.joints, soft)
    known = {one.drive: one.map for one in soft}
    run = run_scene(changed, drives=known)
    lowest = inf
    for q in run.assembly.trajectory.position[::200]:
        # columns of the inertia matrix from inverse dynamics
        rest = arm.gravity(q[None])[0]
        units = [
            arm.torques(q[None], 0 * q[None], a[None])[0] - rest for a in np.eye(2)
        ]
        (a, b), (_, d) = units
        p, r = a * d - b * b, stiffness.prod()
        q1 = stiffness[0] * d + stiffness[1] * a
        square = (q1 - sqrt(q1**2 - 4 * p * r)) / (2 * p)
        if (found := sqrt(square) / (2 * pi)) < lowest:
            lowest = found
            mode = np.array([square * b, stiffness[0] - square * a])
            energy = stiffness * mode**2
    frequency, shares = lowest_resonance(run)
    assert frequency == pytest.approx(lowest, rel=1e-9)
    expected = energy / energy.sum()
    assert [*shares.values()] == pytest.approx(
        expected, rel=1e-6
    ) and expected.min() > 0
    assert (
        lowest_resonance(run_scene(changed.with_level("rigid"), drives=known)) is None
    )


@pytest.mark.parametrize(("spec", "sizes"), SPECS, ids=str)
def test_exhaustive_search_finds_the_same_set(spec, sizes):
    """The cheapest of all nine simulated sets is the selected one."""
    everything = simulate_all(1.0, spec)
    found = select_drives(scene(1.0), small(), spec=spec)
    good = [one for one in everything if one.met]
    best = min(good, key=lambda one: one.cost).drives if good else None
    assert (found.winner.drives if found.winner else None) == best
    assert [name.split("-")[1] for name in (best or {}).values()] == [*sizes]
    assert (found.scene is None) == bool(found.failure) == (best is None)
    assert len(found.simulated) <= len(everything)
    for one in found.simulated:  # the same simulation, by either way
        (twin,) = [other for other in everything if other.drives == one.drives]
        assert one.figures == twin.figures and one.met == twin.met


def test_a_joint_at_rest_meets_limits_of_the_ripple(tmp_path):
    """A set that compare accepts is selected, even if one joint has no ripple."""
    file = tmp_path / "arm.xml"
    file.write_text(
        """<mujoco><worldbody><body><joint name="turn" axis="0 0 1"/>
        <geom size="0.05" mass="1"/><body><joint name="lift" axis="0 1 0"/>
        <geom size="0.05" mass="2" pos="0.2 0 0"/></body></body></worldbody></mujoco>"""
    )
    changes = {"trajectory.end_deg": {"lift": 10.0}, "simulation.duration_s": 3.0}
    task = scene_of_arm(str(file), overrides=changes)
    for limit in (50.0, 1e-3):
        found = select_drives(task, small()[:1], spec={"ripple_rms_percent": limit})
        (row,) = compare(["full"], found.scene or task, spec=found.spec)
        joints = row.run.metrics()["joints"]
        assert joints["turn"]["ripple_missing"] and not joints["lift"]["ripple_missing"]
        assert bool(row.missed) == (found.winner is None) == (limit < 1.0)


def cost_of(found) -> float:
    return inf if found.winner is None else found.winner.cost


@pytest.mark.parametrize(
    ("key", "limits"),
    [
        ("tool_path_rms_mm", (10.0, 3.0, 1.5, 1.0, 0.7, 0.4)),
        ("torsion_arcmin", (10.0, 3.0, 1.5, 0.4)),  # none is stiff enough from 1.5 on
    ],
    ids=["tool_path_rms_mm", "torsion_arcmin"],
)
def test_a_tighter_limit_never_gives_a_cheaper_set(key, limits):
    costs = [
        cost_of(select_drives(scene(), ratio_100(), spec={key: limit}))
        for limit in limits
    ]
    assert costs == sorted(costs) and len(set(costs)) > 2


def test_a_heavier_payload_never_gives_a_cheaper_set():
    costs = [
        cost_of(select_drives(scene(payload), ratio_100()))
        for payload in (0.5, 2.0, 4.0, 8.0, 16.0, 1000.0)
    ]
    assert costs == sorted(costs) and len(set(costs)) > 3 and costs[-1] == inf


def test_a_set_that_fails_drops_its_drive_only(monkeypatch):
    """A run that diverges with one drive in one joint: the others are still chosen."""
    task = scene(1.0)
    first = rigid_tasks(task)[0].arm.joints[0]
    light = select_drives(task, small()).winner.drives[first]
    failing = {light}

    def run_or_fail(one, **settings):
        if one.joint_settings(first).drive in failing:
            raise ComputationError("the motion diverged")
        return run_scene(one, **settings)

    monkeypatch.setattr(select, "run_scene", run_or_fail)
    found = select_drives(task, small())
    assert found.winner is not None and found.winner.drives[first] != light
    assert found.dropped[first] == {light: "the motion diverged"}
    assert not any(found.dropped[name] for name in found.dropped if name != first)
    failing |= set(SMALL)
    found = select_drives(task, small())
    assert found.winner is None and "stiffest" in found.failure
    assert len(found.simulated) == 2 and "the motion diverged" in found.failure


# ---- command


def run(capsys, *argv: str) -> tuple[int, dict]:
    status = main(["select", *argv, "--json", "--quiet"])
    return status, json.loads(capsys.readouterr().out)


TWO_LINKS = ["two-link", "--payload", "3"]


def test_the_winner_meets_the_spec_on_its_own(tmp_path, capsys):
    """The written scene, run alone, has the figures of the selection."""
    spec = tmp_path / "spec.toml"
    spec.write_text("[spec]\ntool_path_rms_mm = 1.5\nL10_h = 10000\n")
    out = tmp_path / "out"
    status, found = run(capsys, *TWO_LINKS, "--spec", str(spec), "--out", str(out))
    assert status == 0 and found["passed"] and found["failure"] is None
    assert {p.name for p in out.iterdir()} == {
        "scene.toml", "select.json", "select.png", "report.html",
    }  # fmt: skip
    alone = run_scene(Scene.load_file(out / "scene.toml")).metrics()
    assert alone["verdict"] == "VALID"
    assert alone["tool"]["path_rms_mm"] <= 1.5
    assert {name: one["drive"] for name, one in alone["joints"].items()} == found[
        "drives"
    ]
    (winner,) = [one for one in found["simulated"] if one["met"]]
    assert winner["tool"]["tool_path_rms_mm"] == alone["tool"]["path_rms_mm"]
    for name, joint in alone["joints"].items():
        life = joint["life"]["bearing"]["L10_h"]
        assert life >= 1e4 and winner["joints"][name]["L10_h"] == life
        assert joint["ratings"]["within"]
    argv = ["compare", "full", "--scene", str(out / "scene.toml"), "--spec", str(spec)]
    assert main([*argv, "--quiet"]) == 0


FEW = ("--table", "{dir}/few.csv", "--without-catalogue")


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["--payload", "900"], ("no drive carries", "cubed_mean_torque_of_rating")),
        (["--limit", "K1_Nm_rad=1e9"], ("K1_Nm_rad", "CSG-32", "limit 1e+09")),
        (
            ["--limit", "tool_path_rms_mm=0.01", *FEW],
            ("tool_path_rms_mm", "limit 0.01", "contributes", "%"),
        ),
        (["--limit", "resonance_Hz=99"], ("resonance_Hz", "limit 99", "energy")),
        (["--limit", "torsion_arcmin=0.001", *FEW], ("torsion_arcmin", "limit 0.001")),
    ],
)
def test_an_impossible_spec_names_joint_and_limit(argv, message, tmp_path, capsys):
    """Status 1, nothing written."""
    out = tmp_path / "out"
    (tmp_path / "few.csv").write_text("drive\nCSG-20-100\nCSG-32-100\n")
    argv = [text.format(dir=tmp_path) for text in argv]
    argv = ["select", *TWO_LINKS, *argv, "--out", str(out), "--quiet"]
    assert main(argv) == 1
    last = capsys.readouterr().out.strip().splitlines()[-1]
    joints = rigid_tasks(scene())[0].arm.joints
    assert names(last, "no set of drives", *message)
    assert any(f"{name}: " in last for name in joints)
    assert not out.exists()


def test_an_arm_gets_feedback_of_the_links_if_motors_do_not_suffice(tmp_path, capsys):
    """Unless the controller is stated; the winner meets the limit on its own."""
    limit = ["--limit", "tool_path_rms_mm=0.6"]
    table = tmp_path / "drives.csv"
    table.write_text("drive\nCSG-20-100\nCSG-25-100\n")
    few = ["--table", str(table), "--without-catalogue", *limit]
    out = tmp_path / "out"
    status, found = run(capsys, *TWO_LINKS, *few, "--out", str(out))
    assert status == 0 and found["feedback"] == "link"
    assert "the nearest set has tool_path_rms_mm" in found["motor_feedback_failure"]
    alone = run_scene(Scene.load_file(out / "scene.toml"))
    assert alone.assembly.scene.controller.feedback == "link"
    assert alone.metrics()["tool"]["path_rms_mm"] < 0.6
    # a stated controller stays as it is, and so does one that meets the limit
    stated = ["--set", "controller.feedback=motor"]
    status, found = run(capsys, *TWO_LINKS, *few, *stated)
    assert status == 1 and found["feedback"] == "motor"
    assert found["motor_feedback_failure"] is None
    few[-1] = "tool_path_rms_mm=20"
    status, found = run(capsys, *TWO_LINKS, *few)
    assert status == 0 and found["feedback"] == "motor"
    assert found["motor_feedback_failure"] is None
    # a limit of a joint is not one that feedback helps to meet
    few[-1] = "torsion_arcmin=0.001"
    status, found = run(capsys, *TWO_LINKS, *few)
    assert status == 1 and found["feedback"] == "motor"


@pytest.mark.filterwarnings("default:.*are not selected")
def test_a_table_adds_drives_and_another_cost(tmp_path, capsys):
    """A map beside the table; drives of the catalogue without a price do not count."""
    DriveMap.from_numbers(stiffness=2e4, rated_torque=60.0).save(tmp_path / "own.swg")
    table = tmp_path / "drives.csv"
    table.write_text(
        "drive;price_eur;max_input_speed_rpm\nown.swg;90.5;6000\n"
        "CSG-17-100;100;\nCSG-25-100;80;1e-3\n"
    )
    argv = ["two-link", "--payload", "1", "--table", str(table), "--by", "price_eur"]
    assert main(["select", *argv, "--json", "--quiet"]) == 0
    shown = capsys.readouterr()
    found = json.loads(shown.out)
    assert names(shown.err, "20 drives", "price_eur", "CSG-14-50")
    assert found["by"] == "price_eur"
    assert {*found["drives"].values()} == {str(tmp_path / "own.swg")}
    assert found["cost"] == 181.0
    rows = next(iter(found["joints"].values()))
    assert [one["mass_kg"] for one in rows] == [0.68, 1.5, None]
    assert "max_input_speed_rpm" in rows[1]["dropped"]
    status, found = run(capsys, *argv[:-2], "--without-catalogue")
    assert status == 0 and {*found["drives"].values()} == {"CSG-17-100"}
    # a map has no rated life, unless the table states it
    status, found = run(capsys, *argv, "--limit", "L10_h=10")
    assert status == 0 and {*found["drives"].values()} == {"CSG-17-100"}
    lines = table.read_text().replace("\n", ";\n").splitlines()
    table.write_text("\n".join([f"{lines[0]}L50_h", f"{lines[1]}35000", *lines[2:]]))
    argv += ["--limit", "L10_h=10", "--out", str(tmp_path / "out")]
    status, found = run(capsys, *argv)
    assert status == 0 and found["cost"] == 181.0
    written = Scene.load_file(tmp_path / "out/scene.toml")
    assert written.joint_settings("elbow").life.L50_h == 35000.0
    assert "own.swg" in written.joint_settings("elbow").drive


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["nowhere.xml"], ("nowhere.xml",)),
        (["ur5e", "--payload", "-1"], ("--payload", "-1")),
        (["ur5e", "--payload", "nan"], ("--payload", "nan")),
        (["ur5e", "--by", "mas_kg"], ("--by mas_kg", "mass_kg")),
        (["ur5e", "--table", "nowhere.csv"], ("nowhere.csv",)),
        (["ur5e", "--table", "{dir}/text.csv"], ("text.csv", "drive")),
        (["ur5e", "--table", "{dir}/mass.csv"], ("CSG-14-100", "mass_kg", "positive")),
        (["ur5e", "--table", "{dir}/name.csv"], ("CSG-99-1",)),
        (["ur5e", "--without-catalogue"], ("--by mass_kg",)),
        (["ur5e", "--limit", "tool_path_rms=1"], ("tool_path_rms_mm",)),
        (["ur5e", "--limit", "wall_s=1"], ("wall_s",)),
        (["ur5e", "--task", "ur5e"], ("--task", "scene")),
        (["ur5e-sweep", "--task", "ur5e-circle"], ("--task", "ur5e-sweep")),
        (["ur5e", "--task", "ur5e-sweep", "--pose", "home"], ("--pose",)),
        (["two-link", "--task", "ur5e-sweep"], ("joint",)),
        (["ur5e", "--limit", "tool_rp_mm=1"], ("tool_rp_mm", "repeated")),
    ],
)
def test_bad_input_is_one_line(argv, message, capsys, tmp_path):
    """Status 2, one line, nothing written."""
    (tmp_path / "text.csv").write_text("name,mass_kg\na,1\n")
    (tmp_path / "mass.csv").write_text("drive,mass_kg\nCSG-14-100,-1\n")
    (tmp_path / "name.csv").write_text("drive,mass_kg\nCSG-99-1,1\n")
    argv = [text.format(dir=tmp_path) for text in argv]
    out = tmp_path / "out"
    assert main(["select", *argv, "--out", str(out), "--quiet"]) == 2
    shown = capsys.readouterr()
    assert names(shown.err.strip().splitlines()[0], *message) and shown.out == ""
    assert not out.exists()


def test_options_have_different_names():
    with pytest.raises(InputError, match=naming("CSG-14-100", "once")):
        select_drives(scene(), [*small(), small()[0]])


# ---- whole arms


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arm", "payload", "feedback", "limit"),
    [
        ("ur5e", 5, "", 0.3),  # as a user types it: motors first, then links
        ("ur5e", 5, "motor", 2.0),
        ("kuka_iiwa/iiwa.xml", 3, "", 0.3),
        ("universal_robots_ur10/ur10_robot.urdf", 3, "", 0.3),
    ],
)
def test_drives_of_whole_arms_meet_the_spec(
    arm, payload, feedback, limit, tmp_path, capsys
):
    """Bundled, MJCF and URDF: the winner meets the spec on its own."""
    out = tmp_path / "out"
    path = str(ROBOTS / arm) if "/" in arm else arm
    argv = [path, "--payload", str(payload)]
    argv += ["--set", f"controller.feedback={feedback}"] if feedback else []
    limits = {"tool_path_rms_mm": limit, "L10_h": 1e4}
    for key, value in limits.items():
        argv += ["--limit", f"{key}={value}"]
    status, found = run(capsys, *argv, "--out", str(out))
    assert status == 0 and found["careful"]
    alone = run_scene(Scene.load_file(out / "scene.toml")).metrics()
    assert alone["verdict"] == "VALID" and alone["tool"]["path_rms_mm"] <= limit
    for name, joint in alone["joints"].items():
        assert joint["drive"] == found["drives"][name] and joint["ratings"]["within"]
        life = joint["life"]["bearing"]
        assert life["unlimited"] or life["L10_h"] >= 1e4
    # no set of the same or a lower cost that was simulated meets the spec
    cheaper = [one for one in found["simulated"] if one["cost"] < found["cost"]]
    assert not any(one["met"] for one in cheaper)
