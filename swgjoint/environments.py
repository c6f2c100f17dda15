"""Ids of the gymnasium environments and their registration.

This module imports only the standard library, because it adds to every import of the
package. Gymnasium has no entry points for packages since version 1.0. Its form
``module:id`` imports a module before it searches the id, so that
``gymnasium.make("swgjoint:swgjoint/JointTracking-v0")`` finds the environment.
"""

import sys

ENVIRONMENTS = {
    "swgjoint/JointTracking-v0": "joint_tracking:JointTracking",
    "swgjoint/RippleSuppression-v0": "ripple_suppression:RippleSuppression",
    "swgjoint/ArmTracking-v0": "arm_tracking:ArmTracking",
}
"""Module and common prefix of its two class names for each environment id."""


def register_environments() -> bool:
    """Register the environments if gymnasium is imported.

    Returns:
        Whether gymnasium knows them.
    """
    registration = sys.modules.get("gymnasium.envs.registration")
    if registration is None or not hasattr(registration, "register"):
        return False
    for name, place in ENVIRONMENTS.items():
        if name not in registration.registry:
            registration.register(
                name,
                entry_point=f"swgjoint.envs.{place}Env",
                vector_entry_point=f"swgjoint.envs.{place}VectorEnv",
            )
    return True
