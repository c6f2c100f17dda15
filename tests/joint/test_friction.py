"""Level full with friction: twin, passivity whatever happens, closed forms, state."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from messages import naming

from swgjoint.errors import InputError
from swgjoint.joint import plugin
from swgjoint.joint.attach import attach
from swgjoint.joint.friction_step import friction_step, stretch_after
from swgjoint.joint.reference import TwinMotion, gradient_force, scheme_force
from swgjoint.joint.region import check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import Jenkin

COULOMB = Friction(stiffness=100.0, coulomb=0.1, static=0.1)


@pytest.fixture
def rubbing(any_layout: DriveMap, friction_law) -> DriveMap:
    """The synthetic map in each layout, with friction and one element."""
    element = Jenkin(stiffness=2e4, yield_torque=2.0)
    return replace(any_layout, friction=friction_law, hysteresis=(element,))


def random_motion(b, rng) -> TwinMotion:
    """A state that sticks, slips, or slips before the step is through."""
    drive = b.drive.drive
    theta = rng.uniform(-8, 8)
    psi = theta / drive.ratio - rng.uniform(-1, 1) ** 5 * drive.torsion_knots[-1]
    rates = rng.normal(0, 1) * 10 ** rng.uniform(-2, 1.5), rng.normal(0, 0.1)
    rest = drive.torsion(theta, psi) + 1e-4 * rng.standard_normal(1)
    relaxed = float(np.dot(drive.friction_direction, (theta, psi)))
    relaxed += 2e-3 * rng.standard_normal()
    b.place(theta, psi, *rates)
    b.data.plugin_state[:] = rng.normal(0, 30), rng.normal(0, 0.5), *rest, relaxed, 1.0
    mujoco.mj_forward(b.model, b.data)
    return b.motion(rest=tuple(rest), relaxed=relaxed)


@pytest.mark.parametrize("integrator", ["RK4", "discrete"])
def test_force_equals_twin(bench, rubbing, integrator):
    """Forces, and under discrete both metrics, are the twin's to round-off."""
    b = bench(rubbing, damping_ratio=0.05, integrator=integrator)
    rng = np.random.default_rng(2)
    model, h = b.model, b.model.opt.timestep
    t, f_t = (model.tendon(name).id for name in ("j_drive", "j_friction"))
    top = max(abs(x) for x in rubbing.torque_range)
    slips = 0
    for _ in range(150):
        motion = random_motion(b, rng)
        shift = np.zeros(2)
        if integrator == "discrete":
            f = scheme_force(rubbing, motion, timestep=h, damping=b.drive.damping)
            metric = 1e-9 + 3 * b.data.ten_length[t] ** 2
            assert metric == pytest.approx(f.metric, rel=1e-8)
            rubs = 1e-9 + 3e-19 * b.data.ten_length[f_t] ** 2
            assert rubs == pytest.approx(f.friction.metric, rel=1e-8)
            slips += f.friction.offset != 70.0 * f.friction.stretch
            direction = np.array(rubbing.friction_direction)
            shift = (
                h * f.metric * b.data.ten_velocity[t] * np.array([f.g_theta, f.g_psi])
                + h * rubs * b.data.ten_velocity[f_t] * direction
            )
            want = np.array([f.theta, f.psi]) + shift
        else:
            want = np.array(gradient_force(rubbing, motion, damping=b.drive.damping))
        np.testing.assert_allclose(
            b.data.qfrc_passive[b.v],
            want,
            rtol=0,
            atol=1e-11 * top + 1e-11 * np.abs(shift).max(),
        )
    assert integrator == "RK4" or 5 < slips < 145


def test_trajectory_equals_twin(bench, rubbing):
    """300 loaded steps through rest and back equal the scheme in numpy, state too."""
    rotor = 0.144 / rubbing.ratio**2
    b = bench(rubbing, damping_ratio=0.02, rotor_inertia=rotor)
    rate = 2.0 * abs(rubbing.ratio) / 60
    b.place(0.2, 0.2 / rubbing.ratio, rate, rate / rubbing.ratio)
    b.data.qfrc_applied[b.v] = -8.0 / rubbing.ratio, 3.0
    twin = b.twin(300)
    mujoco.mj_step(b.model, b.data, 300)
    ratio = abs(rubbing.ratio)
    np.testing.assert_allclose(
        b.data.qpos[b.q] / [ratio, 1], twin.q / [ratio, 1], rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(b.bristle[0], twin.relaxed, rtol=0, atol=1e-8 * ratio)
    assert sum(f.offset == 70.0 * f.stretch for f in twin.rubs) < 300


positive = st.floats(1e-3, 1e3)
signed = st.floats(-1e3, 1e3)


@settings(max_examples=250, deadline=None, derandomize=True)
@given(
    reach=st.floats(0, 1e-1),
    stiffness=positive,
    damping=st.floats(0, 10),
    viscous=st.floats(0, 1),
    stretch=st.floats(-0.2, 0.2),
    speed=signed,
    free=signed,
    response=st.floats(1e-6, 1e4),
    step=st.floats(1e-5, 5e-3),
    off=st.floats(-10, 10),
)
def test_one_step_never_gives_more_than_the_bristle_had(
    reach, stiffness, damping, viscous, stretch, speed, free, response, step, off
):
    """Also where the true step is another than the predicted: work >= energy gained.

    And where it is the predicted one, the torque is that of the law: inside the reach
    the spring and dashpot, beyond it the work of sticking and of slipping.
    """
    law = Friction(stiffness=stiffness, damping=damping, viscous=viscous)
    got = friction_step(
        law,
        stretch=stretch,
        yield_torque=reach * stiffness,
        speed=speed,
        free=free,
        response=response,
        timestep=step,
    )
    dx = step * (speed + 0.5 * (free - response * got.predicted))
    for true in (dx, dx + off * max(reach, 1e-6), -dx, 0.0):
        # what the engine applies over the step is linear in the change of the speed
        change = 2.0 * (true / step - speed)
        work = (got.force + step * got.metric * change) * true
        end = stretch_after(law, got, true)
        gained = 0.5 * stiffness * (end**2 - got.stretch**2)
        scale = abs(work) + stiffness * got.stretch**2
        scale += abs(got.force * true) + step * got.metric * abs(change * true)
        assert gained <= work + 1e-12 * scale + 1e-90  # squares that underflow
        assert abs(end) <= reach * (1 + 1e-12)
    # the law by quadrature along the predicted way, at constant speed
    way = np.linspace(0.0, dx, 20_001)
    z = np.clip(got.stretch + way, -reach, reach)
    mean = stiffness * np.trapezoid(z, dx=1.0 / 20_000)
    mean += damping * (z[-1] - z[0]) / step + viscous * dx / step
    size = stiffness * reach + (damping + viscous * step) * abs(dx) / step
    slack = 1e-6 * (size + stiffness * abs(dx)) + 1e-9 * abs(got.predicted) + 1e-90
    # what the prediction takes off the speed must be the torque that is found
    assert abs(got.predicted - mean) <= slack + 1e-9 * (abs(speed) + abs(free)) * (
        stiffness * step + damping + viscous
    )


@settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    seed=st.integers(0, 2**32 - 1),
    step=st.sampled_from([2e-4, 1e-3, 5e-3]),
    stiffness=st.floats(1e0, 1e4),
    rotor=st.floats(-6.5, -3.5),
)
def test_random_pushes_never_give_energy(bench, seed, step, stiffness, rotor):
    """Random torques that jump: the energy gained is at most their work.

    On a linear spring the step is exact, so this holds from step to step to round-off,
    whatever the friction; its bristle counts in the energy. What is lost is seen, too.
    """
    law = Friction(
        stiffness=stiffness,
        coulomb=0.05,
        static=0.08,
        stribeck_speed=2.0,
        viscous=1e-4,
        load=0.1,
        damping=1e-3 * stiffness,
    )
    drive = replace(DriveMap.linear(2e4), friction=law)
    plugin.require_metric()
    with pytest.MonkeyPatch.context() as patch:
        # the damping of unresolved torsion is no friction and not quite passive
        exact = partial(plugin.config, numerical_damping=0.0)
        patch.setattr(plugin, "config", exact)
        b = bench(drive, step=step, rotor_inertia=10**rotor)
    rng = np.random.default_rng(seed)
    before, lost, scale = b.energy(midpoint=True), 0.0, 1e-3
    for _ in range(60):
        push = rng.normal(0, 0.3), rng.normal(0, 10.0)
        push = np.array(push) * (rng.random(2) < 0.5)
        b.data.qfrc_applied[b.v] = push
        x = b.data.qpos[b.q] - 0.5 * step * b.data.qvel[b.v]
        mujoco.mj_step(b.model, b.data)
        moved = b.data.qpos[b.q] - 0.5 * step * b.data.qvel[b.v] - x
        after, work = b.energy(midpoint=True), float(push @ moved)
        scale = max(scale, after, abs(work))
        assert after - before - work <= 1e-9 * scale
        lost += before + work - after
        before = after
    assert lost > 0.0


@pytest.mark.parametrize("step", [2e-4, 1e-3, 5e-3])
def test_coasting_stops_as_the_closed_form_says(bench, step):
    """Coulomb friction and the stretching of the bristle take f t + sigma_1 R.

    The rotor stops after that momentum is gone, and stays.
    """
    law = replace(COULOMB, damping=0.02)
    drive = replace(DriveMap.linear(2e4), friction=law, layout="flexspline_fixed")
    b = bench(drive, step=step, rotor_inertia=4e-5, link=1e-3)
    inertia = np.array([4e-5, 1e-3 / drive.ratio])
    total = 4e-5 + 1e-3 / drive.ratio**2
    b.place(0.0, 0.0, 100.0, 100.0 / drive.ratio)
    stretching = 0.02 * law.static / law.stiffness
    stop = (100.0 * total - stretching) / 0.1
    mujoco.mj_step(b.model, b.data, round(0.5 * stop / step))
    momentum = inertia @ b.data.qvel[b.v]
    # half a stretch, while the spring loads, and 100 rad/s
    slack = 0.5 * 0.1 * 1e-3 / 100.0 + 1e-3 * 100.0 * total
    assert momentum == pytest.approx(0.1 * (stop - b.data.time), abs=slack)
    mujoco.mj_step(b.model, b.data, round(20 * stop / step))
    stays = b.data.qpos[b.q[0]]
    assert abs(b.data.qvel[b.v[0]]) < 1e-3
    mujoco.mj_step(b.model, b.data, 100)
    assert b.data.qpos[b.q[0]] == pytest.approx(stays, abs=1e-4)


def test_true_stiction(bench):
    """Below the static torque nothing creeps in ten seconds, above it turns."""
    drive = replace(
        DriveMap.linear(2e4), friction=replace(COULOMB, damping=0.1), damping_ratio=0.0
    )
    for part, moves in ((0.98, False), (1.02, True)):
        b = bench(drive, joint='damping="100"', damping_ratio=0.1)
        # virtual work: friction on theta - psi = theta (1 - 1/i)
        torque = part * 0.1 * (1.0 - 1.0 / drive.ratio)
        for k in range(1000):
            b.data.qfrc_applied[b.v[0]] = torque * (k + 1) / 1000
            mujoco.mj_step(b.model, b.data)
        mujoco.mj_step(b.model, b.data, 2000)
        first = b.data.qpos[b.q[0]]
        mujoco.mj_step(b.model, b.data, 10_000)
        change = b.data.qpos[b.q[0]] - first
        if moves:
            assert change > 1.0
        else:
            # the bristle's own stretch, and no more of it
            assert first == pytest.approx(part * 0.1 / 100.0, rel=0.02)
            assert abs(change) < 1e-8


def test_full_equals_rk4(bench, rubbing, friction_law):
    """With a short step the scheme goes the same way as RK4."""
    rotor = 0.144 / rubbing.ratio**2
    # explicit integrators leave out the creep of a reach that grows
    rubbing = replace(rubbing, friction=replace(friction_law, damping=0.0))
    ends = []
    for integrator in ("discrete", "RK4"):
        b = bench(rubbing, integrator=integrator, step=1e-5, rotor_inertia=rotor)
        b.data.qfrc_applied[b.v] = 30.0 / rubbing.ratio, 5.0
        mujoco.mj_step(b.model, b.data, 10_000)
        ends.append(b.data.qpos[b.q] / [rubbing.ratio, 1])
    assert np.abs(ends[1]).max() > 0.1
    assert np.abs(ends[0] - ends[1]).max() < 1e-3 * np.abs(ends[1]).max()


def full_state(b, data, kind=mujoco.mjtState.mjSTATE_INTEGRATION):
    state = np.empty(mujoco.mj_stateSize(b.model, kind))
    mujoco.mj_getState(b.model, data, state, kind)
    return state


@pytest.mark.parametrize("integrator", ["RK4", "discrete"])
def test_copies_continue_bitwise(bench, synthetic_map, integrator, friction_law):
    """A copy and a set state go on with the same bits; a reset forgets the bristle."""
    b = bench(
        replace(synthetic_map, friction=friction_law), integrator=integrator, step=1e-4
    )
    b.place(0.1, -3e-3, 3.0, 0.05)
    mujoco.mj_step(b.model, b.data, 50)
    assert b.bristle[1] > 0.0
    twin, fresh = copy.copy(b.data), mujoco.MjData(b.model)
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    mujoco.mj_setState(b.model, fresh, full_state(b, b.data), kind)
    for data in (b.data, twin, fresh):
        mujoco.mj_step(b.model, data, 200)
        np.testing.assert_array_equal(full_state(b, data), full_state(b, b.data))
    mujoco.mj_resetData(b.model, b.data)
    assert not b.data.plugin_state.any()


def test_absent_unless_asked_for(bench, synthetic_map, friction_law):
    """No tendon, no state, no attribute unless the map has it and it is asked for."""
    b = bench(synthetic_map)
    assert (b.model.ntendon, b.model.npluginstate) == (1, 2)
    assert "friction" not in plugin.config(synthetic_map, damping=0.0)
    b = bench(replace(synthetic_map, friction=friction_law))
    assert (b.model.ntendon, b.model.npluginstate) == (2, 4)
    b = bench(replace(synthetic_map, friction=friction_law), friction=False)
    assert (b.model.ntendon, b.model.npluginstate) == (1, 2)
    b = bench(
        replace(synthetic_map, friction=friction_law), friction=False, level="native"
    )
    assert not b.model.dof_frictionloss.any() and not b.model.dof_damping.any()
    for level, tendons in (("linear", 1), ("native", 1)):
        b = bench(replace(synthetic_map, friction=friction_law), level=level)
        assert b.model.ntendon == tendons


def test_native_has_friction_without_load(bench, synthetic_map, friction_law):
    """Frictionloss of the rotor is Coulomb and bending, damping the viscous part."""
    b = bench(replace(synthetic_map, friction=friction_law), level="native")
    np.testing.assert_allclose(b.model.dof_frictionloss[b.v], [0.045, 0.0])
    np.testing.assert_allclose(b.model.dof_damping[b.v], [6e-4, 0.0])
    assert b.drive.native.friction == pytest.approx(0.045)
    assert "load" in b.drive.native.friction_note
    constant = replace(friction_law, load=0.0, static=0.04)
    b = bench(replace(synthetic_map, friction=constant), level="native")
    assert not b.drive.native.friction_note


@pytest.mark.parametrize(
    "text",
    [
        "1 2",
        "1 -1 0 0 1 1 1 0 0",
        "2 -1 1 0 1 1 1 0 0",
        "1 -1 1 0 2 1 1 0 0",
        "1 -1 1 0 1 1 0 0 0",
        "1 -1 1 -1 1 1 1 0 0",
        "1 -1 1 nan 1 1 1 0 0",
        "1 0 1 0 1 1 1 0 0",
        "x",
    ],
)
def test_bad_attribute_is_rejected(text):
    """Numbers that are no friction, or a tendon that is not there, give an error."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    drive = replace(DriveMap.linear(1e4), friction=COULOMB)
    attach(spec, joint="j", drive=drive, rotor_inertia=4e-5, friction=True)
    [instance] = spec.plugins
    instance.config = {**plugin.config(drive, damping=1.0), "friction": text}
    with pytest.raises(
        ValueError,
        match=naming("'j_drive'", "'friction'", "nine", "b_theta", "b_psi", "load"),
    ):
        spec.compile()


def test_a_prefix_and_suffix_leave_the_friction_in_place(synthetic_map, friction_law):
    """A model attached to another finds its friction tendon under any name."""
    arm = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body name="b"><joint name="j"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    drive = replace(synthetic_map, friction=friction_law)
    attach(arm, joint="j", drive=drive, rotor_inertia=4e-5, friction=True)
    parent = mujoco.MjSpec()
    parent.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    parent.attach(arm, prefix="a_", suffix="_z", frame=parent.worldbody.add_frame())
    model = parent.compile()
    assert model.npluginstate == 4
    mujoco.mj_step(model, mujoco.MjData(model), 10)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"stiffness": 0.0}, ("stiffness", "0.0 N·m/rad", "> 0")),
        ({"viscous": -1.0}, ("viscous", "-1.0 N·m·s/rad", ">= 0")),
        ({"load": float("nan")}, ("load", "nan", ">= 0")),
        ({"static": 0.01}, ("static", "0.01 N·m", "coulomb", "0.04 N·m")),
        ({"stribeck_speed": 0.0}, ("stribeck_speed", "0.0 rad/s", "> 0")),
        ({"coulomb": True}, ("coulomb", "True N·m", ">= 0")),
    ],
)
def test_bad_friction_is_refused(change, says, friction_law):
    """Parameters that no friction has are named with what is accepted."""
    with pytest.raises(InputError, match=naming("friction", *says)):
        replace(friction_law, **change)


def test_the_joint_runs_as_its_spec_sheet_says(bench):
    """CSG-25-100 in MuJoCo: starting, running, back-driving torque and efficiency.

    Two per cent below the starting and the back-driving torque it stands, two above it
    turns; under the no-load running torque, and under rated load with what the
    efficiency asks for, it keeps 2000 rpm.
    """
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0)
    sheet = drive.spec_sheet()
    speed, i = 2000 * np.pi / 30, drive.ratio

    def turned(torque, load, rate=0.0):
        b = bench(drive, damping_ratio=0.1, step=1e-3)
        start = load if rate else 0.0
        b.place(0.0, -drive.mean_torsion(start), rate, rate / i)
        for k in range(1000):
            part = 1.0 if rate else min(1.0, (k + 1) / 500)
            b.data.qfrc_applied[b.v] = part * torque, -part * load
            mujoco.mj_step(b.model, b.data)
        return b.data.qpos[b.q[0]], b.data.qvel[b.v[0]]

    for part, moves in ((0.98, False), (1.02, True)):
        angle, _ = turned(part * sheet["starting_torque_Nm"], 0.0)
        assert (abs(angle) > 0.1) == moves
        # a load against the sense of the ratio drives an input that turns forward
        load = np.sign(i) * -part * sheet["back_driving_torque_Nm"]
        angle, _ = turned(0.0, load)
        # the torsion under the load lets the input turn by less than a degree
        assert (angle > 0.1) == moves
    _, rate = turned(sheet["no_load_running_torque_Nm"], 0.0, rate=speed)
    assert rate == pytest.approx(speed, rel=2e-3)
    needed = 87.0 / abs(i) / (0.01 * sheet["efficiency_percent"])
    _, rate = turned(needed, np.sign(i) * 87.0, rate=speed)
    assert rate == pytest.approx(speed, rel=1e-2)


@pytest.mark.parametrize(
    ("law", "what"),
    [
        ({"stiffness": 700.0}, "torsion and friction bristle"),
        ({"stiffness": 70.0, "damping": 0.2}, "decay rate of friction"),
    ],
)
def test_rk4_is_refused_where_the_bristle_would_not_hold(bench, law, what):
    """Outside the region it creeps below its yield torque or diverges; inside it rests.

    The rotor carries two fifths of what the friction holds, for a second.
    """
    friction = Friction(coulomb=0.05, static=0.05, **law)
    drive = replace(DriveMap.linear(2e4), friction=friction)

    def moved(step):
        b = bench(drive, step=step, integrator="RK4", damping_ratio=0.02)
        region = check_region(b.drive, timestep=step, integrator="RK4")
        b.data.qfrc_applied[b.v] = 0.02, 0.0
        mujoco.mj_step(b.model, b.data, round(1.0 / step))
        return region, b.data

    region, data = moved(1e-3)
    assert what in region.message and region.suggested_timestep is not None
    reach = 0.05 / friction.stiffness
    diverged = any(w.number for w in data.warning)
    assert diverged or abs(data.qpos[:]).max() > 10.0 * reach
    region, data = moved(region.suggested_timestep)
    assert region.ok and not any(w.number for w in data.warning)
    # the first swing goes a little over the reach
    assert abs(data.qpos[:]).max() < 2.0 * reach


def test_observed_friction_slips_on_while_its_yield_torque_grows(bench):
    """The observed torque accelerates the link, also while the load on a slip grows.

    In the scheme, the bristle is at the yield torque of the middle of the step, which
    is then smaller than that of the state. With the bristle damping of a sticking
    bristle, the observed torque is wrong by 10 of 17 N·m.
    """
    law = Friction(stiffness=70.0, coulomb=0.07, static=0.07, load=0.07, damping=0.07)
    b = bench(replace(DriveMap.linear(3e4), friction=law), damping_ratio=0.02)
    torque, rate = [], []
    for k in range(600):
        b.data.qfrc_applied[b.v[0]] = 0.25 * np.sin(8e-3 * np.pi * k)
        mujoco.mj_step(b.model, b.data)
        torque.append(float(b.drive.observe(b.model, b.data).torque))
        rate.append(b.data.qvel[b.v[1]])
    # the mean torque of two steps is that of the state between them
    wanted = b.drive.link_inertia * (np.array(rate[2:]) - rate[:-2]) / 2e-3
    # 2.4 % = curvature of the torque over two steps and the step in which it sticks
    apart = np.abs(torque[1:-1] - wanted).max()
    assert apart < 0.03 * np.abs(wanted).max()


def test_observed_friction_is_that_of_the_engine(bench):
    """Also where the spring is damped: the yield torque takes the elastic torque alone.

    With the damping torque, the bristle seems to stick, and the observed torque is
    wrong by up to its largest value.
    """
    law = Friction(stiffness=70.0, coulomb=0.07, static=0.07, load=0.07, damping=0.07)
    drive = replace(DriveMap.linear(3e4), friction=law)
    b = bench(drive, damping_ratio=0.02, step=1e-4, integrator="RK4")
    observed, acting = [], []
    for k in range(1000):
        b.data.qfrc_applied[b.v[0]] = 0.25 * np.sin(4e-3 * np.pi * k)
        mujoco.mj_step(b.model, b.data)
        now = copy.copy(b.data)
        mujoco.mj_forward(b.model, now)
        observed.append(float(b.drive.observe(b.model, b.data).torque))
        acting.append(now.qfrc_passive[b.v[1]])
    np.testing.assert_allclose(observed, acting, rtol=0, atol=1e-6 * max(acting))
