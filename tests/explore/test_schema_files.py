"""The schemas beside the bundled files: current, named by the files, and strict."""

from __future__ import annotations

import copy
import json
import tomllib

import pytest
from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match

from swgjoint.cli.main import main
from swgjoint.explore.schema import KINDS, file_schema, schema_text
from swgjoint.models_path import KINDS as FOLDERS
from swgjoint.models_path import models_path

OF_FOLDER = {
    "drives": "design",
    "scenes": "scene",
    "sweeps": "sweep",
    "optimisations": "optimise",
}
FILES = [
    (kind, path)
    for folder, kind in OF_FOLDER.items()
    for path in sorted((models_path() / folder).glob("*.toml"))
]


def faults(kind, data):
    """Places that a validator marks, as dotted keys, with the messages."""
    errors = Draft202012Validator(file_schema(kind)).iter_errors(data)
    found = [best_match([error]) for error in errors]  # the part of an alternative
    return {".".join(map(str, one.absolute_path)): one.message for one in found}


@pytest.mark.parametrize("kind", KINDS)
def test_stored_schema_is_current(kind):
    """If this fails: python notebooks/guide/write_reference.py writes them again."""
    path = models_path() / "schemas" / f"{kind}.json"
    assert path.read_text(encoding="utf-8") == schema_text(kind)
    Draft202012Validator.check_schema(json.loads(schema_text(kind)))


def test_every_folder_with_toml_files_has_a_kind():
    """No bundled file that a command reads by name is left without a schema."""
    assert {name for name, one in FOLDERS.items() if one[0] == ".toml"} == set(
        OF_FOLDER
    )
    assert len(FILES) > 40


@pytest.mark.parametrize(("kind", "path"), FILES, ids=lambda x: getattr(x, "stem", x))
def test_bundled_file_is_valid_and_names_its_schema(kind, path):
    """The first line is the directive of taplo, a path relative to the file."""
    text = path.read_text(encoding="utf-8")
    directive, _, rest = text.partition("\n")
    word, _, schema = directive.partition(" ")
    assert word == "#:schema" and "#:schema" not in rest
    found = (path.parent / schema).resolve()
    assert found == (models_path() / "schemas" / f"{kind}.json").resolve()
    assert faults(kind, tomllib.loads(text)) == {}


@pytest.mark.parametrize(
    ("kind", "name", "change", "place", "part"),
    [
        ("design", "reference-2d", ("drive", "module_cm", 1.0), "drive", "module_cm"),
        ("design", "reference-2d", ("drive", "module_mm", 60.0), "drive.module_mm", 50),
        ("scene", "bench", ("simulation", "step", 1e-3), "simulation", "'step'"),
        ("scene", "bench", ("defaults", "level", "ful"), "defaults.level", "native"),
        ("sweep", "tolerances", ("meshing", "figures", ["x"]), "meshing.figures.0", ""),
        ("optimise", "qca-stress", ("confirm", "designs", 0), "confirm.designs", "1"),
    ],
)
def test_a_wrong_key_is_marked(kind, name, change, place, part):
    """An unknown key, a value out of range and a wrong word, at their place."""
    folder = next(folder for folder, one in OF_FOLDER.items() if one == kind)
    data = tomllib.loads((models_path() / folder / f"{name}.toml").read_text("utf-8"))
    bad = copy.deepcopy(data)
    table, key, value = change
    bad.setdefault(table, {})[key] = value
    found = faults(kind, bad)
    assert set(found) == {place}
    assert str(part) in found[place]


@pytest.mark.parametrize("kind", ["spec", "lot"])
def test_a_wrong_limit_is_marked(kind):
    """Limits of files that users write."""
    assert faults(kind, {"spec": {"ripple_rms_percent": 1.0}}) == {}
    assert set(faults(kind, {"spec": {"ripple_rms": 1.0}})) == {"spec"}
    assert set(faults(kind, {"spec": {"ripple_rms_percent": -1.0}})) == {
        "spec.ripple_rms_percent"
    }


def test_schema_is_written_whole_or_not_at_all(tmp_path, capsys):
    """The option -o writes what is stored beside the bundled files."""
    path = tmp_path / "scene.json"
    assert main(["schema", "scene", "-o", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"files": [str(path)]}
    assert path.read_text(encoding="utf-8") == schema_text("scene")
    for wrong in (tmp_path / "scene.toml", tmp_path / "none" / "scene.json"):
        assert main(["schema", "scene", "-o", str(wrong)]) == 2
        out, err = capsys.readouterr()
        assert not out and (str(wrong) in err or str(wrong.parent) in err)
    assert [one.name for one in tmp_path.iterdir()] == ["scene.json"]
