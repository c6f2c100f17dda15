"""``swgjoint schema``: the keys that the files have, as their models check them."""

from __future__ import annotations

import json
import tomllib

import pytest

from swgjoint.cli.main import main
from swgjoint.cli.schema import KINDS
from swgjoint.errors import DesignError
from swgjoint.explore import schema as source
from swgjoint.explore.accept.figures import LIMITED
from swgjoint.explore.bearing_lot import FIGURES as BEARING_FIGURES
from swgjoint.explore.lot import FIGURES
from swgjoint.explore.sweep.keys import known_keys
from swgjoint.faults import unit_of
from swgjoint.gear.design.design import Design
from swgjoint.models_path import models_path
from swgjoint.sim.figures.keys import LOWER, UPPER

FILES = {
    "design": "drives",
    "scene": "scenes",
    "sweep": "sweeps",
    "optimise": "optimisations",
}


def asked(capsys, kind):
    assert main(["schema", kind, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_every_kind_is_there():
    """The command offers what the schemas are made of."""
    assert KINDS == source.KINDS


def fits(value, form, root):
    """Whether a value has the keys, types and ranges of a schema: a checker of ours."""
    if "$ref" in form:
        return fits(value, root["$defs"][form["$ref"].rpartition("/")[2]], root)
    for several in ("anyOf", "oneOf"):
        if several in form:
            return any(fits(value, one, root) for one in form[several])
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool}
    kinds |= {"integer": int, "number": (int, float), "null": type(None)}
    if "type" in form and not isinstance(value, kinds[form["type"]]):
        return False
    if "const" in form and value != form["const"]:
        return False
    if "enum" in form and value not in form["enum"]:
        return False
    if isinstance(value, dict):
        known, rest = form.get("properties", {}), form.get("additionalProperties", True)
        others = set(value) - set(known)
        if (others and rest is False) or not set(form.get("required", ())) <= set(
            value
        ):
            return False
        return all(
            fits(value[k], known.get(k, rest if isinstance(rest, dict) else {}), root)
            for k in value
        )
    if isinstance(value, list):
        return all(fits(item, form.get("items", {}), root) for item in value)
    if isinstance(value, int | float):
        return (
            value > form.get("exclusiveMinimum", float("-inf"))
            and value >= form.get("minimum", float("-inf"))
            and value < form.get("exclusiveMaximum", float("inf"))
            and value <= form.get("maximum", float("inf"))
        )
    return True


@pytest.mark.parametrize("kind", FILES)
def test_bundled_files_fit_their_schema(kind, capsys):
    """All of them, and none with another key or a wrong type in a table."""
    schema = asked(capsys, kind)
    files = sorted((models_path() / FILES[kind]).glob("*.toml"))
    assert files
    for file in files:
        data = tomllib.loads(file.read_text())
        assert fits(data, schema, schema), file
        for table in [data, *(v for v in data.values() if isinstance(v, dict))]:
            table["no_such_key"] = 1
            assert not fits(data, schema, schema), file
            del table["no_such_key"]


def test_a_range_is_that_of_the_check(capsys):
    """At the bound of every plain number of a design the file is refused or read."""
    schema = asked(capsys, "design")
    rows = {row["key"]: row for row in source.described_keys(schema)}
    assert rows["drive.module_mm"]["range"] == "> 0, <= 50"
    assert rows["drive.module_mm"]["unit"] == "mm" and rows["drive.name"]["required"]
    design = Design.preset("reference-2d")
    with pytest.raises(DesignError):
        design.with_changes({"drive.module_mm": 0.0})
    assert rows["wave_generator.minor_axis_coefficient"]["default"] == 1.0


def test_every_key_of_a_design_has_a_meaning(capsys):
    """Of all tables and kinds, but for the kind itself."""
    rows = source.described_keys(asked(capsys, "design"))
    without = [row["key"] for row in rows if not row["meaning"]]
    assert {key.rpartition(".")[2] for key in without} <= {"kind"}


@pytest.mark.parametrize("kind", ["design", "scene"])
def test_every_key_is_described(kind, capsys):
    """The keys are those that a sweep may vary; units follow their endings."""
    rows = source.described_keys(asked(capsys, kind))
    listed = {row["key"].replace("NAME", "*") for row in rows}
    inside_lists = {key for key in listed if "[]" in key}
    stars = {key for key in known_keys(kind) if key.endswith(".*")}
    assert listed - inside_lists == set(known_keys(kind)) - stars
    for row in rows:
        assert row["unit"] == unit_of(row["key"].rpartition(".")[2])
    assert main(["schema", kind]) == 0
    lines = capsys.readouterr().out.splitlines()
    told = [line.partition(":")[0].partition(" ")[0] for line in lines]
    assert {row["key"] for row in rows} <= set(told)


@pytest.mark.parametrize(
    ("kind", "figures"),
    [
        ("spec", UPPER + LOWER),
        ("lot", (*FIGURES, *BEARING_FIGURES)),
        ("accept", LIMITED),
    ],
)
def test_limits_are_the_figures_that_may_be_limited(kind, figures, capsys):
    """Each with its unit and a meaning, positive numbers only."""
    schema = asked(capsys, kind)
    table = schema["properties"]["spec"]["properties"]
    assert set(table) == set(figures)
    assert all(entry["exclusiveMinimum"] == 0 for entry in table.values())
    assert all(entry.get("unit", "") == unit_of(key) for key, entry in table.items())
    assert fits({"spec": dict.fromkeys(figures, 1.0)}, schema, schema)
    assert not fits({"spec": {figures[0]: 0.0}}, schema, schema)
