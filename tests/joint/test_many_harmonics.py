"""Drives with a thousand weak harmonics: the region is that of their largest sum."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from swgjoint import attach
from swgjoint.joint import region
from swgjoint.joint.region import check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.phase_bounds import largest_sums

COUNT = 1000


def with_many_harmonics(rng):
    """A spring with random errors of equal size up to the order 50, and cogging."""
    linear = DriveMap.linear(5e4, rated_torque=80.0)
    orders = np.stack(np.meshgrid(np.arange(1, 26), np.arange(-25, 26)), -1)
    orders = rng.permutation(orders.reshape(-1, 2))[:COUNT]
    potential = np.zeros((COUNT + 1, 2, 1, 5))
    potential[0] = linear.potential[0]
    potential[1:, :, 0, 0] = 3e-6 * rng.normal(size=(COUNT, 2))
    error = np.zeros((COUNT + 1, 2))
    error[1:] = 2e-7 * rng.normal(size=(COUNT, 2))
    return replace(
        linear,
        orders=np.concatenate([[[0, 0]], orders]),
        potential=potential,
        end_stiffness=np.concatenate([linear.end_stiffness, np.zeros((COUNT, 2, 2))]),
        kinematic_error=error,
    )


def test_the_region_is_that_of_the_largest_sum(bench):
    """Slope and curvature at any phases are below the bounds, and not far below."""
    rng = np.random.default_rng(5)
    drive = with_many_harmonics(rng)
    b = bench(drive, step=1e-3, rotor_inertia=1e-4, link=1.0)
    bounds = {x.what: x for x in check_region(b.drive, timestep=1e-3).bounds}
    slope = bounds["slope of the kinematic error at the rotor, i sum n e"].value
    theta = rng.uniform(0.0, 2e3, 3000)
    psi = rng.uniform(0.0, 20.0, 3000)
    phases = drive.phases(theta, psi)
    _, by_theta, by_psi = drive.error_at(phases)
    found = np.abs(by_theta + by_psi / drive.ratio).max() * abs(drive.ratio)
    assert found <= slope <= 2.0 * found
    assert slope < 0.25 * abs(drive.ratio) * np.sum(
        np.abs(drive.angle_orders @ [1.0, 1.0 / drive.ratio])
        * np.hypot(*drive.kinematic_error.T)
    )


def test_the_sign_of_orders_does_not_matter(bench):
    """Orders and sine amplitudes of the opposite sign make the same function."""
    drive = with_many_harmonics(np.random.default_rng(6))
    sign = np.where(np.arange(len(drive.orders)) % 3 == 1, -1, 1)
    swapped = np.stack([np.ones(sign.size), sign], axis=1)
    mirrored = replace(
        drive,
        orders=drive.orders * sign[:, None],
        kinematic_error=drive.kinematic_error * swapped,
        potential=drive.potential * swapped[:, :, None, None],
        end_stiffness=drive.end_stiffness * swapped[:, :, None],
    )
    found = []
    for one in (drive, mirrored):
        b = bench(one, step=1e-3, rotor_inertia=1e-4, link=1.0)
        bounds = check_region(b.drive, timestep=1e-3).bounds
        found.append([bound.value for bound in bounds])
    assert found[1] == pytest.approx(found[0], rel=1e-9)


def test_a_potential_in_base64_is_that_in_decimals():
    """Both texts of the attribute give the same bits after five steps."""
    drive = with_many_harmonics(np.random.default_rng(7))
    spec = mujoco.MjSpec.from_string(
        '<mujoco><option timestep="1e-3" integrator="discrete"/><worldbody><body>'
        '<joint name="j"/><geom size=".1"/></body></worldbody></mujoco>'
    )
    attach(spec, joint="j", drive=drive, rotor_inertia=1e-4)
    [instance] = spec.plugins
    text = instance.config
    assert text["potential"].startswith("base64:")
    numbers = map(repr, drive.potential.ravel().tolist())
    models = [spec.compile()]
    instance.config = {**text, "potential": " ".join(numbers)}
    models.append(spec.compile())
    found = []
    for model in models:
        data = mujoco.MjData(model)
        data.qvel[:] = 3.0, 0.05
        mujoco.mj_step(model, data, 5)
        found.append([*data.qpos, *data.qvel])
    assert found[0] == found[1]


@pytest.mark.parametrize("rotor", [1e-6, 1e-5, 1e-4])
def test_free_joints_gain_no_energy(bench, rotor):
    """Without losses, from the edge of the region inwards, at random speeds."""
    rng = np.random.default_rng(8)
    drive = with_many_harmonics(rng)
    cogging = largest_sums(drive.orders[1:], drive.potential[None, 1:, :, 0, 0]).max()
    for link in (0.01, 1.0):
        speed = rng.uniform(-1.0, 1.0) * 0.2 / 1e-3 / 50.0
        b = bench(drive, step=1e-3, rotor_inertia=rotor, link=link)
        parts = check_region(
            b.drive, timestep=1e-3, max_input_speed=abs(speed)
        ).require(region.MAX_SUB_STEPS)
        step = b.model.opt.timestep = 1e-3 / parts
        e0, slope, _ = drive.error_at(drive.phases(0.0, 0.0))
        rate = speed * (1.0 / drive.ratio + float(slope))
        b.place(0.5 * step * speed, float(e0) + 0.5 * step * rate, speed, rate)
        energies = [b.energy(midpoint=True)]
        for _ in range(20):
            mujoco.mj_step(b.model, b.data, 25 * parts)
            assert not any(w.number for w in b.data.warning)
            energies.append(b.energy(midpoint=True))
        assert max(energies) < energies[0] + 0.05 * (abs(energies[0]) + cogging)
