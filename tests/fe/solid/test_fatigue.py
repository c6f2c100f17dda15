"""Nominal stress, ranges and safety factors from stresses in space."""

from __future__ import annotations

from functools import cache
from math import pi

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import DesignError
from swgjoint.fe.solid.figures import fatigue as module
from swgjoint.fe.solid.figures.fatigue import (
    FatigueLimits,
    assess,
    fatigue,
    half_range,
    root_stress,
)
from swgjoint.fe.solid.figures.four_forces import four_forces
from swgjoint.fe.solid.figures.pinched_cup import pinched_cup
from swgjoint.fe.solid.strip.masters import Orders
from swgjoint.gear.design.design import Design
from swgjoint.gear.shell_theory import ShellDimensions, safety_factor

LIMITS = FatigueLimits(bending=800e6, torsion=320e6)
PHI = 2.0 * pi * np.arange(40) / 40


def small_design():
    """The cup of the article with 60 teeth, its wall and length in proportion."""
    return Design.load("stress-cup").with_changes(
        {
            "drive.teeth_flexspline": 60,
            "drive.teeth_circular_spline": 62,
            "drive.face_width_mm": 5.0,
            "flexspline.rim_mm": 0.5,
            "cup.length_mm": 12.0,
            "cup.fillet_mm": 1.0,
            "cup.bore_radius_mm": 3.5,
            "mesh.refinement": 0.5,
        }
    )


@cache
def small_cup():
    return pinched_cup(small_design(), orders=Orders())


@cache
def four():
    return four_forces(small_cup(), 0.3e-3)


def field(around, axial=0.0, shear=0.0):
    """Stress of the teeth from values by time and node."""
    points = np.asarray(small_cup().strip.teeth.segment.mesh.p)
    x, y = points[:2] / np.hypot(points[0], points[1])
    around = np.broadcast_to(around, (len(PHI), len(x)))
    stress = np.zeros((*around.shape, 6))
    # unit vector around, clockwise: (y, -x, 0)
    stress[..., 0], stress[..., 1] = around * y**2, around * x**2
    stress[..., 3] = -around * x * y
    stress[..., 2] = axial
    stress[..., 5], stress[..., 4] = shear * y, -shear * x
    return stress


def test_nominal_stress_is_that_of_the_outside_of_a_bent_wall():
    """Membrane and bending come back exactly at the root; a notch counts little."""
    strip = small_cup().strip
    points = np.asarray(strip.teeth.segment.mesh.p)
    land = np.asarray(strip.teeth.plane.mesh.p)[:, strip.teeth.plane.face_first]
    r = np.hypot(*land)
    middle, height = 0.5 * (r[0] + r[-1]), r[0] - r[-1]
    depth = (np.hypot(points[0], points[1]) - middle) / height
    found = root_stress(strip, field(7.0 + 40.0 * depth, 3.0, 5.0))
    assert found[..., 0] == pytest.approx(27.0)
    assert found[..., 1] == pytest.approx(3.0)
    assert found[..., 2] == pytest.approx(5.0)


def test_half_range_of_the_history():
    """Amplitudes of tension and of shear; a constant stress has none."""
    tension = field(np.cos(2 * PHI)[:, None] * 100e6 + 30e6)
    assert half_range(tension) == pytest.approx(100e6, rel=1e-6)
    shear = field(0.0, shear=np.cos(2 * PHI)[:, None] * 10e6)
    assert half_range(shear) == pytest.approx(3**0.5 * 10e6, rel=1e-6)
    assert half_range(field(50e6, 20e6)).max() < 1.0


def test_safety_factors_of_a_known_history():
    """Amplitudes and means of cosines give what the formula gives."""
    wave = np.cos(2 * PHI)[:, None]
    stress = field(120e6 * wave, 36e6 * wave, 25e6 + 15e6 * wave)
    shell = ShellDimensions.from_design(Design.load("stress-cup"))
    strip = small_cup().strip
    found = assess(strip, {"teeth": stress}, 100.0, LIMITS, shell)
    expected = safety_factor(
        bending_limit=800e6,
        torsion_limit=320e6,
        normal_amplitude=120e6,
        shear_amplitude=15e6,
        shear_mean=25e6,
    )
    assert found.worst.safety.combined == pytest.approx(expected.combined)
    assert found.middle.axial_amplitude == pytest.approx(36e6)
    assert abs(found.middle.z) == np.abs(strip.teeth.z).min()
    assert found.shell.combined == pytest.approx(2.17, abs=0.005)
    shown = found.to_json()
    assert shown["mid_face"]["shear_mean_MPa"] == pytest.approx(25.0)
    local = found.amplitude["root, mid-face"]
    assert shown["S_without_factors_mid_face"] == pytest.approx(800e6 / local)


def test_four_forces_are_equal_and_stay():
    """Without torque alike; the areas do not move with it; the teeth move by w_0."""
    found = four()
    assert found.force[0] == found.force[1] > 0.0
    assert found.largest_radial(0.0) == pytest.approx(0.3e-3)
    teeth = small_cup().strip.teeth
    middle = teeth.bore[np.abs(teeth.z) <= 0.2 * np.ptp(teeth.z) + 1e-9]
    for sector in (4, 26):  # 24 and 156 deg from the major axis
        moved = found.radial_by_torque[sector, middle].mean()
        assert abs(moved) < 1e-6 * np.abs(found.radial_by_torque).max()
    # the torque lifts one area off and presses the other one as much
    assert found.force_by_torque.sum() == pytest.approx(
        0.0, abs=1e-6 * np.abs(found.force_by_torque).max()
    )


def test_torque_runs_through_the_cylinder():
    """Mean shear stress of the wall is T/(2 pi r^2 t), without torque zero."""
    cup = small_cup()
    number = [segment.name for segment in cup.segments].index("cylinder 3")
    mesh = cup.segments[number].mesh
    points = np.asarray(mesh.mesh.p)
    station = np.unique(np.round(mesh.position, 9))[2]
    here = mesh.first[np.abs(mesh.position - station) < 1e-8]
    x, y = points[:2, here] / np.hypot(*points[:2, here])
    r = np.hypot(*points[:2, here])
    wall, radius = np.ptp(r), r.mean()

    def shear(torque):
        stress = four().stresses(torque)["cylinder 3"][:, here]
        by_node = (x * stress[..., 4] - y * stress[..., 5]).mean(axis=0)
        # trapezoid through the wall
        return float((0.5 * (by_node[:-1] + by_node[1:])).mean())

    torque = 5.0
    assert abs(shear(torque)) == pytest.approx(
        torque / (2 * pi * radius**2 * wall), rel=0.01
    )
    assert abs(shear(0.0)) < 1e-3 * abs(shear(torque))


def test_bending_of_four_forces_is_the_shell_theory():
    """No torque: C_sigma w_0 E s/r^2 and a third more, as only the roots bend."""
    design = small_design()
    shell = ShellDimensions.from_design(design)
    found = assess(small_cup().strip, four().stresses(0.0), 0.0, LIMITS, shell)
    ratio = found.middle.normal_amplitude / (
        shell.bending_stress(1.510) * 0.3e-3 / shell.deflection
    )
    assert 1.2 < ratio < 1.45
    assert found.amplitude["root, mid-face"] > found.middle.normal_amplitude


def test_limits_are_needed():
    """Refused with the keys that are missing."""
    with pytest.raises(
        DesignError,
        match=naming(
            "reference-3d",
            "material.fatigue_limit_bending_MPa",
            "material.fatigue_limit_torsion_MPa",
        ),
    ):
        fatigue(Design.load("reference-3d"), [20.0])


@pytest.mark.slow
def test_one_equilibrium_per_torque(monkeypatch, small_ring):
    """The drive is followed from torque to torque; safety falls on the way."""
    design = Design.load("reference-3d-modified").with_changes(
        {
            "drive.teeth_flexspline": 40,
            "drive.teeth_circular_spline": 42,
            "cup.length_mm": 14.0,
            "cup.bore_radius_mm": 7.0,
            "material.fatigue_limit_bending_MPa": 800.0,
            "material.fatigue_limit_torsion_MPa": 320.0,
        }
    )
    monkeypatch.setattr(module, "solid_sector_model", lambda design, half: small_ring)
    seen = []
    low, high = fatigue(design, [1.0, 5.0], progress=lambda *a: seen.append(a))
    assert (low.torque, high.torque) == (1.0, 5.0)
    assert high.middle.shear_amplitude > low.middle.shear_amplitude
    assert high.middle.safety.shear < low.middle.safety.shear
    assert low.worst.safety.combined <= low.middle.safety.combined
    assert seen[-1] == ("fatigue", 4, 4)
