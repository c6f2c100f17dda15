"""Starts of searches at further angles: trend and tangent of the angles before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.solid import equilibrium

pytestmark = pytest.mark.fe

STEP = 2.0 * np.pi / 42 / 64
"""A part of a pitch over which the equilibria of the small drive change smoothly."""


@pytest.fixture(scope="module")
def earlier(small_drive, loaded):
    """Under the same torque, a step before."""
    return small_drive.to_angle(loaded, small_drive.input_angle(loaded) - STEP)


@pytest.fixture
def factorised(monkeypatch):
    """Tangents that searches factorise."""
    made = []

    class Counted(equilibrium.SolidTangent):
        def __init__(self, *args):
            made.append(self)
            super().__init__(*args)

    monkeypatch.setattr(equilibrium, "SolidTangent", Counted)
    return made


def test_the_trend_is_closer_to_the_next_equilibrium(small_drive, loaded, earlier):
    """Than the last equilibrium, and leads to the same one."""
    angle = small_drive.input_angle(loaded) + STEP
    plain = small_drive.to_angle(loaded, angle)
    start = small_drive.extrapolate(loaded, earlier, angle)
    assert small_drive.input_angle(start) == small_drive.input_angle(loaded)
    found = small_drive.to_angle(start, angle)
    assert found.outcome.ok
    assert np.linalg.norm(found.faces - small_drive.predict(start, angle).faces) < (
        0.5 * np.linalg.norm(found.faces - small_drive.predict(loaded, angle).faces)
    )
    assert np.abs(found.faces - plain.faces).max() < 1e-9
    assert found.energy == pytest.approx(plain.energy, rel=1e-9)


def test_no_trend_without_tooth_contact(small_drive, deflected, loaded):
    """A free output keeps its position."""
    angle = small_drive.input_angle(loaded) + STEP
    assert small_drive.extrapolate(deflected, loaded, angle) is deflected
    assert small_drive.extrapolate(loaded, deflected, angle) is loaded


def test_a_tangent_nearby_replaces_that_of_the_start(
    small_drive, loaded, earlier, factorised
):
    """The same equilibrium without a factorisation."""
    angle = small_drive.input_angle(loaded) + STEP
    start = small_drive.extrapolate(loaded, earlier, angle)
    wanted = small_drive.to_angle(start, angle)
    own = len(factorised)
    near = small_drive.near(earlier)
    factorised.clear()
    found = near.to_angle(start, angle)
    assert own > len(factorised) == 0
    assert found.outcome.ok and len(found.history) <= len(wanted.history) + 1
    assert np.abs(found.faces - wanted.faces).max() < 1e-9
    assert found.energy == pytest.approx(wanted.energy, rel=1e-9)
    assert found.compliance == pytest.approx(wanted.compliance, rel=1e-3)


def test_a_tangent_from_afar_is_renewed(small_drive, loaded, factorised):
    """Its first increment is large, and the search goes on with its own tangents."""
    torque = 2.0 * loaded.torque
    wanted = small_drive.to_torque(loaded, torque)
    stiff = replace(loaded, touching=np.zeros_like(loaded.touching))
    near = small_drive.near(stiff)
    factorised.clear()
    found = near.to_torque(loaded, torque)
    assert found.outcome.ok and factorised
    assert np.abs(found.faces - wanted.faces).max() < 1e-8
