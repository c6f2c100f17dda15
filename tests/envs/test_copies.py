"""Copies of environments: by pickle for other processes, and by deepcopy."""

from __future__ import annotations

import pickle
from copy import deepcopy

import gymnasium
import numpy as np
import pytest

from swgjoint.errors import InputError

NAME = "swgjoint.envs:swgjoint/JointTracking-v0"
KEYS = {"episode_s": 0.5, "randomise": True, "sensors": {"link_encoder": True}}


@pytest.mark.parametrize("copied", [deepcopy, lambda e: pickle.loads(pickle.dumps(e))])
@pytest.mark.parametrize("wrapped", [True, False])
def test_a_copy_of_an_environment_has_its_arguments(copied, wrapped):
    """It begins with a reset, and then agrees to the last bit."""
    env = gymnasium.make(NAME, **KEYS)
    env.reset(seed=1)
    env.step(env.action_space.sample())
    env = env if wrapped else env.unwrapped
    other = copied(env)
    with pytest.raises((InputError, gymnasium.error.ResetNeeded)):
        other.unwrapped.step(env.action_space.sample())
    starts = [one.reset(seed=5)[0] for one in (env, other)]
    np.testing.assert_array_equal(*starts)
    action = np.full(env.action_space.shape, 0.3)
    for _ in range(5):
        np.testing.assert_array_equal(*(one.step(action)[0] for one in (env, other)))


def test_a_copy_of_a_batch_has_its_arguments():
    """Number of episodes and restart mode included."""
    keys = {**KEYS, "vectorization_mode": "vector_entry_point"}
    batch = gymnasium.make_vec(NAME, num_envs=3, **keys).unwrapped
    other = pickle.loads(pickle.dumps(batch))
    assert other.num_envs == 3 and other.metadata == batch.metadata
    np.testing.assert_array_equal(*(one.reset(seed=7)[0] for one in (batch, other)))
