"""A design with ``[losses]``: its table, its map, its spec sheet, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.drives import build_map as builder
from swgjoint.drives import solve_map as solving
from swgjoint.drives.spec_sheet import measure_drive
from swgjoint.errors import DesignError
from swgjoint.fe.rings import losses as ring_losses
from swgjoint.fe.rings.losses import LossModel
from swgjoint.fe.rings.running import RunningFriction
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.losses import LossConditions
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction_temperature import KEY, at_temperature
from swgjoint.maps.sheet.friction_running import (
    efficiency,
    no_load_running_torque,
)
from swgjoint.view.plots.spec import spec_picture

OIL = {"base_oil_40C_mm2_s": 37.0, "base_oil_100C_mm2_s": 5.9}
PLAIN = Design.preset("size-25-100")
DESIGN = PLAIN.with_changes({"losses": {**OIL, "temperature_C": 31.0}})


def loss_model(design, *, progress=None):
    """Losses of a design without finite elements: balls and bending only."""
    if design.drive.name == "broken":
        raise DesignError("broken: the ring model expects something else")
    load = np.array([0.0, 40.0, 87.0])
    one = np.ones(2)
    return LossModel(
        load=load,
        cases=tuple(
            RunningFriction(
                input_angle=np.arange(2.0),
                elastic=one * T / -100.0,
                teeth=0.0 * one,
                race=0.0 * one,
                tooth_pairs=one,
                lobe_force=np.full((2, 2), 80.0 + 13.0 * T),
                bending=0.1 * one,
                bearing=BallBearing.from_design(design),
            )
            for T in load.tolist()
        ),
        ratio=design.ratio,
        mu=0.0,
        conditions=LossConditions.from_section(design.losses),
    )


@pytest.fixture
def without_elements(monkeypatch):
    """Cached map and losses instead of finite elements."""
    missing = {"efficiency_percent": "none", "orders": "kept"}
    plain = replace(DriveMap.linear(2e4, rated_torque=87.0), info={"missing": missing})
    monkeypatch.setattr(builder, "cache_map", lambda parts, build, name: plain)
    monkeypatch.setattr(solving, "loss_model", loss_model)
    monkeypatch.setattr(ring_losses, "loss_model", loss_model)
    return plain


def test_a_design_without_the_table_is_the_same_design():
    """Absent table, same hash; every key of the table changes the hash."""
    assert DESIGN.with_changes({"losses": None}).content_hash() == PLAIN.content_hash()
    hashes = {
        PLAIN.with_changes({"losses": {**OIL, **more}}).content_hash()
        for more in (
            {},
            {"grease": "flooded"},
            {"temperature_C": 31.0},
            {"bending_loss_factor": 2e-3},
            {"seal_torque_mNm": 1.0},
        )
    }
    assert len(hashes | {PLAIN.content_hash()}) == 6
    assert Design.from_toml(DESIGN.to_toml()).content_hash() == DESIGN.content_hash()


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"base_oil_100C_mm2_s": 40.0}, ("base_oil_100C_mm2_s", "below", "37")),
        ({"base_oil_40C_mm2_s": 0.5}, ("base_oil_40C_mm2_s", "mm²/s", ">= 2")),
        ({"temperature_C": 300.0}, ("temperature_C", "°C", "80")),
        (
            {"temperature_C": -15.0, "grease": "flooded"},
            ("temperature_C: -15 °C", "500 mm²/s", ">= -2.0 °C", "run_in"),
        ),
        ({"grease": "wet"}, ("grease", "run_in", "flooded")),
        ({"seal_torque_mNm": -1.0}, ("seal_torque_mNm", "mN·m", ">= 0")),
    ],
)
def test_values_that_are_refused(change, named):
    """One line with key, value, unit and what is accepted."""
    with pytest.raises(DesignError) as failure:
        PLAIN.with_changes({"losses": {**OIL, **change}})
    (line,) = str(failure.value).splitlines()
    assert all(word in line for word in named), line


def test_map_with_the_friction_of_the_design(without_elements):
    """Exact at the temperature of the design, within 1 % of the model at others."""
    drive = builder.build_map(DESIGN, model="ring")
    model = loss_model(DESIGN)
    assert drive.info["design_hash"] == DESIGN.content_hash()
    assert drive.info["missing"] == {"orders": "kept"}
    for celsius, close in ((31.0, 1e-9), (-17.0, 0.01), (57.5, 0.01)):
        one = at_temperature(drive, celsius + 273.15, where="")
        stated = model.catalogue_losses(celsius + 273.15)
        assert no_load_running_torque(one) == pytest.approx(
            stated.no_load_running, rel=close
        )
        assert efficiency(one, 87.0) == pytest.approx(stated.efficiency, rel=close)
    assert at_temperature(drive, 304.15, where="").friction == drive.friction


def test_a_failure_becomes_the_reason(without_elements):
    """No friction, and the sheet says why."""
    broken = DESIGN.with_changes({"drive.name": "broken"})
    drive = builder.build_map(broken, model="ring")
    assert drive.friction is None and KEY not in drive.info
    assert "expects something else" in drive.info["missing"]["efficiency_percent"]


def test_spec_sheet_without_and_with_a_map(without_elements):
    """The same figures; the table, the parts, two panels more in the picture."""
    keys = ["efficiency_percent", "no_load_running_torque_Nm", "starting_torque_Nm"]
    alone = measure_drive(DESIGN, only=keys)
    whole = measure_drive(DESIGN, model="ring", only=[*keys, "back_driving_torque_Nm"])
    for key in keys:
        assert alone.result[key] == whole.result[key] is not None
    assert whole.result["back_driving_torque_Nm"] > 0.0
    table = alone.result["efficiency"]
    assert table["temperature_C"] == [0.0, 20.0, 40.0, 60.0]
    assert np.shape(table["efficiency_percent"]) == (4, 4, 2)
    assert set(alone.result["losses"]["friction_Nm"]) >= {"balls", "bending", "drag"}
    small = spec_picture("a", alone.sheet)
    large = spec_picture("a", alone.sheet, alone.efficiency)
    widths = [int.from_bytes(png[16:20], "big") for png in (small, large)]
    assert widths[1] > 1.5 * widths[0]
    assert "losses" not in measure_drive(PLAIN, only=["T1_Nm"]).result
