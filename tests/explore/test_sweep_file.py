"""Sweep files: faults, plans, keys."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.explore.sweep.figures import MESHING_FIGURES
from swgjoint.explore.sweep.file import SweepFile
from swgjoint.explore.sweep.keys import kind_of, known_keys
from swgjoint.explore.sweep.points import points_of, values_of
from swgjoint.explore.sweep.validity import validity_of
from swgjoint.faults import validate
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.feasibility import design_checks
from swgjoint.models_path import bundled_names, models_path
from swgjoint.sim.scene.scene import Scene
from swgjoint.toml_file import parse_toml

HEAD = """
design = "reference-2d"
[spec]
figures = ["rated_torque_Nm"]
"""


def sweep(text: str, head: str = HEAD) -> SweepFile:
    return validate(SweepFile, parse_toml(head + text, where="x"), where="x")


def parameter(keys: str, rest: str) -> str:
    return f"[[plan.parameters]]\nkeys = [{keys}]\n{rest}\n"


GRID = '[plan]\nkind = "grid"\n'
LIST = '[plan]\nkind = "list"\n'
RIM = '"flexspline.rim_mm"'
MODULE = '"drive.module_mm"'
KINDS = ("number", "text", "true", "false", "list", "table")


def test_a_grid_has_every_value_with_every_other():
    """The last parameter changes first; ends of a range are hit to the last digit."""
    file = sweep(
        GRID
        + parameter(RIM, "values = [1.0, 1.2]")
        + parameter('"drive.face_width_mm"', "low = 0.1\nhigh = 0.7\ncount = 3")
    )
    found = [tuple(values.values()) for values in values_of(file)]
    assert found == [
        (1.0, 0.1),
        (1.0, pytest.approx(0.4, abs=1e-15)),
        (1.0, 0.7),
        (1.2, 0.1),
        (1.2, pytest.approx(0.4, abs=1e-15)),
        (1.2, 0.7),
    ]


def test_a_latin_hypercube_has_one_design_in_every_part():
    """Of n equal parts of each range every one holds one value, for every parameter."""
    text = '[plan]\nkind = "latin_hypercube"\ndesigns = 20\nseed = {}\n'
    text += parameter(RIM, "low = 1\nhigh = 2")
    text += parameter(MODULE, "low = -3.0\nhigh = 7.0")
    values = np.array([list(v.values()) for v in values_of(sweep(text.format(4)))])
    parts = np.floor((values - [1.0, -3.0]) / [1.0, 10.0] * 20).astype(int)
    for column in parts.T:
        assert sorted(column) == list(range(20))
    again = np.array([list(v.values()) for v in values_of(sweep(text.format(4)))])
    other = np.array([list(v.values()) for v in values_of(sweep(text.format(5)))])
    assert np.array_equal(values, again)
    assert not np.isclose(values, other).any()


def test_a_latin_hypercube_takes_names_in_equal_shares():
    """A list of values is strewn like a range."""
    file = sweep(
        '[plan]\nkind = "latin_hypercube"\ndesigns = 9\n'
        + parameter('"wave_generator.kind"', 'values = ["a", "b", "c"]')
    )
    found = [value for values in values_of(file) for value in values.values()]
    assert sorted(found) == ["a"] * 3 + ["b"] * 3 + ["c"] * 3


def test_a_latin_hypercube_takes_whole_numbers_in_equal_shares():
    """The ends of a range of teeth or seeds are as likely as those between."""
    file = sweep(
        '[plan]\nkind = "latin_hypercube"\ndesigns = 999\n'
        + parameter('"tolerances.seed"', "low = 1\nhigh = 3")
    )
    found = [value for values in values_of(file) for value in values.values()]
    assert sorted(found) == [1] * 333 + [2] * 333 + [3] * 333


def test_whole_numbers_stay_whole():
    """A range over teeth or seeds is rounded, one over lengths is not."""
    file = sweep(
        GRID
        + parameter('"tolerances.seed"', "low = 1\nhigh = 4\ncount = 4")
        + parameter(RIM, "low = 1\nhigh = 2\ncount = 2")
    )
    first, *_, last = values_of(file)
    assert first == {"tolerances.seed": 1, "flexspline.rim_mm": 1.0}
    assert [type(v) for v in last.values()] == [int, float]


def test_keys_that_belong_together_take_the_same_value():
    """Several keys of a parameter all change, its column is the first."""
    both = '"flexspline.pressure_angle_deg", "circular_spline.pressure_angle_deg"'
    (point,) = points_of(sweep(LIST + parameter(both, "values = [21.5]")))
    assert point.values == {"flexspline.pressure_angle_deg": 21.5}
    design = point.asked.design
    assert design.flexspline.pressure_angle_deg == 21.5
    assert design.circular_spline.pressure_angle_deg == 21.5


def test_the_base_design_is_a_parameter_too():
    """Other parameters are changes of whichever design a point is based on."""
    file = sweep(
        GRID
        + parameter('"design"', 'values = ["reference-2d", "reference-2d-dca"]')
        + parameter(RIM, "values = [1.1]")
    )
    designs = [point.asked.design for point in points_of(file)]
    assert [design.flexspline.profile.kind for design in designs] == ["qca", "dca"]
    assert {design.flexspline.rim_mm for design in designs} == {1.1}


def test_the_key_of_a_result_is_what_decides_it():
    """Names do not count, values, figures and settings do."""

    def key(text, head=HEAD):
        (point,) = points_of(sweep(LIST + text, head))
        return point.asked.key

    rim = parameter(RIM, "values = [1.0]")
    assert key(rim) == key(parameter(RIM, "values = [1]"))
    assert key(rim) == key(parameter('"drive.name"', 'values = ["other"]'))
    assert key(rim) != key(parameter(RIM, "values = [1.000001]"))
    assert key(rim) != key(rim, HEAD.replace("rated_torque_Nm", "T1_Nm"))
    assert key(rim) != key(rim, HEAD + 'model = "2d"\n')


def test_an_arm_that_was_changed_has_another_key(tmp_path):
    """Two sweeps of one process read the file of the arm, each for itself."""
    arm = tmp_path / "arm.xml"
    arm.write_text((models_path() / "arms" / "bench.xml").read_text())
    file = sweep(
        LIST + parameter('"arm"', f'values = ["{arm.as_posix()}"]'),
        'scene = "bench"\n[run]\nfigures = ["ripple_rms_percent"]\n',
    )
    (before,), (same,) = points_of(file), points_of(file)
    arm.write_text(arm.read_text() + "\n")
    (after,) = points_of(file)
    assert before.fault == ""
    assert before.key == same.key != after.key


def test_files_among_the_values_lie_relative_to_the_sweep(tmp_path):
    """As the bases do; names of bundled ones and of the catalogue stay names."""
    for name in ("own.toml", "own.xml", "bench", "qca"):
        (tmp_path / name).write_text("")
    (tmp_path / "some.toml").write_text(
        'design = "own.toml"\nscene = "bench"\n[run]\nfigures = ["tool_ap_mm"]\n'
        + LIST
        + parameter('"design"', 'values = ["own.toml", "reference-2d"]')
        + parameter('"defaults.drive"', 'values = ["own.toml", "CSG-25-100"]')
        + parameter('"joints.joint.drive"', 'values = ["own.toml", "none.swg"]')
        + parameter('"arm"', f'values = ["own.xml", "{"x" * 300}"]')
        + parameter('"trajectory.file"', 'values = ["own.xml", 3]')
        + parameter('"flexspline.profile.kind"', 'values = ["qca", "dca"]')
    )
    file = SweepFile.load(tmp_path / "some.toml")
    toml, xml = str(tmp_path / "own.toml"), str(tmp_path / "own.xml")
    assert (file.design, file.scene) == (toml, str(tmp_path / "bench"))
    assert [parameter.values for parameter in file.plan.parameters] == [
        (toml, "reference-2d"),
        (toml, "CSG-25-100"),
        (toml, "none.swg"),
        (xml, "x" * 300),
        (xml, 3),
        ("qca", "dca"),
    ]


def test_a_planned_design_weighs_little():
    """A sweep of a million fits: no design is held before it is handed out."""
    file = sweep(
        GRID
        + parameter(RIM, "low = 1\nhigh = 1.2\ncount = 10")
        + parameter(MODULE, "low = 1\nhigh = 1.2\ncount = 10")
    )
    points_of(file)  # what is read once
    tracemalloc.start()
    try:
        points = points_of(file)
        held, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert points[7].asked.design.drive.module_mm != 1.0
    assert held / len(points) < 1500  # bytes; measured: 500, a design takes 31 000


def test_every_task_has_a_label_of_validity():
    """Level, torque, what is not modelled, as the task asks for it."""
    text = LIST + parameter(RIM, "values = [1]")
    head = """
    design = "reference-2d"
    scene = "bench"
    [meshing]
    figures = ["von_mises_MPa"]
    model = "2d"
    torque_Nm = 12.5
    [spec]
    figures = ["K1_Nm_rad"]
    [run]
    figures = ["ripple_rms_percent"]
    model = "ring"
    """
    found = validity_of(sweep(text, head))
    assert list(found) == ["meshing", "spec", "run"]
    assert (found["meshing"]["level"], found["meshing"]["torque"]) == ("2d", "12.5 N·m")
    assert "bearing" in found["meshing"]["not_modelled"]["2d"]
    assert list(found["spec"]["not_modelled"]) == ["2d", "3d"]
    assert list(found["run"]["not_modelled"]) == ["ring", "joint"]
    assert validity_of(sweep(text))["spec"]["level"] == "ratings alone"
    scene = LIST + parameter('"simulation.step_s"', "values = [0.001]")
    head = 'scene = "bench"\n[run]\nfigures = ["ripple_rms_percent"]\n'
    found = validity_of(sweep(scene, head))
    assert found["run"]["level"] == "drives of the scene"


def test_scene_keys_change_the_scene():
    """A scene alone keeps its drives; its keys are found beside those of designs."""
    file = sweep(
        GRID
        + parameter('"simulation.step_s"', "values = [0.001, 0.0005]")
        + parameter('"defaults.drive"', 'values = ["CSG-25-100"]'),
        'scene = "bench"\n[run]\nfigures = ["ripple_rms_percent"]\n',
    )
    points = points_of(file)
    assert [p.asked.scene.simulation.step_s for p in points] == [0.001, 0.0005]
    assert {p.asked.scene.joint_settings("joint").drive for p in points} == {
        "CSG-25-100"
    }
    assert {p.asked.design for p in points} == {None}
    assert len({p.asked.key for p in points}) == 2


def test_no_key_is_both_of_a_design_and_of_a_scene():
    """A dotted path tells which of the two it changes."""
    assert set(Design.model_fields) & set(Scene.model_fields) == set()
    assert not set(known_keys("design")) & set(known_keys("scene"))


@pytest.mark.parametrize(
    "key",
    [
        "flexspline.profile.tip_radius_mm",
        "wave_generator.aperture_deg",
        "wave_generator.bearing.clearance_um",
        "tolerances.random_pitch_um",
        "cup.length_mm",
        "design",
    ],
)
def test_keys_of_every_kind_of_table_are_known(key):
    """Whatever kind of profile or wave generator has a key, a sweep may change it."""
    assert kind_of(key, ("design",)) == "design"


@pytest.mark.parametrize(
    ("key", "near"),
    [
        (
            "wave_generator.minor_axis_coeficient",
            "wave_generator.minor_axis_coefficient",
        ),
        ("tolerances.random_pitch", "tolerances.random_pitch_um"),
        ("minor_axis_coefficient", "wave_generator.minor_axis_coefficient"),
        ("flexspline.rim", "flexspline.rim_mm"),
    ],
)
def test_an_unknown_key_is_one_line_with_near_ones(key, near):
    """A slip of the pen is told before anything is computed."""
    with pytest.raises(InputError) as caught:
        sweep(GRID + parameter(f'"{key}"', "values = [1]"))
    assert names(str(caught.value), "plan.parameters[0].keys[0]", f"{key!r}", near)
    assert "\n" not in str(caught.value)


def test_all_faults_are_listed_at_once():
    """One line a fault, with the path and the value with its unit."""
    with pytest.raises(InputError) as caught:
        sweep(
            GRID
            + parameter(RIM, "low = 1.5\nhigh = 1.2\ncount = 3")
            + parameter(MODULE, "values = [1.0]\nlow = 1.0"),
            HEAD.replace("rated_torque_Nm", "rated_torqe_Nm"),
        )
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert names(lines[0], "spec.figures[0]", "'rated_torqe_Nm'", "T1_Nm", "T2_Nm")
    assert lines[0].count("rated_torque_Nm") == 2  # the nearest, and among all
    assert names(lines[1], "plan.parameters[0].high", "1.2 mm", "1.5 mm")
    assert names(lines[2], "plan.parameters[1].values", "low", "high")


@pytest.mark.parametrize("figure", MESHING_FIGURES)
def test_a_range_needs_two_positions(figure):
    """One position has no peak to peak: it was zero, which met any limit."""
    head = f'design = "reference-2d"\n[meshing]\nfigures = ["{figure}"]\npositions = '
    plan = GRID + parameter(RIM, "values = [1.0]")
    assert sweep(plan, f"{head}2\n").meshing.positions == 2
    if "_pp_" not in figure:
        assert sweep(plan, f"{head}1\n").meshing.positions == 1
        return
    with pytest.raises(InputError, match=naming("meshing.positions", figure, "2")):
        sweep(plan, f"{head}1\n")


@pytest.mark.parametrize(
    ("text", "head", "told"),
    [
        (
            LIST + parameter(RIM, "values=[1, 1979-05-27]"),
            HEAD,
            ("plan.parameters[0].values[1]", "1979-05-27", *KINDS),
        ),
        (
            LIST + parameter(RIM, "values=[[07:32:00]]"),
            HEAD,
            ("plan.parameters[0].values[0]", "time(7, 32)", *KINDS),
        ),
        (GRID + "parameters = []", HEAD, ("plan.parameters", "one")),
        (
            LIST + parameter(RIM, "low = 1\nhigh = 2"),
            HEAD,
            ("plan.parameters[0].values", "list"),
        ),
        (
            GRID + parameter(RIM, "low = 1\nhigh = 2"),
            HEAD,
            ("plan.parameters[0].count", "integer", ">= 2"),
        ),
        (
            GRID + parameter('"tolerances.seed"', "low = 1.4\nhigh = 3\ncount = 2"),
            HEAD,
            ("plan.parameters[0].low", "1.4", "integer"),
        ),
        (
            GRID + parameter('"tolerances.seed"', "low = 1\nhigh = 3.6\ncount = 2"),
            HEAD,
            ("plan.parameters[0].high", "3.6", "integer"),
        ),
        (
            GRID + parameter(RIM, "low = -1e308\nhigh = 1e308\ncount = 2"),
            HEAD,
            ("plan.parameters[0].high", "1e+308 mm", "finite length"),
        ),
        (
            LIST + parameter(RIM, "values=[1]") + parameter(MODULE, "values=[1, 2]"),
            HEAD,
            ("plan.parameters", "1, 2 values"),
        ),
        (
            GRID + parameter(RIM, "values=[1]") + parameter(RIM, "values=[2]"),
            HEAD,
            ("plan.parameters[1].keys[0]", "'flexspline.rim_mm'"),
        ),
        (
            GRID + parameter(RIM, "values=[1]"),
            'design = "reference-2d"\n',
            ("meshing", "spec", "size", "run"),
        ),
        (
            GRID + parameter(RIM, "values=[1]"),
            HEAD[HEAD.index("[") :],
            ("design", "scene"),
        ),
        (
            GRID + parameter(RIM, "values=[1]"),
            'scene = "bench"\n' + HEAD,
            ("run", "scene"),
        ),
        (
            GRID
            + parameter(RIM, "low=0.9\nhigh=1.0\ncount=1001")
            + parameter(MODULE, "low=0.9\nhigh=1.0\ncount=1000"),
            HEAD,
            ("plan", "1001000 designs", "1000000"),
        ),
    ],
)
def test_plans_that_do_not_fit_are_refused(text, head, told):
    """Missing counts, uneven lists, doubled keys, too many designs."""
    with pytest.raises(InputError, match=naming(*told)):
        sweep(text, head)


def test_a_value_that_no_design_takes_is_a_row():
    """A fault of one point says what is accepted and leaves the others alone."""
    file = sweep(GRID + parameter('"flexspline.pressure_angle_deg"', "values=[20, 90]"))
    good, bad = points_of(file)
    assert good.fault == ""
    assert bad.asked is None
    parts = ("flexspline.pressure_angle_deg", "90 deg", "> 0 deg", "< 60 deg")
    assert names(bad.fault, *parts) and "\n" not in bad.fault


@pytest.mark.parametrize("name", bundled_names("sweeps", ".toml"))
def test_bundled_sweeps_have_feasible_designs(name):
    """At least eight points that can be built, each of its own key."""
    points = points_of(SweepFile.load(name))
    assert all(point.fault == "" for point in points)
    assert len({point.asked.key for point in points}) == len(points) >= 8
    for point in points:
        if point.asked.design is not None:
            assert all(check.ok for check in design_checks(point.asked.design))


@pytest.mark.parametrize("low", ["nan", "true", '"1"'])
def test_a_wrong_end_of_a_range_is_one_fault(low):
    """One line with the key as written in the file, and no type behind the key."""
    text = GRID + parameter(RIM, f"low = {low}\nhigh = 2\ncount = 2")
    with pytest.raises(InputError, match=naming("low = ", "number")) as caught:
        sweep(text)
    (line,) = str(caught.value).splitlines()
    assert not names(line, "float")
