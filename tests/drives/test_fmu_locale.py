"""An exported FMU in a simulator whose locale has a decimal comma."""

from __future__ import annotations

import locale
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from fmi3 import Fmu

import swgjoint
from swgjoint.maps.hysteresis import Jenkin

NAME = "de_DE.UTF-8"


@pytest.fixture
def decimal_comma(tmp_path, monkeypatch):
    """The numbers of C functions have a decimal comma."""
    program = shutil.which("localedef")
    if program is None or not Path("/usr/share/i18n/locales/de_DE").exists():
        pytest.skip("localedef or its sources are not installed")
    place = tmp_path / "locales"
    place.mkdir()
    options = ["--no-archive", "-i", "de_DE", "-f", "UTF-8", str(place / NAME)]
    subprocess.run([program, *options], capture_output=True, check=False)
    monkeypatch.setenv("LOCPATH", str(place))
    before = locale.setlocale(locale.LC_NUMERIC)
    locale.setlocale(locale.LC_NUMERIC, NAME)
    assert locale.localeconv()["decimal_point"] == ","
    yield
    locale.setlocale(locale.LC_NUMERIC, before)


def test_a_decimal_comma_changes_nothing(synthetic_map, tmp_path, decimal_comma):
    """Parameters of hysteresis elements are applied with all their digits.

    They were written as text with a comma, so that the FMU did not start.
    """
    element = Jenkin(stiffness=2e4 / 3.0, yield_torque=1.1)
    path = tmp_path / "drive.fmu"
    swgjoint.export_fmu(
        replace(synthetic_map, hysteresis=(element,)), path, rotor_inertia=4e-5
    )
    fmu = Fmu(path, by_steps=True)
    ends = []
    for name in (NAME, "C"):
        locale.setlocale(locale.LC_NUMERIC, name)
        assert fmu.call("Reset") and fmu.start(), fmu.said
        for k in range(50):
            assert fmu.set(motor_torque=0.3, load_torque=-4.0)
            assert fmu.step(k * 1e-3, 1e-3)
        ends.append(fmu.get("motor_angle", "torsion", "output_torque"))
    assert ends[0] == ends[1]
