"""Payloads of ArmTracking-v0: weight and inertia reach the engine and the start."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from messages import naming

from swgjoint.envs.arm import core
from swgjoint.envs.arm_tracking import ArmTrackingEnv, ArmTrackingVectorEnv
from swgjoint.errors import InputError
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.units import mm

G = 9.81
CENTRE = (20.0, -30.0, 60.0)
SENSORS = {"link_encoder": True, "torque_sensor": True}
SHORT = {"episode_s": 0.3, "friction": False, "kinematic_error_arcmin": 0.0}


def mass_matrix(env, k=0):
    """Mass matrix of one simulation, with all links at the start of the path."""
    batch, nv = env.core.plant.batch, env.core.plant.model.nv
    model, data, full = batch.get_model(k), batch.get_data(k), np.zeros((nv, nv))
    start = env.task.position[0].reshape(-1, len(env.task.joints.names))[0]
    for name, q in zip(env.task.joints.names, start, strict=True):
        data.joint(name).qpos = q
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fullM(model, data, full)
    return full


def at_start(scene="ur5e-circle", **keys):
    """Environment after a reset, and its info there."""
    env = ArmTrackingEnv(scene=scene, **SHORT, **keys)
    return env, env.reset(seed=1)[1]


def point_jacobian(q, centre_mm):
    """Position and Jacobian of a point of the tool of the UR5e. Shapes (3,), (3, 6)."""
    arm = RigidArm("ur5e")
    data, J = mujoco.MjData(arm.model), np.zeros((3, 6))
    data.qpos[:] = q
    mujoco.mj_forward(arm.model, data)
    turn = data.site_xmat[arm.tool].reshape(3, 3)
    point = data.site_xpos[arm.tool] + turn @ (np.array(centre_mm) * mm)
    body = int(arm.model.site_bodyid[arm.tool])
    mujoco.mj_jac(arm.model, data, J, None, point, body)
    return point, J


def test_static_torque_of_the_base_changes_by_the_moment_of_the_weight():
    """By m g r with the horizontal distance r; the two-link arm lies stretched out."""
    r = 0.4 + 0.36 + 0.05  # m
    torques = {}
    for mass in (0.0, 1.5):
        env, info = at_start(
            "two-link", payload_kg=mass, payload_centre_mm=(50.0, 0.0, 0.0)
        )
        # positive angles lower the arm, so the drive pushes upwards
        torques[mass] = env.task.link_torque[0, 0], info["output_torque_Nm"][0]
    planned, simulated = np.subtract(torques[1.5], torques[0.0])
    assert planned == pytest.approx(-1.5 * G * r, rel=1e-9)
    # the links sag by the torsion of the drives, which moves the weight
    assert simulated == pytest.approx(-1.5 * G * r, rel=1e-3)


def test_weight_and_inertia_are_those_of_a_point_mass():
    """Torque J^T m g and mass matrix J^T m J at every joint of the UR5e."""
    env, _ = at_start()
    loaded, _ = at_start(payload_kg=2.0, payload_centre_mm=CENTRE)
    q = env.task.position[0]
    _, J = point_jacobian(q, CENTRE)
    weight = loaded.task.link_torque[0] - env.task.link_torque[0]
    np.testing.assert_allclose(weight, 2.0 * G * J[2], atol=1e-9)
    links = [env.core.plant.model.joint(n).dofadr[0] for n in env.task.joints.names]
    change = (mass_matrix(loaded) - mass_matrix(env))[np.ix_(links, links)]
    np.testing.assert_allclose(change, 2.0 * J.T @ J, atol=1e-8)
    assert change[1, 1] > 0.3


@pytest.mark.parametrize("level", ["full", "linear"])
def test_a_drawn_payload_is_the_fixed_one_of_its_mass(level):
    """Same masses and mass matrix, though the controller knows the mean."""
    keys = {"payload_centre_mm": CENTRE, "sensors": SENSORS, "level": level}
    drawn = ArmTrackingVectorEnv(3, 1, payload_kg=(0.5, 3.5), **SHORT, **keys)
    _, info = drawn.reset(seed=1)
    masses = info["payload_kg"]
    assert ((masses >= 0.5) & (masses <= 3.5)).all() and np.ptp(masses) > 0.1
    nominal = ArmTrackingEnv(payload_kg=2.0, **SHORT, **keys)
    nominal.reset(seed=1)
    np.testing.assert_array_equal(
        drawn.task.link_torque[:, 0], nominal.task.link_torque
    )
    for k, mass in enumerate(masses):
        fixed = ArmTrackingEnv(payload_kg=float(mass), **SHORT, **keys)
        fixed.reset(seed=1)
        model, twin = drawn.core.plant.batch.get_model(k), fixed.core.plant.model
        for field in (
            "body_mass",
            "body_subtreemass",
            "body_inertia",
            "dof_invweight0",
        ):
            np.testing.assert_allclose(
                getattr(model, field), getattr(twin, field), rtol=1e-12, atol=1e-15
            )
        np.testing.assert_allclose(
            mass_matrix(drawn, k), mass_matrix(fixed), rtol=1e-12, atol=1e-9
        )
        assert np.abs(mass_matrix(drawn, k) - mass_matrix(nominal)).max() > 1e-3


def test_a_range_without_width_is_a_known_payload():
    """Same start and same motion as with the fixed payload."""
    runs = []
    for mass in (1.5, (1.5, 1.5)):
        env, info = at_start(payload_kg=mass, payload_centre_mm=CENTRE)
        run = [info["link_angle_rad"], info["output_torque_Nm"]]
        for _ in range(290):
            *_, info = env.step(np.full(6, 0.2))
            run += [info["link_angle_rad"], info["output_torque_Nm"]]
        runs.append(run)
    np.testing.assert_allclose(*runs, rtol=1e-9, atol=1e-9)


def test_a_drawn_payload_starts_at_rest():
    """Nothing moves until the path does; drives carry the weight of the payload."""
    env = ArmTrackingVectorEnv(4, 1, payload_kg=(0.0, 4.0), **SHORT)
    _, first = env.reset(seed=5)
    for _ in range(150):  # the path rests for 200 periods
        *_, info = env.step(np.zeros((4, 6)))
    moved = info["link_angle_rad"] - first["link_angle_rad"]
    assert np.abs(moved).max() < 1e-7
    np.testing.assert_allclose(
        info["output_torque_Nm"], first["output_torque_Nm"], atol=2e-3
    )
    # the loops carry what their feed-forward does not know: k_p (i q - theta)
    missing = first["output_torque_Nm"] - env.task.link_torque[0]
    ratio, gain = env.task.joints.ratio, env.core.loop.stiffness
    sag = ratio * env.task.position[0] - first["motor_angle_rad"]
    np.testing.assert_allclose(gain * sag, missing / ratio, atol=1e-5)
    # a weight at the tool, at links that sag by some 1e-3 rad
    _, J = point_jacobian(env.task.position[0, 0], (0.0, 0.0, 0.0))
    want = np.outer(first["payload_kg"] - 2.0, G * J[2])
    np.testing.assert_allclose(missing, want, atol=0.05)
    assert np.abs(want).max() > 5.0


def test_the_step_is_checked_with_the_lightest_payload(monkeypatch):
    """Its link inertias are those without a payload, if the range begins with zero."""
    checked, check = [], core.check_region

    def record(drive, **keys):
        checked.append(drive.link_inertia)
        return check(drive, **keys)

    monkeypatch.setattr(core, "check_region", record)
    for mass in (0.0, (0.0, 4.0)):
        ArmTrackingEnv(payload_kg=mass, payload_centre_mm=CENTRE, **SHORT)
    empty, lightest = checked[:6], checked[6:]
    np.testing.assert_allclose(lightest, empty, rtol=1e-9)


def test_payloads_are_drawn_anew_and_from_the_seed():
    """Uniformly from the range, together with specimens, too."""
    env = ArmTrackingEnv(payload_kg=(1.0, 2.0), randomise=True, **SHORT)
    masses = [env.reset(seed=s)[1]["payload_kg"] for s in (7, None, 7, None)]
    assert masses[0] == masses[2] and masses[1] == masses[3]
    assert masses[0] != masses[1]
    assert all(1.0 <= one <= 2.0 for one in masses)
    assert "payload_kg" not in at_start()[1]


def test_a_payload_replaces_that_of_the_scene(tmp_path):
    """Mass, centre and inertia; None keeps it."""
    from swgjoint.models_path import models_path

    text = (models_path() / "scenes" / "ur5e-circle.toml").read_text("utf-8")
    path = tmp_path / "scene.toml"
    section = "[payload]\nmass_kg = 3.0\ncentre_mm = [0.0, 0.0, 60.0]\n"
    path.write_text(text.replace("[trajectory]\n", f"{section}[trajectory]\n"), "utf-8")
    kept, _ = at_start(str(path))
    same, _ = at_start(payload_kg=3.0, payload_centre_mm=(0.0, 0.0, 60.0))
    np.testing.assert_array_equal(kept.task.link_torque, same.task.link_torque)
    none, _ = at_start(str(path), payload_kg=0.0)
    plain, _ = at_start()
    np.testing.assert_array_equal(none.task.link_torque, plain.task.link_torque)


@pytest.mark.parametrize(
    ("keys", "match"),
    [
        ({"payload_kg": -1.0}, ("payload_kg", "-1.0 kg", "number", "range")),
        ({"payload_kg": "2"}, ("payload_kg", "'2' kg", "number", "range")),
        ({"payload_kg": (3.0, 1.0)}, ("payload_kg", "(3.0, 1.0) kg", "range")),
        ({"payload_kg": (0.0, 0.0)}, ("payload_kg", "(0.0, 0.0) kg", "range")),
        ({"payload_kg": 2e3}, ("payload_kg", "2000.0 kg", "1000")),
        ({"payload_centre_mm": 5.0}, ("payload_centre_mm", "5.0 mm", "three")),
        (
            {"payload_centre_mm": (0.0, 0.0, 60.0)},
            ("payload_centre_mm", "without payload_kg"),
        ),
        (
            {"payload_centre_mm": (0.0, np.inf, 0.0)},
            ("payload_centre_mm", "(0.0, inf, 0.0) mm", "three"),
        ),
    ],
)
def test_what_is_no_payload_gives_one_line(keys, match):
    """What, where, and what is accepted."""
    with pytest.raises(InputError, match=naming(*match)):
        ArmTrackingEnv(**keys)


@pytest.mark.parametrize("payload", [80.0, (1.0, 80.0)], ids=str)
def test_a_payload_beyond_the_strength_of_the_arm_is_rejected(payload):
    """Every episode with it would end at its first step."""
    keys = {"payload_kg": payload, "payload_centre_mm": (0.0, 0.0, 60.0)}
    match = naming("payload of 80 kg", "wrist_1_joint", "up to 58 N·m", "momentary")
    with pytest.raises(InputError, match=match):
        ArmTrackingEnv(**keys)
