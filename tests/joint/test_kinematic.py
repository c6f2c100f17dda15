"""Level kinematic: the rigid joint whose output is off by the kinematic error."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.joint.attach import attach
from swgjoint.joint.prescribed import (
    error_of_motor,
    kinematic_part,
    motor_of_link,
    ratio_variation,
)

TEXT = """<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody>
  <body><joint name="j" armature="0.1"/>
  <inertial pos="0 0 0" mass="1" diaginertia=".5 .5 .5"/></body></worldbody></mujoco>"""


def joint(drive, level="kinematic", **keys):
    spec = mujoco.MjSpec.from_string(TEXT)
    got = attach(spec, joint="j", drive=drive, level=level, rotor_inertia=4e-5, **keys)
    return got, spec.compile()


def test_adds_nothing_to_the_rigid_model(synthetic_map):
    """Same degrees of freedom and armature as rigid, no tendon, no plugin."""
    got, model = joint(synthetic_map)
    _, rigid = joint(synthetic_map, level="rigid")
    assert (model.nv, model.ntendon, model.nplugin, model.nbody) == (1, 0, 0, 2)
    np.testing.assert_array_equal(model.dof_armature, rigid.dof_armature)
    assert model.opt.integrator == rigid.opt.integrator
    assert got.rotor is got.tendon is got.plugin is None
    assert got.natural_frequency == 0.0


def test_motor_and_link_angle_fulfil_the_constraint(any_layout):
    """It is psi = theta/i + e0(theta, psi), both ways, in every layout."""
    drive = kinematic_part(any_layout)
    theta = np.linspace(-7.0, 7.0, 501)
    psi = theta / drive.ratio + error_of_motor(drive, theta)
    np.testing.assert_allclose(drive.torsion(theta, psi), 0.0, atol=1e-15)
    np.testing.assert_allclose(motor_of_link(drive, psi), theta, atol=1e-11)


def test_observed_error_is_the_kinematic_error(synthetic_map):
    """Transmission error is e0 at the motor angle that belongs to the link."""
    got, model = joint(synthetic_map)
    data = mujoco.MjData(model)
    for psi in (0.0, 0.3, -1.2):
        data.qpos[0] = psi
        mujoco.mj_forward(model, data)
        signals = got.observe(model, data)
        theta = float(got.motor_angle(psi))
        e0 = synthetic_map.error_at(synthetic_map.phases(theta, psi))[0]
        assert signals.torsion == 0.0
        assert signals.transmission_error == pytest.approx(float(e0), abs=1e-14)
        assert abs(e0) > 1e-7
    with pytest.raises(
        InputError, match=naming("'j'", "kinematic", "observe(model, data)")
    ):
        got.signals(0.0, 0.0)


def test_only_harmonics_with_error_are_kept_or_listed(synthetic_map):
    """Torque-only harmonics are dropped silently, too fast ones are unresolved."""
    error = synthetic_map.kinematic_error.copy()
    error[2] = 0.0
    got, _ = joint(replace(synthetic_map, kinematic_error=error), max_input_speed=60.0)
    assert [u.order for u in got.unresolved] == [122.0]
    assert got.kept_orders == pytest.approx((2.0, 4.0 + 1 / 60))


def test_ratio_variation_bounds_the_slope(any_layout):
    """The bound holds at every angle and is not larger than the sum needs."""
    theta = np.linspace(0.0, 2.0 * np.pi, 20_001)
    _, slope, cross = any_layout.error_at(
        any_layout.phases(theta, theta / any_layout.ratio)
    )
    rise = abs(any_layout.ratio) * np.abs(slope) + np.abs(cross)
    assert 0.3 * ratio_variation(any_layout) < rise.max() < ratio_variation(any_layout)


def test_error_that_locks_the_gear_is_refused(synthetic_map):
    """An error so steep that the ratio passes zero has no motor angle."""
    steep = replace(synthetic_map, kinematic_error=100 * synthetic_map.kinematic_error)
    with pytest.raises(
        InputError, match=naming("'synthetic'", "15.2", "kinematic", "1")
    ):
        joint(steep)
