"""Levels against each other, the signals, and the region of the integrator."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import ComputationError, InputError
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.region import check_region
from swgjoint.maps.drive_map import DriveMap


@pytest.mark.parametrize("layout", ["circular_spline_fixed", "flexspline_fixed"])
def test_linear_map_equals_native_spring(bench, layout):
    """The plugin with a linear map moves as the native tendon spring under RK4."""
    drive = DriveMap.linear(2e4, layout=layout)
    ends = []
    for level in ("linear", "full"):
        b = bench(drive, level=level, integrator="RK4", step=1e-4, damping_ratio=0.02)
        b.place(0.3, 2e-3, 10.0, 0.0)
        path = []
        for _ in range(100):
            mujoco.mj_step(b.model, b.data, 20)
            path.append(b.data.qpos[b.q].copy())
        ends.append(np.array(path))
        assert b.drive.damping > 0
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-11)


def test_scheme_is_second_order(bench, synthetic_map):
    """At half the step the error against RK4 is a quarter or less."""
    drive = synthetic_map.with_harmonics([1, 1, 1, 0, 1])
    x0 = np.array([0.0, -0.1 * drive.torsion_knots[-1]])
    v0 = np.array([6.0, 6.0 / drive.ratio])

    def end(step, integrator):
        b = bench(drive, step=step, integrator=integrator, damping_ratio=0.02)
        # the scheme lives half a step before q
        half = 0.5 * step if integrator == "discrete" else 0.0
        b.place(*(x0 + half * v0), *v0)
        b.data.qfrc_applied[b.v[1]] = -20.0
        mujoco.mj_step(b.model, b.data, round(0.05 / step))
        return b.data.qpos[b.q] - half * b.data.qvel[b.v]

    want = end(1e-5, "RK4")
    errors = [np.abs(end(h, "discrete") - want) for h in (2e-3, 1e-3, 5e-4)]
    assert (errors[0] > 3.5 * errors[1]).all()
    assert (errors[1] > 3.5 * errors[2]).all()
    assert errors[1][1] < 0.02 / 60 * np.pi / 180  # 0.02 arcmin at the link


def test_scheme_leaves_the_resonance_undamped(bench):
    """At h w = 0.4 the linear level loses a swing that the scheme keeps."""
    kept = {}
    for level in ("linear", "full"):
        b = bench(DriveMap.linear(2e4), level=level)
        frequency = b.drive.natural_frequency
        assert frequency * 1e-3 == pytest.approx(0.4, rel=0.3)
        b.place(0.0, -1e-3)
        swings = []
        for _ in range(200):
            mujoco.mj_step(b.model, b.data)
            swings.append(abs(b.data.qpos[b.q] @ [1 / b.drive.ratio, -1]))
        kept[level] = max(swings[-20:]) / 1e-3
    assert kept["full"] > 0.98
    assert kept["linear"] < 0.1


def test_motor_torque_comes_out_times_ratio(bench, synthetic_map):
    """At rest a held rotor and a loaded link show the load as torque and torsion."""
    drive = synthetic_map.with_harmonics([1, 0, 0, 0, 0])
    b = bench(drive, damping_ratio=0.7)
    b.model.dof_damping[b.v[1]] = 50.0
    b.data.qfrc_applied[b.v] = 30.0 / drive.ratio, -30.0
    mujoco.mj_step(b.model, b.data, 3000)
    signals = b.drive.observe(b.model, b.data)
    assert signals.torque == pytest.approx(30.0, rel=1e-6)
    assert signals.torsion == pytest.approx(drive.mean_torsion(30.0), rel=1e-6)
    assert signals.transmission_error == pytest.approx(-signals.torsion, rel=1e-9)


@pytest.mark.parametrize("level", ["linear", "full"])
def test_signals_are_the_force_on_the_link(bench, any_layout, level):
    """Recorded torque is the passive force that RK4 applied to the link."""
    b = bench(any_layout, level=level, integrator="RK4", damping_ratio=0.05)
    rng = np.random.default_rng(4)
    for _ in range(20):
        theta = rng.uniform(-3, 3)
        b.place(theta, theta / any_layout.ratio + 1e-3, *rng.normal(0, 1, 2))
        mujoco.mj_forward(b.model, b.data)
        signals = b.drive.observe(b.model, b.data)
        assert signals.torque == pytest.approx(
            b.data.qfrc_passive[b.v[1]], rel=1e-9, abs=1e-9
        )
        psi = b.data.qpos[b.q[1]]
        e0 = (
            0.0
            if level == "linear"
            else any_layout.torsion(theta, psi) - (theta / any_layout.ratio - psi)
        )
        # transmission error = kinematic error - torsion
        assert signals.transmission_error == pytest.approx(
            e0 - signals.torsion, abs=1e-15
        )


def test_rigid_has_no_rotor_signals(synthetic_map):
    """Asking a rigid joint for rotor signals says what to use."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    from swgjoint.joint.attach import attach

    got = attach(
        spec, joint="j", drive=synthetic_map, level="rigid", rotor_inertia=1e-4
    )
    assert isinstance(got, JointDrive)
    with pytest.raises(
        InputError, match=naming("'j'", "rigid", "observe(model, data)")
    ):
        got.signals(0.0, 0.0)
    assert got.natural_frequency == 0.0
    assert check_region(got, timestep=0.02).ok


def test_region_names_bound_and_step(bench, synthetic_map):
    """Outside the region the message names joint, bound and a step that is inside."""
    drive = bench(synthetic_map).drive
    region = check_region(drive, timestep=2e-3, max_input_speed=10.0)
    assert not region.ok
    assert names(region.message, "joint", "'j'", "step", "2 ms")
    assert names(region.message, "phase step", "[rad]", "2.44 > 0.5")
    step = region.suggested_timestep
    assert step is not None
    assert names(region.message, f"{1e3 * step:.2g} ms")
    with pytest.raises(
        ComputationError, match=naming("'j'", "2 ms", "2.44 > 0.5", "0.4 ms")
    ):
        region.require()
    inside = check_region(drive, timestep=step, max_input_speed=10.0)
    assert inside.ok and inside.message == "ok"
    inside.require()
    more = check_region(drive, timestep=1.2 * step, max_input_speed=10.0)
    assert not more.ok  # the step is not needlessly small


def test_sub_steps_lie_well_inside_and_are_no_more_than_that(bench, synthetic_map):
    """A step of 1.4 h/n is inside, one of 1.4 h/(n - 1) is not; inside n is 1."""
    drive = bench(synthetic_map, rotor_inertia=1e-7, link=1e-4).drive
    seen = set()
    for step in (1e-5, 3e-4, 1e-3, 7e-3, 2e-2):
        for speed in (0.0, 3.0, 40.0):
            parts = check_region(drive, timestep=step, max_input_speed=speed).sub_steps
            assert parts is not None
            seen.add(parts)
            for n, inside in ((parts, True), (parts - 1, False)):
                if n and parts > 1:
                    h = 1.4 * step / n
                    region = check_region(drive, timestep=h, max_input_speed=speed)
                    assert region.ok is inside
            region = check_region(drive, timestep=step, max_input_speed=speed)
            assert region.ok is (parts == 1)
    assert 1 in seen and len(seen) > 3


def test_no_sub_step_helps_against_a_steep_kinematic_error(bench, synthetic_map):
    """A bound that no step meets is refused however many sub-steps are accepted."""
    steep = replace(
        synthetic_map, kinematic_error=100.0 * synthetic_map.kinematic_error
    )
    region = check_region(bench(steep).drive, timestep=1e-3)
    assert region.sub_steps is None
    with pytest.raises(
        ComputationError,
        match=naming("'j'", "1 ms", "kinematic error", "15.2 > 0.56", "linear"),
    ):
        region.require(1000)


def test_more_sub_steps_than_accepted_are_refused_with_their_number(
    bench, synthetic_map
):
    """The message has the number of parts; accepting that many gives it back."""
    region = check_region(
        bench(synthetic_map).drive, timestep=2e-3, max_input_speed=100.0
    )
    parts = region.sub_steps
    assert parts is not None and parts > 2
    with pytest.raises(
        ComputationError, match=naming("'j'", f"{parts} sub-steps", f"{parts - 1}")
    ):
        region.require(parts - 1)
    assert region.require(parts) == parts


def test_region_without_a_step(bench, synthetic_map):
    """Too steep a kinematic error is no matter of the step, and it says so."""
    from dataclasses import replace

    steep = replace(synthetic_map, kinematic_error=20 * synthetic_map.kinematic_error)
    region = check_region(bench(steep).drive, timestep=1e-5)
    assert region.suggested_timestep is None
    assert "no step helps" in region.message


@pytest.mark.parametrize(("factor", "stable"), [(0.95, True), (1.5, False)])
def test_explicit_bound_is_where_rk4_diverges(bench, factor, stable):
    """RK4 holds inside its bound and loses the torsion mode 1.5 times beyond."""
    b = bench(DriveMap.linear(2e4), integrator="RK4")
    limit = check_region(b.drive, timestep=1.0, integrator="RK4").suggested_timestep
    assert limit is not None
    b.model.opt.timestep = factor * limit
    b.place(0.0, -1e-6)
    start = b.energy()
    mujoco.mj_step(b.model, b.data, 15)
    assert (b.energy() < 1.01 * start) == stable
    assert check_region(b.drive, timestep=factor * limit, integrator="RK4").ok == stable
