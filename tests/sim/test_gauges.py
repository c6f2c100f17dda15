"""Strain gauges of a scene: what is read, what is refused, and no trace without."""

from __future__ import annotations

import json

import numpy as np
import pytest

from swgjoint.cli.run import report
from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.gear.gauges import FlexsplineWall
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.assembly import assemble
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import mm
from swgjoint.view.gauges import gauge_notes, gauge_picture, gauge_tables
from swgjoint.view.recording.entities import signals_of
from swgjoint.view.run import run_scene

LINEAR = DriveMap.linear(5e4, teeth_flexspline=120, teeth_circular_spline=122)
KEY = "joints.joint.gauges."
SHORT = {
    "defaults.drive": "map",
    "defaults.level": "linear",
    "simulation.duration_s": 4.5,
}
GAUGES = {
    KEY + "strain": "outline",
    KEY + "flexspline": "reference-3d",
    KEY + "position_mm": 24.0,
}


def run(**gauges):
    """Two input turns at rated torque, with these gauges."""
    stated = {KEY + key: value for key, value in gauges.items()}
    changes = SHORT | (GAUGES | stated if gauges else {})
    return run_scene("bench", overrides=changes, drives={"map": LINEAR})


@pytest.fixture(scope="module")
def one():
    """One exact bridge."""
    return run(bridges=1)


@pytest.fixture(scope="module")
def figures(one):
    """Its figures."""
    return one.metrics()["joints"]["joint"]["gauges"]


def test_reading_is_torque_and_the_shear_that_follows_the_lobes(one, figures):
    """At input and output angle: -sin 2(theta - psi) of the closed form, and beyond."""
    reading, torque = one.gauge_torque(0), one.output_torque[:, 0]
    beta = one.motor_position[:, 0] - one.position[:, 0]
    wall = FlexsplineWall.from_design(Design.load("reference-3d"))
    twist = 3.0 * wall.wall * 1e-3 / (2.0 * wall.radius * wall.length)
    amplitude = twist / wall.torsion_strain()
    left = reading - torque + amplitude * np.sin(2.0 * beta)
    fourth = figures["ripple"][1]["amplitude_Nm"]
    assert np.abs(left).max() == pytest.approx(fourth, rel=0.05)
    assert fourth < 0.04 * amplitude
    assert np.ptp(beta) > 2.0 * np.pi
    # with the circular spline fixed, the flexspline turns against the input
    orders = [line["order"] for line in figures["ripple"]]
    assert orders[:2] == pytest.approx([2.0 * (1 + 1 / 60), 4.0 * (1 + 1 / 60)])
    assert figures["error_Nm"]["pp"] == pytest.approx(2.0 * amplitude, rel=0.02)


@pytest.mark.parametrize(("bridges", "left"), [(2, 2), (3, 6), (5, 10)])
def test_bridges_cancel_orders_of_the_recorded_reading(figures, bridges, left):
    """The strongest order that stays is the first multiple of 2 and the number."""
    more = run(bridges=bridges)
    found = more.metrics()["joints"]["joint"]["gauges"]
    alone = figures["ripple"][left // 2 - 1]["amplitude_Nm"]
    assert found["error_Nm"]["pp"] == pytest.approx(2.0 * alone, rel=0.05)
    stays = [left_of["bridges"] for left_of in found["compensation"]].index(bridges)
    percent = found["compensation"][stays]["ripple_rms_percent"]
    assert percent == pytest.approx(found["error_rms_percent"], rel=0.1)


def test_a_fixed_flexspline_takes_the_reaction(tmp_path, figures):
    """Signal of the other sign, 120/122 as large; whole orders of the input."""
    drive = DriveMap.linear(
        5e4, teeth_flexspline=120, teeth_circular_spline=122, layout="flexspline_fixed"
    )
    design = Design.load("reference-3d").with_changes(
        {"drive.layout": "flexspline_fixed"}
    )
    path = tmp_path / "fixed.toml"
    path.write_text(design.to_toml())
    changes = SHORT | GAUGES | {KEY + "flexspline": str(path), KEY + "bridges": 5}
    fixed = run_scene("bench", overrides=changes, drives={"map": drive})
    found = fixed.metrics()["joints"]["joint"]["gauges"]
    gain = figures["gain_uV_V_Nm"]
    assert found["gain_uV_V_Nm"] == pytest.approx(-gain * 120.0 / 122.0)
    orders = [line["order"] for line in found["ripple"]]
    assert orders[:2] == pytest.approx([2.0, 4.0])
    reading, torque = fixed.gauge_torque(0), fixed.output_torque[:, 0]
    assert np.abs(torque).max() > 50.0
    assert np.abs(reading - torque).max() < 1e-3


def test_contact_is_solved_by_default(tmp_path, figures, monkeypatch):
    """Coarse elements: less shear of two lobes than the outline has, more of four."""
    design = Design.load("reference-3d").with_changes({"mesh.refinement": 0.5})
    path = tmp_path / "coarse.toml"
    path.write_text(design.to_toml())
    changes = SHORT | {KEY + "flexspline": str(path), KEY + "position_mm": 18.0}
    stages = []
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path / "cache"))
    contact = run_scene(
        "bench",
        overrides=changes,
        drives={"map": LINEAR},
        progress=lambda *stage: stages.append(stage),
    )
    strain = [done for name, done, of in stages if "wall strain" in name and of == 2]
    assert strain == [0, 1, 2]
    found = contact.metrics()["joints"]["joint"]["gauges"]
    assert (found["strain"], figures["strain"]) == ("3d", "outline")
    assert found["gain_uV_V_Nm"] == pytest.approx(figures["gain_uV_V_Nm"])
    ratios = [
        line["amplitude_Nm"] / other["amplitude_Nm"]
        for line, other in zip(found["ripple"], figures["ripple"], strict=False)
    ]
    assert 0.65 < ratios[0] < 0.75
    assert 2.9 < ratios[1] < 3.5
    reading, torque = contact.gauge_torque(0), contact.output_torque[:, 0]
    most = sum(line["amplitude_Nm"] for line in found["ripple"])
    assert 0.5 * most < np.abs(reading - torque).max() < 1.001 * most


def test_without_gauges_nothing_changes(one):
    """The same model and the same signals; gauges add one signal."""
    import mujoco

    bare = run()
    models = []
    for assembly in (bare.assembly, one.assembly):
        buffer = np.zeros(mujoco.mj_sizeModel(assembly.model), np.uint8)
        mujoco.mj_saveModel(assembly.model, None, buffer)
        models.append(buffer.tobytes())
    assert models[0] == models[1]
    assert bare.gauge_torque(0) is None
    assert "gauges" not in bare.metrics()["joints"]["joint"]
    assert "gauges" not in bare.contains
    more = set(signals_of(one, 0)) - set(signals_of(bare, 0))
    assert more == {"gauge_torque_Nm"}
    for name, values in signals_of(bare, 0).items():
        assert np.array_equal(values, signals_of(one, 0)[name])
    assert gauge_tables({"bare": bare}) == []


def test_table_and_picture(one):
    """The run states gain, orders, and what 1, 2, 3 and 5 bridges leave."""
    metrics = one.metrics() | {
        "scene": "bench",
        "contains": one.contains,
        "files": [],
        "drive_choice": {},
    }
    text = report(json.loads(json.dumps(metrics)))
    assert "µV/V per N·m" in text
    assert "flexspline of design reference-3d, strain: outline\n" in text
    contact = {"joint": {"gauges": metrics["joints"]["joint"]["gauges"]}}
    contact["joint"]["gauges"] |= {"strain": "3d"}
    (note,) = gauge_notes(contact)
    assert note.endswith("six lobes to a fifth")
    (table,) = gauge_tables({"one": one})
    assert len(table.rows) == 1
    assert len(table.rows[0]) == len(table.header)
    assert gauge_picture(one).startswith(b"\x89PNG")


def refuse(**changes):
    """The message about a scene with these gauges."""
    gauges = {"position_mm": 24.0} | changes
    stated = {KEY + k: v for k, v in gauges.items() if v is not None}
    with pytest.raises(InputError) as caught:
        run_scene("bench", overrides=SHORT | stated, drives={"map": LINEAR})
    (line,) = str(caught.value).splitlines()
    assert "joints.joint.gauges." in line
    return line


def test_unknown_geometry_is_refused():
    """A catalogue drive, a map, and a design without a cup or of another ratio."""
    line = refuse(flexspline="reference-2d")
    assert "flexspline: reference-2d has no [cup]" in line
    assert "ratio -100" in refuse(flexspline="size-25-100")
    changes = SHORT | {"defaults.drive": "CSG-25-100", KEY + "position_mm": 24.0}
    with pytest.raises(InputError, match="'CSG-25-100' does not state the geometry"):
        run_scene("bench", overrides=changes)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("position_mm", 1.0),
        ("position_mm", 41.0),
        ("position_mm", None),
        ("bridges", 0),
        ("gauge_angle_deg", 90.0),
        ("gauge_factor", -2.0),
        ("place_errors_deg", [0.1, 0.2]),
        ("turn_errors_deg", [50.0]),
        ("spacing_deg", 0.0),
    ],
)
def test_bad_values_are_refused_in_one_line(key, value):
    """With the key and what is accepted."""
    line = refuse(flexspline="reference-3d", **{key: value})
    assert f".{key}" in line
    assert "accepted" in line


def test_place_is_kept_in_millimetres():
    """The bridges of a scene in SI units."""
    scene = Scene.from_toml(
        'name = "x"\narm = "bench"\n[defaults]\ndrive = "map"\nlevel = "linear"\n'
        "rotor_inertia_kgm2 = 1e-4\n"
        '[defaults.gauges]\nstrain = "outline"\nflexspline = "reference-3d"\n'
        "position_mm = 20.0\n"
        "bridges = 2\nspacing_deg = 90.0\nturn_errors_deg = [1.0, 0.0]\n"
        '[trajectory]\nkind = "constant_speed"\n'
        "[trajectory.start_deg]\njoint = 0.0\n"
        "[trajectory.speed_deg_s]\njoint = 3.0\n"
        "[simulation]\nduration_s = 1.0\n"
    )
    ring = assemble(scene, drives={"map": LINEAR}).gauges["joint"].ring
    assert ring.place == pytest.approx(20.0 * mm)
    assert ring.angles == pytest.approx([0.0, 0.5 * np.pi])
    assert ring.turns == pytest.approx((np.pi / 180.0, 0.0))
