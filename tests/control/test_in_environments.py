"""Controllers drive the environments, one episode or many side by side."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import swgjoint.envs  # noqa: F401
from swgjoint.control.flexible import flexible_plan
from swgjoint.control.learning import LearningCompensation
from swgjoint.control.motor_side import MotorPID, ideal_plan, rigid_plan
from swgjoint.control.observer import DisturbanceObserver

NAME = "swgjoint/JointTracking-v0"
KEYS = {
    "episode_s": 0.8,
    "friction": False,
    "sensors": {"link_encoder": True},
}


def episode(env, controller, steps):
    """Link errors and torques of one episode. Shapes (steps, ...)."""
    observation, _ = env.reset(seed=5)
    inside = env.unwrapped
    task = inside.task
    controller.start(task)
    errors, torques = [], []
    for k in range(steps):
        torque = controller.torque(k, inside.read_measurements(observation))
        action = np.clip(torque / task.joints.torque_limit, -1.0, 1.0)
        observation, _, _, _, info = env.step(action)
        errors.append(info["link_error_arcmin"])
        torques.append(torque)
    return np.array(errors), np.array(torques)


@pytest.mark.parametrize(
    "wrap",
    [
        lambda inner: inner,
        lambda inner: DisturbanceObserver(inner, bandwidth=2.0),
        lambda inner: LearningCompensation(inner, turns=2.0),
    ],
)
def test_one_controller_serves_one_episode_and_many(wrap):
    """The first of three episodes side by side is the episode alone."""
    alone = gymnasium.make(NAME, **KEYS)
    many = gymnasium.make_vec(NAME, num_envs=3, **KEYS)
    got = []
    for env in (alone, many):
        controller = wrap(MotorPID(flexible_plan, frequency=20.0))
        got.append(episode(env, controller, 500)[1])
        env.close()
    assert got[1].shape == (500, 3, 1)
    np.testing.assert_allclose(got[1][:, 0], got[0], rtol=0, atol=1e-9)
    assert np.abs(got[1][:, 1] - got[1][:, 0]).max() > 1e-3


def test_the_delay_of_the_sensors_is_told():
    """With readings two periods old a motor follows its plan as with those of now."""
    rms = []
    for periods in (0, 2):
        keys = {**KEYS, "sensors": {"link_encoder": True, "delay_periods": periods}}
        many = gymnasium.make_vec(NAME, num_envs=2, **keys)
        errors, _ = episode(many, MotorPID(flexible_plan, frequency=8.0), 799)
        age = many.unwrapped.task.reading_age
        assert age.motor == age.link == age.torque == periods * 1e-3
        many.close()
        rms.append(np.sqrt(np.mean(errors**2)))
    assert rms[1] < 1.1 * rms[0]


def test_plans_that_know_more_track_better():
    """From nothing over the rigid arm to the map: less error of the link."""
    many = gymnasium.make_vec(NAME, num_envs=4, **KEYS)
    rms = []
    for plan in (ideal_plan, rigid_plan, flexible_plan):
        errors, _ = episode(many, MotorPID(plan, frequency=20.0), 799)
        rms.append(np.sqrt(np.mean(errors**2)))
    many.close()
    assert rms[1] < 0.8 * rms[0]
    assert rms[2] < 0.4 * rms[1]
