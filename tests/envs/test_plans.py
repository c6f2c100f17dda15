"""Starts, plans and noise of episodes: in arrays and in parts as one by one."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from swgjoint.envs import ENVIRONMENTS, plans
from swgjoint.envs.plans import MEMORY, PlanSize
from swgjoint.envs.rest import balance_specimens
from swgjoint.joint.variation import Variation
from swgjoint.maps.drive_map import DriveMap

SHORT = {
    "swgjoint/JointTracking-v0": {"episode_s": 0.5},
    "swgjoint/RippleSuppression-v0": {"episode_s": 1.6, "period_s": 4e-3},
    "swgjoint/ArmTracking-v0": {"episode_s": 0.3},
}
SENSORS = {"link_encoder": True, "torque_sensor": True}


def simple_balance(drive, theta, torque):
    """Equilibrium of one drive: link angle, torques on input and output, torsion."""
    psi = theta / drive.ratio
    for _ in range(50):
        on_input, on_output = (float(f) for f in drive.forces(theta, psi))
        missing = torque - on_output
        if abs(missing) < 1e-9 * drive.ratings.rated_torque:
            break
        torsion = drive.torsion(theta, psi)
        psi -= missing / float(drive.stiffness(torsion, theta, psi))
    return psi, on_input, on_output, float(drive.torsion(theta, psi))


@pytest.mark.parametrize(
    ("theta", "torque"), [(0.0, 0.0), (3.1, 20.0), (-50.0, -700.0)]
)
def test_equilibria_in_arrays_are_those_of_the_maps(synthetic_map, theta, torque):
    """To the last bit, also beyond the knots, whichever specimens come together."""
    rng = np.random.default_rng(0)
    kinds = [Variation()] + [
        Variation(
            stiffness=rng.uniform(-0.2, 0.2),
            kinematic_error=rng.uniform(-0.5, 0.5),
            losses=rng.uniform(-0.3, 0.3),
            theta=rng.uniform(0.0, 6.0),
            psi=rng.uniform(0.0, 6.0),
        )
        for _ in range(20)
    ]
    numbers = np.array([one.numbers for one in kinds])
    for drive in (DriveMap.from_catalogue("CSG-25-100"), synthetic_map):
        want = [simple_balance(one.apply_to(drive), theta, torque) for one in kinds]
        for part in (slice(None), slice(3, 4), slice(5, 9)):
            got = balance_specimens(drive, numbers[part], theta, torque)
            rows = (got.link_angle, got.input_torque, got.output_torque, got.torsion)
            np.testing.assert_array_equal(np.transpose(rows), want[part])


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_windows_change_nothing(name, monkeypatch):
    """Little memory gives the same observations, rewards and tasks, bit by bit."""
    runs = []
    for memory in (MEMORY, 1):
        monkeypatch.setattr(plans, "MEMORY", memory)
        env = gymnasium.make_vec(
            f"swgjoint.envs:{name}", 3, sensors=SENSORS, randomise=True, **SHORT[name]
        )
        rng, seen = np.random.default_rng(1), [env.reset(seed=4)[0]]
        for _ in range(520 if name.endswith("JointTracking-v0") else 420):
            actions = np.array([[1.0], [0.01], [0.0]]) * rng.uniform(
                -1.0, 1.0, env.action_space.shape
            )
            observation, reward, _, _, info = env.step(actions)
            seen += [observation, reward, info["load_torque_Nm"]]
        task = env.unwrapped.task
        runs.append([*seen, task.position, task.acceleration, task.link_torque])
    for a, b in zip(*runs, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("joints", "channels", "shared"), [(1, 3, 0), (6, 18, 1)])
def test_memory_of_plans_is_bounded(joints, channels, shared):
    """Few episodes are kept whole; of many there is a window that fits."""

    def size(count):
        return PlanSize(
            count=count,
            instants=4001,
            joints=joints,
            channels=channels,
            shared=bool(shared),
        )

    values = channels + (0 if shared else 5 * joints)
    assert size(1).window == 4001
    many = size(65_536)
    assert 40 <= many.window < 4001
    assert 8 * values * many.count * many.window <= MEMORY


def test_episodes_are_those_of_numpy(monkeypatch):
    """Observations and rewards have the same bits without the compiled loops."""

    def run():
        env = gymnasium.make_vec("swgjoint.envs:swgjoint/JointTracking-v0", 8)
        rows, rng = [env.reset(seed=1)[0]], np.random.default_rng(0)
        for _ in range(300):
            rows += env.step(rng.uniform(-0.3, 0.3, (8, 1)))[:4]
        return rows

    compiled = run()
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    for one, want in zip(compiled, run(), strict=True):
        np.testing.assert_array_equal(one, want, strict=True)
