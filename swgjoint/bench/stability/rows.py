"""Rows of the stability study and their counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from swgjoint.bench.stability.joint import GAIN, Course

DEFAULT = "discrete"
FREE = "free 10 s"
"""Group in which a loss of energy is also a fault."""
OUTCOMES = ("ok", "sub_stepped", "refused", "diverged", "energy_gain")


@dataclass(frozen=True, kw_only=True)
class StabilityRow:
    """Result of one run."""

    case: str
    group: str
    """Kind of run: ``free``, ``loaded``, ``released``, ``step``, ``drop``, ..."""
    scheme: str
    step_s: float
    outcome: str
    """One of :data:`OUTCOMES`."""
    sub_steps: int | None = None
    """Number of parts of the step; None if the run was refused."""
    largest_gain: float | None = None
    """Largest mean gain over a tenth of the run: energy minus work, relative to the
    initial kinetic and torsion energy [-]."""
    own_gain: float | None = None
    """Largest gain of a run with a much smaller step [-]; it shows the energy that the
    contacts of the engine add."""
    energy_balance: float | None = None
    """Mean gain in the last tenth [-]; negative if energy was lost."""
    error: float | None = None
    """Largest error of the link angle relative to the reference [arcmin]."""
    numerical_damping_ratio: float | None = None
    """Damping ratio of the torsional vibration that the integrator causes [-]."""
    physical_damping_ratio: float | None = None
    """Damping ratio of the drive itself [-]; the runs omit it."""
    phase_step: float | None = None
    """Step times frequency of the torsional vibration [rad]."""
    reason: str | None = None
    """Limit that a refused or sub-stepped run exceeded."""

    @property
    def unexplained(self) -> bool:
        """Whether the default scheme failed although its region was not exceeded."""
        if self.scheme != DEFAULT:
            return False
        braked = self.group == FREE and (self.energy_balance or 0.0) < -GAIN
        return braked or self.outcome in ("diverged", "energy_gain")

    def to_json(self) -> dict[str, Any]:
        """All columns; values that are not finite become None."""
        return {
            key: None if isinstance(value, float) and not isfinite(value) else value
            for key, value in asdict(self).items()
        }


def outcome_of(course: Course, *, own_gain: float = 0.0) -> str:
    """Outcome of a run that was not refused.

    Args:
        course: Course of the run.
        own_gain: Energy gain that the contacts of the engine explain [-].
    """
    if course.diverged:
        return "diverged"
    if course.gain > GAIN + own_gain:
        return "energy_gain"
    return "sub_stepped" if course.sub_steps > 1 else "ok"


def counts(rows: Sequence[StabilityRow]) -> dict[str, dict[str, int]]:
    """Number of rows by key ``group: scheme``, then by outcome."""
    found: dict[str, Counter[str]] = {}
    for row in rows:
        found.setdefault(f"{row.group}: {row.scheme}", Counter())[row.outcome] += 1
    return {key: dict(count) for key, count in found.items()}


def shares(rows: Sequence[StabilityRow]) -> dict[str, float]:
    """Fraction of each outcome among the rows of the default scheme [-]."""
    own = [row.outcome for row in rows if row.scheme == DEFAULT]
    return {name: own.count(name) / max(1, len(own)) for name in OUTCOMES}
