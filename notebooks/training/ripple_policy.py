"""Inputs and actions of a learned policy for RippleSuppression-v0, with numpy only."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swgjoint.control.kinematic_error import KinematicErrorTable
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import AMPLITUDES
from swgjoint.units import arcmin


def drive_of_training():
    """CSG-25-100 with 1 arcmin of error at 2 and 4 cycles per turn of either angle."""
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
    "normalise": False,
}
RATIO, RATED = -100.0, 87.0
"""Ratio and rated torque [N·m] of that drive."""
SHARE = 0.25
"""Share of the largest added torque of the environment that the policy uses [-]."""
folder = Path(__file__).parent
TEST_SEED, TEST_COUNT = 10_000, 32


def features(observation):
    """Scaled readings and harmonics of the two gear angles. Shape (n, 22).

    The errors of the circular spline are periodic in the angle of the wave generator
    relative to it (alpha), those of the flexspline in the angle relative to the
    flexspline, which turns with the output (beta). Their effect depends on the speed.
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
    """Mean action of the network, which has two tanh layers. Shape (n, 1)."""
    x = np.clip(features(np.atleast_2d(observation)), -10.0, 10.0)
    for layer in ("1", "2"):
        x = np.tanh(x @ policy["weight" + layer].T + policy["bias" + layer])
    x = x @ policy["weight3"].T + policy["bias3"]
    return SHARE * np.clip(x, -1.0, 1.0)


def evaluate(env, policy=None, seed=TEST_SEED):
    """Simulate episodes with a policy, or with the servo loop alone for None.

    Returns:
        Mean reward of the steady steps, rms of the torque ripple [% of the rated
        torque] and rms of the uneven motion of the link [arcmin]. Shapes (n,).
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
    """Load the stored policy as arrays by name."""
    with np.load(folder / "ripple-policy.npz", allow_pickle=False) as file:
        return {key: file[key].astype(float) for key in file.files}
