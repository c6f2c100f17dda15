"""Rows of the stability study and what they add up to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from swgjoint.bench.stability.joint import GAIN, Course

DEFAULT = "discrete"
FREE = "free 10 s"
"""Group in which energy must not be lost either."""
OUTCOMES = ("ok", "sub_stepped", "refused", "diverged", "energy_gain")


@dataclass(frozen=True, kw_only=True)
class StabilityRow:
    """One run."""

    case: str
    group: str
    """What happens: ``free``, ``loaded``, ``released``, ``step``, ``drop``, ..."""
    scheme: str
    step_s: float
    outcome: str
    """One of :data:`OUTCOMES`."""
    sub_steps: int | None = None
    """Parts of the step; None where the run was refused."""
    largest_gain: float | None = None
    """Largest sustained gain of energy less work over kinetic and torsion energy at the
    start; sustained: mean over a tenth of the run."""
    own_gain: float | None = None
    """The same of a much finer run, where the contacts of the engine give energy."""
    energy_balance: float | None = None
    """Mean of the last tenth; negative where energy was lost."""
    error: float | None = None
    """Largest error of the link angle against the reference [arcmin]."""
    numerical_damping_ratio: float | None = None
    """Numerical damping ratio of the torsional vibration, given by the steps."""
    physical_damping_ratio: float | None = None
    """That the drive itself has; the runs are without."""
    phase_step: float | None = None
    """Step times frequency of the torsional vibration [rad]."""
    reason: str | None = None
    """What a refused or sub-stepped run exceeded."""

    @property
    def unexplained(self) -> bool:
        """Whether the default scheme went wrong without having said so before."""
        if self.scheme != DEFAULT:
            return False
        braked = self.group == FREE and (self.energy_balance or 0.0) < -GAIN
        return braked or self.outcome in ("diverged", "energy_gain")

    def to_json(self) -> dict[str, Any]:
        """All columns; numbers that are not finite become None."""
        return {
            key: None if isinstance(value, float) and not isfinite(value) else value
            for key, value in asdict(self).items()
        }


def outcome_of(course: Course, *, own_gain: float = 0.0) -> str:
    """What became of a run that was not refused."""
    if course.diverged:
        return "diverged"
    if course.gain > GAIN + own_gain:
        return "energy_gain"
    return "sub_stepped" if course.sub_steps > 1 else "ok"


def counts(rows: Sequence[StabilityRow]) -> dict[str, dict[str, int]]:
    """Number of rows by ``group: scheme`` and outcome."""
    found: dict[str, Counter[str]] = {}
    for row in rows:
        found.setdefault(f"{row.group}: {row.scheme}", Counter())[row.outcome] += 1
    return {key: dict(count) for key, count in found.items()}


def shares(rows: Sequence[StabilityRow]) -> dict[str, float]:
    """Share of every outcome among the rows of the default scheme."""
    own = [row.outcome for row in rows if row.scheme == DEFAULT]
    return {name: own.count(name) / max(1, len(own)) for name in OUTCOMES}
