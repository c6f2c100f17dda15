"""Environments tell the drives that they simulate: every level, friction on and off."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.motor_side import MotorPID
from swgjoint.envs.arm_tracking import ArmTrackingEnv
from swgjoint.envs.bench import LEVELS
from swgjoint.envs.joint_tracking import JointTrackingEnv
from swgjoint.envs.ripple_suppression import RippleSuppressionEnv

EXACT = {"motor_counts": 0, "motor_noise_rad": 0.0, "delay_periods": 0}


def rms_of(env) -> float:
    """Error of the link under the plan from the task, later half [arcmin]."""
    controller, (observation, _) = MotorPID(flexible_plan), env.reset(seed=3)
    controller.start(env.task)
    limit, errors = env.core.limits.motor_torque[0], []
    for k in range(env.core.steps):
        torque = controller.torque(k, env.read_measurements(observation))
        observation, _, ended, _, info = env.step(torque / limit)
        assert not ended
        errors.append(info["link_error_arcmin"])
    return float(np.sqrt(np.mean(np.array(errors[len(errors) // 2 :]) ** 2)))


@pytest.mark.parametrize("friction", [True, False])
@pytest.mark.parametrize("level", LEVELS)
def test_the_plan_from_the_task_holds_the_link(level, friction):
    """Within a few tenths of an arcmin, which drives that are not simulated exceed."""
    env = JointTrackingEnv(
        level=level, friction=friction, sensors=EXACT, load_of_rated=0.3
    )
    assert rms_of(env) < (0.3 if friction and level == "full" else 0.05)


@pytest.mark.parametrize("friction", [True, False])
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    "kind", [JointTrackingEnv, RippleSuppressionEnv, ArmTrackingEnv]
)
def test_a_drive_is_told_as_the_model_has_it(kind, level, friction):
    """At linear one spring alone, at full error, and friction where it is on."""
    more = {"scene": "ur5e-catalogue"} if kind is ArmTrackingEnv else {}
    env = kind(level=level, friction=friction, **more)
    for drive, attached in zip(
        env.core.joints.drives, env.core.plant.drives, strict=True
    ):
        full = level == "full"
        assert bool(drive.kinematic_error.any()) == full
        assert (drive.friction is not None) == (full and friction)
        assert drive.mean_stiffness == pytest.approx(attached.stiffness, rel=1e-9)
        assert drive.ratings == attached.drive.ratings
        spread = np.ptp(drive.coefficients(np.linspace(0.0, 1e-3, 9), 2)[:, 0, 0])
        assert (spread > 1e-6 * attached.stiffness) == full
