"""Rated torques of a drive."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Ratings:
    """Rated torques at the output, as in a catalogue [N·m]."""

    rated_torque: float
    repeated_peak: float
    momentary_peak: float
    T1: float
    T2: float
    source: str = "given"
    ratcheting_torque: float | None = None
    """Output torque at which the teeth skip; None if unknown."""
