"""The plugin against its numpy twin, and the forces against the potential."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from swgjoint.drives.references import load_drive
from swgjoint.joint.reference import gradient_force, scheme_force
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.phase_bounds import MANY

ROOT = Path(__file__).parents[2]


def random_motion(bench, rng, spread=1.5, speed=30.0):
    """A state whose torsion lies on both sides of the outer knots."""
    drive = bench.drive.drive
    theta = rng.uniform(-8, 8)
    psi = theta / drive.ratio + spread * rng.uniform(-1, 1) * drive.torsion_knots[-1]
    rates = rng.normal(0, speed), rng.normal(0, speed / 60)
    other = rng.normal(0, 300), rng.normal(0, 5)
    bench.place(theta, psi, *rates)
    bench.data.plugin_state[:] = other
    mujoco.mj_forward(bench.model, bench.data)
    return bench.motion()


def scale(drive):
    """Largest torque of the sampled range [N·m]."""
    return max(abs(t) for t in drive.torque_range)


@pytest.mark.parametrize("integrator", ["RK4", "Euler", "implicitfast"])
def test_gradient_force_equals_twin(bench, any_layout, integrator):
    """Without the scheme the plugin's force is minus the gradient plus damping."""
    b = bench(any_layout, damping_ratio=0.05)
    b.model.opt.integrator = getattr(
        mujoco.mjtIntegrator, "mjINT_" + integrator.upper()
    )
    rng = np.random.default_rng(1)
    for _ in range(100):
        motion = random_motion(b, rng)
        want = gradient_force(any_layout, motion, damping=b.drive.damping)
        got = b.data.qfrc_passive[b.v]
        ratio = abs(any_layout.ratio)
        np.testing.assert_allclose(
            got * [ratio, 1.0],
            np.multiply(want, [ratio, 1.0]),
            rtol=0,
            atol=1e-12 * scale(any_layout) * (1 if ratio > 2 else 5),
        )


def check_scheme(b, speed):
    """Force, direction and stiffness that the scheme hands over equal the twin's."""
    drive = b.drive.drive
    rng = np.random.default_rng(2)
    t = b.model.tendon(b.drive.tendon).id
    row = b.model.ten_J_rowadr[t]
    entries = [row + list(b.model.ten_J_colind[row:]).index(dof) for dof in b.v]
    h = b.model.opt.timestep
    for _ in range(100):
        motion = random_motion(b, rng, speed=speed)
        want = scheme_force(drive, motion, timestep=h, damping=b.drive.damping)
        a, _, c = 1e-9, 0.0, 1.0
        metric = a + 3 * c * b.data.ten_length[t] ** 2
        assert metric == pytest.approx(want.metric, rel=1e-8)
        g = np.array([want.g_theta, want.g_psi])
        np.testing.assert_allclose(b.data.ten_J[entries], g, rtol=1e-12)
        # the engine's shift along the tendon is cancelled by the plugin
        shift = h * want.metric * b.data.ten_velocity[t] * g
        np.testing.assert_allclose(
            b.data.qfrc_passive[b.v],
            np.array([want.theta, want.psi]) + shift,
            rtol=0,
            atol=1e-12 * scale(drive) + 1e-12 * np.abs(shift).max(),
        )


@pytest.mark.parametrize("speed", [30.0, 1.0])
def test_scheme_force_equals_twin(bench, any_layout, speed):
    """The plugin computes sin and cos of large and small phase changes in two ways."""
    check_scheme(bench(any_layout, damping_ratio=0.05), speed)


@pytest.mark.parametrize("phase", [0.2, 2.0, 20.0])
def test_scheme_force_of_many_harmonics_equals_twin(bench, phase):
    """23 multiples of one order, most of which follow from others.

    In a step the phase of the highest order changes by about ``phase``: most often less
    than 1 rad, less than 4 rad or more, which are three ways to compute sin and cos.
    """
    drive = load_drive(str(ROOT / "notebooks/maps/reference-2d.swg"))
    b = bench(drive, damping_ratio=0.05)
    top = np.abs(drive.angle_orders).max()
    check_scheme(b, phase / top / b.model.opt.timestep)


def with_many_harmonics(drive, orders, share=1e-4):
    """The map with weak harmonics of the given orders that it does not have yet.

    ``share`` is their largest amplitude relative to the mean.
    """
    own = {tuple(order) for order in drive.orders.tolist()}
    more = np.array([order for order in orders if order not in own])
    rng = np.random.default_rng(4)
    size = share * rng.uniform(-1.0, 1.0, (len(more), 2, 1, 1))
    weak, ends = size * drive.potential[0, 0], size[..., 0] * drive.end_stiffness[0, 0]
    error = 1e-8 * rng.normal(size=(len(more), 2))
    return replace(
        drive,
        orders=np.concatenate([drive.orders, more]),
        potential=np.concatenate([drive.potential, weak]),
        end_stiffness=np.concatenate([drive.end_stiffness, ends]),
        kinematic_error=np.concatenate([drive.kinematic_error, error]),
    )


WAVES = [(n - q, q) for n in range(6) for q in range(-24, 25) if (n, q) > (0, 0)]
"""Many harmonics with few different orders p + q in theta, as of tooth errors."""


@pytest.mark.parametrize("speed", [0.2, 3.0, 30.0])
@pytest.mark.parametrize(
    "orders",
    [
        [(p, q) for p in range(12) for q in range(-7, 8) if (p, q) > (0, 0)],
        [(2 * p, 0) for p in range(1, 160)],
        WAVES,
    ],
    ids=["both", "multiples", "waves"],
)
def test_scheme_force_of_weak_harmonics_equals_twin(bench, any_layout, orders, speed):
    """More than 128 harmonics, processed in wide blocks, most of them from others."""
    b = bench(with_many_harmonics(any_layout, orders), damping_ratio=0.05)
    assert len(b.drive.drive.orders) - 1 > MANY
    check_scheme(b, speed)


@pytest.mark.parametrize("change", [0.03, 0.037, 0.039, 0.3])
def test_steps_anywhere_near_a_position_equal_the_twin(bench, synthetic_map, change):
    """Polynomials of the output angle hold up to half their width away.

    The largest phase change by psi is ``change`` in a step, to either side; above 0.038
    rad, the harmonics are summed one by one. Two positions are 0.4 rad of phase apart.
    """
    b = bench(with_many_harmonics(synthetic_map, WAVES, share=0.1), damping_ratio=0.05)
    drive, h = b.drive.drive, b.model.opt.timestep
    top = np.abs(drive.angle_orders[:, 1]).max()
    rng = np.random.default_rng(9)
    for place in np.linspace(-0.2, 0.2, 9):
        rate = rng.choice([-1.0, 1.0]) * change / top / h
        psi = (0.4 * rng.integers(-99, 100) + place) / top
        theta = drive.ratio * (psi + 1e-4 * rng.normal())
        b.place(theta, psi, 0.9 / np.abs(drive.angle_orders).max() / h, rate)
        # the scheme begins half a step earlier
        b.data.qpos[b.v] += 0.5 * h * b.data.qvel[b.v]
        mujoco.mj_forward(b.model, b.data)
        motion = b.motion()
        want = scheme_force(drive, motion, timestep=h, damping=b.drive.damping)
        t = b.model.tendon(b.drive.tendon).id
        g = np.array([want.g_theta, want.g_psi])
        shift = h * want.metric * b.data.ten_velocity[t] * g
        np.testing.assert_allclose(
            b.data.qfrc_passive[b.v],
            np.array([want.theta, want.psi]) + shift,
            rtol=0,
            atol=1e-12 * scale(drive) + 1e-12 * np.abs(shift).max(),
        )


def test_forces_do_not_depend_on_earlier_positions(bench, synthetic_map):
    """The same state yields the same bits after the joint has been elsewhere."""
    b = bench(with_many_harmonics(synthetic_map, WAVES), damping_ratio=0.05)
    ratio = b.drive.drive.ratio
    forces = []
    for psi in (0.1, 0.1 + 1e-3, 0.4, 0.1):
        b.place(ratio * psi, psi, 1.0, 1.0 / ratio)
        mujoco.mj_forward(b.model, b.data)
        forces.append(b.data.qfrc_passive[b.v].copy())
    np.testing.assert_array_equal(forces[3], forces[0])
    assert (forces[1] != forces[0]).any()


LIMIT = {"joint": 'limited="true" range="-10 10"'}
WELD = {"equality": '<equality><weld body1="link"/></equality>'}


@pytest.mark.parametrize(
    ("keys", "psi", "acts"),
    [
        (LIMIT, 0.2, True),
        (LIMIT, 0.1, False),
        ({"joint": 'frictionloss=".1"'}, 0.2, False),
        (WELD, 0.2, False),
        (LIMIT | {"damping_ratio": 0.001}, 0.2, False),
    ],
    ids=["pressed", "free", "friction loss", "equality", "damped"],
)
def test_a_drive_without_losses_is_damped_while_a_limit_acts(
    bench, synthetic_map, keys, psi, acts
):
    """The torque and the metric equal the twin's, with contact_damping then only.

    Rows of friction loss and equalities are neither contacts nor limits, and a drive
    with losses keeps its own damping.
    """
    b = bench(synthetic_map, **keys)
    b.place(synthetic_map.ratio * psi, psi, 3.0, 0.2)
    b.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_DAMPER * acts
    mujoco.mj_forward(b.model, b.data)
    assert (b.data.nefc > 0) == (psi == 0.2)
    h = b.model.opt.timestep
    floor = 0.05 * 2.0 * np.sqrt(b.drive.stiffness / b.drive.mobility)
    damping = floor if acts else b.drive.damping
    want = scheme_force(synthetic_map, b.motion(), timestep=h, damping=damping)
    tendon = b.model.tendon(b.drive.tendon).id
    metric = 1e-9 + 3.0 * b.data.ten_length[tendon] ** 2
    assert metric == pytest.approx(want.metric, rel=1e-8)
    shift = h * want.metric * b.data.ten_velocity[tendon]
    g = np.array([want.g_theta, want.g_psi])
    np.testing.assert_allclose(
        b.data.qfrc_passive[b.v], [want.theta, want.psi] + shift * g, rtol=1e-8
    )


@pytest.mark.parametrize("torque", [0.0, 40.0])
def test_trajectory_equals_twin(bench, any_layout, torque):
    """300 loaded steps, plugin state included, equal the scheme solved in numpy."""
    rotor = 0.144 / any_layout.ratio**2
    b = bench(any_layout, damping_ratio=0.02, rotor_inertia=rotor)
    b.place(0.2, 0.2 / any_layout.ratio, 20.0, 20.0 / any_layout.ratio)
    b.data.qfrc_applied[b.v] = -torque / any_layout.ratio, 0.6 * torque
    twin = b.twin(300)
    mujoco.mj_step(b.model, b.data, 300)
    ratio = abs(any_layout.ratio)
    np.testing.assert_allclose(
        b.data.qpos[b.q] / [ratio, 1], twin.q / [ratio, 1], rtol=0, atol=1e-10
    )
    np.testing.assert_allclose(
        b.data.qvel[b.v] / [ratio, 1], twin.v / [ratio, 1], rtol=0, atol=1e-7
    )
    # what the drive did not cause is what was applied, over the inertia
    if torque:
        inertia = np.array([rotor, b.drive.link_inertia])
        np.testing.assert_allclose(
            b.data.plugin_state, b.data.qfrc_applied[b.v] / inertia, rtol=1e-6
        )


def test_a_map_without_harmonics_equals_twin_across_its_knots(bench):
    """The three lines of a catalogue drive alone, wound up past all corners."""
    drive = DriveMap.from_catalogue("CSG-25-100")
    drive = drive.with_harmonics(np.arange(len(drive.angle_orders)) == 0)
    b = bench(drive)
    b.place(0.0, 3.0 * drive.torsion_knots[0])
    twin = b.twin(40)
    torsion = []
    for _ in range(40):
        mujoco.mj_step(b.model, b.data)
        torsion.append(float(drive.torsion(*b.data.qpos[b.q])))
    assert min(torsion) < drive.torsion_knots[0]
    assert max(torsion) > drive.torsion_knots[-1]
    np.testing.assert_allclose(b.data.qpos[b.q], twin.q, rtol=1e-9)
    np.testing.assert_allclose(b.data.qvel[b.v], twin.v, rtol=1e-9)


def test_force_is_slope_of_potential(bench, any_layout):
    """Differences of V over the positions give the plugin's force to 1e-7."""
    b = bench(any_layout, integrator="RK4")
    drive = any_layout
    rng = np.random.default_rng(3)
    ratio = abs(drive.ratio)

    def energy(theta, psi):
        return float(drive.energy(drive.torsion(theta, psi), theta, psi))

    for _ in range(40):
        theta = rng.uniform(-3, 3)
        psi = theta / drive.ratio + 1.2 * rng.uniform(-1, 1) * drive.torsion_knots[-1]
        b.place(theta, psi)
        mujoco.mj_forward(b.model, b.data)
        # fourth order, about 1e-2 of the shortest wave and of a knot interval
        d_theta, d_psi = 2e-4 * min(1.0, ratio / 50), 4e-6
        slope = [
            (
                8 * (energy(theta + x, psi + y) - energy(theta - x, psi - y))
                - (
                    energy(theta + 2 * x, psi + 2 * y)
                    - energy(theta - 2 * x, psi - 2 * y)
                )
            )
            / (12 * (x + y))
            for x, y in ((d_theta, 0.0), (0.0, d_psi))
        ]
        np.testing.assert_allclose(
            b.data.qfrc_passive[b.v] * [ratio, 1],
            -np.array(slope) * [ratio, 1],
            rtol=0,
            atol=1e-7 * scale(drive),
        )
