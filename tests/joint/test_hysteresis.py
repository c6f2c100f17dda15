"""Level full with hysteresis: twin, closed form, energy, state."""

from __future__ import annotations

import copy
from dataclasses import replace

import mujoco
import mujoco.rollout
import numpy as np
import pytest
from messages import naming

from swgjoint.joint import plugin
from swgjoint.joint.attach import attach
from swgjoint.joint.reference import gradient_force, scheme_force
from swgjoint.joint.region import check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin

ELEMENTS = (
    Jenkin(stiffness=2e4, yield_torque=2.0),
    Jenkin(stiffness=9e4, yield_torque=5.0),
)


LOADED = (
    Jenkin(stiffness=9e4, yield_torque=2.0, yield_curve=((15.0, 5.0), (60.0, 1.0))),
    Jenkin(stiffness=3e5, yield_torque=0.0, yield_curve=((50.0, 8.0),)),
)


@pytest.fixture(params=[ELEMENTS, LOADED], ids=["constant", "loaded"])
def lossy(request: pytest.FixtureRequest, any_layout: DriveMap) -> DriveMap:
    """The synthetic map in each layout, with two elements."""
    return replace(any_layout, hysteresis=request.param)


def random_motion(b, rng):
    """A state that sticks, slips, or slips before the step is through."""
    drive = b.drive.drive
    theta = rng.uniform(-8, 8)
    torsion = rng.uniform(-1, 1) * drive.torsion_knots[-1]
    psi = theta / drive.ratio - torsion
    rates = rng.normal(0, 20), rng.normal(0, 0.5)
    rest = drive.torsion(theta, psi) + 2e-4 * rng.standard_normal(2)
    limit = np.zeros(b.data.plugin_state.size - 4)
    if limit.size:
        limit[:] = rng.uniform(1e-5, 2e-4, 2)
    b.place(theta, psi, *rates)
    b.data.plugin_state[:] = rng.normal(0, 300), rng.normal(0, 5), *rest, *limit
    mujoco.mj_forward(b.model, b.data)
    return b.motion(rest=tuple(rest), limit=tuple(limit))


@pytest.mark.parametrize("integrator", ["RK4", "discrete"])
def test_force_equals_twin(bench, lossy, integrator):
    """Forces, and under discrete the metric, are the twin's to round-off."""
    b = bench(lossy, damping_ratio=0.05, integrator=integrator)
    rng = np.random.default_rng(2)
    t, h = b.model.tendon(b.drive.tendon).id, b.model.opt.timestep
    top = max(abs(x) for x in lossy.torque_range)
    for _ in range(100):
        motion = random_motion(b, rng)
        shift = np.zeros(2)
        if integrator == "discrete":
            f = scheme_force(lossy, motion, timestep=h, damping=b.drive.damping)
            metric = 1e-9 + 3 * b.data.ten_length[t] ** 2
            assert metric == pytest.approx(f.metric, rel=1e-8)
            g = np.array([f.g_theta, f.g_psi])
            shift = h * f.metric * b.data.ten_velocity[t] * g
            want = np.array([f.theta, f.psi]) + shift
        else:
            want = np.array(gradient_force(lossy, motion, damping=b.drive.damping))
        np.testing.assert_allclose(
            b.data.qfrc_passive[b.v],
            want,
            rtol=0,
            atol=1e-11 * top + 1e-11 * np.abs(shift).max(),
        )


def test_trajectory_equals_twin(bench, lossy):
    """300 loaded steps with the state of the elements equal the scheme in numpy."""
    rotor = 0.144 / lossy.ratio**2
    b = bench(lossy, damping_ratio=0.02, rotor_inertia=rotor)
    b.place(0.2, 0.2 / lossy.ratio, 20.0, 20.0 / lossy.ratio)
    b.data.qfrc_applied[b.v] = -20.0 / lossy.ratio, 12.0
    twin = b.twin(300)
    mujoco.mj_step(b.model, b.data, 300)
    ratio = abs(lossy.ratio)
    np.testing.assert_allclose(
        b.data.qpos[b.q] / [ratio, 1], twin.q / [ratio, 1], rtol=0, atol=1e-10
    )
    np.testing.assert_allclose(b.rest, twin.rest, rtol=0, atol=1e-10)
    assert np.abs(b.rest).min() > 1e-5  # they have slipped


@pytest.mark.parametrize("integrator", ["RK4", "discrete"])
def test_cycle_loses_four_f_times_the_slip(bench, integrator):
    """A slow cycle loses 4 f (X - f/k); observe() has the torque of the engine."""
    k, f, amplitude = 4e3, 2.0, 2e-3
    drive = replace(
        DriveMap.linear(2e4), hysteresis=(Jenkin(stiffness=k, yield_torque=f),)
    )
    b = bench(drive, step=1e-7, integrator=integrator)  # the step moves nothing
    turn = np.linspace(0.0, 4.0 * np.pi, 1001)
    torque, torsion = [], []
    for x in amplitude * np.sin(turn):
        b.place(b.drive.ratio * x, 0.0, 0.0, 0.0)
        mujoco.mj_step(b.model, b.data)
        b.place(b.drive.ratio * x, 0.0, 0.0, 0.0)
        mujoco.mj_forward(b.model, b.data)
        signals = b.drive.observe(b.model, b.data)
        assert signals.torque == pytest.approx(b.data.qfrc_passive[b.v[1]], abs=1e-4)
        torque.append(float(signals.torque))
        torsion.append(float(signals.torsion))
    last = slice(500, 1001)
    loss = float(np.trapezoid(np.array(torque)[last], np.array(torsion)[last]))
    assert loss == pytest.approx(4.0 * f * (amplitude - f / k), rel=1e-3)


def test_full_equals_native_elements(bench):
    """The plugin moves as the engine's own springyield tendon under RK4.

    The engine slips at the end of a step: the two differ by its length.
    """
    drive = replace(DriveMap.linear(2e4), hysteresis=ELEMENTS[:1])
    paths = {}
    for level in ("native", "full"):
        b = bench(drive, level=level, integrator="RK4", step=2e-6)
        b.place(0.0, 2e-3, 10.0, 0.0)
        path = []
        for _ in range(100):
            mujoco.mj_step(b.model, b.data, 200)
            path.append(b.data.qpos[b.q] @ [1 / drive.ratio, -1])
        paths[level] = np.array(path)
    swing = np.ptp(paths["full"])
    assert np.abs(paths["full"] - paths["native"]).max() < 2e-3 * swing
    bare = bench(replace(drive, hysteresis=()), integrator="RK4", step=2e-6)
    bare.place(0.0, 2e-3, 10.0, 0.0)
    mujoco.mj_step(bare.model, bare.data, 20_000)
    off = bare.data.qpos[bare.q] @ [1 / drive.ratio, -1] - paths["full"][-1]
    assert abs(off) > 0.05 * swing  # the elements matter


@pytest.mark.parametrize(
    "elements", [ELEMENTS, LOADED, (Jenkin(stiffness=4e5, yield_torque=10.0),)]
)
def test_free_swing_only_loses(bench, synthetic_map, elements):
    """Energy falls from step to step at 1 ms until no element slips any more.

    Two elements, and one that while it sticks is 20 times as stiff as the drive
    (h w = 2 in the torsion mode).
    """
    drive = replace(synthetic_map.with_harmonics([1, 1, 1, 0, 1]), hysteresis=elements)
    b = bench(drive)
    psi = -0.9 * drive.torsion_knots[-1]
    b.place(0.0, psi)
    b.rest[:] = drive.torsion(0.0, psi)
    assert check_region(b.drive, timestep=1e-3).ok
    energy = [b.energy(midpoint=True)]
    for _ in range(1000):
        mujoco.mj_step(b.model, b.data)
        energy.append(b.energy(midpoint=True))
    # what one linearised solve leaves; seen: 3e-6
    assert np.diff(energy).max() < 1e-5 * energy[0]
    assert energy[-1] < 0.02 * energy[0]


def test_swing_below_yield_goes_on(bench):
    """An element that never slips is a spring: higher frequency, no loss."""
    K, k = 2e4, 1e4
    b = bench(
        replace(
            DriveMap.linear(K), hysteresis=(Jenkin(stiffness=k, yield_torque=1e3),)
        ),
        step=1e-4,
    )
    b.place(0.0, -1e-3)
    energy, swing = [b.energy(midpoint=True)], []
    for _ in range(2000):
        mujoco.mj_step(b.model, b.data)
        energy.append(b.energy(midpoint=True))
        swing.append(b.data.qpos[b.q] @ [1 / b.drive.ratio, -1])
    assert energy[-1] == pytest.approx(energy[0], rel=1e-3)
    rotor, link = b.drive.ratio**2 * b.drive.rotor_inertia, b.drive.link_inertia
    frequency = np.sqrt((K + k) * (1 / rotor + 1 / link)) / (2 * np.pi)
    crossings = np.sum(np.diff(np.sign(swing)) != 0)
    assert crossings / 2 / 0.2 == pytest.approx(frequency, rel=0.02)


def start(b):
    b.place(0.1, -5e-4, 30.0, 0.5)
    b.data.qfrc_applied[b.v] = 0.2, -20.0
    mujoco.mj_step(b.model, b.data, 50)
    assert np.abs(b.data.plugin_state).min() > 0.0


def full_state(b, data, kind=mujoco.mjtState.mjSTATE_INTEGRATION):
    state = np.empty(mujoco.mj_stateSize(b.model, kind))
    mujoco.mj_getState(b.model, data, state, kind)
    return state


@pytest.mark.parametrize("integrator", ["RK4", "discrete"])
def test_copies_and_rollout_continue_bitwise(bench, synthetic_map, integrator):
    """A copy, a copy within a step, a set state and two threads: the same bits."""
    b = bench(replace(synthetic_map, hysteresis=ELEMENTS), integrator=integrator)
    if integrator == "RK4":
        b.model.opt.timestep = 2e-4
        b.place(0.1, -3e-3, 30.0, 0.5)
        mujoco.mj_step(b.model, b.data, 50)
    else:
        start(b)
    state = full_state(b, b.data)
    twin, fresh = copy.copy(b.data), mujoco.MjData(b.model)
    mujoco.mj_setState(b.model, fresh, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    threads = [mujoco.MjData(b.model) for _ in range(2)]
    begin = np.tile(full_state(b, b.data, kind), (4, 1))
    applied = b.data.qfrc_applied.copy()
    b.data.qfrc_applied[:] = 0.0
    rolled, _ = mujoco.rollout.rollout(b.model, threads, begin, nstep=200)
    free = copy.copy(b.data)
    free.qacc_warmstart[:] = 0.0
    mujoco.mj_step(b.model, free, 200)
    for k in range(4):
        np.testing.assert_array_equal(rolled[k, -1], full_state(b, free, kind))
    b.data.qfrc_applied[:] = applied
    for data in (b.data, twin, fresh):
        mujoco.mj_step(b.model, data, 200)
        np.testing.assert_array_equal(full_state(b, data), full_state(b, b.data))
    if integrator == "discrete":
        mujoco.mj_step1(b.model, b.data)
        twin = copy.copy(b.data)
        for data in (b.data, twin):
            mujoco.mj_step2(b.model, data)
            mujoco.mj_step(b.model, data, 20)
        np.testing.assert_array_equal(full_state(b, twin), full_state(b, b.data))
    mujoco.mj_resetData(b.model, b.data)
    assert not b.data.plugin_state.any()


def test_forward_does_not_slip(bench, synthetic_map):
    """mj_forward at other positions leaves the state of the elements alone."""
    b = bench(replace(synthetic_map, hysteresis=ELEMENTS))
    start(b)
    before = b.data.plugin_state.copy()
    b.data.qpos[b.q] += [0.0, 3e-3]
    mujoco.mj_forward(b.model, b.data)
    mujoco.mj_forward(b.model, b.data)
    np.testing.assert_array_equal(b.data.plugin_state, before)


def test_a_map_without_hysteresis_has_no_state_for_it(bench, synthetic_map):
    """Two numbers of state and no attribute, as before; else one more per element."""
    b = bench(synthetic_map)
    assert b.model.npluginstate == 2
    assert "hysteresis" not in plugin.config(synthetic_map, damping=0.0)
    b = bench(replace(synthetic_map, hysteresis=ELEMENTS))
    assert b.model.npluginstate == 4


@pytest.mark.parametrize(
    "text", ["1", "1 2 3", "1 -2", "0 1", "1 nan", "x", "1 1 " * 65]
)
def test_bad_attribute_is_rejected(text):
    """Elements that are no pairs of positive numbers give an error that names them."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    drive = DriveMap.linear(1e4)
    attach(spec, joint="j", drive=drive, rotor_inertia=4e-5)
    [instance] = spec.plugins
    instance.config = {**plugin.config(drive, damping=1.0), "hysteresis": text}
    with pytest.raises(
        ValueError, match=naming("'j_drive'", "'hysteresis'", "64", "pairs", "> 0")
    ):
        spec.compile()


def test_stiff_sticking_leaves_the_region(bench):
    """The elements that stick count in the largest stiffness."""
    element = Jenkin(stiffness=6e5, yield_torque=1.0)
    b = bench(replace(DriveMap.linear(2e4), hysteresis=(element,)))
    region = check_region(b.drive, timestep=1e-3)
    assert not region.ok
    assert "largest over mean stiffness = 31 > 30" in region.message
    steps = [
        check_region(
            replace(b.drive, drive=drive), timestep=1.0, integrator="RK4"
        ).suggested_timestep
        for drive in (b.drive.drive, DriveMap.linear(2e4))
    ]
    assert steps[0] == pytest.approx(steps[1] / np.sqrt(31), rel=0.1)


def test_equal_curves_step_bit_for_bit_as_constants(bench, synthetic_map):
    """A curve of one value gives the bits of the constant element in every step."""
    flat = tuple(replace(e, yield_curve=((30.0, e.yield_torque),)) for e in ELEMENTS)
    ends = []
    for elements in (ELEMENTS, flat):
        b = bench(replace(synthetic_map, hysteresis=elements))
        b.place(0.1, -5e-4, 30.0, 0.5)
        b.data.qfrc_applied[b.v] = 0.2, -20.0
        mujoco.mj_step(b.model, b.data, 200)
        ends.append((b.data.qpos.copy(), b.data.qvel.copy(), b.rest.copy()))
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)


def test_loaded_elements_continue_bitwise_from_a_state(bench, synthetic_map):
    """Copies, also within a step, and a state that is set: the same bits."""
    b = bench(replace(synthetic_map, hysteresis=LOADED))
    b.place(0.1, -5e-4, 30.0, 0.5)
    b.data.qfrc_applied[b.v] = 0.2, -20.0
    mujoco.mj_step(b.model, b.data, 50)
    assert b.model.npluginstate == 6 and b.data.plugin_state[4:].min() > 0.0
    fresh = mujoco.MjData(b.model)
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    mujoco.mj_setState(b.model, fresh, full_state(b, b.data), kind)
    mujoco.mj_step1(b.model, b.data)
    twin = copy.copy(b.data)
    for data in (b.data, twin):
        mujoco.mj_step2(b.model, data)
        mujoco.mj_step(b.model, data, 20)
    mujoco.mj_step(b.model, fresh, 21)
    np.testing.assert_array_equal(full_state(b, twin), full_state(b, b.data))
    np.testing.assert_array_equal(full_state(b, fresh), full_state(b, b.data))


@pytest.mark.parametrize("integrator", ["RK4", "discrete"])
def test_observed_torque_is_that_of_the_engine(bench, integrator):
    """observe() and the engine agree after a step, while the load changes."""
    element = Jenkin(stiffness=6e4, yield_torque=0.5, yield_curve=((40.0, 5.0),))
    b = bench(
        replace(DriveMap.linear(2e4), hysteresis=(element,)),
        step=1e-7,
        integrator=integrator,
    )
    for x in 2e-3 * np.sin(np.linspace(0.0, 9.0, 200)):
        b.place(b.drive.ratio * x, 0.0, 0.0, 0.0)
        mujoco.mj_step(b.model, b.data)
        b.place(b.drive.ratio * x, 0.0, 0.0, 0.0)
        mujoco.mj_forward(b.model, b.data)
        signals = b.drive.observe(b.model, b.data)
        assert signals.torque == pytest.approx(b.data.qfrc_passive[b.v[1]], abs=1e-4)


@pytest.mark.parametrize("text", ["1 0 1", "2 1 2 1 1", "2 0 5 1", "2 0 5 1 -1", "x"])
def test_bad_yield_curve_is_rejected(text):
    """A table that does not fit the elements gives an error that names it."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    drive = replace(
        DriveMap.linear(1e4), hysteresis=(Jenkin(stiffness=1e4, yield_torque=1.0),)
    )
    attach(spec, joint="j", drive=drive, rotor_inertia=4e-5)
    [instance] = spec.plugins
    instance.config = {**plugin.config(drive, damping=1.0), "yield_curve": text}
    with pytest.raises(
        ValueError, match=naming("'j_drive'", "'yield_curve'", "torques", ">= 0")
    ):
        spec.compile()


def test_native_takes_the_yield_at_half_the_rated_torque(bench):
    """A tendon yields at a constant torque; an element without torque there is none."""
    drive = DriveMap.linear(2e4)  # rated 100 N·m
    loaded = Jenkin(stiffness=4e4, yield_torque=1.0, yield_curve=((100.0, 3.0),))
    none = Jenkin(
        stiffness=4e4, yield_torque=0.0, yield_curve=((60.0, 0.0), (90.0, 1.0))
    )
    b = bench(replace(drive, hysteresis=(loaded, none)), level="native")
    assert b.drive.elements == (Jenkin(stiffness=4e4, yield_torque=2.0),)
