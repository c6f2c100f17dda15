"""``swgjoint spec``: figures, files, and no more work than the keys need."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from golden import CASES, load
from messages import names
from validation_record import validated_map

from swgjoint.cli.main import main
from swgjoint.drives import build_map as builder
from swgjoint.drives.references import load_drive
from swgjoint.errors import DesignError, Outcome
from swgjoint.fe.plane.figures import ratcheting
from swgjoint.fe.plane.figures.ratcheting import RatchetingPath
from swgjoint.fe.rings import running as ring_running
from swgjoint.fe.rings.running import RunningFriction
from swgjoint.fe.solid.figures import spec_figures
from swgjoint.fe.solid.figures.fatigue import Fatigue, FatigueLimits, SectionFatigue
from swgjoint.fe.solid.figures.radial_stiffness import RadialStiffness
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors
from swgjoint.gear.shell_theory import (
    SafetyFactor,
    ShellDimensions,
    shell_safety_factor,
)
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.sheet.loop import torque_loop
from swgjoint.maps.sheet.map_validity import NOT_VALIDATED
from swgjoint.units import arcmin

CONTRACT = (
    "K1_Nm_rad K2_Nm_rad K3_Nm_rad T1_Nm T2_Nm hysteresis_loss_arcmin"
    " lost_motion_arcmin transmission_accuracy_arcmin orders ripple_rms_percent"
    " no_load_running_torque_Nm starting_torque_Nm back_driving_torque_Nm"
    " efficiency_percent fatigue_safety_factor radial_stiffness_N_mm wall_s"
).split()


@pytest.fixture
def built(monkeypatch, synthetic_map):
    """Give the command a map without finite elements; the options that it asked for."""
    asked = []

    def build(design, **options):
        asked.append(options)
        return synthetic_map

    monkeypatch.setattr(builder, "build_map", build)
    return asked


def spec(capsys, *arguments: str) -> dict:
    assert main(["spec", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_catalogue_drive(capsys, tmp_path, monkeypatch):
    """The JSON object has every key; null has its reason; the files are there."""
    monkeypatch.chdir(tmp_path)
    result = spec(capsys, "CSG-25-100", "--out", "out")
    assert set(CONTRACT) <= set(result)
    assert result["K1_Nm_rad"] == pytest.approx(3.1e4, rel=0.02)
    assert result["transmission_accuracy_arcmin"] == pytest.approx(1.0, rel=1e-3)
    assert "assumed: 1 arcmin" in result["validity"]["kinematic_error"]
    empty = {k for k in CONTRACT if result[k] is None}
    assert empty <= set(result["missing"])
    assert result["stated"]["transmission_accuracy_arcmin"] == 1.0
    assert result["efficiency_percent"] == pytest.approx(77.0)
    assert result["stated"]["back_driving_torque_Nm"] == 7.26
    assert result["validity"]["running_speed_rpm"] == pytest.approx(2000.0)
    assert result["files"] == ["out/spec.json", "out/spec.png"]
    written = json.loads((tmp_path / "out/spec.json").read_text())
    skip = {"wall_s"}
    assert {k: v for k, v in written.items() if k not in skip} == {
        k: v for k, v in result.items() if k not in skip
    }
    assert (tmp_path / "out/spec.png").read_bytes().startswith(b"\x89PNG")


def test_map_file(capsys, tmp_path, synthetic_map):
    """A saved map gives the sheet of the map that was saved."""
    path = tmp_path / "a.swg"
    synthetic_map.save(path)
    keys = ["K2_Nm_rad", "lost_motion_arcmin"]
    result = spec(capsys, str(path), "--only", ",".join(keys))
    own = synthetic_map.spec_sheet(keys)
    assert [result[k] for k in keys] == [own[k] for k in keys]
    assert "K1_Nm_rad" not in result
    assert result["wall_s"] > 0


def test_only_what_a_design_needs(built, capsys):
    """Ratings need no map; locked-input figures few positions; the turn all of them."""
    assert spec(capsys, "reference-2d", "--only", "T1_Nm")["T1_Nm"] > 0
    absent = spec(capsys, "reference-2d", "--only", "fatigue_safety_factor")
    assert absent["fatigue_safety_factor"] is None
    assert absent["missing"]["fatigue_safety_factor"]
    assert built == []
    spec(capsys, "reference-2d", "--only", "K1_Nm_rad,hysteresis_loss_arcmin,T2_Nm")
    assert built.pop()["angles"] == 3
    spec(capsys, "reference-2d", "--only", "ripple_pp_percent", "--model", "2d")
    options = built.pop()
    assert options["angles"] is None
    assert options["model"] == "2d"


@pytest.fixture
def solid(monkeypatch):
    """Both figures of the solid model at once; the calls that were made."""
    calls = []

    def stiffness(design, progress):
        calls.append(("radial", design.drive.name))
        return RadialStiffness(
            mid_face=65e3,
            open_edge=50e3,
            face_width=66e3,
            outward=67e3,
            inward=64e3,
            force=26.0,
            finer=65.1e3,
            coarser=65.5e3,
            shell=51e3,
        )

    def safety(design, torques, progress):
        calls.append(("fatigue", *torques))
        limits, shell = (
            FatigueLimits.from_design(design),
            ShellDimensions.from_design(design),
        )
        sections = tuple(
            SectionFatigue(
                z=z,
                normal_amplitude=2e8,
                normal_mean=0.0,
                axial_amplitude=0.0,
                shear_amplitude=0.0,
                shear_mean=0.0,
                safety=SafetyFactor(normal=S, shear=9.0, combined=S),
            )
            for z, S in ((-1e-3, 1.5), (0.0, 2.0))
        )
        theory = shell_safety_factor(
            shell,
            torques[0],
            bending_limit=limits.bending,
            torsion_limit=limits.torsion,
        )
        return [
            Fatigue(
                torque=torques[0],
                sections=sections,
                amplitude={"root, mid-face": 4e8},
                shell=theory,
                limits=limits,
            )
        ]

    monkeypatch.setattr(spec_figures, "radial_stiffness", stiffness)
    monkeypatch.setattr(spec_figures, "fatigue", safety)
    monkeypatch.setenv("SWGJOINT_CACHE", "")  # not what a test makes up
    return calls


def test_errors_are_left_out_of_figures_at_a_locked_input(
    capsys, monkeypatch, synthetic_map
):
    """No superposition over the cycle of the teeth for a stiffness; for orders, one."""
    asked = []

    def build(design, **options):
        asked.append(has_errors(design))
        return synthetic_map

    monkeypatch.setattr(builder, "build_map", build)
    found = spec(capsys, "reference-2d-tolerances", "--only", "K1_Nm_rad")
    assert found["validity"]["manufacturing_errors"] == "left out"
    spec(capsys, "reference-2d-tolerances", "--only", "orders")
    assert asked == [False, True]


@pytest.mark.parametrize("rubs", [False, True])
def test_a_sheet_says_that_its_ripple_has_no_friction(
    capsys, monkeypatch, synthetic_map, rubs
):
    """Maps of finite elements carry the friction of the teeth as hysteresis alone."""
    label = {"model": "2d", "friction": "left out of the potential" if rubs else None}
    drive = replace(synthetic_map, info={**synthetic_map.info, "label": label})
    monkeypatch.setattr(builder, "build_map", lambda design, **options: drive)
    found = spec(capsys, "reference-2d", "--only", "K1_Nm_rad")
    assert found["validity"].get("ripple") == (
        "without friction of the teeth" if rubs else None
    )
    assert main(["spec", "reference-2d", "--only", "K1_Nm_rad", "--quiet"]) == 0
    says = "ripple without friction of the teeth" in capsys.readouterr().out
    assert says == rubs


@pytest.mark.parametrize("key", ["K1_Nm_rad", "T1_Nm"])
@pytest.mark.parametrize("left_out", ["", "wave_generator.bearing, more"])
def test_a_sheet_says_that_its_stiffness_has_no_bearing(
    capsys, monkeypatch, synthetic_map, left_out, key
):
    """Maps of the 3D model have a rigid wave generator, which triples K1."""
    label = {"model": "3d", "left_out": left_out}
    drive = replace(synthetic_map, info={**synthetic_map.info, "label": label})
    monkeypatch.setattr(builder, "build_map", lambda design, **options: drive)
    assert main(["spec", "reference-3d", "--only", key, "--quiet"]) == 0
    says = "rigid wave generator" in capsys.readouterr().out
    assert says == (bool(left_out) and key == "K1_Nm_rad")


def test_figures_of_the_solid_model(built, solid, capsys):
    """Each alone computes nothing else; details stand beside them."""
    found = spec(capsys, "xb1-100-80", "--only", "radial_stiffness_N_mm")
    assert found["radial_stiffness_N_mm"] == 65.0
    assert found["radial_stiffness"]["open_edge_N_mm"] == 50.0
    assert solid == [("radial", "xb1-100-80")]
    found = spec(capsys, "stress-cup", "--only", "fatigue_safety_factor,T1_Nm")
    assert found["fatigue_safety_factor"] == 1.5  # the worst section
    assert found["fatigue"]["mid_face"]["S"] == 2.0
    assert found["fatigue"]["S_without_factors_mid_face"] == 2.0
    assert solid[1:] == [("fatigue", pytest.approx(86.85, abs=0.01))]
    assert built == []
    assert found["missing"] == {}
    keys = "radial_stiffness_N_mm,fatigue_safety_factor"
    assert main(["spec", "stress-cup", "--only", keys]) == 0
    out = capsys.readouterr().out
    assert (
        "open edge 50," in out
        and "half the elements 65.5," in out
        and "2 at mid-face (200 MPa)" in out
    )


def test_figures_of_the_solid_model_are_kept(solid, capsys, monkeypatch, tmp_path):
    """Each takes minutes: the same sheet is there at once, another torque is not."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    keys = "radial_stiffness_N_mm,fatigue_safety_factor"
    first, second = (spec(capsys, "stress-cup", "--only", keys) for _ in range(2))
    assert len(solid) == 2
    for key in (*keys.split(","), "radial_stiffness", "fatigue"):
        assert second[key] == first[key]
    design = Design.load("stress-cup")
    spec_figures.solid_figures(design, keys.split(","), 1.0)
    assert solid[2:] == [("fatigue", 1.0)]


def test_reasons_of_the_solid_model(built, capsys):
    """No cup, no endurance limits, the plane model asked for: null with the reason."""
    keys = "radial_stiffness_N_mm,fatigue_safety_factor"
    for arguments, reason in (
        (["reference-2d"], "needs a design with a [cup]"),
        (["xb1-100-80", "--model", "2d"], "needs the 3d model, not --model 2d"),
        (["CSG-25-100"], "a map contains torque and torsion only"),
    ):
        found = spec(capsys, *arguments, "--only", keys)
        for key in keys.split(","):
            assert found[key] is None
            assert reason in found["missing"][key]
    assert built == []
    found = spec(capsys, "xb1-100-80", "--only", "fatigue_safety_factor")
    assert "fatigue_limit_bending_MPa" in found["missing"]["fatigue_safety_factor"]


def test_radial_stiffness_of_xb1():
    """The figure itself, within the 1 % that mesh and displacements leave.

    A slow test of ``tests/golden`` runs the command and compares with this result.
    """
    found = load("spec-radial")
    command = ["spec", "xb1-100-80", "--only", "radial_stiffness_N_mm"]
    assert found["command"] == command == CASES["slow"]["spec-radial"]
    assert found["result"]["radial_stiffness_N_mm"] == pytest.approx(65.4, rel=0.01)


def test_report(capsys, tmp_path, synthetic_map):
    """The terminal shows figures with units, orders, reasons and stated values."""
    path = tmp_path / "a.swg"
    synthetic_map.save(path)
    assert main(["spec", str(path)]) == 0
    out = capsys.readouterr().out
    assert "spec sheet of synthetic" in out.splitlines()[0]
    assert "N·m/rad" in out
    assert "strongest orders" in out
    assert "- radial stiffness: needs the finite elements" in out
    assert main(["spec", "CSG-25-100", "--only", "K1_Nm_rad"]) == 0
    (row,) = (r for r in capsys.readouterr().out.splitlines() if r.startswith("K1"))
    assert row.split() == ["K1", "3.115e+04", "3.1e+04", "N·m/rad"]


@pytest.mark.parametrize("rubs", [False, True])
def test_friction_that_a_map_lacks_is_named(capsys, tmp_path, synthetic_map, rubs):
    """Loop figures of a design with friction say if the map has no hysteresis.

    The loop of a map with a clearance has a width without it.
    """
    lacks = "friction of the teeth gives no hysteresis: clearance"
    info = {
        **synthetic_map.info,
        "label": {"friction": "left out of the potential" if rubs else None},
        "missing": {"hysteresis_loss_arcmin": lacks},
    }
    path = tmp_path / "a.swg"
    synthetic_map.with_parts(info=info).save(path)
    assert main(["spec", str(path), "--only", "K1_Nm_rad"]) == 0
    assert (f"torque loop: {lacks}" in capsys.readouterr().out) == rubs
    assert main(["spec", str(path), "--only", "K1_Nm_rad", "--json"]) == 0
    source = json.loads(capsys.readouterr().out)["validity"]["hysteresis"]
    assert source == (f"none: {lacks}" if rubs else "none")
    run = ["run", "bench", "--set", f"defaults.drive={path}"]
    assert main([*run, "--set", "simulation.duration_s=0.7", "--json"]) in (0, 1)
    left = json.loads(capsys.readouterr().out)["contains"]["left_out"]
    assert any(item["reason"] == lacks for item in left) == rubs


def test_report_of_losses(capsys):
    """Losses stand with their conditions and source, or with the reason."""
    keys = "starting_torque_Nm,back_driving_torque_Nm"
    assert main(["spec", "CSG-25-100", "--only", keys]) == 0
    out = capsys.readouterr().out
    (row,) = (r for r in out.splitlines() if r.startswith("starting"))
    assert row.split() == ["starting", "torque", "0.06903", "0.069", "N·m"]
    assert "at 2000 rpm" in out and "prediction" in out
    assert main(["spec", "CSG-25-50", "--only", keys]) == 0
    assert "the map has no friction" in capsys.readouterr().out


def test_a_built_map_names_what_bending_alone_takes(built, capsys):
    """Finite elements have no friction; the reason has the loss of the bent rim."""
    keys = "starting_torque_Nm,K1_Nm_rad"
    result = spec(capsys, "reference-2d", "--only", keys)
    assert result["starting_torque_Nm"] is None
    assert "takes about 0.049 mN·m" in result["missing"]["starting_torque_Nm"]
    assert spec(capsys, "reference-2d", "--only", "starting_torque_Nm")["missing"]
    assert len(built) == 1


@pytest.fixture
def turning(monkeypatch):
    """Friction of a design that turns slowly, at once; the designs that were asked."""
    asked = []

    def friction(design):
        asked.append(design)
        if not design.wave_generator.bearing:
            raise DesignError("no bearing\nno cam")
        return RunningFriction(
            input_angle=np.zeros(2),
            elastic=np.array([0.004, -0.004]),
            teeth=np.array([0.1, 0.2]),
            race=np.array([0.3, 0.6]),
            tooth_pairs=np.array([2.0, 4.0]),
            lobe_force=np.full((2, 2), 100.0),
            bending=np.full(2, 0.09),
            bearing=BallBearing.from_design(design),
        )

    monkeypatch.setattr(ring_running, "running_friction", friction)
    return asked


def rubbing_file(tmp_path, name):
    """A bundled design with a coefficient of friction, as a file."""
    design = Design.preset(name).with_changes({"friction.tooth_coefficient": 0.1})
    path = tmp_path / "rubs.toml"
    path.write_text(design.to_toml())
    return str(path)


def test_slow_running_of_a_design(built, turning, capsys, tmp_path):
    """A lower bound is no figure, but told with its parts; no map is built."""
    path = rubbing_file(tmp_path, "size-25-100")
    key = "no_load_running_torque_Nm"
    found = spec(capsys, path, "--only", key)
    assert found[key] is None and "starting_torque_Nm" not in found
    assert list(found["missing"]) == [key]
    slow = found["running"]
    balls = min(slow["balls_Nm"])
    assert 0.01 < balls < 0.03
    told = f"more than {0.06 + balls:.3g} N·m (friction of teeth"
    assert found["missing"][key].startswith(told)
    assert slow["coefficient"] == 0.1 and slow["bound"] == "lower"
    assert [slow["teeth_Nm"], slow["race_Nm"]] == pytest.approx([0.015, 0.045])
    assert slow["teeth_share"] == pytest.approx(0.25)
    both = spec(capsys, path, "--only", f"starting_torque_Nm,{key}")
    assert slow["starting_torque_Nm"] == pytest.approx(0.076, abs=0.003)
    told = f"more than {slow['starting_torque_Nm']:.3g} N·m"
    assert told in both["missing"]["starting_torque_Nm"]
    assert slow["running_torque_Nm"] == pytest.approx(0.06 + balls)
    assert built == []
    assert main(["spec", path, "--only", key]) == 0
    out = capsys.readouterr().out
    assert "teeth (25 %)" in out and "lower bound" in out
    assert "not included: churning" in out


def test_reasons_of_slow_running(built, turning, capsys, tmp_path):
    """No coefficient, no bearing, a map without friction: null with the reason."""
    key = "no_load_running_torque_Nm"
    for argument, reason in (
        ("size-25-100", "no friction with friction.tooth_coefficient = 0"),
        (rubbing_file(tmp_path, "reference-2d"), "no bearing; no cam"),
        ("CSG-25-50", "ratio 100"),
    ):
        found = spec(capsys, argument, "--only", key)
        assert found[key] is None
        assert reason in found["missing"][key]
        assert "running" not in found
    assert len(turning) == 1
    found = spec(capsys, "reference-2d", "--only", f"{key},K1_Nm_rad")
    assert "no friction with" in found["missing"][key]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["CSG-26-100"], ("'CSG-26-100'", "ratings.csv", "CSG-25-100")),
        (["SHG-25-100"], ("'SHG-25-100'", "ratings", "CHA", "CSG", "CSG-25-100")),
        (["none.swg"], ("none.swg", "No such file")),
        (["refrence-2d"], ("'refrence-2d'", "models/drives", "reference-2d")),
        (["CSG25100.toml"], ("'CSG25100.toml'", "models/drives", "reference-2d")),
        (
            ["CSG-25-100", "--model", "2d"],
            ("'2d'", "'CSG-25-100'", "'catalogue'", "design"),
        ),
        (["CSG-25-100", "--only", "K1_Nm_ra"], ("'K1_Nm_ra'", "K1_Nm_rad", "T1_Nm")),
        (["CSG-25-100", "--only", ""], ("key", "''", "T1_Nm", "K1_Nm_rad")),
        (["a\0b"], ("'a\\x00b'", "path", "size-NN-RRR")),
        (["CSG-25-100", "--out", "file/x"], ("folder", "'file/x'", "'file'")),
    ],
)
def test_bad_input(capsys, tmp_path, monkeypatch, arguments, message):
    """One line on stderr, status 2, nothing written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    assert main(["spec", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert names(err, *message)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_scenes_resolve_the_same_references(tmp_path, monkeypatch, synthetic_map):
    """A catalogue name, a map file; an existing file goes before the catalogue."""
    assert load_drive("CSG-25-100").name == "CSG-25-100"
    path = tmp_path / "a.swg"
    synthetic_map.save(path)
    assert load_drive(str(path)).name == "synthetic"
    seen = []

    def build(design, **options):
        seen.append(design)
        return DriveMap.linear(1e4)

    monkeypatch.setattr(builder, "build_map", build)
    monkeypatch.chdir(tmp_path)
    from swgjoint.models_path import models_path

    text = (models_path() / "drives" / "reference-2d.toml").read_text()
    (tmp_path / "CSG-25-100").write_text(text)
    assert load_drive("CSG-25-100").name == "linear"
    assert isinstance(seen[0], Design)


def loop_file(path, drive, *, factor=1.0):
    """A loop as a rig would write it."""
    loop = torque_loop(drive)
    rows = [
        f"{torque:.17g},{factor * x / arcmin:.17g}"
        for torque, x in zip(loop.torque, loop.torsion, strict=True)
    ]
    path.write_text("\n".join(["torque_Nm,torsion_arcmin", *rows]) + "\n")
    return str(path)


def test_a_measured_loop_over_a_map(capsys, tmp_path, synthetic_map):
    """Residual by segment, both K, a picture; nothing is left of the map's own loop."""
    synthetic_map.save(tmp_path / "a.swg")
    own = loop_file(tmp_path / "own.csv", synthetic_map)
    drive, out = str(tmp_path / "a.swg"), str(tmp_path / "out")
    result = spec(capsys, drive, "--only", "T1_Nm", "--measured", own, "--out", out)
    found = result["measured"]
    assert found["largest_arcmin"] < 1e-8
    assert [row["segment"] for row in found["segments"]] == ["K1", "K2", "K3"]
    assert [row["to_Nm"] for row in found["segments"]] == pytest.approx([10, 30, 100])
    assert result["files"][-1] == f"{out}/measured.png"
    assert (tmp_path / "out/measured.png").read_bytes().startswith(b"\x89PNG")
    soft = loop_file(tmp_path / "soft.csv", synthetic_map, factor=1.25)
    found = spec(capsys, drive, "--measured", soft)["measured"]
    for row in found["segments"]:
        ratio = row["K_predicted_Nm_rad"] / row["K_measured_Nm_rad"]
        assert ratio == pytest.approx(1.25, rel=1e-6)
    assert main(["spec", drive, "--measured", soft]) == 0
    assert "residual rms" in capsys.readouterr().out


SHUFFLED = "torque_Nm,torsion_rad\n" + "".join(
    f"{torque},{torque / 2e4}\n"
    for torque in np.random.default_rng(1).permutation(np.linspace(-80.0, 80.0, 60))
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, ("a.csv", "No such file")),
        ("torque_Nm,twist\n1,2\n", ("a.csv", "torsion_arcmin", "torsion_rad")),
        (
            "torque_Nm,torsion_rad\n" + "1,2\n" * 9,
            ("a.csv", "torque_Nm", "1 N·m", "both signs"),
        ),
        (
            "torque_Nm,torsion_rad\n1,x\n",
            ("a.csv", "line 2", "torsion_rad", "'x'", "finite"),
        ),
        (SHUFFLED, ("a.csv", "torque_Nm", "39 times", "60 samples", "time")),
    ],
)
def test_a_bad_loop_is_one_line(capsys, tmp_path, text, words):
    """Exit status 2 before anything is computed, no folder left behind."""
    path = tmp_path / "a.csv"
    if text is not None:
        path.write_text(text)
    out = tmp_path / "out"
    # a design: finite elements would take minutes
    arguments = ["spec", "size-25-100", "--measured", str(path), "--out", str(out)]
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert names(said, *words)
    assert said.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize("passes", [True, False])
def test_ratcheting_torque_of_a_design(capsys, monkeypatch, tmp_path, passes):
    """The limit where it was passed, else null and the lower bound in the reason."""
    torque = [0.0, 400.0, 500.0, 450.0] if passes else [0.0, 400.0, 500.0, 600.0]
    path = RatchetingPath(
        turned=np.arange(4) * 1e-3,
        torque=np.array(torque),
        energy=np.zeros(4),
        offset=np.zeros((4, 2)),
        pairs=np.arange(4),
        pitch=1e-2,
        outcome=Outcome.CONVERGED if passes else Outcome.ACTIVE_SET_CYCLES,
    )
    calls = []

    def search(design, **_):
        calls.append(design)
        return path

    monkeypatch.setattr(ratcheting, "ratcheting_path", search)
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    key = "ratcheting_torque_Nm"
    result = spec(capsys, "size-25-100", "--only", key)
    if passes:
        assert result[key] == pytest.approx(path.limit) and path.limit > 500.0
        assert result["ratcheting"]["at_largest_pitches"] == pytest.approx(0.2)
    else:
        assert result[key] is None
        assert "more than 600 N·m" in result["missing"][key]
    assert key in spec(capsys, "CSG-25-100")["missing"]
    assert main(["spec", "size-25-100", "--only", key]) == 0
    out = capsys.readouterr().out
    # teeth where the torque is largest, not where the path ends
    where = "0.2 of a pitch, with 2" if passes else "0.3 of a pitch, with 3"
    assert f"ratcheting: the torque is largest after {where} teeth in contact" in out
    assert ("the search ended before a maximum" in out) is not passes
    assert len(calls) == 1  # it takes minutes: kept


def test_the_sheet_does_not_call_predictions_measured(capsys):
    assert main(["spec", "CSG-25-100", "--only", "K1_Nm_rad"]) == 0
    header = capsys.readouterr().out.splitlines()[1]
    assert "predicted" in header
    assert "measured" not in header


def test_figures_that_a_map_misses_are_marked(capsys, tmp_path, synthetic_map):
    """Uncertain accuracy and stiffness with a sign, a ripple that is not valid none."""
    path = tmp_path / "a.swg"
    validated_map(synthetic_map, {50.0: (0.4, 0.2)}, 0.12).save(path)
    assert main(["spec", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()

    def row(start: str) -> list[str]:
        return next(line for line in lines if line.startswith(start)).split()

    assert (
        row("K1")[1] == "~" and row("transmission accuracy at rated torque")[5] == "~"
    )
    assert row("output torque ripple, rms")[4] == "-"
    assert any(names(line, "not valid", "50 N·m", "40 %") for line in lines)
    assert any(names(line, "~", "12 %", "K1", "K2", "K3") for line in lines)
    result = spec(capsys, str(path), "--only", "K1_Nm_rad")
    assert set(result["uncertain"]) == {"K1_Nm_rad"}
    assert result["validation_notes"] == []


def test_a_good_map_says_against_what_it_was_validated(capsys, tmp_path, synthetic_map):
    """One line, no mark; a map without a record has the phrase in the head."""
    path = tmp_path / "a.swg"
    validated_map(synthetic_map, {50.0: (0.04, 0.02)}).save(path)
    assert main(["spec", str(path)]) == 0
    text = capsys.readouterr().out
    assert text.count("unseen") == 1 and "~" not in text and "!" not in text
    replace(synthetic_map, info={"validation": {"solves": -1}}).save(path)
    assert main(["spec", str(path)]) == 0
    assert names(capsys.readouterr().out, NOT_VALIDATED, "validation.rows")
    synthetic_map.save(path)
    assert main(["spec", str(path)]) == 0
    head, *rest = capsys.readouterr().out.splitlines()
    assert NOT_VALIDATED in head and not any("unseen" in line for line in rest)
    assert main(["spec", str(path), "--only", "T1_Nm"]) == 0
