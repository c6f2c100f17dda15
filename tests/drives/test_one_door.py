"""The same design gives the same map and the same sheet, whoever asks."""

from __future__ import annotations

import json
from dataclasses import replace

import mujoco
import pytest
from known_samples import samples_of
from messages import naming

import swgjoint
from swgjoint.cli.main import main
from swgjoint.drives import solve_map as solving
from swgjoint.drives.references import load_drive
from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.maps.file import map_bytes
from swgjoint.sim.assembly import assemble
from swgjoint.sim.scene.scene import Scene


@pytest.fixture
def design(monkeypatch, tmp_path):
    """A bundled design whose finite elements give known samples."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path / "cache"))
    design = Design.load("reference-2d")
    info = {"design_hash": design.content_hash()}
    samples = replace(samples_of(), name="reference-2d", info=info)
    monkeypatch.setattr(solving, "sample_map", lambda *_, **__: samples)
    return design


def test_one_map(design, tmp_path):
    """``build_map``, a scene, ``attach`` and the command give equal bytes."""
    wanted = map_bytes(swgjoint.build_map(design))
    assert "no_load_running_torque_Nm" in swgjoint.build_map(design).info["missing"]
    scene = Scene.load_file("bench", {"simulation.duration_s": 0.6})
    in_scene = assemble(scene).transmissions[0].drive
    spec = mujoco.MjSpec.from_string(
        "<mujoco><option timestep='1e-4'/><worldbody><body>"
        "<joint name='j' range='-1 1'/>"
        "<geom size='.1'/></body></worldbody></mujoco>"
    )
    attached = swgjoint.attach(spec, joint="j", drive=design, rotor_inertia=1e-4)
    assert main(["map", "reference-2d", "-o", str(tmp_path / "a.swg"), "--quiet"]) == 0
    written = swgjoint.DriveMap.load(tmp_path / "a.swg")
    for drive in (load_drive("reference-2d"), in_scene, attached.drive, written):
        assert map_bytes(drive) == wanted


@pytest.mark.parametrize("source", ["design", "map", "name", "catalogue"])
def test_one_sheet(design, capsys, tmp_path, source):
    """``swgjoint.spec_sheet`` says what ``swgjoint spec`` prints."""
    path = tmp_path / "a.swg"
    swgjoint.build_map(design).save(path)
    sources = {
        "design": (design, "reference-2d"),
        "map": (swgjoint.DriveMap.load(path), str(path)),
        "name": ("reference-2d", "reference-2d"),
        "catalogue": ("CSG-25-100", "CSG-25-100"),
    }
    given, named = sources[source]
    found = swgjoint.spec_sheet(given)
    assert main(["spec", named, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed.pop("files") == []
    for result in (found, printed):
        assert result.pop("wall_s") >= 0.0
    assert json.loads(json.dumps(found)) == printed


def test_a_fidelity_needs_a_design():
    """A map has its own."""
    said = naming("2d", "CSG-25-100", "catalogue", "a design")
    with pytest.raises(InputError, match=said):
        swgjoint.spec_sheet("CSG-25-100", model="2d")
