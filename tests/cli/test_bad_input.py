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
    "no TOML": ("[drive]", "[drive", ("bad.toml", "TOML", "line 3", "column 7")),
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


MODELS = models_path()
KINDS = {
    "design": MODELS / "drives" / "reference-2d.toml",
    "scene": MODELS / "scenes" / "bench.toml",
    "sweep": MODELS / "sweeps" / "bench-speed.toml",
    "optimisation": MODELS / "optimisations" / "qca-stress.toml",
    "spec": None,
    "arm (MJCF)": MODELS / "arms" / "two-link.xml",
}
TAKES = {
    "design": ["profile"],
    "scene": ["advise", "--error", "1arcmin"],
    "sweep": ["sweep"],
    "optimisation": ["optimise"],
    "spec": ["compare", "CSG-25-100", "--spec"],
}


@pytest.mark.parametrize("needed", TAKES)
@pytest.mark.parametrize("given", KINDS)
def test_a_file_of_another_kind_is_named(here, capsys, given, needed):
    """One line says what the file is and what is needed, whatever its keys."""
    if given == needed or (given, needed) == ("arm (MJCF)", "scene"):
        return
    file = KINDS[given] or here / "spec.toml"
    if given == "spec":
        file.write_text("[spec]\nK1_Nm_rad = 1e4\n")
    command, *options = TAKES[needed]
    arguments = [*options, str(file)] if needed == "spec" else [str(file), *options]
    err = refused(capsys, command, *arguments)
    assert err.count("\n") == 1
    assert names(err, file.name, f"this is a{'n' * (given[0] in 'ao')} {given}", needed)


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("CSD-25-100", ("mean CSG-25-100", "CHA", "14 to 32", "swgjoint list drives")),
        ("size-25", ("mean size-25-100", "size-NN-RRR")),
        ("ur5e", ("'ur5e'", "an arm", "a design", "reference-2d")),
        ("size-25-999", ("'size-25-999'", "999", "30 to 200")),
    ],
)
def test_drives_are_suggested_from_all_sources(here, capsys, reference, message):
    """Catalogue, bundled designs and the rule, each for its own spelling."""
    err = refused(capsys, "spec", reference)
    assert err.count("\n") == 1 and names(err, *message)


def test_an_arm_is_suggested_where_a_scene_may_be_one(here, capsys):
    """A wrong name has those of arms beside those of scenes."""
    err = refused(capsys, "run", "ur10e")
    assert err.count("\n") == 1
    assert names(err, "'ur10e'", "mean ur5e", "list scenes", "two-link", "models/arms")


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("trajectory.speed_deg_s=0.6", ("trajectory.speed_deg_s.NAME =", "3600 deg/s")),
        ("payload.centre_mm=0,0,60", ("'0,0,60'", "centre_mm = [1.5, 1.5, 1.5]")),
        ("payload=3", ("[payload]", "mass_kg", "inertia_kgm2")),
        ("disturbance=3", ("[[disturbance]]",)),
    ],
)
def test_lists_and_tables_are_shown_as_they_are_written(
    here, capsys, override, message
):
    """A value of another shape is answered with the syntax of the right one."""
    err = refused(capsys, "run", "bench", "--set", override)
    assert names(err, override.partition("=")[0], *message)


@pytest.mark.parametrize("ending", ["", ".toml", ".swg", ".xml"])
@pytest.mark.parametrize("name", ["n" * 300, "d/" * 1500 + "d", "n" * 200])
@pytest.mark.parametrize(
    "arguments",
    [
        ["profile"],
        ["spec"],
        ["run"],
        ["compare"],
        ["sweep"],
        ["run", "bench", "--drive"],
    ],
)
def test_names_that_no_file_has_are_bad_input(here, capsys, arguments, name, ending):
    """Longer than a file system takes: one line that does not echo it."""
    err = refused(capsys, *arguments, name + ending)
    assert err.count("\n") == 1
    assert len(err) < 700
