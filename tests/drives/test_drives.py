"""Drives of a scene: kinematic error by joint, fidelity, what a file may ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import names, naming

from swgjoint.cli.main import main
from swgjoint.cli.run import left_out_lines
from swgjoint.drives import references as module
from swgjoint.drives.references import drive_of, load_drive
from swgjoint.drives.sections import JointSection
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import peak_to_peak, with_assumed_error
from swgjoint.sim.assembly import assemble
from swgjoint.sim.figures.contains import contents
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene

SCENE = {
    "name": "two",
    "arm": "two-link",
    "defaults": {"drive": "CSG-25-100", "rotor_inertia_kgm2": 1e-4},
    "trajectory": {"kind": "sweep", "end_deg": {"shoulder": 2.0}},
    "simulation": {"duration_s": 3.0},
}

SHORT = ("--set", "simulation.duration_s=2.0")


def errors_of(**overrides: object) -> list[np.ndarray]:
    """Amplitudes of the kinematic error of both joints [rad]."""
    keys = {key.replace("__", "."): value for key, value in overrides.items()}
    whole = assemble(Scene.from_data(SCENE, overrides=keys))
    return [t.drive.kinematic_error for t in whole.transmissions]


def sizes_of(**overrides: object) -> list[float]:
    """Peak to peak of the kinematic error of both joints [arcmin]."""
    keys = {key.replace("__", "."): value for key, value in overrides.items()}
    whole = assemble(Scene.from_data(SCENE, overrides=keys))
    return [peak_to_peak(t.drive) / arcmin for t in whole.transmissions]


def test_joints_of_one_seed_have_drives_of_their_own():
    """Phases differ between joints and seeds, and a scene gives them again."""
    first, again, other = errors_of(), errors_of(), errors_of(defaults__seed=1)
    assert not np.allclose(first[0], first[1])
    for joint in range(2):
        assert np.array_equal(first[joint], again[joint])
        assert not np.allclose(first[joint], other[joint])
    changed = errors_of(joints__elbow__seed=1)
    assert np.array_equal(changed[0], first[0])
    assert np.array_equal(changed[1], other[1])


def test_a_scene_sizes_the_error():
    """The stated accuracy by default, a value of a joint or of all, 0 for none."""
    assert sizes_of() == pytest.approx([1.0, 1.0], rel=0.05)
    sized = sizes_of(
        defaults__kinematic_error_arcmin=0.0, joints__elbow__kinematic_error_arcmin=2.5
    )
    assert sized[0] == 0.0 and sized[1] == pytest.approx(2.5, rel=0.05)


def test_without_error_and_friction_a_drive_is_its_curve():
    """Switched off, nothing but the stiffness of the row is left, bit for bit."""
    keys = {"defaults.kinematic_error_arcmin": 0, "defaults.friction": False}
    whole = assemble(Scene.from_data(SCENE, overrides=keys))
    plain = replace(
        DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0), friction=None
    )
    for t in whole.transmissions:
        for key in ("orders", "kinematic_error", "potential", "end_stiffness"):
            assert np.array_equal(getattr(t.law, key), getattr(plain, key))
        assert t.law.friction is None and t.law.hysteresis == ()


def test_a_given_map_and_one_with_an_error_are_taken_as_they_are(synthetic_map):
    """What a caller hands over keeps its error; 0 is no request to take it away."""
    given = DriveMap.from_catalogue("CSG-25-100", seed=7)
    for drive in (given, synthetic_map):
        for wanted in (None, 0.0):
            section = JointSection(drive="x", kinematic_error_arcmin=wanted)
            assert drive_of(section, known={"x": drive}, joint="a") is drive
        section = JointSection(drive="x", kinematic_error_arcmin=1.0)
        with pytest.raises(
            InputError, match=naming("joints.a", "kinematic_error_arcmin", "1")
        ):
            drive_of(section, known={"x": drive}, joint="a")
    bare = DriveMap.linear(1e4)
    section = JointSection(drive="x", kinematic_error_arcmin=1.0, seed=3)
    got = drive_of(section, known={"x": bare}, joint="a")
    want = with_assumed_error(bare, arcmin, seed=3, joint="a")
    assert np.array_equal(got.kinematic_error, want.kinematic_error)


def test_a_fidelity_is_for_designs(monkeypatch):
    """A design is built with it, once; a catalogue drive or a map refuses it."""
    asked = []

    def load(reference, *, model=None, progress=None):
        asked.append((reference, model))
        return replace(DriveMap.linear(1e4), level=model or "2d")

    monkeypatch.setattr(module, "load_drive", load)
    known: dict[str, DriveMap] = {}
    for model, level in (
        ("ring", "ring"),
        (None, "2d"),
        ("ring", "ring"),
        ("2d", "2d"),
    ):
        section = JointSection(drive="reference-2d", model=model)
        assert drive_of(section, known=known).level == level
    assert asked == [("reference-2d", "ring"), ("reference-2d", None)]
    for section in (
        {"drive": "CSG-25-100"},
        {"drive": "my.swg"},
        {"linear": {"stiffness_Nm_rad": 1e4}},
    ):
        with pytest.raises(
            InputError, match=naming("joints.elbow", "model", "'ring'", "design")
        ):
            drive_of(JointSection(model="ring", **section), known=known, joint="elbow")


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("kinematic_error_arcmin", -0.5, ("-0.5", ">= 0")),
        ("kinematic_error_arcmin", 100, ("100", "60")),
        ("seed", -1, ("-1", ">= 0")),
        ("seed", 1.5, ("1.5",)),
        ("model", "4d", ("'4d'", "ring", "2d", "3d")),
    ],
)
def test_values_out_of_range(key, value, words):
    """Keys of a joint are checked with the file."""
    with pytest.raises(InputError, match=naming(f"joints.elbow.{key}", *words)):
        Scene.from_data(SCENE, overrides={f"joints.elbow.{key}": value})


def test_a_measured_loop_as_a_drive_is_sent_to_its_map():
    """A CSV file has neither teeth nor ratings: the command that asks for them."""
    message = naming("'loop.csv'", "swgjoint map loop.csv", "--measured-teeth FS/CS")
    with pytest.raises(InputError, match=message):
        load_drive("loop.csv")


def test_a_loaded_drive_takes_an_error_where_it_has_none(tmp_path, synthetic_map):
    """Catalogue and map file alike; a map with an error of its own refuses."""
    assert peak_to_peak(load_drive("CSG-25-100", kinematic_error_arcmin=0.0)) == 0.0
    bare, own = tmp_path / "bare.swg", tmp_path / "own.swg"
    DriveMap.linear(1e4).save(bare)
    synthetic_map.save(own)
    got = load_drive(str(bare), kinematic_error_arcmin=2.0)
    assert peak_to_peak(got) / arcmin == pytest.approx(2.0, rel=0.05)
    with pytest.raises(InputError, match=naming("kinematic_error_arcmin")):
        load_drive(str(own), kinematic_error_arcmin=2.0)


def test_the_bench_shows_the_stated_error():
    """Transmission error of a slow loaded turn: 1 arcmin and a ripple, or neither."""
    keys = {"defaults.drive": "CSG-25-100", "simulation.duration_s": 5.0}
    shown = run_scene("bench", overrides=keys).metrics()["joints"]["joint"]
    assert shown["transmission_error_arcmin"]["pp"] == pytest.approx(1.0, rel=0.1)
    assert shown["ripple_pp_percent"] > 0.1
    keys |= {"defaults.kinematic_error_arcmin": 0.0}
    shown = run_scene("bench", overrides=keys).metrics()["joints"]["joint"]
    assert shown["transmission_error_arcmin"]["pp"] < 0.01


def test_a_run_names_what_is_left_out_once(capsys):
    """One line for all joints, with the key that brings it back."""
    keys = [*SHORT, "--set", "defaults.friction=false"]
    assert main(["run", "two-link", "--drive", "CSG-25-100", *keys]) == 0
    lines = [x for x in capsys.readouterr().out.splitlines() if "not simulated" in x]
    (line,) = (x for x in lines if "friction of the drive" in x)
    assert names(line, "joints.*.friction", "false")


def test_contents_say_where_the_error_comes_from():
    """Assumed with size and seed; switched off, one line names the key."""
    found = contents(assemble(Scene.from_data(SCENE)))
    for joint, part in found["joints"].items():
        assert names(part["kinematic_error"], "assumed", "1 arcmin", "seed 0", joint)
    assert left_out_lines(found) == []
    keys = {"defaults.kinematic_error_arcmin": 0.0, "defaults.friction": False}
    lines = left_out_lines(contents(assemble(Scene.from_data(SCENE, overrides=keys))))
    assert len(lines) == 2
    for key in ("kinematic_error_arcmin", "friction"):
        (line,) = (one for one in lines if key in one)
        assert names(line, f"joints.*.{key}")
    one = keys | {"joints.elbow.friction": True}
    lines = left_out_lines(contents(assemble(Scene.from_data(SCENE, overrides=one))))
    (line,) = (text for text in lines if "friction" in text)
    assert names(line, "(shoulder)")


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("shoulder_", "did you mean shoulder?"),
        ("*", "'defaults', e.g. defaults.friction"),
    ],
)
def test_a_wrong_joint_points_to_what_was_meant(name, hint):
    scene = Scene.from_data(SCENE | {"joints": {name: {"friction": False}}})
    with pytest.raises(InputError, match=hint.replace("?", r"\?")):
        assemble(scene)
