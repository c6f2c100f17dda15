"""Limits of joints at which an episode ends."""

from __future__ import annotations

from dataclasses import dataclass

from swgjoint.typing import Array

LIMITS = ("none", "angle", "speed", "momentary_peak", "ratcheting")
"""Names of the limits by their number in ``info["broken_limit"]``."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeLimits:
    """Limits of the joints. Arrays have shape (n_joints,)."""

    angle: Array
    """Largest deviation of the link angle from ``centre`` [rad]."""
    centre: Array
    """Centre of the range of the link angle [rad]."""
    motor_speed: Array
    """Largest motor speed [rad/s]."""
    momentary_peak: Array
    """Momentary peak torque of the drives [N·m]."""
    ratcheting: Array
    """Ratcheting torque of the drives [N·m], inf if unknown."""
    motor_torque: Array
    """Largest motor torque [N·m]; motors saturate there, and the episode continues."""
