"""What a learned policy sees of RippleSuppression-v0, and how it acts; numpy alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swgjoint.control.kinematic_error import KinematicErrorTable
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import AMPLITUDES
from swgjoint.units import arcmin


def drive_of_training():
    """CSG-25-100 whose two members err: 1 arcmin at 2 and 4 per turn against either."""
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)
    orders, phase = ((2, 0), (0, 2), (4, 0), (0, 4)), np.arange(1.0, 5.0)
    size = np.array([[AMPLITUDES[pq]] for pq in orders])
    table = KinematicErrorTable(
        orders=np.array(orders),
        amplitudes=size * np.stack([np.cos(phase), np.sin(phase)], axis=1),
    )
    return table.scale_to(drive, arcmin).apply_to(drive)


ENVIRONMENT = "swgjoint/RippleSuppression-v0"
ARGUMENTS = {
    "drive": drive_of_training(),
    "sensors": {"torque_sensor": True},
    "episode_s": 3.0,
}
RATIO, RATED = -100.0, 87.0
"""Of that drive; torque in N·m."""
SHARE = 0.25
"""Of the environment's authority that the policy uses."""
folder = Path(__file__).parent
TEST_SEED, TEST_COUNT = 10_000, 32


def features(observation):
    """Scaled readings, harmonics of the gear's two angles. Shape (n, 22).

    Both members of the gear err, one at multiples of the wave generator's angle
    against the circular spline (alpha), the other against the flexspline, which turns
    with the output (beta); how much of it comes through depends on the speed.
    """
    angle, _, angle_error, speed_error, s, c, speed, load, last, torque = observation.T
    s2, c2 = 2.0 * s * c, c * c - s * s
    p, q = np.sin(2.0 * angle / RATIO), np.cos(2.0 * angle / RATIO)
    s2b, c2b = s2 * q - c2 * p, c2 * q + s2 * p
    harmonics = [
        *(s2, c2, 2.0 * s2 * c2, c2 * c2 - s2 * s2),
        *(s2b, c2b, 2.0 * s2b * c2b, c2b * c2b - s2b * s2b),
    ]
    turning = speed / 0.6
    return np.stack(
        [
            *harmonics,
            *(turning * x for x in harmonics),
            turning,
            load / (0.5 * RATED),
            last / SHARE,
            20.0 * angle_error,
            0.3 * speed_error,
            20.0 * (torque - load) / RATED,
        ],
        axis=-1,
    )


def act(policy, observation):
    """Mean action of the network, two layers of tanh. Shape (n, 1)."""
    x = np.clip(features(np.atleast_2d(observation)), -10.0, 10.0)
    for layer in ("1", "2"):
        x = np.tanh(x @ policy["weight" + layer].T + policy["bias" + layer])
    x = x @ policy["weight3"].T + policy["bias3"]
    return SHARE * np.clip(x, -1.0, 1.0)


def evaluate(env, policy=None, seed=TEST_SEED):
    """Episodes of a batch under a policy, or under the loop alone for None.

    Returns:
        Mean reward of a step that counts, rms of the torque ripple in % of the rated
        torque, rms of the link's uneven motion [arcmin]; shapes (n,).
    """
    observation, _ = env.reset(seed=seed)
    rewards, torques, errors = [], [], []
    for _ in range(env.unwrapped.core.steps):
        action = np.zeros((env.num_envs, 1))
        if policy is not None:
            action = act(policy, observation)
        observation, reward, _, _, info = env.step(action)
        if info["steady"].all():
            rewards.append(reward)
            torques.append(info["torque_ripple_Nm"])
            errors.append(info["link_error_ripple_arcmin"])

    def rms(values):
        return np.sqrt(np.mean(np.square(values), axis=0))

    return np.mean(rewards, axis=0), 100.0 * rms(torques) / RATED, rms(errors)


def load():
    """The stored policy, plain arrays."""
    with np.load(folder / "ripple-policy.npz", allow_pickle=False) as file:
        return {key: file[key].astype(float) for key in file.files}
