"""The validation of a map: what it says between its rows, and unsound records."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from messages import names
from validation_record import made_record, validated_map

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import with_error
from swgjoint.maps.sheet.map_validity import (
    LIMIT,
    NOT_VALIDATED,
    WARNING,
    Difference,
    MapValidation,
    map_validation,
    validation_json,
    validation_lines,
)
from swgjoint.maps.sheet.validity_marks import error_mark, mark
from swgjoint.units import arcmin
from swgjoint.view.validity import map_error

ROWS = {5.0: (0.02, 0.01), 15.0: (0.5, 0.04), 30.0: (0.1, 0.2)}


def read(drive: DriveMap) -> MapValidation:
    found, reason = map_validation(drive)
    assert reason is None and found is not None
    return found


def largest(found: MapValidation, low: float, high: float) -> tuple[float, float]:
    both = found.worst_between(low, high)
    return both["input_torque"].largest, both["output_error"].largest


def test_a_row_counts_at_its_own_torque_and_a_line_between_two(synthetic_map):
    """At 15 N·m the row itself, halfway to 5 N·m the mean, beyond the last the last."""
    found = read(validated_map(synthetic_map, ROWS))
    for torque, row in ROWS.items():
        assert largest(found, torque, torque) == pytest.approx(row)
    assert largest(found, 10.0, 10.0) == pytest.approx((0.26, 0.025))
    assert largest(found, 0.0, 1.0) == pytest.approx(ROWS[5.0])
    assert largest(found, 90.0, 99.0) == pytest.approx(ROWS[30.0])
    worst = found.worst_between(4.0, 40.0)["input_torque"]
    assert (worst.torque, worst.largest, worst.from_rows) == (15.0, 0.5, ())
    line = found.worst_between(1.0, 10.0)["input_torque"]
    assert (line.torque, line.from_rows) == (10.0, (5.0, 15.0))
    assert names(str(line), "26 %", "10 N·m", "5", "15 N·m")
    assert Difference.from_json(line.to_json()) == line
    assert (found.worst.quantity, found.worst.torque) == ("input_torque", 15.0)


def test_a_wider_range_of_torques_never_looks_better(synthetic_map):
    """Random nested ranges, record of one sign and of both."""
    rng = np.random.default_rng(3)
    for sign in (0.0, -1.0):
        torques = rng.uniform(40.0 * sign, 40.0, 9)
        rows = {float(torque): tuple(rng.uniform(0.0, 0.6, 2)) for torque in torques}
        found = read(validated_map(synthetic_map, rows))
        for _ in range(100):
            a, b, c, d = np.sort(rng.uniform(-50.0, 50.0, 4))
            inner, outer = largest(found, b, c), largest(found, a, d)
            assert outer[0] >= inner[0] and outer[1] >= inner[1]


def test_a_record_of_one_sign_holds_for_the_other(synthetic_map):
    """Positive torques alone stand for a symmetric drive; both signs do not mirror."""
    found = read(validated_map(synthetic_map, ROWS))
    assert largest(found, -15.0, -15.0) == pytest.approx(ROWS[15.0])
    assert largest(found, -6.0, 16.0)[0] == pytest.approx(0.5)
    both = {-15.0: (0.01, 0.01), **ROWS}
    found = read(validated_map(synthetic_map, both))
    assert largest(found, -15.0, -15.0) == pytest.approx((0.01, 0.01))


def test_marks_follow_the_two_limits():
    """Nothing up to a tenth, then uncertain, above 30 % not valid."""
    assert [mark(one) for one in (None, 0.0, WARNING, 0.11, LIMIT, 0.31)] == [
        "",
        "",
        "",
        "~",
        "~",
        "!",
    ]


def test_a_transmission_error_is_marked_by_what_the_difference_is_of_it(synthetic_map):
    """20 % of 1 arcmin: all of 0.2, a fifth of 1, a fiftieth of 10 arcmin."""
    drive = validated_map(synthetic_map, {20.0: (0.0, 0.2)}, error=arcmin)
    found = read(drive).worst_between(15.0, 25.0)
    joint = {
        "ripple_valid": True,
        "map_difference": {key: one.to_json() for key, one in found.items()},
    }
    assert [error_mark(joint, value) for value in (0.2, 1.0, 10.0)] == ["!", "~", ""]
    assert error_mark(joint | {"ripple_valid": None}, 1.0) == ""


@pytest.mark.parametrize(
    ("rows", "stiffness", "parts"),
    [
        ({5.0: (0.02, 0.03)}, 0.01, ()),
        ({5.0: (0.02, 0.13)}, 0.01, ("uncertain", "13 %", "output error", "5 N·m")),
        (ROWS, 0.01, ("not valid", "15 N·m", "50 %", "input torque", "meshing")),
        ({5.0: (0.0, 0.0)}, 0.2, ("20 %", "secant stiffness")),
    ],
)
def test_what_a_map_misses_is_told_with_quantity_and_torque(
    synthetic_map, rows, stiffness, parts
):
    """No line for a good map, one for each grade of a bad one."""
    lines = validation_lines(read(validated_map(synthetic_map, rows, stiffness)))
    assert len(lines) == bool(parts)
    assert all(names(line, *parts) for line in lines)


def test_the_record_survives_the_file(synthetic_map, tmp_path):
    """Saved and loaded it is the same, and so is what follows from it."""
    drive = validated_map(synthetic_map, ROWS)
    drive.save(tmp_path / "a.swg")
    again = DriveMap.load(tmp_path / "a.swg")
    assert again.info["validation"] == drive.info["validation"]
    assert read(again) == read(drive)


def test_a_map_without_a_record_says_so(synthetic_map):
    """One phrase with the reason, for every kind of map."""
    for drive in (
        synthetic_map,
        DriveMap.linear(2e4),
        DriveMap.from_catalogue("CSG-25-100"),
    ):
        found = validation_json(drive)
        assert found["validation"] is None
        assert names(found["validation_reason"], NOT_VALIDATED)
        assert names(map_error(drive)[0], NOT_VALIDATED)


def test_another_kinematic_error_is_not_validated(synthetic_map):
    """The record tells nothing of an error that took the place of the map's own."""
    drive = with_error(validated_map(synthetic_map, ROWS), [(2, 0)], [(1e-5, 0.0)])
    assert map_validation(drive)[0] is None


def test_the_error_of_a_map_begins_with_its_validation(synthetic_map):
    """Also with errors of the teeth, whose own solves and perfect teeth stay."""
    drive = validated_map(synthetic_map, ROWS)
    perfect = {"energy_check": {"relative": 0.0123}}
    drive = replace(drive, info={**drive.info, "perfect_teeth": perfect})
    first, second = map_error(drive)
    assert names(first, "unseen", "50 %", "15 N·m", "20 %", "30 N·m")
    assert names(second, "1.2 %")


def broken(*path: Any, value: Any) -> Any:
    """A record with another value in one place."""
    record = made_record(ROWS)
    inner: Any = record
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return record


@pytest.mark.parametrize(
    ("record", "place"),
    [
        ("perfect", "validation"),
        ([1.0], "validation"),
        ({}, "rows"),
        (broken("rows", value=[]), "rows"),
        (broken("rows", value="all of them"), "rows"),
        (broken("rows", value=[{}] * 200_000), "200000"),
        (broken("rows", 1, value=7), "rows.1"),
        (broken("rows", 1, "torque_Nm", value="15"), "rows.1.torque_Nm"),
        (broken("rows", 2, "output_error_largest", value=-0.1), "rows.2"),
        (broken("rows", 0, "input_torque_largest", value=float("nan")), "rows.0"),
        (broken("rows", 0, "input_torque_largest", value=10**400), "rows.0"),
        (broken("input_torque", "largest", value=True), "input_torque.largest"),
        (broken("output_error", value=None), "output_error"),
        (broken("solves", value=10**400), "solves"),
        (broken("reason", value={"a": 1}), "reason"),
    ],
)
def test_a_record_that_is_not_sound_is_ignored_with_its_place(
    synthetic_map, record, place
):
    """No traceback: the map counts as not validated, and the reason names the place."""
    drive = replace(synthetic_map, info={"validation": record})
    found = validation_json(drive)
    assert found["validation"] is None
    reason = found["validation_reason"]
    assert names(reason, NOT_VALIDATED, place) and len(reason) < 250
    assert drive.spec_sheet(("ripple_rms_percent",))["ripple_rms_percent"] > 0.0


def test_checks_of_a_map_that_are_no_numbers_are_left_out(synthetic_map):
    """A file may hold anything under the other keys, too."""
    info = {
        "energy_check": {"relative": "small"},
        "residual": {"torque_Nm": 10**400, "threshold": None},
        "stiffness_range_Nm_rad": ["a", []],
    }
    assert len(map_error(replace(synthetic_map, info=info))) == 1
