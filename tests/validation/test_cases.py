"""The study file of the thesis: complete, consistent, every design a drive."""

from __future__ import annotations

from itertools import combinations

import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.feasibility import design_checks
from swgjoint.validation.thesis.cases import KINDS, StudyFile, case_of

STUDY = StudyFile.load("thesis")
CASES = [case_of(STUDY, group, entry) for group in STUDY.group for entry in group.cases]
TABLES = {"table-5.6": 4, "table-6.7": 2, "table-6.11": 2, "table-6.12": 3}
SECTIONS = (
    *("4.4", "4.6", "4.8", "4.11.2", "4.11.3"),
    *("5.2", "5.3", "5.4.1", "5.4.2", "5.4.3", "5.4.4", "5.5.1", "5.5.2"),
    *("5.7.1", "5.7.2", "5.8"),
    *("6.2", "6.3", "6.4.1", "6.4.2", "6.4.3", "6.4.4", "6.4.5", "6.4.6"),
    *("6.5.1", "6.5.2", "6.5.3"),
)


def test_every_section_and_table_is_there():
    """Each section with a parameter study chooses at least one group."""
    for section in SECTIONS:
        assert STUDY.chosen((section,)), section
    sizes = {group.id: len(group.cases) for group in STUDY.group}
    assert {name: sizes[name] for name in TABLES} == TABLES


def test_chapter_seven_has_its_printed_values():
    """Table 7.4 of the 3D study is whole, and every design of the file is a drive."""
    study = StudyFile.load("thesis-3d")
    assert study.model == "3d"
    (table,) = study.chosen(("table-7.4",))
    assert all(None not in case.printed.values() for case in table.cases)
    for group in study.group:
        for entry in group.cases:
            case = case_of(study, group, entry)
            assert case.design is not None and case.design.cup is not None
            failed = [c.name for c in design_checks(case.design) if not c.ok]
            assert not failed, (case.name, failed)


def test_tables_are_complete():
    """The four tables have all three stresses of every case and ask for convergence."""
    for name in TABLES:
        (group,) = STUDY.chosen((name,))
        assert group.converge
        assert all(None not in case.printed.values() for case in group.cases)


def test_every_design_is_a_drive():
    """No design is refused and each passes every feasibility check."""
    assert [case.name for case in CASES if case.fault] == []
    designs = {case.design.content_hash(): case for case in CASES}
    failed = {
        case.name: [check.name for check in design_checks(case.design) if not check.ok]
        for case in designs.values()
    }
    assert {name: checks for name, checks in failed.items() if checks} == {}


def test_the_parameter_makes_the_difference():
    """Inside a group no two cases are the same computation."""
    for group in STUDY.group:
        runs = [
            (c.design.content_hash(), c.torque, c.entry.state, c.entry.angle_deg)
            for c in CASES
            if c.group.id == group.id
        ]
        assert len(set(runs)) == len(runs), group.id


def test_printed_values_agree_where_the_source_repeats_them():
    """The same design under the same load has the same value, to its rounding."""
    pairs = 0
    for a, b in combinations(CASES, 2):
        load_a = (a.torque, a.entry.state, a.entry.angle_deg)
        if load_a != (b.torque, b.entry.state, b.entry.angle_deg):
            continue
        if a.design.content_hash() != b.design.content_hash():
            continue
        for kind in KINDS:
            first, second = a.entry.printed[kind], b.entry.printed[kind]
            if first is not None and second is not None:
                pairs += 1
                # section 6.2 rounds the compressive stress to 197.5 MPa
                assert first == pytest.approx(second, rel=3e-3), (a.name, b.name, kind)
    assert pairs > 30


def test_changes_reach_the_design():
    """Group changes, parameter and case changes are applied in that order."""
    (case,) = [c for c in CASES if c.name == "6.4.4 r_r = 0.5 mm"]
    for member in (case.design.flexspline, case.design.circular_spline):
        assert member.profile.root_radius_mm == 0.5
        assert member.profile.dedendum_radius_mm == 20.0
        assert member.profile.straight_mm == 0.0
    (case,) = [c for c in CASES if c.name == "5.7.2 left r_c = 8 mm"]
    assert case.design.wave_generator.left.connector_radius_mm == 8.0
    assert case.design.wave_generator.right.connector_radius_mm == 10.0
    (case,) = [c for c in CASES if c.name == "4.11.3-200Nm t_r = 0.18 mm"]
    assert case.torque == 200.0
    improved = Design.preset("reference-2d-qca-improved").content_hash()
    (case,) = [c for c in CASES if c.name == "6.4.6 c_P = 1"]
    assert case.design.content_hash() == improved


def test_parts_choose_whole_names():
    """5.4 takes 5.4.1 to 5.4.4; 4.1 is no beginning of 4.11."""
    chosen = [group.id for group in STUDY.chosen(("5.4", "table"))]
    assert chosen[0] == "5.4.1" and "5.4.4" in chosen and "5.5.1" not in chosen
    assert set(TABLES) <= set(chosen)
    with pytest.raises(
        InputError, match=naming("4.1", "9", "4.4", "4.6", "table-6.12")
    ):
        STUDY.chosen(("4.1", "9"))


def test_a_case_that_is_no_design_keeps_its_fault():
    """A refused case stays in the study with the message of the design."""
    (group,) = STUDY.chosen(("4.11.2",))
    entry = group.cases[0].model_copy(update={"value": -1.0})
    case = case_of(STUDY, group, entry)
    assert case.design is None
    assert "flexspline.rim_mm = -1 mm" in case.fault


FAULTY = """
source = "x"
torque_Nm = -2.0
positions = 3
[[group]]
id = "a"
title = "t"
source = "s"
base = "reference-2d"
keys = ["flexspline.rim_mm"]
lowest = { von_mises = 3.0 }
cases = [{ value = 2.0 }, { value = 1.0, tensile_MPa = -5.0 }, { name = "b" }]
[[group]]
id = "b"
title = "t"
source = "s"
base = "reference-2d"
cases = [{ nam = "c" }]
"""


def test_all_faults_of_a_file_at_once(tmp_path):
    """A faulty study file is refused with one line a fault: path, value, accepted."""
    path = tmp_path / "bad.toml"
    path.write_text(FAULTY)
    with pytest.raises(InputError) as refused:
        StudyFile.load(path)
    lines = str(refused.value).splitlines()
    assert any(names(line, "torque_Nm", "-2 N·m", ">= 0 N·m") for line in lines)
    assert any(
        names(line, "group[0].cases[1].tensile_MPa", "-5 MPa", "> 0 MPa")
        for line in lines
    )
    assert any(names(line, "group[1].cases[0].nam", "name", "note") for line in lines)
    path.write_text(FAULTY.replace("-2.0", "2.0").replace("-5.0", "5.0"))
    path.write_text(path.read_text().replace("nam =", "name ="))
    with pytest.raises(InputError) as refused:
        StudyFile.load(path)
    lines = str(refused.value).splitlines()
    assert any(names(line, "group[0].cases", "increasing") for line in lines)
    assert any(names(line, "group[0].lowest.von_mises", "3", "case") for line in lines)
    assert any(names(line, "group[0].cases[2].value", "keys") for line in lines)
