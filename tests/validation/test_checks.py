"""Rank orders, trends and reasons, on records made by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from swgjoint.validation.reasons import Facts, reason_for
from swgjoint.validation.thesis.cases import StudyFile, case_of
from swgjoint.validation.thesis.checks import rank_checks, trend_checks
from swgjoint.validation.thesis.record import RunRecord
from swgjoint.validation.thesis.rows import CaseRecords

STUDY = StudyFile.load("thesis")


def results(part, nominal, tenth):
    """Cases of a part whose three stresses are all the given ones [MPa]."""
    (group,) = STUDY.chosen((part,))

    def record(value):
        if value is None:
            return RunRecord(outcome="failed", message="stuck")
        stresses = dict.fromkeys(("tensile", "compressive", "von_mises"), value)
        return RunRecord(outcome="converged", average=stresses)

    return [
        CaseRecords(
            case=case_of(STUDY, group, entry),
            nominal={1: record(a)},
            tenth={1: record(b)},
        )
        for entry, a, b in zip(group.cases, nominal, tenth, strict=True)
    ]


def test_rank_order():
    """Pairs that the source prints within 5 % have no rank; others must not swap."""
    # printed: simplified 228.7, elliptical 288.1, parabolic 228.9, four roller 493.2
    tenth, nominal = rank_checks(
        results("table-5.6", [310, 296, 319, 804], [224, 288, 217, 460])
    )
    assert tenth.tenth and tenth.agrees and tenth.pairs == 5
    assert not nominal.agrees
    assert set(nominal.swapped) == {
        ("simplified", "elliptical"),
        ("parabolic", "elliptical"),
    }
    # 310 - 224 and 296 - 288
    assert "simplified above elliptical (from T/10 to T +86 and +8 MPa)" in nominal.text


def test_a_missing_case_is_no_agreement():
    """A table with a failed case cannot have the printed order."""
    tenth, _ = rank_checks(results("table-6.12", [400, 230, 236], [None, 230.0, 236.0]))
    assert not tenth.agrees
    assert tenth.missing == ("involute",)
    assert tenth.text.endswith("involute missing")


def test_trends():
    """Lowest at the stated parameter, within 2 %; flat within 5 %."""
    # 5.4.4: all stresses lowest at r_c = 10 mm
    checks = trend_checks(
        results("5.4.4", [101.0, 100, 110, 120], [103.0, 100, 110, 120])
    )
    assert [c.agrees for c in checks if not c.tenth] == [True] * 3
    assert [c.agrees for c in checks if c.tenth] == [False] * 3
    assert {c.ours for c in checks} == {15.0}
    assert checks[0].text == "T/10: tensile stress lowest at 15, not as stated (10)"
    flat = trend_checks(results("6.4.5", [100, 101, 104, 102], [100, 101, 106, 102]))
    assert [c.agrees for c in flat] == [False, True]
    assert [c.ours for c in flat] == pytest.approx([0.06, 0.04])
    assert flat[1].text == "T: von Mises stress within 4.0 %, as stated (flat)"


def test_trends_on_the_finest_mesh():
    """Where finer meshes were run, the trend is checked on the finest as well."""
    cases = results("6.5.1", [272, 271, 269, 272, 286], [258, 257, 255, 258, 273])
    fine = [297.0, 284, 277, 275, 284]
    cases = [
        replace(case, tenth={**case.tenth, 3: replace(case.tenth[1], average=stress)})
        for case, value in zip(cases, fine, strict=True)
        for stress in [dict.fromkeys(case.tenth[1].average, value)]
    ]
    cases = [replace(case, nominal=case.tenth) for case in cases]
    checks = {(c.refinement, c.kind): c for c in trend_checks(cases) if c.tenth}
    assert checks[1, "tensile"].ours == 0.5
    assert checks[3, "tensile"].ours == 0.6
    assert checks[3, "tensile"].text == (
        "T/10, refinement 3: tensile stress lowest at 0.6, as stated"
    )


def test_flat_over_a_range():
    """5.2: stresses are alike for C from 0.91 to 0.94, not beyond."""
    tenth = [342.0, 342, 342, 343, 329, 276, 224, 266]
    nominal = [540.0, 486, 435, 383, 333, 317, 310, 303]
    checks = trend_checks(results("5.2", nominal, tenth))
    flat = {(c.kind, c.tenth): c for c in checks if c.claim == "flat"}
    assert flat["von_mises", True].agrees
    assert not flat["von_mises", False].agrees
    assert flat["von_mises", False].ours == pytest.approx(540 / 383 - 1)


def test_highest():
    """6.2: tensile and von Mises stress are highest without backlash."""
    checks = trend_checks(results("6.2", [90.0, 91.0, 100.0], [None, 91.0, 80.0]))
    claims = {(c.claim, c.kind, c.tenth): c.agrees for c in checks}
    assert claims["highest", "tensile", False]
    assert not claims["highest", "von_mises", True]


def facts(**changes):
    values = {
        "printed": 100.0,
        "nominal": 101.0,
        "value": 100.0,
        "away": 100.0,
        "fine": None,
        "places": {"fillet": 35},
    }
    return Facts(**{**values, **changes})


def test_no_reason_where_nothing_is_to_explain():
    """Within 15 %, or without a printed value, a row has no reason."""
    assert reason_for(facts()) is None
    assert reason_for(facts(printed=None, nominal=900.0)) is None


def test_reasons_come_from_the_runs():
    """Failure, torque, place, contacts, mesh and open points are named where found."""
    failed = reason_for(facts(nominal=None, failures=("T: stuck",)))
    assert failed == "T: stuck"
    assert reason_for(facts(nominal=140.0)) == (
        "torque: +40 % at T, +0 % at T/10; from T/10 to T our value changes by +40 MPa"
    )
    high = facts(value=130.0, places={"contact": 30, "fillet": 5}, away=104.0)
    assert reason_for(high) == (
        "+30 % at T/10; largest next to loaded tooth contacts at 30 of 35 positions;"
        " +4 % away from the contacts"
    )
    mesh = reason_for(facts(value=80.0, fine=98.4, note="the source is silent"))
    assert "largest in the tooth fillets at 35 of 35 positions" in mesh
    assert "the finest mesh changes it by +23 %" in mesh
    assert mesh.endswith("the source is silent")
    assert "independent of the mesh (+1 %" in reason_for(facts(value=80.0, fine=81.0))


def test_values_at_both_loads_and_on_all_meshes():
    """Judged at T: what T/10 gives, and whether the last mesh still changes it."""
    told = facts(
        value=150.0,
        nominal=150.0,
        load="T",
        tenth=80.0,
        places={},
        by_mesh={1: 150.0, 1.3: 160.0, 1.6: 162.0},
    )
    assert reason_for(told) == (
        "+50 % at T; -20 % at T/10, the torque adds +70 MPa; 150, 160, 162 MPa at"
        " refinement 1, 1.3, 1.6, +1.2 % in the last step: settles"
    )
    grows = reason_for(facts(by_mesh={1: 100.0, 1.3: 110.0, 1.6: 120.0}))
    assert grows is not None and grows.endswith(
        "+9.1 % in the last step: has no converged value"
    )
