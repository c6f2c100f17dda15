"""Friction of a map over temperature: nodes, interpolation, refusals, files."""

from __future__ import annotations

from dataclasses import replace

import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.gear.bearing.base_oil import MAKER_GREASES, ROOM
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.friction_temperature import KEY, at_temperature, friction_table
from swgjoint.maps.sheet.efficiency import efficiency_of_map
from swgjoint.maps.sheet.friction_running import (
    RUNNING_SPEED,
    no_load_running_torque,
    starting_torque,
)
from swgjoint.units import ZERO_CELSIUS


def law(viscous):
    return Friction(
        stiffness=50.0, coulomb=0.05, static=0.06, viscous=viscous, load=0.1
    )


LAWS = {
    T + ZERO_CELSIUS: law(v) for T, v in ((0.0, 4e-3), (20.0, 1e-3), (40.0, 0.5e-3))
}
TABLE = friction_table(LAWS, lubricant="an oil")
DRIVE = replace(DriveMap.linear(2e4), friction=LAWS[ROOM], info={KEY: TABLE})


def test_nodes_and_the_geometric_mean_between_them():
    """Each law at its own temperature; half way the mean of the logarithms."""
    for temperature, own in LAWS.items():
        found = at_temperature(DRIVE, temperature, where="x").friction
        assert found.viscous == pytest.approx(own.viscous, rel=1e-12)
        assert found.coulomb == pytest.approx(own.coulomb, rel=1e-12)
        assert found.load == pytest.approx(own.load, rel=1e-12)
    found = at_temperature(DRIVE, 10.0 + ZERO_CELSIUS, where="x").friction
    assert found.viscous == pytest.approx(2e-3, rel=1e-12)
    assert "10 °C, an oil" in found.source


def test_what_has_no_table_or_lies_outside_is_refused():
    """One line with key and value: no friction, no lubricant, too cold."""
    plain = DriveMap.linear(2e4)
    for drive, why in (
        (plain, "has no friction"),
        (replace(plain, friction=law(1e-3)), "states no lubricant"),
    ):
        with pytest.raises(InputError, match=naming("temperature_C = 30", why)):
            at_temperature(drive, 303.15, where="joints.a.temperature_C = 30 °C")
    with pytest.raises(InputError, match=naming("0 to 40 °C")):
        at_temperature(DRIVE, 272.0, where="x")


def test_the_table_survives_a_file(tmp_path):
    """A map at another temperature after a round trip; a damaged table is dropped."""
    DRIVE.save(tmp_path / "a.swg")
    again = DriveMap.load(tmp_path / "a.swg")
    warm = [at_temperature(one, 305.0, where="").friction for one in (DRIVE, again)]
    assert warm[0] == warm[1]
    for change in (
        {"viscous_Nms_rad": [1e-3]},
        {"temperature_C": [0.0, 0.0, 40.0]},
        {"stiffness_Nm_rad": [0.0, 1.0, 1.0]},
        {"static_Nm": [0.0, 0.0, 0.0]},
    ):
        broken = replace(DRIVE, info={KEY: TABLE | change})
        broken.save(tmp_path / "b.swg")
        with pytest.warns(UserWarning, match=KEY):
            assert KEY not in DriveMap.load(tmp_path / "b.swg").info


def test_catalogue_drives_follow_the_viscosity():
    """As stated at 20 °C; the rise with speed goes with viscosity to the 2/3."""
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)
    assert no_load_running_torque(drive) == pytest.approx(0.195)
    room, cold = (at_temperature(drive, T, where="") for T in (ROOM, 273.15))
    assert no_load_running_torque(room) == pytest.approx(0.195, rel=1e-9)
    oil = MAKER_GREASES["SK-1A, SK-2"]
    thicker = (oil.viscosity(273.15) / oil.viscosity(ROOM)) ** (2.0 / 3.0)
    rise = cold.friction.viscous / drive.friction.viscous
    assert rise == pytest.approx(thicker, rel=1e-9)
    assert starting_torque(cold) == pytest.approx(starting_torque(drive))
    more = cold.friction.steady(RUNNING_SPEED, 0.0) - cold.friction.coulomb
    less = drive.friction.steady(RUNNING_SPEED, 0.0) - drive.friction.coulomb
    assert more / less == pytest.approx(thicker, rel=1e-9)
    assert KEY not in DriveMap.from_catalogue("CSG-25-50").info


def test_efficiency_over_temperature_of_a_map():
    """77 % as stated at 20 °C and 2000 rpm; better if warmer, slower or loaded more."""
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)
    found = efficiency_of_map(drive)
    assert found.as_dict()["efficiency_percent"][1][2][-1] == pytest.approx(77.0)
    assert found.as_dict()["temperature_C"][1] == 20.0
    for axis, sign in ((0, 1.0), (1, -1.0), (2, 1.0)):
        steps = sign * (
            found.efficiency.take([1], axis) - found.efficiency.take([0], axis)
        )
        assert (steps > 0.0).all()
    assert efficiency_of_map(DriveMap.from_catalogue("CSG-25-50")) is None
