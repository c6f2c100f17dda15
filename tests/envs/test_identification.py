"""RippleSuppression-v0 with ``identify``: estimates of the kinematic error."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from swgjoint.envs import ripple_suppression  # noqa: F401
from swgjoint.maps.drive_map import DriveMap

NAME = "swgjoint.envs:swgjoint/RippleSuppression-v0"


def make(**keys):
    return gymnasium.make_vec(NAME, num_envs=6, identify=True, threads=1, **keys)


def compensate(core):
    """Action that lets the motor turn against the estimated error. Shape (n, 1)."""
    loop, ratio, s = core.loop, core.joint.ratio, core.settings
    speed, torque = np.where(core.now[:, 1, 0] < 0.0, -1e-9, 1e-9), 0.0
    speed = ratio * (core.now[:, 1, 0] + speed)
    for k, order in enumerate((2, 4)):
        error, rate = (one[:, 0] for one in core.estimate.columns()[2 * k : 2 * k + 2])
        inertia = s.rotor_inertia_kgm2 * (order * speed) ** 2
        torque = torque - ratio * (
            (loop.stiffness - inertia) * error + loop.damping * rate
        )
        # the load drives the motor through the slope of the error
        torque = torque + core.now[:, 4, 0] * rate / speed
    return (torque / core.authority)[:, None]


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


@pytest.mark.parametrize(
    ("keys", "act", "within"),
    [
        ({"friction": False}, nothing, 0.15),
        ({"friction": False}, noise, 0.4),
        ({"sensors": {"delay_periods": 4}}, nothing, 0.2),
        ({"drive": "CSG-14-50"}, nothing, 0.4),
    ],
)
def test_the_estimate_is_the_error_of_each_specimen(keys, act, within):
    """In size and phase, whatever the action is, also with old readings."""
    estimate, _, true, _ = run(make(randomise=True, episode_s=3.0, **keys), act)
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
    *_, after = run(env, lambda core, k: compensate(core) * (k > 800))
    assert (after > 1.3 * before).all() and after.mean() > 1.8 * before.mean()
