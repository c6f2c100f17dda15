"""Train a policy that reduces the ripple of a joint with PPO of stable-baselines3.

The tests do not run this script. The extra ``rl`` installs torch:

    pip install 'swgjoint[envs,rl]'
    python notebooks/training/train_ripple_policy.py [--minutes 10] [--seed 0]

The script writes the learning curve ``ripple-policy.csv`` and the arrays of the policy
``ripple-policy.npz`` into its own folder; ``reinforcement-learning.py`` shows both.

Source:
    Schulman et al. (2017), "Proximal policy optimization algorithms", arXiv:1707.06347.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import gymnasium
import numpy as np
import torch
from ripple_policy import (
    ARGUMENTS,
    ENVIRONMENT,
    SHARE,
    TEST_COUNT,
    evaluate,
    features,
)
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

import swgjoint.envs  # noqa: F401

COUNT, WIDTH = 64, 32
HERE = Path(__file__).parent


class Batched(VecEnv):
    """The batched environment in the interface of stable-baselines3."""

    def __init__(self, count):
        self.env = gymnasium.make_vec(
            ENVIRONMENT, count, autoreset_mode="SameStep", **ARGUMENTS
        )
        size = features(np.zeros(self.env.observation_space.shape)).shape[1]
        space = gymnasium.spaces.Box(-10.0, 10.0, (size,), np.float32)
        action = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.first_seed = 0
        super().__init__(count, space, action)

    @staticmethod
    def seen(observation):
        return np.clip(features(observation), -10.0, 10.0).astype(np.float32)

    def reset(self):
        return self.seen(self.env.reset(seed=self.first_seed)[0])

    def step_async(self, actions):
        self.actions = SHARE * np.asarray(actions, float)

    def step_wait(self):
        observation, reward, broken, over, info = self.env.step(self.actions)
        done, infos = broken | over, [{} for _ in range(self.num_envs)]
        for k in np.flatnonzero(done):
            infos[k] = {
                "TimeLimit.truncated": bool(over[k] and not broken[k]),
                "terminal_observation": self.seen(info["final_obs"][k][None])[0],
            }
        return self.seen(observation), reward.astype(np.float32), done, infos

    def close(self):
        self.env.close()

    def get_attr(self, attr_name, indices=None):
        return [None] * self.num_envs

    def set_attr(self, attr_name, value, indices=None):
        raise NotImplementedError

    def env_method(self, method_name, *args, indices=None, **keys):
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * self.num_envs


class Curve(BaseCallback):
    """Evaluate at intervals, store the best policy, and stop at the time limit."""

    def __init__(self, minutes, every):
        super().__init__()
        self.end = time.process_time() + 60.0 * minutes
        self.every, self.rollouts, self.rows, self.best = every, 0, [], -np.inf
        self.test = gymnasium.make_vec(ENVIRONMENT, TEST_COUNT, **ARGUMENTS)

    def _on_rollout_end(self):
        if self.rollouts % self.every == 0:
            policy = weights(self.model)
            reward, torque, error = evaluate(self.test, policy)
            row = [
                self.num_timesteps,
                *(float(x.mean()) for x in (reward, torque, error)),
            ]
            self.rows.append(row)
            print(" ".join(f"{x:.5g}" for x in row), flush=True)
            if row[1] > self.best:
                self.best = row[1]
                np.savez(HERE / "ripple-policy.npz", **policy)
            with (HERE / "ripple-policy.csv").open("w", newline="") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(
                    ["steps", "reward", "torque_ripple_percent", "link_ripple_arcmin"]
                )
                writer.writerows([[f"{x:.6g}" for x in r] for r in self.rows])
        self.rollouts += 1

    def _on_step(self):
        return time.process_time() < self.end


def weights(model):
    """Layers of the policy network as arrays by name."""
    net = model.policy
    layers = [net.mlp_extractor.policy_net[0], net.mlp_extractor.policy_net[2]]
    got = {}
    for k, layer in enumerate([*layers, net.action_net], start=1):
        got[f"weight{k}"] = layer.weight.detach().numpy().astype(np.float32)
        got[f"bias{k}"] = layer.bias.detach().numpy().astype(np.float32)
    return got


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0, help="CPU time [min]")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    torch.set_num_threads(1)
    curve = Curve(given.minutes, every=5)
    base = [float(x.mean()) for x in evaluate(curve.test)]
    print("without policy:", " ".join(f"{x:.5g}" for x in base), flush=True)
    model = PPO(
        "MlpPolicy",
        Batched(COUNT),
        n_steps=250,
        batch_size=4000,
        n_epochs=6,
        learning_rate=1e-3,
        gamma=0.98,
        gae_lambda=0.95,
        ent_coef=0.0,
        policy_kwargs={
            "net_arch": [WIDTH, WIDTH],
            "activation_fn": torch.nn.Tanh,
            "log_std_init": -1.5,
        },
        seed=given.seed,
        device="cpu",
    )
    model.learn(10**9, callback=curve)


if __name__ == "__main__":
    main()
