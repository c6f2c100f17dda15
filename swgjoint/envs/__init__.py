"""Gymnasium environments of joints with strain wave gears, single and batched.

Importing this package registers them. Both calls below import it first:
``gymnasium.make("swgjoint.envs:swgjoint/JointTracking-v0", drive="CSG-25-100")`` or
``gymnasium.make_vec("swgjoint.envs:swgjoint/JointTracking-v0", num_envs=256)``.
"""

from __future__ import annotations

from swgjoint.errors import MissingExtraError

try:
    from gymnasium.envs.registration import register, registry
except ImportError as error:
    raise MissingExtraError(
        "environments need gymnasium: pip install 'swgjoint[envs]'"
    ) from error

ENVIRONMENTS = {
    "swgjoint/JointTracking-v0": "joint_tracking:JointTracking",
    "swgjoint/RippleSuppression-v0": "ripple_suppression:RippleSuppression",
    "swgjoint/ArmTracking-v0": "arm_tracking:ArmTracking",
}
"""Module and common prefix of its two class names for each environment id."""

for _name, _place in ENVIRONMENTS.items():
    if _name not in registry:
        register(
            _name,
            entry_point=f"swgjoint.envs.{_place}Env",
            vector_entry_point=f"swgjoint.envs.{_place}VectorEnv",
        )
