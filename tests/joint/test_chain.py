"""Drives in every joint of an arm: gravity, coupling, limits."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from swgjoint.joint.attach import attach
from swgjoint.joint.response import responses
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.phase_bounds import MANY

LINKS = ((8.0, 0.42), (6.0, 0.38), (2.0, 0.1), (1.2, 0.1), (1.2, 0.1), (0.3, 0.06))


@pytest.fixture
def arm(synthetic_map):
    """Six links with drives without damping, axes alternating, 2 ms unless given."""
    potential = synthetic_map.potential.copy()
    potential[1:, :, :, 0] *= 0.1  # cogging that light wrists can carry
    drive = replace(synthetic_map, potential=potential).with_harmonics([1, 1, 1, 0, 1])

    def make(*, level="full", step=2e-3, integrator="discrete", limit=False):
        spec = mujoco.MjSpec()
        spec.option.timestep = step
        spec.option.integrator = getattr(
            mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}"
        )
        body, z = spec.worldbody, 1.0
        for k, (mass, length) in enumerate(LINKS):
            body = body.add_body(name=f"link{k}", pos=[0, 0, z])
            z = length
            joint = body.add_joint(name=f"j{k}", axis=[[0, 0, 1], [0, 1, 0]][k % 2])
            if limit:
                joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
                joint.range = [-30, 60]
            geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, mass=mass)
            geom.fromto = [0, 0, 0, 0, 0, length]
            geom.size = [0.03, 0, 0]
            geom.contype = geom.conaffinity = 0
        drives = [
            attach(
                spec,
                joint=f"j{k}",
                drive=drive,
                level=level,
                rotor_inertia=4e-5,
                damping_ratio=0.02 if limit else 0.0,
            )
            for k in range(len(LINKS))
        ]
        model = spec.compile()
        data = mujoco.MjData(model)
        for k, one in enumerate(drives):
            psi = 0.2 + 0.1 * k
            data.joint(f"j{k}").qpos = psi
            if one.rotor:
                theta = one.ratio * psi
                theta -= one.ratio * one.drive.torsion(theta, psi)
                data.joint(one.rotor).qpos = theta
        return model, data, drives

    return make


def total_energy(model, data, drives):
    """Kinetic, gravity and drives, half a step back where the scheme lives."""
    at = mujoco.MjData(model)
    at.qvel[:] = data.qvel
    at.qpos[:] = data.qpos - 0.5 * model.opt.timestep * data.qvel
    mujoco.mj_fwdPosition(model, at)
    mujoco.mj_energyPos(model, at)
    mujoco.mj_energyVel(model, at)
    stored = 0.0
    for one in drives:
        theta, psi = at.joint(one.rotor).qpos[0], at.joint(one.joint).qpos[0]
        stored += float(one.drive.energy(one.drive.torsion(theta, psi), theta, psi))
    return float(at.energy.sum()) + stored


def test_falling_arm_keeps_its_energy(arm):
    """Six undamped drives swing under gravity at 2 ms for 5 s without gain."""
    model, data, drives = arm()
    start = total_energy(model, data, drives)
    energies, lows = [], []
    for _ in range(50):
        mujoco.mj_step(model, data, 50)
        energies.append(total_energy(model, data, drives))
        mujoco.mj_energyPos(model, data)
        lows.append(max(abs(one.observe(model, data).torsion) for one in drives))
    energies = np.array(energies)
    # of up to 190 J in play; the engine's explicit Coriolis terms give 1.5 J here
    assert np.abs(energies - start).max() < 2.0
    assert max(lows) < 0.01


def test_falling_arm_is_as_accurate_as_the_rigid_one(arm):
    """At 1 ms the drives add little to the engine's own error in a free fall."""

    def fall(level, step, integrator):
        model, data, _ = arm(level=level, step=step, integrator=integrator)
        mujoco.mj_step(model, data, round(0.3 / step))
        return np.array([data.joint(f"j{k}").qpos[0] for k in range(len(LINKS))])

    def error(level):
        want = fall(level, 2e-5, "RK4")
        return np.abs(fall(level, 1e-3, "discrete") - want).max()

    assert error("full") < 1.5 * error("rigid")


def test_joint_limits_stop_the_links(arm):
    """Links that fall into their limits stay there, torsion and speed bounded."""
    model, data, drives = arm(limit=True)
    peak = 0.0
    for _ in range(400):
        mujoco.mj_step(model, data, 5)
        peak = max(
            peak, *(abs(float(one.observe(model, data).torsion)) for one in drives)
        )
    angles = [data.joint(one.joint).qpos[0] for one in drives]
    assert np.isfinite(data.qpos).all()
    assert np.abs(angles).max() < np.deg2rad(65)
    assert 1e-4 < peak < 0.05


def test_responses_are_the_diagonal_of_the_inverse_mass_matrix(arm):
    """What the plugin takes for rotor and link follows from the factor of M."""
    model, data, _ = arm()
    data.qpos[:] = np.random.default_rng(3).uniform(-1, 1, model.nq)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    got = responses(model, data.qLD, data.qLDiagInv, range(model.nv))
    np.testing.assert_allclose(got, np.linalg.inv(mass).diagonal(), rtol=1e-9)
    many = [np.tile(part, (2, 3, 1)) for part in (data.qLD, data.qLDiagInv)]
    assert responses(model, *many, [1, 4]).shape == (2, 3, 2)
    np.testing.assert_array_equal(responses(model, *many, [1, 4])[1, 2], got[[1, 4]])


@pytest.mark.parametrize("step", [2.5e-4, 5e-4, 1e-3])
def test_torsion_of_a_light_chain_does_not_feed_itself(step):
    """Two links on catalogue drives wound up past T2, no damping: no energy appears.

    Each link answers to its drive far more than its own inertia says, for the other
    gives way; a drive that predicts by its own inertia gains hundreds of times the
    energy in seconds, at any of these steps.
    """
    drive = DriveMap.from_catalogue("CSG-17-100", kinematic_error_arcmin=0.0)
    spec = mujoco.MjSpec.from_string(f"""
      <mujoco><option timestep="{step}" gravity="0 0 0"/><worldbody>
        <body><joint name="a" axis="0 1 0"/>
          <geom type="capsule" size=".03" fromto="0 0 0 .4 0 0" mass=".3"/>
          <body pos=".4 0 0"><joint name="b" axis="0 1 0"/>
            <geom type="capsule" size=".03" fromto="0 0 0 .3 0 0" mass=".3"/></body>
        </body></worldbody></mujoco>""")
    keys = {"rotor_inertia": 7.9e-6, "damping_ratio": 0.0, "friction": False}
    drives = [attach(spec, joint=j, drive=drive, **keys) for j in "ab"]
    model = spec.compile()
    data = mujoco.MjData(model)
    torsion = drive.mean_torsion(drive.ratings.T2)
    data.joint("a").qpos, data.joint("b").qpos = 0.5 * torsion, 2.0 * torsion
    energies = []
    for _ in range(round(2.0 / step / 50)):
        energies.append(total_energy(model, data, drives))
        mujoco.mj_step(model, data, 50)
    assert max(energies) < 1.05 * energies[0]


def test_a_drive_is_predicted_with_all_other_joints_free():
    """In a chain of three, rotor and link feel one torque by the inverse mass matrix.

    What the plugin remembers is the acceleration less that by its own torque, so the
    rest of the acceleration times the inertia is that torque, on either side.
    """
    link = (
        '<body pos=".3 0 0"><joint name="j{}" axis="0 1 0"/><geom type="capsule"'
        ' size=".03" fromto="0 0 0 .3 0 0" mass="1"/>'
    )
    spec = mujoco.MjSpec.from_string(
        '<mujoco><option timestep="0.0005" integrator="discrete" gravity="0 0 -9.81"/>'
        f"<worldbody>{''.join(link.format(k) for k in range(3))}{'</body>' * 3}"
        "</worldbody></mujoco>"
    )
    drive = DriveMap.linear(1e4)
    got = [
        attach(spec, joint=f"j{k}", drive=drive, rotor_inertia=4e-5) for k in range(3)
    ]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.3
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    response = np.linalg.inv(mass).diagonal()
    before = data.qvel.copy()
    mujoco.mj_step(model, data)
    rate = (data.qvel - before) / model.opt.timestep
    for k, joint in enumerate(got):
        state = data.plugin_state[model.plugin_stateadr[k] :][:2]
        dofs = [model.joint(name).dofadr[0] for name in (joint.rotor, joint.joint)]
        rotor, link_torque = (rate[dofs] - state) / response[dofs]
        assert abs(link_torque) > 1.0
        assert rotor * joint.ratio == pytest.approx(-link_torque, rel=1e-6)


def test_a_drive_gets_the_same_bits_alone_and_among_others(synthetic_map):
    """The plugin predicts up to eight drives together; here there are twelve.

    Every third one has hysteresis, and every fourth one many harmonics, which the
    plugin predicts alone. The drives are on separate bodies, so that none changes the
    motion of another.
    """
    error = 1e-9 * np.ones((MANY + 1, 2))
    many = replace(
        synthetic_map,
        orders=np.concatenate(
            [synthetic_map.orders, [(500 + p, 1) for p in range(MANY + 1)]]
        ),
        potential=np.concatenate(
            [synthetic_map.potential, [0.0 * synthetic_map.potential[0]] * (MANY + 1)]
        ),
        end_stiffness=np.concatenate(
            [synthetic_map.end_stiffness, np.zeros((MANY + 1, 2, 2))]
        ),
        kinematic_error=np.concatenate([synthetic_map.kinematic_error, error]),
    )
    elements = (Jenkin(stiffness=4e3, yield_torque=1.0),)
    rng = np.random.default_rng(5)
    turns, speeds = rng.uniform(-1e-3, 1e-3, 12), rng.uniform(-40.0, 40.0, 12)

    def torques(numbers):
        spec = mujoco.MjSpec()
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        for k in numbers:
            body = spec.worldbody.add_body(name=f"link{k}")
            body.add_joint(name=f"j{k}")
            body.mass, body.inertia, body.explicitinertial = 1.0, [0.1] * 3, True
        drives = [
            attach(
                spec,
                joint=f"j{k}",
                drive=replace(
                    synthetic_map if k % 4 else many,
                    hysteresis=() if k % 3 else elements,
                ),
                rotor_inertia=1e-4,
                friction=False,
            )
            for k in numbers
        ]
        model = spec.compile()
        data = mujoco.MjData(model)
        for k, drive in zip(numbers, drives, strict=True):
            data.joint(drive.joint).qpos = turns[k]
            data.joint(drive.rotor).qvel = speeds[k]
        mujoco.mj_forward(model, data)
        return [
            data.qfrc_passive[model.joint(name).dofadr[0]]
            for drive in drives
            for name in (drive.rotor, drive.joint)
        ]

    together = torques(range(12))
    alone = [torque for k in range(12) for torque in torques([k])]
    assert together == alone
    assert np.ptp(alone) > 1.0
