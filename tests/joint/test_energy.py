"""What the integrators do to energy: nothing, unless the physics does."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from swgjoint.joint.region import check_region
from swgjoint.maps.drive_map import DriveMap


def test_rk4_conserves_energy(bench, any_layout):
    """Small steps of RK4 keep the energy: the force is the gradient of V."""
    # the same reflected inertia in every layout keeps the torsion below 1 krad/s
    rotor = 0.144 / any_layout.ratio**2
    b = bench(any_layout, integrator="RK4", step=1e-5, rotor_inertia=rotor)
    psi = -0.5 * any_layout.torsion_knots[-1]
    b.place(0.0, psi, 8.0, 8.0 / any_layout.ratio)
    start = b.energy()
    mujoco.mj_step(b.model, b.data, 20_000)
    assert abs(b.data.qpos[b.q[0]]) > 0.5  # ten tooth pitches
    assert b.energy() == pytest.approx(start, rel=1e-9)


def test_scheme_keeps_energy_of_loaded_joint(bench, synthetic_map):
    """A wound-up joint let go gains no energy in 10 s at 1 ms and hardly loses any."""
    b = bench(synthetic_map.with_harmonics([1, 1, 1, 0, 1]))
    b.place(0.0, -0.2 * synthetic_map.torsion_knots[-1])
    start = b.energy(midpoint=True)
    energies = []
    for _ in range(100):
        mujoco.mj_step(b.model, b.data, 100)
        energies.append(b.energy(midpoint=True))
    assert check_region(b.drive, timestep=1e-3).ok
    assert max(energies) < 1.05 * start
    # the numerical damping, 5e-5 of critical at this h w = 0.43, takes 4 % in 1 s
    assert energies[9] > 0.95 * start


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_scheme_does_not_brake_free_run(bench, synthetic_map, turn):
    """A frictionless joint with kinematic error runs on for 10 s at 1 ms."""
    b = bench(synthetic_map.with_harmonics([1, 1, 1, 0, 1]))
    e0, slope, _ = synthetic_map.error_at(synthetic_map.phases(0.0, 0.0))
    speed = turn * 40.0
    b.place(0.0, float(e0), speed, speed * (1 / synthetic_map.ratio + float(slope)))
    start = b.energy(midpoint=True)
    energies = []
    for _ in range(100):
        mujoco.mj_step(b.model, b.data, 100)
        energies.append(b.energy(midpoint=True))
    assert max(energies) < 1.02 * start
    assert min(energies) > 0.98 * start


@pytest.mark.parametrize("step", [2e-3, 5e-3])
def test_stiff_extreme_does_not_gain(bench, step):
    """K 1e6, rotor 1e-6, i 160, 1 arcmin at 4 per turn, full torque stays bounded."""
    linear = DriveMap.linear(1e6, teeth_flexspline=320, teeth_circular_spline=322)
    drive = replace(
        linear,
        orders=np.array([[0, 0], [4, 0]]),
        potential=np.concatenate([linear.potential, 0 * linear.potential]),
        end_stiffness=np.concatenate([linear.end_stiffness, 0 * linear.end_stiffness]),
        kinematic_error=np.array([[0.0, 0.0], [2.9e-4, 0.0]]),
    )
    assert drive.ratio == -160
    b = bench(drive, step=step, link=10.0, rotor_inertia=1e-6)
    b.place(0.0, -0.9 * drive.torsion_knots[-1])
    start = b.energy(midpoint=True)
    largest = 0.0
    for _ in range(200):
        mujoco.mj_step(b.model, b.data, 10)
        largest = max(largest, b.energy(midpoint=True))
    assert np.isfinite(largest)
    assert largest < 1.05 * start
