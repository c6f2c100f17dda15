"""Losses of a drive over load, speed and temperature: hand sums, twins, limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming
from solved import hundred_elements

from swgjoint.drives import solve_map
from swgjoint.errors import DesignError
from swgjoint.fe.rings import losses as ring_losses
from swgjoint.fe.rings.losses import LossModel, loss_model
from swgjoint.fe.rings.running import RunningFriction, running_friction
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.bearing.base_oil import BaseOil
from swgjoint.gear.bearing.rolling_friction import GreasedBearing
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.losses import LossConditions
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.friction_bending import cup_bending_energy
from swgjoint.maps.fit.friction_fit import friction_of_losses
from swgjoint.maps.sheet.efficiency import efficiency_of_map
from swgjoint.maps.sheet.friction_running import (
    RUNNING_SPEED,
    efficiency,
    no_load_running_torque,
    starting_torque,
)
from swgjoint.units import ZERO_CELSIUS, rpm

BEARING = BallBearing.from_design(Design.preset("size-25-100"))
CONDITIONS = LossConditions(
    base_oil=BaseOil(at_40=37e-6, at_100=5.9e-6),
    flooded=True,
    temperature=20.0 + ZERO_CELSIUS,
    loss_factor=2e-3,
    seal_torque=0.004,
)
LOADS = np.array([0.0, 40.0, 80.0])
WARM = 45.0 + ZERO_CELSIUS


def case(load):
    """Two angles; teeth, race and balls in proportion to the load."""
    ones = np.array([0.9, 1.1])
    return RunningFriction(
        input_angle=np.arange(2.0),
        elastic=load / -100.0 + np.array([-0.01, 0.01]),
        teeth=0.004 * load * ones,
        race=0.001 * (1.0 + load) * ones,
        tooth_pairs=np.ones(2),
        lobe_force=np.full((2, 2), 80.0 + 15.0 * load),
        bending=np.full(2, 0.08 + 0.001 * load),
        bearing=BEARING,
    )


MODEL = LossModel(
    load=LOADS,
    cases=tuple(case(load) for load in LOADS.tolist()),
    ratio=-100.0,
    mu=0.1,
    conditions=CONDITIONS,
)


def test_sum_of_the_parts_by_hand():
    """Each part on its own formula; input 0.8 N·m at 80 N·m and ratio 100."""
    speed = 1500.0 * rpm
    nu = CONDITIONS.base_oil.viscosity(WARM)
    bearing = GreasedBearing.from_bearing(BEARING, nu)
    lobe = bearing.friction_torque(80.0 + 15.0 * 80.0, speed)
    hand = 0.1 * (0.004 * 80.0 + 0.001 * 81.0) + 2.0 * lobe
    hand += bearing.drag_torque(speed) + 2e-3 * 0.16 + 0.004
    assert MODEL.friction(speed, WARM)[-1] == pytest.approx(hand, rel=1e-12)
    found = MODEL.efficiency(speed, WARM)
    assert found[-1] == pytest.approx(0.8 / (0.8 + hand), rel=1e-12)
    assert found[0] == 0.0


def test_only_the_lubricant_knows_the_temperature():
    """Balls and drag change, everything else stays; without a bath nothing drags."""
    cold, warm = (MODEL.parts(200.0, CONDITIONS.temperature + d) for d in (0.0, 25.0))
    for key in ("teeth", "race", "bending", "seals"):
        assert np.array_equal(cold[key], warm[key])
    assert (cold["drag"] > warm["drag"]).all()
    assert (cold["balls"] != warm["balls"]).all()
    run_in = replace(MODEL, conditions=replace(CONDITIONS, flooded=False))
    assert (run_in.parts(200.0, WARM)["drag"] == 0.0).all()
    other = MODEL.friction(200.0, WARM) - warm["drag"]
    assert run_in.friction(200.0, WARM) == pytest.approx(other)


def test_table_and_share_of_bending():
    """The table is the function at its nodes; bending over the sum of the parts."""
    found = MODEL.table()
    assert found.efficiency.shape == (4, 4, 2)
    speed, T = found.speed[1], found.temperature[2]
    assert found.efficiency[2, 1] == pytest.approx(MODEL.efficiency(speed, T)[1:])
    content = MODEL.as_dict()
    total = MODEL.friction(RUNNING_SPEED, CONDITIONS.temperature)
    share = 2e-3 * (0.08 + 0.001 * LOADS) / total
    assert content["bending_share"] == pytest.approx(share)
    thick = BaseOil(at_40=400e-6, at_100=30e-6)
    few = replace(MODEL, conditions=replace(CONDITIONS, base_oil=thick)).table()
    assert few.temperature.min() >= thick.temperature(500e-6)
    assert few.efficiency.shape == (2, 4, 2)


@pytest.mark.parametrize("celsius", [5.0, 20.0, 70.0])
def test_a_map_with_this_friction_has_these_losses(celsius):
    """The law of a map returns running torque and efficiency of the model."""
    stated = MODEL.catalogue_losses(celsius + ZERO_CELSIUS)
    film = MODEL.film(celsius + ZERO_CELSIUS)
    law = friction_of_losses(stated, -100.0, source="test", film=film)
    drive = DriveMap.linear(2e4, rated_torque=80.0)
    drive = replace(drive, friction=law)
    assert no_load_running_torque(drive) == pytest.approx(stated.no_load_running)
    assert efficiency(drive, 80.0) == pytest.approx(stated.efficiency)
    assert starting_torque(drive) == pytest.approx(stated.starting)
    assert law.coulomb < law.static and law.viscous > 0.0


def test_starting_torque_is_that_of_the_worst_angle():
    """Elastic torque and friction at rest, angle by angle; the bath is at rest."""
    balls = GreasedBearing.from_bearing(BEARING, 1e-4).friction_torque(80.0, 0.0)
    worst = 0.01 + 0.1 * 0.001 * 1.1 + 2.0 * balls + 2e-3 * 0.08 + 0.004
    assert MODEL.starting_torque() == pytest.approx(worst)


def test_the_cup_bends_with_the_rim():
    """Its torque per loss factor counts under any load and at rest."""
    cup = replace(MODEL, cup_bending=0.03)
    more = cup.friction(200.0, WARM) - MODEL.friction(200.0, WARM)
    assert more == pytest.approx(2e-3 * 0.03 * np.ones(3))
    start = cup.starting_torque() - MODEL.starting_torque()
    assert start == pytest.approx(2e-3 * 0.03)


def test_arrays_survive_the_cache():
    """Values to JSON and back."""
    one = MODEL.cases[1]
    again = RunningFriction.from_json(one.to_json(), BEARING)
    assert np.array_equal(again.lobe_force, one.lobe_force)
    assert again.to_json() == one.to_json()


def test_designs_beyond_the_rings_are_named():
    """No bearing: one line that says what the losses need."""
    oil = {"base_oil_40C_mm2_s": 37.0, "base_oil_100C_mm2_s": 5.9}
    design = Design.preset("reference-2d").with_changes({"losses": oil})
    with pytest.raises(DesignError, match=naming("reference-2d", "losses", "bearing")):
        loss_model(design)


@pytest.mark.slow
def test_losses_of_a_design(monkeypatch):
    """Coefficient, oil and seals of the design; equilibria as without its losses."""
    monkeypatch.setattr(ring_losses, "LOADED_POSITIONS", 1)
    monkeypatch.setattr(ring_losses, "LOADS", (0.5, 1.0))
    oil = {"base_oil_40C_mm2_s": 37.0, "base_oil_100C_mm2_s": 5.9}
    plain = Design.preset("size-25-50")
    design = plain.with_changes(
        {"losses": {**oil, "seal_torque_mNm": 3.0}, "friction.tooth_coefficient": 0.05}
    )
    with hundred_elements():
        model = loss_model(design)
        free = running_friction(plain)
    assert model.cases[0].race == pytest.approx(free.race, rel=1e-9)
    assert model.mu == 0.05
    assert model.cup_bending == pytest.approx(4.0 * cup_bending_energy(plain))
    assert model.conditions.seal_torque == pytest.approx(0.003)
    parts = model.parts(RUNNING_SPEED, model.conditions.temperature)
    assert parts["teeth"][0] == 0.0
    for key in ("teeth", "race", "balls", "bending"):
        assert (np.diff(parts[key]) > 0.0).all()
    assert 0.5 < model.catalogue_losses(model.conditions.temperature).efficiency < 0.95


def test_a_map_states_how_far_its_law_of_friction_is_off(monkeypatch):
    """The largest difference of both tables of the efficiency, in the source."""
    oil = {"base_oil_40C_mm2_s": 25.0, "base_oil_100C_mm2_s": 5.0}
    design = Design.preset("size-25-50").with_changes({"losses": oil})
    drive = DriveMap.from_numbers(stiffness=5e4, rated_torque=51.0, ratio=50)
    drive = drive.with_parts(info={**drive.info, "missing": {}})
    monkeypatch.setattr(ring_losses, "LOADED_POSITIONS", 1)
    with hundred_elements():
        model = loss_model(design)
    monkeypatch.setattr(solve_map, "loss_model", lambda *_, **__: model)
    found = solve_map.with_losses(design, drive, lambda *_: None)
    ours, exact = efficiency_of_map(found), model.table()
    kept = np.isin(np.round(exact.temperature, 6), np.round(ours.temperature, 6))
    off = 100.0 * np.abs(exact.efficiency[kept] - ours.efficiency).max()
    assert 2.0 < off < 50.0
    assert f"within {off:.2g} percentage points" in found.friction.source
    assert "500 to 3500 rpm, 10 to 100 % of the" in found.friction.source
