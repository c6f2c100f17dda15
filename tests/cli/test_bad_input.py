"""Bad input: one clear line, exit status 2, nothing written."""

from __future__ import annotations

import os

import pytest

from swgjoint.cli.main import main
from swgjoint.models_path import models_path

REFERENCE = (models_path() / "drives" / "reference-2d.toml").read_text()
FAULTS = {
    "wrong key": ("rim_mm = 1.0", "rim = 1.0", "flexspline.rim: unknown key"),
    "negative thickness": (
        "rim_mm = 1.0",
        "rim_mm = -1.0",
        "flexspline.rim_mm = -1 mm: accepted: > 0 mm",
    ),
    "string for a number": (
        "module_mm = 1.0",
        'module_mm = "1.0"',
        "drive.module_mm = '1.0': accepted: a number > 0 mm",
    ),
    "infeasible tooth": (
        "root_radius_mm = 0.3",
        "root_radius_mm = 1.9",
        "flexspline.profile.",
    ),
    "missing table": ("[wave_generator]", "[joint.x]", "wave_generator: missing"),
    "no TOML": ("[drive]", "[drive", "not valid TOML"),
}
COMMANDS = {
    "profile": ["--out", "out"],
    "meshing": ["--out", "out", "--steps", "1"],
    "map": ["-o", "out.swg"],
}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty current folder that must stay as it is."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    return tmp_path


def refused(capsys, *arguments: str) -> str:
    """Lines of a command that must be refused."""
    before = sorted(os.listdir())
    assert main(list(arguments)) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sorted(os.listdir()) == before
    assert all(
        line.startswith(f"swgjoint {arguments[0]}: ") for line in err.splitlines()
    )
    return err


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("fault", FAULTS)
def test_designs(here, capsys, command, fault):
    """A faulty design is refused by every command that takes one."""
    old, new, message = FAULTS[fault]
    assert old in REFERENCE
    (here / "bad.toml").write_text(REFERENCE.replace(old, new, 1))
    err = refused(capsys, command, "bad.toml", *COMMANDS[command])
    assert message in err
    if fault in ("negative thickness", "string for a number", "infeasible tooth"):
        assert err.count("\n") == 1


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("reference", ["none.toml", "refrence-2d", ".", "a\0b"])
def test_missing_designs(here, capsys, command, reference):
    """A design that is not there is refused in one line that names the bundled ones."""
    err = refused(capsys, command, reference, *COMMANDS[command])
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["map", "reference-2d", "-o", "out.npz"], "accepted: a name ending .swg"),
        (["map", "reference-2d", "-o", "none/out.swg"], "'none' does not exist"),
        (["meshing", "reference-2d", "--torque", "nan"], "--torque nan N·m"),
        (["meshing", "reference-2d", "--torque", "1e9"], "accepted: -1e6 to 1e6 N·m"),
        (["meshing", "reference-2d", "--steps", "0"], "--steps 0; accepted: 1 to"),
        (["meshing", "reference-2d", "--turn", "0"], "--turn 0 turns"),
        (["meshing", "reference-2d", "--turn", "inf"], "--turn inf turns"),
        (["meshing", "reference-2d", "--out", "file/x"], "is a file"),
        (["profile", "reference-2d", "--out", "file"], "is a file"),
    ],
)
def test_options(here, capsys, arguments, message):
    """Options outside their range and outputs that cannot be written are refused."""
    (here / "file").write_text("")
    err = refused(capsys, *arguments)
    assert err.count("\n") == 1
    assert message in err


def test_all_faults_of_the_options_at_once(here, capsys):
    """Every wrong option has its line."""
    err = refused(capsys, "meshing", "reference-2d", "--torque", "inf", "--steps", "-1")
    assert err.count("\n") == 2
