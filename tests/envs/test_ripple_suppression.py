"""RippleSuppression-v0: where the ripple comes from and what the reward counts."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.envs.ripple_suppression import RippleSuppressionEnv
from swgjoint.errors import InputError
from swgjoint.units import arcmin

QUIET = {
    "motor_counts": 0,
    "motor_noise_rad": 0.0,
    "delay_periods": 0,
}


def turn(env, seed=1, action=0.0):
    """Infos and rewards of an episode with a constant action."""
    env.reset(seed=seed)
    rows = []
    for _ in range(env.core.steps):
        _, reward, terminated, truncated, info = env.step(np.array([action]))
        rows.append((reward, info))
        if terminated or truncated:
            break
    assert truncated and not terminated
    return rows


def steady(rows, key):
    """One figure of the part that counts."""
    return np.array([info[key] for _, info in rows if info["steady"]])


def test_a_perfect_drive_has_no_ripple():
    """Without kinematic error torque and speed are even, and the reward is full."""
    env = RippleSuppressionEnv(
        kinematic_error_arcmin=0.0, sensors=QUIET, friction=False, episode_s=2.5
    )
    rows = turn(env)
    assert np.abs(steady(rows, "torque_ripple_Nm")).max() < 0.05
    # the inertia of the link, 2 N·m while it speeds up, is known and no ripple
    ripple = [abs(info["torque_ripple_Nm"]) for _, info in rows]
    assert max(ripple) < 0.5
    assert np.abs(steady(rows, "transmission_error_ripple_arcmin")).max() < 0.01
    rewards = [reward for reward, info in rows if info["steady"]]
    assert min(rewards) > 0.98
    assert {reward for reward, info in rows if not info["steady"]} == {0.0}


def test_ripple_has_the_orders_of_the_error():
    """Twice and four times per turn of the wave generator, in proportion."""
    sizes = []
    for error in (0.5, 1.0):
        env = RippleSuppressionEnv(
            kinematic_error_arcmin=error,
            sensors=QUIET,
            friction=False,
            slowest=1.0,
            episode_s=3.0,
        )
        rows = turn(env)
        ripple = steady(rows, "transmission_error_ripple_arcmin")
        theta = steady(rows, "motor_angle_rad")
        even = np.linspace(*np.sort(theta[[0, -1]]), theta.size)
        order = np.argsort(theta)
        signal = np.interp(even, theta[order], ripple[order])
        signal = signal * np.hanning(signal.size)
        power = np.abs(np.fft.rfft(signal)) ** 2
        orders = np.arange(power.size) * 2.0 * np.pi / np.ptp(even)
        near = (np.abs(orders - 2.0) < 0.2) | (np.abs(orders - 4.0) < 0.2)
        assert power[near].sum() > 0.98 * power.sum()
        sizes.append(ripple.std())
    assert sizes[1] / sizes[0] == pytest.approx(2.0, rel=0.05)


def test_reward_and_observation_are_what_the_docstring_says():
    """Reward from ripple, error and action; sine and cosine of the angle read."""
    env = RippleSuppressionEnv(authority_of_rated=0.01, episode_s=2.5)
    rated = env.task.joints.drives[0].ratings.rated_torque
    for reward, info in turn(env, action=0.5):
        a = info["torque_ripple_Nm"] / (0.01 * rated)
        b = info["link_error_ripple_arcmin"] / 0.1
        want = 1.0 / (1.0 + a**2 + b**2) - 0.1 * 0.25
        assert reward == pytest.approx(want * info["steady"])
    observation, _ = env.reset(seed=3)
    for _ in range(300):
        observation, *_ = env.step(np.zeros(1))
    angle = env.read_measurements(observation).motor_angle[0]
    np.testing.assert_allclose(observation[4:6], [np.sin(angle), np.cos(angle)])
    assert abs(angle) > 1.0


def test_what_evens_the_link_takes_ripple_and_not_the_transmission_error():
    """A motor that runs against the known kinematic error leaves little to see."""
    env = RippleSuppressionEnv(
        sensors=QUIET,
        friction=False,
        slowest=1.0,
        authority_of_rated=1.0,
        episode_s=3.0,
    )
    runs = []
    for compensate in (False, True):
        env.reset(seed=1)
        core, task, rows = env.core, env.task, []
        drive = task.joints.drives[0]
        loop, i = core.loop, drive.ratio
        # what the motor shall do beyond the reference, on the nominal motion
        psi = task.position[:, 0]
        error, slope, _ = drive.error_at(drive.phases(i * psi, psi))
        beyond = -i * error
        rate = np.gradient(beyond, task.period)
        bend = np.gradient(rate, task.period)
        torque = loop.stiffness * beyond + loop.damping * rate
        torque += task.joints.rotor_inertia * bend
        # the load drives the motor through the slope of the error
        torque += task.link_torque[:, 0] * slope
        for k in range(core.steps):
            action = compensate * torque[k + 1 : k + 2] / core.authority
            rows.append((0.0, env.step(action)[-1]))
        runs.append(
            {
                key: steady(rows, f"{key}").std()
                for key in (
                    "torque_ripple_Nm",
                    "link_error_ripple_arcmin",
                    "transmission_error_ripple_arcmin",
                )
            }
        )
    before, after = runs
    assert after["torque_ripple_Nm"] < 0.2 * before["torque_ripple_Nm"]
    assert after["link_error_ripple_arcmin"] < 0.2 * before["link_error_ripple_arcmin"]
    # the transmission error is then the kinematic error itself; of its slowest wave,
    # 10 Hz, the running mean follows a tenth
    alone = float(np.std(error[1500:])) / arcmin
    got = after["transmission_error_ripple_arcmin"]
    assert got == pytest.approx(alone, rel=0.15)
    assert got > 3.0 * after["link_error_ripple_arcmin"]


@pytest.mark.parametrize(
    ("keys", "match"),
    [
        ({"episode_s": 1.5}, ("episode_s", "1.5 s")),
        (
            {"max_angle_rad": 1.0},
            ("max_angle_rad", "1.0 rad", "2.4 rad", "max_speed_rad_s", "episode_s"),
        ),
        ({"slowest": 2.0}, ("slowest", "2.0", "> 0", "1")),
    ],
)
def test_bad_arguments_give_one_line(keys, match):
    """What, the value, and what is accepted."""
    with pytest.raises(InputError, match=naming(*match)):
        RippleSuppressionEnv(**keys)
