"""Two drives with a cup that differ only in micro-geometry, side by side."""

from __future__ import annotations

import json

import pytest

from swgjoint.cli.main import main
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.gear.design import Design
from swgjoint.view.solid_plots import contact_forces

pytestmark = [pytest.mark.fe, pytest.mark.slow]

TORQUE = 10.0
SMALL = {
    "drive.teeth_flexspline": 40,
    "drive.teeth_circular_spline": 42,
    "cup.length_mm": 14.0,
    "cup.bore_radius_mm": 7.0,
    "mesh.refinement": 0.5,
    "ratings.rated_torque_Nm": TORQUE,
}
"""Seconds instead of minutes; its short cup cones more, stresses are far above those of
steel."""
RELIEF = {
    "micro_geometry.wave_generator_crowning_um": 60.0,
    "micro_geometry.wave_generator_slope_um": 120.0,
    "micro_geometry.flexspline_crowning_um": 36.0,
}


def at_edges(design):
    """Share of tooth and of wave-generator force in the two outermost planes."""
    run = simulate_meshing(design, model="3d", torque=TORQUE, steps=1, half=True)
    _, *forces = contact_forces(run.model, run.setup[2].state)
    planes = [force.sum(axis=0) for force in forces]
    return [float((of[0] + of[-1]) / of.sum()) for of in planes]


def test_micro_geometry_shows_with_the_sign_of_the_contact_pattern(
    tmp_path, capsys, monkeypatch
):
    """Contact leaves the edges: less stress, play, so a lower stiffness from zero."""
    monkeypatch.setattr("swgjoint.study.compare.STRESS_POSITIONS", 2)
    monkeypatch.setattr("swgjoint.fe.sampling.SOLID_ANGLES", 4)
    initial = Design.load("reference-3d").with_changes(SMALL)
    designs = {"initial": initial, "relieved": initial.with_changes(RELIEF)}
    for name, design in designs.items():
        (tmp_path / f"{name}.toml").write_text(design.to_toml(), encoding="utf-8")
    files = [str(tmp_path / f"{name}.toml") for name in designs]
    short = ["simulation.duration_s=1.5", "trajectory.settle_s=0.3"]
    options = [part for change in short for part in ("--set", change)]
    assert main(["compare", *files, *options, "--json"]) == 0
    before, after = json.loads(capsys.readouterr().out)["rows"]

    # the pattern: a straight cup bears on its edges, a relieved one inside
    (teeth, wave), (teeth_after, wave_after) = (at_edges(d) for d in designs.values())
    assert teeth > 0.95 and wave > 0.8
    assert teeth_after < 0.7 and wave_after < 0.2
    # the edges carried the stress
    assert after["von_mises_MPa"] < 0.7 * before["von_mises_MPa"]
    # edges that wedge the teeth leave no play; without them the teeth are free first
    assert after["K1_Nm_rad"] < 0.5 * before["K1_Nm_rad"]
    # the pattern does not decide its sign: play adds, a wider contact takes away
    ripple = after["ripple_rms_percent"] / before["ripple_rms_percent"]
    assert not 0.9 < ripple < 1.1
