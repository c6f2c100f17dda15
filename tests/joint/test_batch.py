"""Many simulations at once: a Batch gives what the loop gives, bit by bit."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

COUNT, STEPS = 6, 120


def starts(b):
    """Different torsions and speeds, some beyond the outer knots. (n, 2) each."""
    rng = np.random.default_rng(5)
    psi = rng.uniform(-2, 2, COUNT) * b.drive.drive.torsion_knots[-1]
    theta = rng.uniform(-1, 1, COUNT)
    q = np.column_stack([theta, theta / b.drive.ratio + psi])
    return q, np.column_stack([rng.normal(0, 20, COUNT), rng.normal(0, 0.3, COUNT)])


def loop(b, model, q, v, load):
    """The same run in an MjData of its own; positions, velocities, plugin state."""
    data = mujoco.MjData(model)
    data.qpos[b.q], data.qvel[b.v] = q, v
    data.qfrc_applied[b.v] = load
    mujoco.mj_step(model, data, STEPS)
    return np.concatenate([data.qpos, data.qvel, data.plugin_state])


@pytest.mark.parametrize("integrator", ["discrete", "RK4"])
@pytest.mark.parametrize("persistent", [False, True])
def test_batch_equals_loop(bench, synthetic_map, integrator, persistent):
    """Two threads with fewer MjData than simulations, the plugin's state included."""
    b = bench(synthetic_map, integrator=integrator, step=5e-4, damping_ratio=0.02)
    q, v = starts(b)
    load = np.array([0.2, -20.0])
    batch = Batch(b.model, COUNT, nthread=2, persistent=persistent)
    batch.qpos[:, b.q], batch.qvel[:, b.v] = q, v
    batch.qfrc_applied[:, b.v] = load
    for _ in range(STEPS // 40):
        batch.step(nstep=40)
    for k in range(COUNT):
        got = np.concatenate([batch.qpos[k], batch.qvel[k], batch.plugin_state[k]])
        np.testing.assert_array_equal(got, loop(b, b.model, q[k], v[k], load))
    if integrator == "discrete":
        assert np.abs(batch.plugin_state).min() > 0.0


def test_batch_equals_loop_at_a_limit(bench, synthetic_map):
    """Simulations that press against a limit and free ones do not mix their damping."""
    half = np.rad2deg(np.median(np.abs(starts(bench(synthetic_map))[0][:, 1])))
    b = bench(synthetic_map, joint=f'limited="true" range="{-half} {half}"')
    q, v = starts(b)
    batch = Batch(b.model, COUNT, nthread=2, persistent=False)
    batch.qpos[:, b.q], batch.qvel[:, b.v] = q, v
    for _ in range(STEPS):
        batch.step()
    assert b.drive.contact_damping > 0.0
    for k in range(COUNT):
        got = np.concatenate([batch.qpos[k], batch.qvel[k], batch.plugin_state[k]])
        want = loop(b, b.model, q[k], v[k], np.zeros(2))
        np.testing.assert_array_equal(got, want)


def test_expanded_fields_equal_models_of_their_own(bench, synthetic_map):
    """Inertia, carrier stiffness and step per simulation act as in separate models."""
    b = bench(synthetic_map, damping_ratio=0.02)
    q, v = starts(b)
    rng = np.random.default_rng(6)
    batch = Batch(b.model, COUNT, nthread=2)
    armature = batch.expand("dof_armature")
    # the plugin takes the carrier tendon's own spring out again: any value will do
    carrier = batch.expand("tendon_stiffness")
    step = batch.expand("opt.timestep")
    armature[:, b.v] = rng.uniform(0.0, 1.0, (COUNT, 2)) * [1e-4, 0.5]
    carrier[:] = rng.uniform(1e-9, 1e3, carrier.shape)
    step[:] = rng.uniform(2e-4, 1e-3, step.shape)
    batch.set_const()
    batch.qpos[:, b.q], batch.qvel[:, b.v] = q, v
    batch.step(nstep=STEPS)
    ends = []
    for k in range(COUNT):
        model = copy.copy(b.model)
        model.dof_armature[:] = armature[k]
        model.tendon_stiffness[:] = carrier[k]
        model.opt.timestep = float(np.ravel(step[k])[0])
        mujoco.mj_setConst(model, mujoco.MjData(model))
        end = loop(b, model, q[k], v[k], np.zeros(2))
        got = np.concatenate([batch.qpos[k], batch.qvel[k], batch.plugin_state[k]])
        np.testing.assert_array_equal(got, end)
        ends.append(end)
    assert np.ptp(ends, axis=0).min() > 0.0
