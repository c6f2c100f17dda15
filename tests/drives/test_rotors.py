"""Rotor inertia that is assumed for a drive."""

from __future__ import annotations

import pytest

from swgjoint.drives.export_fmu import export_fmu
from swgjoint.drives.references import load_drive
from swgjoint.drives.rotors import rotor_inertia_of
from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.maps.drive_map import DriveMap

UNIT = 1e-4


@pytest.mark.parametrize(
    ("size", "wave_generator"), [(14, 0.033), (20, 0.193), (25, 0.413), (32, 1.69)]
)
def test_catalogue_drives_have_twice_the_inertia_in_the_catalogue(size, wave_generator):
    """So has the design of the same size and ratio, by name and as an object."""
    twice = pytest.approx(2.0 * UNIT * wave_generator, rel=1e-4)
    assert rotor_inertia_of(f"CSG-{size}-100") == twice
    assert rotor_inertia_of(load_drive(f"CSG-{size}-80")) == twice
    assert rotor_inertia_of(f"size-{size}-100") == twice
    assert rotor_inertia_of(Design.load(f"size-{size}-50")) == twice


def test_inertia_grows_with_the_fifth_power_of_the_size():
    """All lengths doubled: torques eightfold, the inertia 32-fold."""
    small = Design.load("size-20-100")
    stated = {"ratings.rated_torque_Nm": 52.0}
    one = rotor_inertia_of(small.with_changes(stated))
    # far above the largest catalogue drive, whose nearest row stays the same
    ends = [
        rotor_inertia_of(small.with_changes({"ratings.rated_torque_Nm": torque}))
        for torque in (500.0, 4000.0)
    ]
    assert one == pytest.approx(2.0 * UNIT * 0.193, rel=1e-3)
    assert ends[1] / ends[0] == pytest.approx(32.0, rel=1e-3)


def test_names_that_are_no_drive_and_plain_springs_have_none():
    """Whoever loads them says what is wrong, or needs the inertia from the user."""
    assert rotor_inertia_of("no-such-drive") is None
    assert rotor_inertia_of(DriveMap.linear(1e4, rated_torque=50.0)) is None


def test_an_export_of_a_spring_needs_the_inertia(tmp_path):
    """Otherwise there is one clear line and no file."""
    spring = DriveMap.linear(1e4, rated_torque=50.0)
    with pytest.raises(InputError, match="rotor_inertia"):
        export_fmu(spring, tmp_path / "out.fmu")
    assert not list(tmp_path.iterdir())
