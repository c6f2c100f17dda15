"""Maps of one gear with different fixed members."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.friction_loop import FrictionLoop
from swgjoint.maps.fit.hysteresis_loops import played_loop
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.layouts import with_layout
from swgjoint.maps.sheet.turn import error_turn


@pytest.fixture
def fixed(synthetic_map):
    """A map with harmonics of both angles and the circular spline fixed."""
    assert synthetic_map.layout == "circular_spline_fixed"
    assert synthetic_map.kinematic_error[1:].any() and len(synthetic_map.orders) > 2
    return synthetic_map


def angles(n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Angles of the wave generator to circular spline and flexspline [rad]."""
    rng = np.random.default_rng(3)
    alpha = rng.uniform(-7.0, 7.0, n)
    return alpha, rng.uniform(-8e-3, 8e-3, n)


@pytest.mark.parametrize("layout", ["flexspline_fixed", "wave_generator_fixed"])
def test_the_work_at_both_angles_is_the_same(fixed, layout):
    """The members exert the same torques on each other, whichever of them is fixed."""
    other = with_layout(fixed, layout, fixed.ratings)
    alpha, extra = angles()
    beta = alpha * fixed.teeth_circular_spline / fixed.teeth_flexspline + extra
    law = fixed.law(alpha, alpha - beta)
    theta = beta if layout == "flexspline_fixed" else -beta
    psi = beta - alpha if layout == "flexspline_fixed" else -alpha
    found = other.law(theta, psi)
    # inside the knots and outside of them
    inside = np.abs(law.torsion) < fixed.torsion_knots[-1]
    assert inside.any() and not inside.all()
    on_wave_generator, on_flexspline = law.input_force, law.output_force
    on_circular_spline = -on_wave_generator - on_flexspline
    size = np.abs(on_flexspline).max()
    assert np.abs(found.output_force - on_circular_spline).max() < 1e-9 * size
    on_input = on_wave_generator if layout == "flexspline_fixed" else law.output_force
    assert np.abs(found.input_force - on_input).max() < 1e-9 * size


def test_stiffness_and_error_follow_the_ratio_of_the_teeth(fixed):
    """K grows with (z_cs/z_fs)², the torque of the output with z_cs/z_fs."""
    other = with_layout(fixed, "flexspline_fixed", fixed.ratings)
    s = fixed.teeth_flexspline / fixed.teeth_circular_spline
    assert other.max_stiffness == pytest.approx(fixed.max_stiffness / s**2)
    low, high = fixed.torque_range
    assert other.torque_range == pytest.approx((-high / s, -low / s))
    assert np.abs(other.kinematic_error).sum() == pytest.approx(
        s * np.abs(fixed.kinematic_error).sum()
    )


def test_hysteresis_dissipates_the_same_work(fixed):
    """A round through the same relative angles takes the same work."""
    elements = (
        Jenkin(stiffness=2e4, yield_torque=1.0, yield_curve=((60.0, 4.0),)),
        Jenkin(stiffness=5e3, yield_torque=2.0),
    )
    drive = replace(fixed, hysteresis=elements)
    s = drive.teeth_flexspline / drive.teeth_circular_spline
    other = with_layout(drive, "flexspline_fixed", drive.ratings)
    up = np.linspace(-48.0, 48.0, 49)[1:]
    torque = np.concatenate([[0.0], up[24:], -up, up, -up, up])
    areas = []
    for one, load in ((drive, torque), (other, -torque / s)):
        blank = np.zeros(torque.size)
        loop = FrictionLoop(
            input_angle=0.0,
            quarter=24,
            torque=load,
            torsion=blank,
            elastic_torsion=blank,
            stiffness=blank + 1.0,
            work=blank,
        )
        areas.append(played_loop(one, loop).area)
    # with the input locked, the other angle turns by the torsion
    assert areas[1] == pytest.approx(areas[0], rel=0.005)


def test_fields_belong_to_the_output_torque_of_the_layout(fixed, fields):
    """The largest torque of the one layout is the smallest of the other."""
    other = with_layout(
        replace(fixed, fields=fields), "flexspline_fixed", fixed.ratings
    )
    s = fixed.teeth_flexspline / fixed.teeth_circular_spline
    assert other.fields.torque == pytest.approx(-fields.torque[::-1] / s)
    assert (other.fields.displacement == fields.displacement[::-1]).all()
    assert (other.fields.wave_generator == fields.wave_generator).all()


def test_yield_torques_and_ranges_scale_with_the_torque(fixed):
    """Elements yield at the same torsion; ranges swap their ends with the sign."""
    element = Jenkin(stiffness=2e4, yield_torque=1.0, yield_curve=((60.0, 4.0),))
    ranges = {"sampled_torque_Nm": [-40.0, 60.0], "torque_range_Nm": [-40.0, 60.0]}
    drive = replace(fixed, hysteresis=(element,), info=ranges)
    other = with_layout(drive, "flexspline_fixed", drive.ratings)
    s = drive.teeth_flexspline / drive.teeth_circular_spline
    torque = np.linspace(0.0, 80.0, 9)
    (turned,) = other.hysteresis
    assert turned.yields(torque / s) == pytest.approx(element.yields(torque) / s)
    assert turned.reach(torque / s) == pytest.approx(s * element.reach(torque))
    for key in ranges:
        assert other.info[key] == pytest.approx([-60.0 / s, 40.0 / s])


@pytest.mark.parametrize("layout", ["flexspline_fixed", "wave_generator_fixed"])
def test_an_unloaded_output_stays_in_the_middle_of_its_clearance(layout):
    """Harmonics of the energy do not move it through the clearance in other layouts.

    They act on the output there, by 2e-6 of the rated torque. The transmission accuracy
    of a drive of 60 and 62 teeth was 1.29 arcmin, and 0.009 with the other layout.
    """
    mean = DriveMap.from_numbers(
        stiffness=7e4, rated_torque=87.0, ratio=30, lost_motion_arcmin=1.0
    )
    assert mean.teeth_flexspline == 60
    potential = np.zeros((2, *mean.potential.shape[1:]))
    potential[0] = mean.potential[0]
    potential[1, 0, :, 0] = 2e-6 * 87.0 / 26
    fixed = replace(
        mean,
        orders=np.array([(0, 0), (26, 0)]),
        potential=potential,
        end_stiffness=np.concatenate([mean.end_stiffness, np.zeros((1, 2, 2))]),
        kinematic_error=np.array([(0.0, 0.0), (1e-6, 0.0)]),
    )
    assert fixed.mean_torsion(0.1) > 1e-4  # the clearance
    other = with_layout(fixed, layout, fixed.ratings)
    s = 60 / 62
    width = error_turn(fixed).peak_to_peak()
    assert width == pytest.approx(2e-6, rel=1e-3)
    assert error_turn(other).peak_to_peak() == pytest.approx(s * width, rel=1e-2)
    theta = np.linspace(0.0, 9.0, 60)
    error = output_angle(other, theta, 0.0) - theta / other.ratio
    assert np.abs(error).max() < 1.01e-6
