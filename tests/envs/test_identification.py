"""RippleSuppression-v0 with ``identify``: estimates of the kinematic error."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from messages import naming

from swgjoint.control.error_compensation import ErrorCompensation
from swgjoint.envs import ripple_suppression  # noqa: F401
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import Measured

NAME = "swgjoint.envs:swgjoint/RippleSuppression-v0"
KNOWN_LOAD = {"randomise": {"load_inertia": 0.0}}


def make(**keys):
    return gymnasium.make_vec(NAME, num_envs=6, identify=True, threads=1, **keys)


def compensate(env):
    """Action that lets the motor turn against the estimated error, by the library."""
    controller, core = ErrorCompensation(), env.unwrapped.core

    def act(_, k):
        if k == 0:
            controller.start(env.unwrapped.task)
        observation = core.observation()
        torque = controller.torque(k, core.read_measurements(observation))
        return torque / core.authority

    return act


def run(env, act, seed=4):
    """Estimates and errors of orders 2 and 4 in the steady part, and mean rewards.

    Returns:
        Sums of the estimates [rad] and of their rates [rad/s], true errors of the same
        orders [rad]; shapes (steps, n). Rewards of the episodes. Shape (n,).
    """
    core = env.unwrapped.core
    env.reset(seed=seed)
    rows, total = [], 0.0
    for k in range(core.steps):
        _, reward, *_ = env.step(act(core, k))
        total = total + reward
        if k >= 1500:
            parts = np.array(core.estimate.columns())[..., 0]
            angles = core.motor_angle[:, 0], core.link_angle[:, 0]
            rows.append((parts[0] + parts[2], parts[1] + parts[3], *angles))
    estimate, rate, theta, psi = np.moveaxis(np.array(rows), 1, 0)
    drives = [one[0].apply_to(core.joint.drive) for one in core.variations]
    true = [waves(*one) for one in zip(drives, theta.T, psi.T, strict=True)]
    return estimate, rate, np.array(true).T, total


def waves(drive: DriveMap, theta, psi):
    """Kinematic error of the orders 2 and 4 of the wave generator [rad]. (steps,)."""
    phases = drive.phases(theta, psi)
    near = np.isin(np.abs(drive.angle_orders[:, 0]), (2, 4))
    a, b = drive.kinematic_error[near].T
    return np.cos(phases[..., near]) @ a + np.sin(phases[..., near]) @ b


def noise(core, k):
    """Random actions that have no part of the estimate."""
    return np.random.default_rng(k).uniform(-0.3, 0.3, (6, 1))


def nothing(core, k):
    return np.zeros((6, 1))


@pytest.mark.parametrize("sensors", [{}, {"link_encoder": True, "torque_sensor": True}])
def test_controllers_read_the_estimate(sensors):
    """In SI units, whichever sensors follow it; the compensation needs it."""
    env = make(sensors=sensors, episode_s=3.0)
    run(env, nothing)
    core = env.unwrapped.core
    read = core.read_measurements(core.observation())
    want = np.concatenate(core.estimate.columns(), axis=1)
    np.testing.assert_allclose(read.error_estimate, want, rtol=1e-12)
    assert np.abs(want).max() > 1e-5
    plain = gymnasium.make_vec(NAME, 1, sensors=sensors).unwrapped
    observation, _ = plain.reset(seed=0)
    read = plain.core.read_measurements(observation)
    assert read.error_estimate is None
    controller = ErrorCompensation()
    controller.start(plain.task)
    with pytest.raises(InputError, match=naming("estimate", "identify=True")):
        controller.torque(0, read)
    other = gymnasium.make_vec("swgjoint.envs:swgjoint/JointTracking-v0", 1).unwrapped
    other.reset(seed=0)
    with pytest.raises(InputError, match=naming("motor loop", "RippleSuppression-v0")):
        controller.start(other.task)


def test_a_lead_advances_the_estimate():
    """By the time of one period, the torque is that of the wave one period later."""
    env = make(friction=False, sensors={"delay_periods": 0, "motor_noise_rad": 0.0})
    env.reset(seed=1)
    task, k = env.unwrapped.task, 3000
    speed = task.joints.ratio * task.velocity[k]
    wave = np.array([3e-5, 1e-5])  # rad

    def torque(time, lead):
        parts = []
        for order, size in zip((2, 4), wave, strict=True):
            omega = order * speed[:, 0]
            parts += [size * np.sin(omega * time), size * omega * np.cos(omega * time)]
        controller = ErrorCompensation(lead_s=lead)
        controller.start(task)
        still = np.zeros_like(speed)
        read = Measured(
            motor_angle=still, motor_speed=still, error_estimate=np.stack(parts, -1)
        )
        return controller.torque(k, read)

    now = 0.0123
    want = torque(now + task.period, 0.0)
    # the speed has an addition of 1e-9 rad/s, so that it is never zero
    np.testing.assert_allclose(torque(now, task.period), want, rtol=1e-7)
    assert np.abs(want - torque(now, 0.0)).max() > 0.1 * np.abs(want).max()


@pytest.mark.parametrize(
    ("keys", "act", "within"),
    [
        (KNOWN_LOAD | {"friction": False}, nothing, 0.15),
        (KNOWN_LOAD | {"friction": False}, noise, 0.4),
        (KNOWN_LOAD | {"sensors": {"delay_periods": 4}}, nothing, 0.2),
        (KNOWN_LOAD | {"drive": "CSG-14-50"}, nothing, 0.4),
        ({"randomise": True, "friction": False}, nothing, 0.25),
    ],
)
def test_the_estimate_is_the_error_of_each_specimen(keys, act, within):
    """In size and phase, whatever the action is, also with old readings.

    The estimate uses the nominal load inertia, and that of a specimen may differ from
    it by 20 %.
    """
    estimate, _, true, _ = run(make(episode_s=3.0, **keys), act)
    missed = np.sqrt(np.mean((estimate - true) ** 2, axis=0))
    size = np.sqrt(np.mean(true**2, axis=0))
    assert (missed < within * size).all()


def test_the_rate_is_the_derivative():
    """Of the estimate, between the instants."""
    env = make(episode_s=3.0)
    estimate, rate, _, _ = run(env, nothing)
    period = env.unwrapped.core.period
    change = (estimate[2:] - estimate[:-2]) / (2.0 * period)
    missed = np.sqrt(np.mean((change - rate[1:-1]) ** 2))
    assert missed < 0.1 * rate.std()


def test_one_law_improves_every_specimen():
    """The same linear law of the observation, whatever the phase of the error."""
    env = make(randomise=True)
    *_, before = run(env, nothing)
    *_, after = run(env, compensate(env))
    assert (after > 1.3 * before).all() and after.mean() > 1.8 * before.mean()
