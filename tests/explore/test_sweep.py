"""Sweeps: what is kept, reused, retried and told."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass, replace
from typing import Any

import pytest
from messages import names, naming
from validation_record import validated_map

from swgjoint import engine
from swgjoint.csv_text import csv_text
from swgjoint.errors import ComputationError, InputError, MissingExtraError
from swgjoint.explore.sweep import figures as sweep_figures
from swgjoint.explore.sweep import sweep as sweep_module
from swgjoint.explore.sweep.figures import Record, compute
from swgjoint.explore.sweep.file import SweepFile
from swgjoint.explore.sweep.points import _engine_version, points_of
from swgjoint.explore.sweep.results import parquet_bytes, place_of
from swgjoint.explore.sweep.sweep import run_sweep
from swgjoint.explore.sweep.tasks import RunTask, SpecTask
from swgjoint.faults import validate
from swgjoint.gear.design.design import Design
from swgjoint.pool import LocalPool, Lost
from swgjoint.sim.scene.scene import Scene
from swgjoint.store import json_content, json_file
from swgjoint.toml_file import parse_toml
from swgjoint.view.plots.sweep import label_of, sweep_picture

ERROR, ERROR_RIPPLE = "transmission_error_arcmin", "transmission_error_ripple_arcmin"
TORSION = "torsion_arcmin"

SHEET = """
design = "reference-2d"
[spec]
figures = ["rated_torque_Nm", "T1_Nm"]
[plan]
kind = "grid"
[[plan.parameters]]
keys = ["ratings.rated_torque_Nm"]
values = {}
"""
"""Figures that need no finite elements."""


def sheet(values) -> SweepFile:
    text = SHEET.format(list(values))
    return validate(SweepFile, parse_toml(text, where="x"), where="x")


@dataclass
class Counted:
    """This process, with what it was asked to compute."""

    workers: int = 1
    tasks: list = None

    def run(self, function, tasks):
        """See :class:`swgjoint.pool.Executor`."""
        for task in tasks:
            self.tasks.append(task)
            yield task, function(task)

    @property
    def designs(self):
        """Everything in the tasks."""
        return [point for task in self.tasks for point in task]


@pytest.fixture
def counted():
    return Counted(tasks=[])


def test_one_row_a_design_in_the_order_of_the_plan(counted):
    """The figures are those of the designs; counts add up."""
    found = run_sweep(sheet([10.0, 30.0, 20.0]), executor=counted)
    result = found.to_json()
    assert [row["rated_torque_Nm"] for row in result["rows"]] == [10.0, 30.0, 20.0]
    assert result["rows"][1] == {
        "ratings.rated_torque_Nm": 30.0,
        "outcome": "ok",
        "rated_torque_Nm": 30.0,
        "T1_Nm": pytest.approx(found.records[1].figures["T1_Nm"]),
        "reason": "",
        "work_s": found.records[1].work_s,
    }
    counts = {k: result[k] for k in ("designs", "done", "failed", "reused", "computed")}
    assert counts == {
        "designs": 3,
        "done": 3,
        "failed": 0,
        "reused": 0,
        "computed": 3,
    }
    assert 0.0 < result["work_s"] < result["wall_s"]
    assert result["efficiency"] == pytest.approx(result["work_s"] / result["wall_s"])


def test_a_bad_design_is_reported_and_the_rest_finishes(counted):
    """No drive, a drive that cannot be built: rows with outcome and reason."""
    file = sheet([10.0, -1.0])
    file = file.model_copy(
        update={
            "plan": file.plan.model_copy(
                update={
                    "parameters": (
                        *file.plan.parameters,
                        file.plan.parameters[0].model_copy(
                            update={
                                "keys": ("flexspline.pressure_angle_deg",),
                                "values": (20.0, 59.0),
                            }
                        ),
                    )
                }
            )
        }
    )
    result = run_sweep(file, executor=counted).to_json()
    outcomes = [row["outcome"] for row in result["rows"]]
    assert outcomes == ["ok", "infeasible", "refused", "refused"]
    assert (result["done"], result["failed"]) == (1, 3)
    reasons = [row["reason"] for row in result["rows"]]
    assert reasons[0] == ""
    tip = ("flexspline.profile.addendum_radius_mm", "1.0 mm", "pressure_angle_deg")
    assert names(reasons[1], *tip, "27.68 deg")
    assert names(reasons[2], "ratings.rated_torque_Nm", "-1 N·m", "> 0 N·m")
    assert result["rows"][1]["rated_torque_Nm"] is None


def test_what_is_kept_is_not_computed_again(tmp_path, counted):
    """A longer sweep, in another order, computes what is new and nothing else."""
    place = place_of(tmp_path / "kept")
    first = run_sweep(sheet([10.0, 20.0]), executor=counted, place=place)
    counted.tasks.clear()
    found = run_sweep(sheet([30.0, 20.0, 10.0]), executor=counted, place=place)
    assert [one.asked.design.ratings.rated_torque_Nm for one in counted.designs] == [
        30.0
    ]
    assert (found.reused, found.computed) == (2, 1)
    assert found.records[1:] == (first.records[1], first.records[0])
    again = run_sweep(sheet([30.0, 20.0, 10.0]), executor=counted, place=place)
    assert (again.reused, again.computed, again.efficiency) == (3, 0, None)
    assert again.rows() == found.rows()


def test_failures_are_kept_and_retried_only_when_asked(tmp_path, counted, monkeypatch):
    """A design that failed is reused as a failure; retrying computes it alone."""
    place = place_of(tmp_path)
    file = sheet([10.0, 20.0])

    def fails(asked):
        if asked.design.ratings.rated_torque_Nm == 20.0:
            raise RuntimeError("bang")
        return {"rated_torque_Nm": 1.0, "T1_Nm": 2.0}, ""

    with monkeypatch.context() as patch:
        patch.setattr("swgjoint.explore.sweep.figures._figures", fails)
        found = run_sweep(file, executor=counted, place=place)
    assert found.records[1].outcome == "error"
    assert found.records[1].reason == "RuntimeError: bang"
    again = run_sweep(file, executor=counted, place=place)
    assert (again.reused, again.computed) == (2, 0)
    assert not again.records[1].ok
    retried = run_sweep(file, executor=counted, place=place, retry_failed=True)
    assert (retried.reused, retried.computed) == (1, 1)
    assert retried.records[1].figures["rated_torque_Nm"] == 20.0
    assert retried.records[0].figures["rated_torque_Nm"] == 1.0  # as it was kept


@pytest.mark.parametrize(
    "fault", [MemoryError("no room"), OSError("disk full"), MissingExtraError("no x")]
)
def test_what_the_machine_lacked_is_not_kept(tmp_path, counted, monkeypatch, fault):
    """Memory, disk and packages are no property of a design: it is tried again."""
    place = place_of(tmp_path)
    file = sheet([10.0])

    def fails(asked):
        raise fault

    with monkeypatch.context() as patch:
        patch.setattr("swgjoint.explore.sweep.figures._figures", fails)
        (record,) = run_sweep(file, executor=counted, place=place).records
    assert record.outcome == "lost"
    assert record.reason == f"{type(fault).__name__}: {fault}"
    again = run_sweep(file, executor=counted, place=place)
    assert (again.reused, again.computed, again.records[0].ok) == (0, 1, True)


def test_a_lost_design_is_not_kept(tmp_path, counted):
    """The walltime of a job or another machine's kill is forgotten."""
    place = place_of(tmp_path)

    class Dead(Counted):
        def run(self, function, tasks):
            for task in tasks:
                yield task, Lost("killed")

    (record,) = run_sweep(sheet([10.0]), executor=Dead(), place=place).records
    assert record == Record(outcome="lost", reason="killed")
    again = run_sweep(sheet([10.0]), executor=counted, place=place)
    assert (again.reused, again.computed, again.records[0].ok) == (0, 1, True)


def test_equal_designs_are_computed_once(counted):
    """Two points that make the same design share a record."""
    found = run_sweep(sheet([10.0, 10, 20.0]), executor=counted)
    assert len(counted.designs) == 2
    assert found.records[0] is found.records[1]
    assert found.to_json()["done"] == 3


def test_a_damaged_result_is_computed_again(tmp_path, counted):
    """Half a file, one of another make, or one with another digit is no result."""
    place = place_of(tmp_path)
    first = run_sweep(sheet([10.0, 20.0, 30.0]), executor=counted, place=place)
    files = sorted(tmp_path.glob("results/*/*.json"))
    assert len(files) == 3
    files[0].write_bytes(files[0].read_bytes()[:-20])
    files[1].write_text('{"outcome": "ok"}')
    whole = files[2].read_text()
    digit = re.search(r'"T1_Nm": (\d)', whole)
    other = str(9 - int(digit[1]))
    files[2].write_text(whole[: digit.start(1)] + other + whole[digit.end(1) :])
    found = run_sweep(sheet([10.0, 20.0, 30.0]), executor=counted, place=place)
    assert (found.reused, found.computed) == (0, 3)
    assert [r.figures for r in found.records] == [r.figures for r in first.records]


@pytest.mark.parametrize(
    "change",
    [
        {"figures": None},
        {"figures": {"T1_Nm": "3"}},
        {"work_s": "1"},
        {"reason": 3},
        {"outcome": None},
    ],
)
def test_a_kept_result_of_other_types_is_computed_again(tmp_path, counted, change):
    """Whatever somebody has written there, it is no result."""
    place = place_of(tmp_path)
    first = run_sweep(sheet([10.0]), executor=counted, place=place)
    (path,) = tmp_path.glob("results/*/*.json")
    content = json_content(path.read_bytes(), dict[str, Any])
    path.write_bytes(json_file(content | change))
    found = run_sweep(sheet([10.0]), executor=counted, place=place)
    assert (found.reused, found.computed) == (0, 1)
    assert found.records[0].figures == first.records[0].figures


def test_another_plugin_is_other_code(tmp_path, monkeypatch):
    """Figures of a run are not those of another library, with or without sources."""
    library, found = tmp_path / "plugin.so", set()
    monkeypatch.setattr(engine, "library", lambda: library)
    try:
        for content in (b"one", b"two"):
            library.write_bytes(content)
            _engine_version.cache_clear()
            found.add(_engine_version())
    finally:
        _engine_version.cache_clear()
    assert len(found) == 2


def test_results_lie_wherever_fsspec_reaches(counted):
    """The same through an address as in a folder."""
    pytest.importorskip("fsspec", reason="needs swgjoint[cluster]")
    place = place_of("memory://sweeps/one")
    found = run_sweep(sheet([10.0, 20.0]), executor=counted, place=place)
    again = run_sweep(sheet([10.0, 20.0]), executor=counted, place=place)
    assert (again.reused, again.computed) == (2, 0)
    assert again.records == found.records
    assert place.write("a.csv", b"x") == "memory://sweeps/one/a.csv"
    assert place.read("a.csv") == b"x"
    assert place.path_of("a.csv") == "memory://sweeps/one/a.csv"
    place.remove("a.csv")
    assert place.read("a.csv") is None
    assert place.read("b.csv") is None


def test_cheap_designs_are_put_together(monkeypatch):
    """A task holds seconds of work; the last ones are short, for an even end."""
    monkeypatch.setattr(
        sweep_module,
        "compute_all",
        lambda task: (
            sweep_module.code_version(),
            [Record(outcome="ok", work_s=0.2) for _ in task],
        ),
    )
    counted = Counted(workers=2, tasks=[])
    run_sweep(sheet([1.0 + k for k in range(300)]), executor=counted)
    sizes = [len(task) for task in counted.tasks]
    assert sum(sizes) == 300
    assert sizes[0] == 1
    assert max(sizes) == 10  # 2 s of 0.2 s each
    assert sizes[-1] == 1
    assert sizes[1:] == sorted(sizes[1:], reverse=True)
    assert len(counted.designs) == len({point.key for point in counted.designs})


def test_a_lost_task_is_tried_design_by_design(monkeypatch):
    """A dead process costs the design that killed it, not those in the same task."""
    file = sheet([1.0 + k for k in range(40)])
    deadly = points_of(file)[30].key

    class Deadly(Counted):
        def run(self, function, tasks):
            for task in tasks:
                self.tasks.append(task)
                if any(point.key == deadly for point in task):
                    yield task, Lost("killed")
                else:
                    yield task, function(task)

    executor = Deadly(tasks=[])
    found = run_sweep(file, executor=executor)
    assert any(len(t) > 1 for t in executor.tasks if deadly in [a.key for a in t])
    lost = [k for k, record in enumerate(found.records) if record.outcome == "lost"]
    assert lost == [30]
    assert found.to_json()["done"] == 39


def test_a_worker_with_other_code_ends_the_sweep(monkeypatch):
    """Its figures would be kept under the name of this code."""
    monkeypatch.setattr(sweep_module, "compute_all", lambda task: ("other", []))
    with pytest.raises(ComputationError, match=naming("worker", "version", "swgjoint")):
        run_sweep(sheet([1.0]), executor=Counted(tasks=[]))


def test_meshing_figures_are_those_of_the_simulation():
    """Means and ranges over the positions of one pitch, under torque and unloaded."""
    from swgjoint.fe.meshing import simulate_meshing

    text = """
    design = "reference-2d"
    [meshing]
    figures = ["von_mises_MPa", "circular_spline_tensile_MPa",
               "transmission_error_pp_arcsec", "kinematic_error_pp_arcsec",
               "pairs_in_contact"]
    positions = 2
    turn_deg = 2.0
    [plan]
    kind = "list"
    [[plan.parameters]]
    keys = ["mesh.refinement"]
    values = [0.5]
    """
    file = validate(SweepFile, parse_toml(text, where="x"), where="x")
    (point,) = points_of(file)
    record = compute(point.asked)
    settings = {"torque": 20.0, "steps": 2, "turn": 2.0 / 360.0, "half": True}
    run = simulate_meshing(point.asked.design, **settings)
    loaded = run.to_json()
    settings["torque"] = 0.0
    free = simulate_meshing(point.asked.design, **settings).to_json()
    error = loaded["per_step"]["output_error_arcsec"]
    unloaded = free["per_step"]["output_error_arcsec"]
    ring = loaded["circular_spline"]["average_max_MPa"]
    assert record.outcome == "ok"
    assert list(record.figures) == list(file.figures)
    assert record.figures == {
        "von_mises_MPa": loaded["flexspline"]["average_max_MPa"]["von_mises"],
        "circular_spline_tensile_MPa": ring["tensile"],
        "transmission_error_pp_arcsec": max(error) - min(error),
        "kinematic_error_pp_arcsec": max(unloaded) - min(unloaded),
        "pairs_in_contact": sum(loaded["per_step"]["pairs_in_contact"]) / 2,
    }
    assert record.figures["transmission_error_pp_arcsec"] > 0.0


@pytest.mark.parametrize("design", ["reference-2d", "stress-cup"])
def test_stiffness_is_the_slope_of_torque_over_torsion(design):
    """By differences of the simulated output, in the plane with the cup in series."""
    from swgjoint.fe.meshing import simulate_meshing
    from swgjoint.units import arcsec

    text = f"""
design = "{design}"
[meshing]
figures = ["torsional_stiffness_Nm_rad"]
model = "2d"
torque_Nm = 20.0
positions = 1
[plan]
kind = "list"
[[plan.parameters]]
keys = ["mesh.refinement"]
values = [0.5]
"""
    file = validate(SweepFile, parse_toml(text, where="x"), where="x")
    (point,) = points_of(file)
    told = compute(point.asked).figures["torsional_stiffness_Nm_rad"]

    def output(torque):
        run = simulate_meshing(point.asked.design, torque=torque, steps=1, half=True)
        return run.to_json()["per_step"]["output_error_arcsec"][0] * arcsec

    slope = 0.2 / (output(19.9) - output(20.1))
    assert told == pytest.approx(slope, rel=1e-3)  # 1 % of torque, round-off of 1e-12


def test_no_stiffness_is_asked_for_without_torque():
    """With play the output is free then."""
    text = """
design = "reference-2d"
[meshing]
figures = ["torsional_stiffness_Nm_rad"]
torque_Nm = 0.0
[plan]
kind = "list"
[[plan.parameters]]
keys = ["mesh.refinement"]
values = [0.5]
"""
    with pytest.raises(
        InputError,
        match=naming("meshing.torque_Nm", "0 N·m", "torsional_stiffness_Nm_rad"),
    ):
        validate(SweepFile, parse_toml(text, where="x"), where="x")


def test_run_figures_are_those_of_the_scene():
    """The worst joint of a short run with a catalogue drive."""
    from swgjoint.sim.scene.scene import Scene
    from swgjoint.view.run import run_scene

    text = """
    scene = "bench"
    [run]
    figures = ["transmission_error_arcmin"]
    [plan]
    kind = "list"
    [[plan.parameters]]
    keys = ["defaults.drive"]
    values = ["CSG-25-100"]
    [[plan.parameters]]
    keys = ["simulation.duration_s"]
    values = [1.0]
    """
    file = validate(SweepFile, parse_toml(text, where="x"), where="x")
    (point,) = points_of(file)
    record = compute(point.asked)
    assert record.outcome == "ok", record.reason
    changes = {"defaults.drive": "CSG-25-100", "simulation.duration_s": 1.0}
    joint = run_scene(Scene.load_file("bench", changes)).metrics()["joints"]["joint"]
    assert record.figures == {
        "transmission_error_arcmin": joint["transmission_error_arcmin"]["pp"]
    }


def test_tables_hold_every_row(counted):
    """CSV and Parquet read back as the rows, with nothing where there is no figure."""
    file = sheet([10.0, 20, -1.0])
    rows = run_sweep(file, executor=counted).rows()
    read = list(csv.DictReader(io.StringIO(csv_text(rows))))
    assert [float(row["ratings.rated_torque_Nm"]) for row in read] == [10.0, 20.0, -1.0]
    assert [row["rated_torque_Nm"] for row in read] == ["10.0", "20.0", ""]
    assert read[2]["reason"] == rows[2]["reason"]
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs pyarrow")
    table = parquet.read_table(io.BytesIO(parquet_bytes(rows))).to_pylist()
    assert table == rows


def test_labels_of_axes_carry_units():
    """The unit of the key, also where the name of a joint follows it."""
    assert label_of("flexspline.rim_mm") == "rim [mm]"
    assert label_of("trajectory.speed_deg_s.joint") == "speed [deg/s], joint"
    assert label_of("wave_generator.kind") == "kind"


def test_the_picture_shows_numbers_names_and_failures(counted):
    """A PNG for parameters of every type, also where no design has figures."""
    file = sheet([10.0, -1.0])
    found = run_sweep(file, executor=counted)
    assert sweep_picture(found).startswith(b"\x89PNG")
    named = tuple(
        replace(point, values={"ratings.rated_torque_Nm": name})
        for point, name in zip(found.points, ("a", "b"), strict=True)
    )
    assert sweep_picture(replace(found, points=named)).startswith(b"\x89PNG")
    none = replace(found, records=(found.records[1],) * 2)
    assert sweep_picture(none).startswith(b"\x89PNG")


def test_processes_give_what_this_process_gives(tmp_path):
    """Where a design is computed changes nothing but the time."""
    file = sheet([10.0, -1.0, 20.0])

    def rows(executor):
        found = run_sweep(file, executor=executor).rows()
        return [{k: v for k, v in row.items() if k != "work_s"} for row in found]

    assert rows(LocalPool(2)) == rows(LocalPool(1))


@pytest.mark.parametrize(("share", "lost"), [(0.04, None), (0.2, False), (0.6, True)])
def test_a_ripple_that_is_not_valid_is_no_figure_of_a_sweep(
    synthetic_map, tmp_path, monkeypatch, share, lost
):
    """Its reason names figure and torque; other figures of the run stay.

    An uncertain ripple stays with the same remark, also that of a spec sheet.
    """
    path = tmp_path / "a.swg"
    validated_map(synthetic_map, {20.0: (share, 0.01)}).save(path)
    short = {"simulation.duration_s": 0.5, "trajectory.settle_s": 0.2}
    load = {"load.joint": {"torque_Nm": 20.0}, "defaults.drive": str(path)}
    scene = Scene.load_file("bench", short | load)
    task = RunTask(figures=("ripple_rms_percent", "torsion_arcmin"))
    figures, reasons = sweep_figures._run(scene, None, task)
    assert (figures["ripple_rms_percent"] is None) == bool(lost)
    assert figures["torsion_arcmin"] > 0.0
    wrong = set() if lost is None else {"ripple_rms_percent"}
    assert set(reasons) == wrong
    percent = f"{100.0 * share:.0f} %"
    assert all(names(why, percent, "20 N·m") for why in reasons.values())
    drive = validated_map(synthetic_map, {20.0: (share, 0.01)})
    design = Design.load("reference-2d")
    monkeypatch.setattr(sweep_figures, "_map", lambda *_, **__: (drive, design))
    monkeypatch.setattr("swgjoint.gear.catalogue.ratings_of", lambda _: drive.ratings)
    spec = SpecTask(figures=("ripple_rms_percent", "K1_Nm_rad"))
    figures, reasons = sweep_figures._spec(design, spec)
    assert (figures["ripple_rms_percent"] is None) == bool(lost)
    assert figures["K1_Nm_rad"] > 0.0
    assert set(reasons) == wrong
    assert all(names(why, percent, "20 N·m") for why in reasons.values())


@pytest.mark.parametrize(
    ("step", "duration", "reasons"),
    [
        (0.5, 3.0, {}),
        (1.5, 3.0, dict.fromkeys(("ripple_rms_percent", ERROR_RIPPLE, ERROR), "step")),
        (0.5, 0.52, {ERROR_RIPPLE: "turn too little"}),
    ],
)
def test_a_ripple_that_a_run_does_not_resolve_is_no_figure_of_a_sweep(
    step, duration, reasons
):
    """Order 20 beyond the step, and less than two waves of it in the window.

    A sweep would find its smallest ripple where the step leaves the orders out.
    """
    numbers = "{K1_Nm_rad=3e4,rated_torque_Nm=67.0,kinematic_error_arcmin={20=0.2}}"
    changes = [f"defaults.numbers={numbers}", "trajectory.speed_deg_s.joint=12.0"]
    changes += [f"simulation.step_s={1e-3 * step}", f"simulation.duration_s={duration}"]
    scene = Scene.load_file("bench", changes)
    task = RunTask(figures=("ripple_rms_percent", ERROR_RIPPLE, ERROR, TORSION))
    figures, found = sweep_figures._run(scene, None, task)
    assert {name: figures[name] is None for name in figures} == {
        name: name in reasons for name in task.figures
    }
    assert set(found) == set(reasons)
    assert all(names(found[name], word) for name, word in reasons.items())
