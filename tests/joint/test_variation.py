"""A specimen that deviates from its map equals the map that it then has."""

from __future__ import annotations

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from messages import naming
from mujoco.batch import Batch

from swgjoint.errors import InputError
from swgjoint.joint.attach import attach
from swgjoint.joint.reference import gradient_force, scheme_force
from swgjoint.joint.variation import SIZE, Variation
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import Jenkin

SPECIMEN = Variation(
    stiffness=-0.2, kinematic_error=0.4, theta=1.1, psi=-0.7, losses=0.5
)


@pytest.fixture
def lossy(any_layout):
    """The synthetic map in each layout, with hysteresis and friction."""
    return replace(
        any_layout,
        hysteresis=(Jenkin(stiffness=2e4, yield_torque=2.0),),
        friction=Friction(
            stiffness=70.0,
            damping=0.05,
            coulomb=0.04,
            static=0.06,
            viscous=1e-3,
            load=0.05,
        ),
    )


def vary(b, variation=SPECIMEN):
    """Write the deviations into the compiled model."""
    t = b.model.tendon(b.drive.tendon).id
    b.model.tendon_user[t] = variation.numbers


def random_motion(b, rng):
    """A state of the specimen, its elements between stuck and slipping."""
    drive = b.drive.drive
    theta = rng.uniform(-8, 8)
    psi = theta / drive.ratio - rng.uniform(-1, 1) * drive.torsion_knots[-1]
    rates = rng.normal(0, 20), rng.normal(0, 0.5)
    rest = SPECIMEN.apply_to(drive).torsion(theta, psi) + 2e-4 * rng.standard_normal(1)
    beta = float(np.dot(drive.friction_direction, [theta, psi]))
    relaxed = beta + 1e-3 * rng.standard_normal()
    b.place(theta, psi, *rates)
    b.data.plugin_state[:] = rng.normal(0, 300), rng.normal(0, 5), *rest, relaxed, 1.0
    mujoco.mj_forward(b.model, b.data)
    return b.motion(rest=tuple(rest), relaxed=relaxed)


@pytest.mark.parametrize("integrator", ["RK4", "discrete"])
def test_force_equals_twin_of_the_varied_map(bench, lossy, integrator):
    """Force, direction and stiffness are the twin's of ``Variation.apply_to``."""
    b = bench(lossy, damping_ratio=0.05, integrator=integrator, variable=True)
    vary(b)
    other = SPECIMEN.apply_to(lossy)
    rng = np.random.default_rng(2)
    t = b.model.tendon(b.drive.tendon).id
    f = b.model.tendon("j_friction").id
    h, damping = b.model.opt.timestep, b.drive.damping
    top = max(abs(x) for x in other.torque_range)
    row = b.model.ten_J_rowadr[t]
    entries = [row + list(b.model.ten_J_colind[row:]).index(dof) for dof in b.v]
    ratio, direction = abs(lossy.ratio), np.array(lossy.friction_direction)
    for _ in range(100):
        motion, shift = random_motion(b, rng), np.zeros(2)
        if integrator == "discrete":
            want = scheme_force(other, motion, timestep=h, damping=damping)
            g = np.array([want.g_theta, want.g_psi])
            np.testing.assert_allclose(b.data.ten_J[entries], g, rtol=1e-12)
            metric = 1e-9 + 3.0 * b.data.ten_length[t] ** 2
            assert metric == pytest.approx(want.metric, rel=1e-8)
            # the engine's shifts along the two tendons are cancelled by the plugin
            shift = h * want.metric * b.data.ten_velocity[t] * g
            shift += h * want.friction.metric * b.data.ten_velocity[f] * direction
            force = np.array([want.theta, want.psi])
        else:
            force = np.array(gradient_force(other, motion, damping=damping))
        np.testing.assert_allclose(
            b.data.qfrc_passive[b.v] * [ratio, 1.0],
            (force + shift) * [ratio, 1.0],
            rtol=0,
            atol=1e-11 * top + 1e-12 * ratio * np.abs(shift).max(),
        )


def test_specimen_moves_as_its_own_map(bench, lossy):
    """300 loaded steps of the specimen equal those of a model with its map."""
    b = bench(lossy, variable=True)
    vary(b)
    own = bench(SPECIMEN.apply_to(lossy), link=0.4, damping_ratio=0.0)
    ends = []
    for one in (b, own):
        one.place(0.2, 0.2 / lossy.ratio, 20.0, 20.0 / lossy.ratio)
        one.data.qfrc_applied[one.v] = 0.3, -10.0
        mujoco.mj_step(one.model, one.data, 300)
        ends.append(np.concatenate([one.data.qpos, one.data.qvel]))
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-8)


def test_zero_deviation_is_the_map_bit_by_bit(bench, lossy):
    """Room for deviations, and none of them, change no bit of a run."""
    ends = []
    for keys in ({}, {"variable": True}):
        b = bench(lossy, **keys)
        assert b.model.nuser_tendon == (SIZE if keys else 0)
        b.place(0.2, 0.2 / lossy.ratio, 20.0, 20.0 / lossy.ratio)
        mujoco.mj_step(b.model, b.data, 200)
        ends.append(np.concatenate([b.data.qpos, b.data.qvel, b.data.plugin_state]))
    np.testing.assert_array_equal(*ends)


def test_specimens_of_a_batch_equal_models_of_their_own(bench, lossy):
    """Simulations that differ on two threads run as in separate models, bit by bit."""
    b = bench(lossy, variable=True)
    rng, count, steps = np.random.default_rng(3), 6, 120
    numbers = np.array(
        [
            Variation(
                stiffness=x[0], kinematic_error=x[1], theta=x[2], psi=x[3], losses=x[4]
            ).numbers
            for x in rng.uniform(-0.5, 0.5, (count, SIZE))
        ]
    )
    t = b.model.tendon(b.drive.tendon).id
    batch = Batch(b.model, count, nthread=2)
    batch.expand("tendon_user")[:, t] = numbers
    start = 0.2 / lossy.ratio + 0.3 * lossy.torsion_knots[-1]
    batch.qpos[:, b.q], batch.qvel[:, b.v] = (0.2, start), (20.0, 0.1)
    batch.step(nstep=steps)
    ends = []
    for k in range(count):
        model = copy.copy(b.model)
        model.tendon_user[t] = numbers[k]
        data = mujoco.MjData(model)
        data.qpos[b.q], data.qvel[b.v] = (0.2, start), (20.0, 0.1)
        mujoco.mj_step(model, data, steps)
        end = np.concatenate([data.qpos, data.qvel, data.plugin_state])
        got = np.concatenate([batch.qpos[k], batch.qvel[k], batch.plugin_state[k]])
        np.testing.assert_array_equal(got, end)
        ends.append(end[:4])
    assert np.ptp(ends, axis=0).min() > 0.0


def test_a_model_may_have_user_data_of_its_own(synthetic_map):
    """Room for a drive grows beside what the model holds for its own tendons."""
    text = """
    <mujoco><option timestep="0.001"/><size nuser_tendon="2"/><worldbody>
      <body><joint name="j" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="1" diaginertia=".4 .4 .4"/></body>
      <body><joint name="k" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="1" diaginertia=".4 .4 .4"/></body>
    </worldbody><tendon><fixed name="own" user="7 8"><joint joint="k" coef="1"/></fixed>
    </tendon></mujoco>"""
    for variable, size in ((False, 2), (True, SIZE)):
        spec = mujoco.MjSpec.from_string(text)
        got = attach(
            spec, joint="j", drive=synthetic_map, rotor_inertia=4e-5, variable=variable
        )
        model = spec.compile()
        assert model.nuser_tendon == size
        own, ours = (model.tendon(name).id for name in ("own", got.tendon))
        assert model.tendon_user[own, :2].tolist() == [7.0, 8.0]
        assert not model.tendon_user[ours].any()


@pytest.mark.parametrize("integrator", ["discrete", "RK4"])
@pytest.mark.parametrize("keeps", [(), ("hysteresis",), ("friction",)])
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e308])
def test_a_bad_number_is_warned_of_and_forgotten(bench, lossy, bad, keeps, integrator):
    """The engine warns and starts anew, and the drive runs as if it had not seen it.

    Silent, the whole model would coast for the rest of the run.
    """
    without = {"hysteresis": (), "friction": None}
    drive = replace(lossy, **{k: v for k, v in without.items() if k not in keeps})
    b = bench(drive, variable=True, integrator=integrator)
    fresh = bench(drive, variable=True, integrator=integrator)
    user = b.model.tendon_user[b.model.tendon(b.drive.tendon).id]
    # a huge angle is still one, and losses count where there are any
    numbers = ([0, 1] if bad == 1e308 else [0, 1, 2, 3]) + [4] * bool(keeps)
    for number in numbers:
        mujoco.mj_resetData(b.model, b.data)
        b.place(0.2, 0.2 / drive.ratio, 20.0, 20.0 / drive.ratio)
        mujoco.mj_step(b.model, b.data, 20)
        user[number] = bad
        mujoco.mj_step(b.model, b.data)
        user[number] = 0.0
        assert b.data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 1
        assert np.isfinite(b.data.plugin_state).all()
        mujoco.mj_step(b.model, b.data)
        mujoco.mj_resetData(fresh.model, fresh.data)
        mujoco.mj_step(fresh.model, fresh.data)
        ends = []
        for one in (b, fresh):
            one.data.qfrc_applied[one.v] = 0.3, -10.0
            mujoco.mj_step(one.model, one.data, 50)
            ends.append(
                np.concatenate([one.data.qpos, one.data.qvel, one.data.plugin_state])
            )
        np.testing.assert_array_equal(*ends)
        assert np.abs(ends[0][:4]).min() > 0.0


def test_a_state_that_is_no_number_is_forgotten(bench, lossy):
    """With the engine's resets off, the next step writes finite states and goes on."""
    b = bench(lossy)
    b.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for k in range(len(b.data.plugin_state)):
        mujoco.mj_resetData(b.model, b.data)
        b.data.plugin_state[k] = np.nan
        mujoco.mj_step(b.model, b.data)
        assert np.isfinite(b.data.plugin_state).all()


@pytest.mark.parametrize("key", ["stiffness", "kinematic_error", "losses"])
def test_a_share_that_leaves_nothing_is_refused(key):
    """A deviation of minus one leaves no spring, no error or no losses."""
    with pytest.raises(InputError, match=naming(key, "-1.0", "> -1")):
        Variation(**{key: -1.0})
