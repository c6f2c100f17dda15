"""Bad input: one clear line, exit status 2, nothing written."""

from __future__ import annotations

import os

import pytest
from messages import names

from swgjoint.cli.main import main
from swgjoint.maps.file import map_bytes
from swgjoint.models_path import models_path

REFERENCE = (models_path() / "drives" / "reference-2d.toml").read_text()
FAULTS = {
    "wrong key": ("rim_mm = 1.0", "rim = 1.0", ("flexspline.rim", "rim_mm", "profile")),
    "negative thickness": (
        "rim_mm = 1.0",
        "rim_mm = -1.0",
        ("bad.toml", "flexspline.rim_mm", "-1 mm", "> 0 mm", "<= 10000 mm"),
    ),
    "string for a number": (
        "module_mm = 1.0",
        'module_mm = "1.0"',
        ("bad.toml", "drive.module_mm", "'1.0'", "> 0 mm", "<= 50 mm"),
    ),
    "infeasible tooth": (
        "root_radius_mm = 0.3",
        "root_radius_mm = 1.9",
        ("flexspline.profile.dedendum_radius_mm", "2.0 mm", "root_radius_mm"),
    ),
    "missing table": (
        "[wave_generator]",
        "[joint.x]",
        ("bad.toml", "wave_generator", "table"),
    ),
    "no TOML": ("[drive]", "[drive", ("bad.toml", "TOML", "line 2", "column 7")),
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
    assert names(err, *message)
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
        (["map", "reference-2d", "-o", "out.npz"], ("'out.npz'", ".swg")),
        (["map", "reference-2d", "-o", "none/out.swg"], ("folder", "'none'")),
        (
            ["meshing", "reference-2d", "--torque", "nan"],
            ("--torque", "nan N·m", "-1e6", "1e6 N·m"),
        ),
        (
            ["meshing", "reference-2d", "--torque", "1e9"],
            ("--torque", "1e+09 N·m", "-1e6", "1e6 N·m"),
        ),
        (["meshing", "reference-2d", "--steps", "0"], ("--steps", "0", "1", "100000")),
        (["meshing", "reference-2d", "--turn", "0"], ("--turn", "0 turns", "1000")),
        (
            ["meshing", "reference-2d", "--turn", "inf"],
            ("--turn", "inf turns", "1000", "0"),
        ),
        (
            ["meshing", "reference-2d", "--out", "file/x"],
            ("folder", "'file/x'", "'file'"),
        ),
        (["profile", "reference-2d", "--out", "file"], ("folder", "'file'")),
    ],
)
def test_options(here, capsys, arguments, message):
    """Options outside their range and outputs that cannot be written are refused."""
    (here / "file").write_text("")
    err = refused(capsys, *arguments)
    assert err.count("\n") == 1
    assert names(err, *message)


def test_all_faults_of_the_options_at_once(here, capsys):
    """Every wrong option has its line."""
    err = refused(capsys, "meshing", "reference-2d", "--torque", "inf", "--steps", "-1")
    assert err.count("\n") == 2


BENCH = (models_path() / "scenes" / "bench.toml").read_text()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[load.joint]",
            "[load.elbow]",
            ("scene.toml", "load.elbow", "'bench'", "joint"),
        ),
        (
            "joint = 3.0",
            "shoulder = 3.0",
            ("trajectory.speed_deg_s.shoulder", "'bench'", "joint"),
        ),
        (
            'level = "full"',
            'levl = "full"',
            ("scene.toml", "defaults.levl", "level", "drive", "rotor"),
        ),
        (
            "step_s = 0.001",
            "step_s = -0.001",
            ("simulation.step_s", "-0.001 s", ">= 1e-06 s", "<= 0.02 s"),
        ),
        (
            'drive = "reference-2d"',
            'drive = "reference-2e"',
            ("'reference-2e'", "models/drives", "reference-2d"),
        ),
        (
            'drive = "reference-2d"',
            'drive = "cut.swg"',
            ("cut.swg", "archive"),
        ),
        ('drive = "reference-2d"', 'drive = "none.swg"', ("none.swg", "No such file")),
        ('arm = "bench"', 'arm = "bnch"', ("'bnch'", "models/arms", "bench", "ur5e")),
    ],
)
def test_scenes(here, capsys, synthetic_map, old, new, message):
    """Unknown joints and keys, a truncated or missing map: refused in one line."""
    assert old in BENCH
    (here / "scene.toml").write_text(BENCH.replace(old, new, 1))
    (here / "cut.swg").write_bytes(map_bytes(synthetic_map)[:-30])
    err = refused(capsys, "run", "scene.toml", "--out", "out")
    assert names(err, *message)
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.toml"], ("'none.toml'", "models/scenes", "bench")),
        (
            ["bench", "--set", "simulation.stp_s=1"],
            ("simulation.stp_s", "step_s", "integrator"),
        ),
        (
            ["bench", "--set", "joints.elbow.level=rigid"],
            ("joints.elbow", "'bench'", "joint"),
        ),
        (["bench", "--set", "nonsense"], ("'nonsense'", "key=value")),
    ],
)
def test_scene_options(here, capsys, arguments, message):
    """A missing scene and a change of what is not there are refused in one line."""
    err = refused(capsys, "run", *arguments, "--out", "out")
    assert names(err, *message)
    assert err.count("\n") == 1
