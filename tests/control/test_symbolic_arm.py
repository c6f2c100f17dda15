"""Symbolic dynamics of arms against the engine."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from messages import naming

from swgjoint.control.symbolic_arm import inertia_of, inverse_dynamics, symbolic_arm
from swgjoint.errors import InputError
from swgjoint.joint.attach import attach
from swgjoint.models_path import bundled_names
from swgjoint.sim.arm.rigid_arm import RigidArm

ARMS = bundled_names("arms", ".xml")


def three_joints() -> mujoco.MjSpec:
    """UR5e with its wrist held."""
    spec = RigidArm("ur5e").spec()
    for joint in list(spec.joints)[3:]:
        spec.delete(joint)
    return spec


def with_drives(spec, drive, **keys):
    names = [joint.name for joint in spec.joints]
    return [
        attach(spec, joint=n, drive=drive, rotor_inertia=1e-4, **keys) for n in names
    ]


@pytest.mark.parametrize("rotor", ["none", "gyroscopic", "lumped"])
@pytest.mark.parametrize("name", [*ARMS, "three joints"])
def test_inertia_and_bias_agree_with_the_engine(name, rotor, synthetic_map):
    """Mass matrix to 1e-10, Coriolis, gyroscopic and weight torques to 1e-9."""
    spec = three_joints() if name == "three joints" else RigidArm(name).spec()
    drives = []
    if rotor != "none":
        drives = with_drives(spec, synthetic_map, rotor=rotor)
    model = spec.compile()
    data = mujoco.MjData(model)
    dynamics = inverse_dynamics(model)
    inertia = inertia_of(dynamics)
    rng, zero = np.random.default_rng(4), np.zeros(model.nv)
    for _ in range(5):
        data.qpos, data.qvel = rng.uniform(-2.0, 2.0, (2, model.nv))
        for drive in drives:  # rotors at up to 2000 rpm
            data.joint(drive.rotor).qvel *= 100.0
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        np.testing.assert_allclose(inertia(data.qpos), full, rtol=0.0, atol=1e-10)
        bias = dynamics(data.qpos, data.qvel, zero).full().ravel()
        bias -= model.dof_damping * data.qvel
        np.testing.assert_allclose(bias, data.qfrc_bias, rtol=0.0, atol=1e-9)


def test_three_joint_arm_moves_as_the_plugin(synthetic_map):
    """RK4 at 1e-5 s over 0.05 s, motors on: within 1e-9 rad at the links."""
    spec = three_joints()
    spec.option.timestep = 1e-5
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    drives = with_drives(spec, synthetic_map)
    model = spec.compile()
    data = mujoco.MjData(model)
    arm = symbolic_arm(model, drives)
    data.qpos[arm.links] = 0.3, -1.2, 0.8
    data.qpos[arm.rotors] = data.qpos[arm.links] * synthetic_map.ratio
    motor = np.array([0.5, -1.0, 0.3])
    data.qfrc_applied[arm.rotors] = motor
    acceleration, h = arm.forward_dynamics, 1e-5
    q, v = data.qpos.copy(), data.qvel.copy()
    for _ in range(500):
        a1 = acceleration(q, v, motor).full().ravel()
        v2 = v + h / 2 * a1
        a2 = acceleration(q + h / 2 * v, v2, motor).full().ravel()
        v3 = v + h / 2 * a2
        a3 = acceleration(q + h / 2 * v2, v3, motor).full().ravel()
        v4 = v + h * a3
        a4 = acceleration(q + h * v3, v4, motor).full().ravel()
        q = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    start = data.qpos[arm.links].copy()
    mujoco.mj_step(model, data, 500)
    assert np.abs(data.qpos[arm.links] - start).max() > 1e-4
    np.testing.assert_allclose(q[arm.links], data.qpos[arm.links], rtol=0.0, atol=1e-9)


def test_what_it_cannot_hold_is_refused(synthetic_map):
    """Joints that are no hinges, and drives without the map."""
    ball = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint name='b' type='ball'/><geom size='.1'/></body>"
        "</worldbody></mujoco>"
    )
    with pytest.raises(InputError, match=naming("'b'", "hinge")):
        inverse_dynamics(ball)
    spec = three_joints()
    drives = with_drives(spec, synthetic_map, level="rigid")
    with pytest.raises(
        InputError, match=naming("'shoulder_pan_joint'", "rigid", "full")
    ):
        symbolic_arm(spec.compile(), drives)
