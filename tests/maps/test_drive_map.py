"""The potential: forces are its gradient, the continuation is smooth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.maps.drive_map import DriveMap


@pytest.mark.parametrize("span", [0.8, 1.6])
def test_forces_are_the_gradient_of_the_potential(synthetic_map, span):
    """Generalised forces against differences, inside and outside the sampled range."""
    rng = np.random.default_rng(3)
    drive = synthetic_map
    theta = rng.uniform(-7, 7, 50)
    psi = theta / drive.ratio - span * drive.torsion_knots[-1] * rng.uniform(-1, 1, 50)

    def energy(theta, psi):
        return drive.energy(drive.torsion(theta, psi), theta, psi)

    h = 1e-8
    on_input = -(energy(theta + h, psi) - energy(theta - h, psi)) / (2 * h)
    on_output = -(energy(theta, psi + h) - energy(theta, psi - h)) / (2 * h)
    found = drive.forces(theta, psi)
    for ours, slope in zip(found, (on_input, on_output), strict=True):
        assert np.abs(ours - slope).max() < 1e-6 * np.abs(slope).max()


def test_derivatives_are_consistent(synthetic_map):
    """Torque and stiffness are the first and second derivative of the energy."""
    drive = synthetic_map
    x = np.linspace(-1.5, 1.5, 41) * drive.torsion_knots[-1] + 1e-9
    h = 1e-9
    for function, derivative in (
        (drive.energy, drive.torque),
        (drive.torque, drive.stiffness),
    ):
        slope = (function(x + h, 0.3, 0.01) - function(x - h, 0.3, 0.01)) / (2 * h)
        ours = derivative(x, 0.3, 0.01)
        assert np.abs(ours - slope).max() < 1e-5 * np.abs(ours).max()
    assert (drive.stiffness(x, 0.3, 0.01) <= drive.max_stiffness).all()


def test_each_end_continues_with_its_own_stiffness():
    """Softer below the sampled torsion than above it: both tangents come back."""
    drive = DriveMap.linear(1e4)
    ends = np.zeros_like(drive.end_stiffness)
    ends[0, 0] = [0.5e4, 2e4]
    drive = replace(drive, end_stiffness=ends)
    low, high = drive.torsion_knots[[0, -1]]
    assert drive.stiffness(low - 1e-3, 0.0, 0.0) == pytest.approx(0.5e4)
    assert drive.stiffness(high + 1e-3, 0.0, 0.0) == pytest.approx(2e4)
    rise = drive.torque(high + 1e-3, 0.0, 0.0) - drive.torque(high, 0.0, 0.0)
    assert rise == pytest.approx(20.0)


def test_linear_map():
    """Constant stiffness: torque K times torsion at any angle, ratio -100."""
    drive = DriveMap.linear(1e4)
    assert drive.torque(0.05, 1.0, 2.0) == pytest.approx(500.0)
    assert drive.mean_stiffness == pytest.approx(1e4)
    assert drive.max_stiffness == pytest.approx(1e4)
    on_input, on_output = drive.forces(0.6, 0.001)
    assert on_output == pytest.approx(1e4 * (0.6 / -100 - 0.001))
    assert on_input == pytest.approx(-on_output / -100)


def test_layouts_turn_the_phases():
    """Circular spline fixed: alpha = theta; flexspline fixed: alpha = theta - psi."""
    for layout, expected in (
        ("circular_spline_fixed", [3, 0]),
        ("flexspline_fixed", [3, -3]),
        ("wave_generator_fixed", [0, -3]),
    ):
        drive = DriveMap.linear(1e4, layout=layout)
        other = DriveMap(
            **{
                **{k: getattr(drive, k) for k in drive.__dataclass_fields__},
                "orders": np.array([[0, 0], [3, 0]]),
                "potential": np.repeat(drive.potential, 2, axis=0),
                "end_stiffness": np.repeat(drive.end_stiffness, 2, axis=0),
                "kinematic_error": np.zeros((2, 2)),
            }
        )
        assert list(other.angle_orders[1]) == expected


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("torsion_knots", np.array([1.0, 0.0]), ("torsion knots", "[rad]", "two")),
        ("potential", np.full((1, 2, 1, 5), np.nan), ("potential", "[J]", "finite")),
        ("orders", np.array([[1, 0]]), ("orders", "(n, 2)", "(0, 0)")),
        (
            "layout",
            "upside_down",
            (
                "layout",
                "'upside_down'",
                "circular_spline_fixed",
                "flexspline_fixed",
                "wave_generator_fixed",
            ),
        ),
    ],
)
def test_bad_content_is_refused(key, value, says):
    """Knots increase, numbers are finite, the mean comes first."""
    drive = DriveMap.linear(1e4)
    fields = {k: getattr(drive, k) for k in drive.__dataclass_fields__}
    with pytest.raises(ValueError, match=naming(*says)):
        DriveMap(**{**fields, key: value})
