"""A single episode in numbers is that of the arrays, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.envs.joint_tracking import JointTrackingEnv
from swgjoint.envs.ripple_suppression import RippleSuppressionEnv

ALL = {"link_encoder": True, "torque_sensor": True}
GAUGES = {
    "flexspline": "size-25-100",
    "position_mm": 13.0,
    "strain": "outline",
    "bridges": 3,
    "place_errors_deg": [0.5, -0.3, 0.2],
    "turn_errors_deg": [1.0, -0.5, 0.2],
}


def run(env, arrays, actions):
    """Observations, rewards, flags and infos; with resets, and beyond one end."""
    if arrays:
        env._episode = None
    rows, late = [env.reset(seed=3)], False
    for action in actions:
        rows.append(env.step(action))
        if rows[-1][2] or rows[-1][3]:
            if late:
                rows.append(env.reset())
            late = not late
    return rows


@pytest.mark.parametrize("kind", [JointTrackingEnv, RippleSuppressionEnv])
@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"level": "linear", "randomise": True, "sensors": ALL},
        {"friction": False, "sensors": {**ALL, "delay_periods": 5}, "payload_kg": 3.0},
        {"randomise": True, "sensors": {"motor_counts": 0, "delay_periods": 0}},
        {"randomise": True, "sensors": ALL, "gauges": GAUGES},
        {"drive": "CSG-14-50", "period_s": 2e-3, "torque_limit_Nm": 0.4},
    ],
)
def test_numbers_are_those_of_the_arrays(kind, keys):
    """Every value of every step has the same bits, and the same type."""
    short = {"episode_s": 0.5} if kind is JointTrackingEnv else {"episode_s": 1.6}
    rng = np.random.default_rng(0)
    size = np.repeat([0.02, 1.0, 0.02], 700)[:, None]
    actions = size * rng.uniform(-1.2, 1.2, (size.size, 1))
    got, want = (run(kind(**short, **keys), one, actions) for one in (False, True))
    assert len(got) == len(want) > len(actions)
    for a, b in zip(got, want, strict=True):
        np.testing.assert_array_equal(a[0], b[0], strict=True)
        assert a[1:-1] == b[1:-1]
        assert [type(x) for x in a[1:-1]] == [type(x) for x in b[1:-1]]
        assert a[-1] == b[-1] and list(a[-1]) == list(b[-1])
        assert {type(x) for x in a[-1].values()} <= {float, int}
