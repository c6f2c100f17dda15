"""Gymnasium environments of joints with strain wave gears, single and batched.

Importing this package registers them. Both calls below import it first:
``gymnasium.make("swgjoint.envs:swgjoint/JointTracking-v0", drive="CSG-25-100")`` or
``gymnasium.make_vec("swgjoint.envs:swgjoint/JointTracking-v0", num_envs=256)``.
"""

from __future__ import annotations

from swgjoint.environments import ENVIRONMENTS, register_environments
from swgjoint.errors import MissingExtraError

__all__ = ["ENVIRONMENTS"]

try:
    import gymnasium  # noqa: F401
except ImportError as error:
    raise MissingExtraError(
        "environments need gymnasium: pip install 'swgjoint[envs]'"
    ) from error

register_environments()
