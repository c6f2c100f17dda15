"""Rated and limit torques of a drive."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Ratings:
    """Catalogue torques at the output [N·m]."""

    rated_torque: float
    """Rated torque."""
    repeated_peak: float
    """Limit for repeated peak torque."""
    momentary_peak: float
    """Limit for momentary peak torque."""
    T1: float
    """End of the first line of the torsion curve, with slope K1."""
    T2: float
    """End of the second line of the torsion curve, with slope K2."""
    source: str = "given"
    """Origin of the values: ``given``, or the rule that supplied defaults."""
    ratcheting_torque: float | None = None
    """Torque at which teeth ratchet; None if it is not known."""
