"""Rated and limit torques of a drive."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Ratings:
    """Catalogue torques at the output [N·m]."""

    rated_torque: float
    """Rated torque [N·m]."""
    repeated_peak: float
    """Limit for repeated peak torque [N·m]."""
    momentary_peak: float
    """Limit for momentary peak torque [N·m]."""
    T1: float
    """Torque at the end of the first line of the torsion curve, whose slope is K1
    [N·m]."""
    T2: float
    """Torque at the end of the second line of the torsion curve, whose slope is K2
    [N·m]."""
    source: str = "given"
    """Origin of the values: ``given``, or the rule that supplied defaults."""
    ratcheting_torque: float | None = None
    """Torque at which the teeth ratchet [N·m]; None if it is not known."""
