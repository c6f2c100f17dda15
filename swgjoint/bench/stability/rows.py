"""Rows of the stability study and their counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from swgjoint.bench.stability.joint import GAIN, Course

DEFAULT = "discrete"
"""Name of the default scheme."""
FREE = "free 10 s"
"""Group in which a loss of energy is also a fault."""
OUTCOMES = ("ok", "sub_stepped", "refused", "diverged", "energy_gain")
"""Possible outcomes of a run."""


@dataclass(frozen=True, kw_only=True)
class StabilityRow:
    """Result of one run."""

    case: str
    """Joint, drive, chain or arm of the run."""
    group: str
    """Kind of run, see :mod:`swgjoint.bench.stability.stability`."""
    scheme: str
    """Time integration: :data:`DEFAULT` or another scheme of the grid."""
    step_s: float
    """Time step, before its division into sub-steps [s]."""
    outcome: str
    """One of :data:`OUTCOMES`."""
    sub_steps: int | None = None
    """Number of parts of the step; None if the run was refused or raised an error."""
    largest_gain: float | None = None
    """Largest mean gain of energy minus work over a tenth of the run [-], relative to
    an energy that depends on the group, see :mod:`swgjoint.bench.stability.stability`.
    """
    own_gain: float | None = None
    """Largest gain of runs with a much smaller step [-]; it shows the energy that the
    contacts of the engine add. None if no such run was needed."""
    energy_balance: float | None = None
    """Mean change of energy in the last tenth of the run, relative to the same energy
    [-]; negative if energy was lost."""
    error: float | None = None
    """Largest deviation of a link angle from the reference [arcmin]; None without a
    reference."""
    numerical_damping_ratio: float | None = None
    """Damping ratio of the torsional vibration that the integrator causes [-]."""
    physical_damping_ratio: float | None = None
    """Damping ratio of the drive itself [-]; only the ``sweep`` runs apply it."""
    phase_step: float | None = None
    """Time step times frequency of the fastest torsional vibration [rad]."""
    reason: str | None = None
    """Bound of the stability region that the undivided step exceeds, or another reason
    for a failed run; None without one."""

    @property
    def unexplained(self) -> bool:
        """Whether the default scheme failed inside its stability region."""
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
    """Outcome of a run that was not refused, one of :data:`OUTCOMES`.

    Args:
        course: Sampled states of the run.
        own_gain: Energy gain that the contacts of the engine explain [-].
    """
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
    """Fraction of each outcome among the rows of the default scheme [-]."""
    own = [row.outcome for row in rows if row.scheme == DEFAULT]
    return {name: own.count(name) / max(1, len(own)) for name in OUTCOMES}
