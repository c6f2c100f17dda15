"""Torques that a drive is rated for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Ratings:
    """Torques at the output that a catalogue states [N·m]."""

    rated_torque: float
    repeated_peak: float
    momentary_peak: float
    T1: float
    T2: float
    source: str = "given"
    ratcheting_torque: float | None = None
    """At which teeth skip; None where it is not known."""
