"""A draft of the studio: its fields, its checks and the values of a new kind."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from swgjoint.cli.main import main
from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.models_path import bundled_names
from swgjoint.studio.draft import (
    differences,
    judge,
    open_bundled,
    open_file,
    with_value,
)
from swgjoint.studio.fields import list_fields, parse_text, text_of, value_at
from swgjoint.studio.work import show_design

NAMES = bundled_names("drives", ".toml")


def leaves(table, above=""):
    for name, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{above}{name}.")
        else:
            yield f"{above}{name}"


@pytest.mark.parametrize("name", NAMES)
def test_every_key_of_a_design_has_a_field(name):
    """Each field shows the value of its key, and its text gives that value again."""
    draft = open_bundled(name)
    fields = {field.key: field for field in list_fields(draft)}
    assert set(leaves(draft)) <= set(fields)
    for key in leaves(draft):
        value = value_at(draft, key)
        again = parse_text(fields[key], text_of(value))
        assert again == (list(value) if isinstance(value, tuple) else value)


def test_fields_say_what_they_are():
    """Unit, range, default and meaning come from the schema."""
    fields = {f.key: f for f in list_fields(open_bundled("reference-2d"))}
    rim = fields["flexspline.rim_mm"]
    assert (rim.label, rim.unit, rim.range) == ("rim", "mm", "> 0, <= 10000")
    assert fields["flexspline.pressure_angle_deg"].default == "20.0"
    assert "conjugate" in fields["flexspline.profile.kind"].choices
    missing = [f.key for f in fields.values() if not f.table and not f.meaning]
    assert missing == []


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("flexspline.profile.tip_radius_mm", "1.5"),
        ("flexspline.rim_mm", "-1"),
        ("flexspline.rim_mm", "thick"),
        ("drive.teeth_flexspline", "121.5"),
        ("circular_spline.thickness_coefficient", "1.4"),
    ],
)
def test_messages_are_those_of_the_command_line(tmp_path, capsys, key, text):
    """The faults of a draft are the lines that ``design check`` prints for its file."""
    from swgjoint.toml_text import toml_text

    draft = open_bundled("reference-2d")
    field = next(f for f in list_fields(draft) if f.key == key)
    draft = with_value(draft, key, parse_text(field, text))
    path = tmp_path / "my.toml"
    path.write_text(toml_text(draft), encoding="utf-8")
    assert main(["design", "check", str(path)]) != 0
    printed = capsys.readouterr().err.splitlines()
    verdict = judge(draft)
    assert verdict.design is None
    ends = [
        line.removeprefix("swgjoint design: ").removeprefix(f"{path}: ")
        for line in printed
    ]
    assert list(verdict.faults) == [x.removeprefix("reference-2d: ") for x in ends]
    assert set(verdict.faults_by_key(draft).values()) == set(verdict.faults)


KINDS = [
    (field.key, kind)
    for field in list_fields(open_bundled("reference-2d"))
    if field.key.endswith(".kind")
    for kind in field.choices
]


def test_all_kinds_are_offered():
    """Both flanks and the wave generator can have each kind of a design file."""
    count = Counter(key for key, _ in KINDS)
    assert count["flexspline.profile.kind"] == count["circular_spline.profile.kind"] > 4
    assert count["wave_generator.kind"] > 6


@pytest.mark.parametrize(("key", "kind"), KINDS)
def test_another_kind_is_a_valid_design(key, kind):
    """A new kind has its own keys only, and can be built at once."""
    draft = with_value(open_bundled("reference-2d"), key, kind)
    assert set(leaves(draft)) <= {field.key for field in list_fields(draft)}
    if kind == "table":  # an outline that only the user has
        faults = judge(draft).faults_by_key(draft)
        assert set(faults) == {"wave_generator.angle_deg", "wave_generator.radius_mm"}
        assert all(": missing; accepted: " in line for line in faults.values())
        return
    assert judge(draft).faults == ()
    assert value_at(judge(draft).design.model_dump(), key) == kind


@pytest.mark.parametrize(
    ("key", "kind", "wrong"),
    [
        ("flexspline.profile", "qca", "dedendum_radius_mm"),
        ("circular_spline.profile", "dca", "addendum_radius_mm"),
        ("wave_generator", "parabolic", "parabola_coefficient_per_mm"),
    ],
)
def test_a_kind_that_does_not_fit_says_where(key, kind, wrong):
    """With another tooth height the dimensions do not fit; one field has the limit."""
    draft = with_value(open_bundled("dca-80-to-1"), f"{key}.kind", kind)
    Design.model_validate(draft)  # all keys that the kind requires are there
    faults = judge(draft).faults_by_key(draft)
    assert set(faults) == {f"{key}.{wrong}"}
    assert "; accepted: " in faults[f"{key}.{wrong}"]


def test_values_of_a_new_kind():
    """Common values stay if they fit; others come from a design, scaled by module."""
    draft = open_bundled("reference-2d")
    draft = with_value(draft, "wave_generator.minor_axis_coefficient", 0.98)
    cosine = with_value(draft, "wave_generator.kind", "cosine")["wave_generator"]
    assert cosine == {"kind": "cosine", "minor_axis_coefficient": 0.98}
    small = with_value(open_bundled("dca-80-to-1"), "flexspline.profile.kind", "qca")
    arcs, scale = small["flexspline"]["profile"], small["drive"]["module_mm"]
    for name, value in draft["flexspline"]["profile"].items():
        wanted = value * scale if name.endswith("_mm") else value
        assert arcs[name] == wanted


def test_a_table_comes_and_goes():
    """A cup is added with values and removed without a trace."""
    draft = open_bundled("reference-2d")
    with_cup = with_value(draft, "cup", {})
    assert judge(with_cup).design.cup is not None
    assert with_value(with_cup, "cup", None) == draft
    assert {key.partition(".")[0] for key, _, _ in differences(draft, with_cup)} == {
        "cup"
    }


@pytest.mark.parametrize("content", [b"\xff", b"a = [", b'arm = "x"\n[trajectory]\n'])
def test_a_wrong_file_is_refused(tmp_path, content):
    """The message names the fault and not the folder of the studio."""
    with pytest.raises(DesignError) as caught:
        open_file(content, tmp_path)
    assert str(tmp_path) not in str(caught.value)


@pytest.mark.parametrize("text", ["2026-12-01", "[12:30:00]", "2026-12-01 12:30:00Z"])
def test_a_date_is_shown_in_its_field(tmp_path, text):
    """Dates of a file, which no key accepts, are shown with the fault beside them."""
    content = Design.preset("reference-2d").to_toml()
    line = next(x for x in content.splitlines() if x.startswith("source = "))
    content = content.replace(line, f"source = {text}")
    draft = open_file(content.encode(), tmp_path)
    fields = {field.key: field for field in list_fields(draft)}
    assert text_of(value_at(draft, fields["drive.source"].key)) != ""
    [fault] = judge(draft).faults
    assert fault.startswith("drive.source")


def test_a_value_replaces_what_is_no_table():
    """A number of a file in the place of a table gives way to the value of its key."""
    draft = open_bundled("reference-2d")
    profile = draft["flexspline"]["profile"]
    draft["flexspline"]["profile"] = 4
    edited = with_value(draft, "flexspline.profile.tip_radius_mm", 0.3)
    assert edited["flexspline"]["profile"] == {"tip_radius_mm": 0.3}
    edited = with_value(draft, "flexspline.profile.kind", profile["kind"])
    assert judge(edited).design is not None


def test_fifty_random_edits_without_an_exception():
    """Any text in any field, one after another, gives a design or its faults."""
    rng = np.random.default_rng(7)
    texts = ["", "0", "-1", "1e-9", "1e300", "nan", "inf", "abc", "[1, 2]", "{", "'"]
    draft, seen = open_bundled("reference-2d"), set()
    for k in range(50):
        fields = [f for f in list_fields(draft) if not f.table]
        field = fields[rng.integers(len(fields))]
        before = value_at(draft, field.key)
        if field.choices:
            text = str(rng.choice(field.choices))
        elif isinstance(before, float) and k % 2:
            text = repr(before * float(rng.uniform(0.5, 1.5)))
        else:
            text = str(rng.choice(texts))
        edited = with_value(draft, field.key, parse_text(field, text))
        shown = show_design(edited)
        seen.add(shown.verdict.design is None)
        assert (shown.verdict.design is None) == (shown.teeth is None)
        assert set(shown.verdict.faults_by_key(edited)) <= {
            f.key for f in list_fields(edited)
        }
        # every other fault stays, so that several come together
        draft = edited if shown.verdict.design or k % 2 else draft
        if shown.verdict.design is None and k % 4 == 3:
            draft = open_bundled(str(rng.choice(NAMES)))
    assert seen == {True, False}
