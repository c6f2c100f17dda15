"""Runs with rigid joints, which need no finite-element map of their drives."""

from __future__ import annotations

import json

import pytest
from solved import BEARING, few_teeth, kept

from swgjoint.cli.main import main
from swgjoint.cli.run import report
from swgjoint.fe.common.sampling import sample_map
from swgjoint.gear.design.design import Design
from swgjoint.maps.fit.fit import fit_map
from swgjoint.sim import rigid_drives as module
from swgjoint.sim.rigid_drives import rigid_drives
from swgjoint.sim.scene.scene import Scene

SHORT = ["--set", "simulation.duration_s=1.0"]
RIGID = ["--set", "defaults.level=rigid"]
PARTS = {
    "tolerances.misalignment_arcmin": 0.5,
    "micro_geometry.flexspline_crowning_um": 45.0,
}
"""Parts that a 2D map leaves out."""


@pytest.fixture
def design(tmp_path):
    """A small drive in a file."""
    path = tmp_path / "drive.toml"
    path.write_text(few_teeth(**PARTS).to_toml(), encoding="utf-8")
    return path


@pytest.fixture
def solves(monkeypatch):
    """Finite-element maps that are asked for; none is solved."""
    asked = []

    def solve(design, *_, **__):
        asked.append(design.drive.name)
        raise SystemExit

    monkeypatch.setattr("swgjoint.drives.solve_map.solve_map", solve)
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    return asked


def run(capsys, *arguments):
    """JSON object of the run, without the measured time, and the printed text."""
    assert main(["run", *arguments, *SHORT, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    del result["steps_per_s"]
    text = report({**result, "steps_per_s": 0.0})
    return result, text


def test_a_rigid_run_shows_the_same_without_a_map(design, solves, capsys, monkeypatch):
    """All figures equal those of a run with the map of the drive."""
    arguments = ["bench", *RIGID, "--set", f"defaults.drive={design}"]
    without = run(capsys, *arguments)
    assert not solves
    solved = kept(
        f"map of few teeth, {PARTS}, 6 angles",
        lambda: fit_map(sample_map(few_teeth(**PARTS), angles=6)),
    )
    monkeypatch.setattr(module, "stand_in", lambda *_: solved)
    assert run(capsys, *arguments) == without
    assert "micro_geometry and tolerances.misalignment_arcmin" in without[1]


def test_a_rigid_joint_has_no_map_range(design, solves, capsys):
    """The range is null with a reason, for every kind of drive."""
    for drive in (design, "CSG-25-100"):
        result, _ = run(capsys, "bench", *RIGID, "--set", f"defaults.drive={drive}")
        ratings = result["joints"]["joint"]["ratings"]
        assert ratings["map_range_Nm"] is None and ratings["within_map"] is None
        assert set(ratings["missing"]) == {"map_range_Nm", "within_map"}


@pytest.mark.parametrize(
    "more",
    [
        ["--set", "joints.joint.level=linear"],
        ["--set", "joints.joint.level=kinematic"],
        ["--set", "defaults.kinematic_error_arcmin=1.0"],
        ["--set", "defaults.temperature_C=0.0"],
        ["--set", "cycle=[{}]"],
        ["--model", "ring"],
        ["--report", "--out", "out"],
    ],
)
def test_what_needs_a_map_builds_it(more, design, solves, tmp_path, monkeypatch):
    """Other levels, figures that only a map has, and the spec sheets of a report."""
    monkeypatch.chdir(tmp_path)
    arguments = ["bench", *RIGID, "--set", f"defaults.drive={design}", *more]
    with pytest.raises(SystemExit):
        main(["run", *arguments, *SHORT])
    assert solves


@pytest.mark.parametrize(
    "change",
    [
        {"friction.tooth_coefficient": 0.1},
        {
            "losses.grease": "run_in",
            "losses.base_oil_40C_mm2_s": 30.0,
            "losses.base_oil_100C_mm2_s": 6.0,
            **BEARING,
        },
        {"drive.layout": "flexspline_fixed", **BEARING},
    ],
)
def test_a_design_whose_map_says_more_gets_no_stand_in(change):
    """A run states losses that it leaves out, and what the map of a twin leaves out."""
    assert module.stand_in(few_teeth(**PARTS)) is not None
    assert module.stand_in(few_teeth(**change)) is None


def test_joints_with_a_map_share_it_with_rigid_ones():
    """A reference gets a stand-in only if all its joints are rigid, at one fidelity."""
    scene = Scene.load_file("ur5e-sweep", {"defaults.level": "rigid"})
    assert set(rigid_drives(scene)) == {"reference-2d"}
    one = scene.with_changes({"joints.elbow_joint.level": "full"})
    assert not rigid_drives(one)
    other = scene.with_changes(
        {"joints.elbow_joint.level": "full", "joints.elbow_joint.drive": "size-25-100"}
    )
    assert set(rigid_drives(other)) == {"reference-2d"}
    mixed = scene.with_changes({"joints.elbow_joint.model": "ring"})
    assert not rigid_drives(mixed)


def test_a_stand_in_of_a_cup_has_the_label_of_its_3d_map():
    """Fidelity, ratio and ratings are those of the design."""
    design = Design.load("reference-3d")
    drive = module.stand_in(design)
    assert drive.level == "3d" and drive.ratio == design.ratio
    assert drive.info["label"]["model"] == "3d"
    assert drive.damping_ratio == design.joint.damping_ratio


@pytest.mark.parametrize(
    ("name", "fault", "named"),
    [
        ("reference-2d", {"flexspline.profile.root_radius_mm": 1.5}, "root_radius_mm"),
        ("reference-3d", {"cup.fillet_mm": 30.0}, "cup.length_mm"),
    ],
)
def test_a_design_that_cannot_be_built_is_refused(name, fault, named, tmp_path, capsys):
    """With rigid joints, too, in the same words as its map."""
    path = tmp_path / "drive.toml"
    path.write_text(Design.load(name).with_changes(fault).to_toml(), encoding="utf-8")
    messages = []
    for level in ("rigid", "full"):
        changes = f"--set defaults.drive={path} --set defaults.level={level}"
        assert main(["run", "bench", *changes.split()]) == 2
        messages.append(capsys.readouterr().err)
    assert messages[0] == messages[1]
    assert named in messages[0]
