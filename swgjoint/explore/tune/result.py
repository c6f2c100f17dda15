"""Settings and results of a tuning run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swgjoint.errors import InputError
from swgjoint.explore.tune.cost import Trace
from swgjoint.explore.tune.search import OPTIMISERS, GainSearch
from swgjoint.explore.tune.tunable import GainParameter
from swgjoint.typing import Array

MINUTES = 3.0
"""Default wall time of a tuning run [min]."""


@dataclass(frozen=True, kw_only=True)
class TuneSettings:
    """Environment, controller, optimiser and budget of a tuning run."""

    environment: str
    controller: Any = "pd-flexible"
    """Name of a controller, ``FILE.py:NAME``, or a class or function of the user, see
    :class:`~swgjoint.explore.tune.own.OwnController`."""
    optimiser: str = "de"
    minutes: float | None = None
    """Wall time [min]; None for :data:`MINUTES`, unless ``evaluations`` is set."""
    evaluations: int | None = None
    """Total number of candidates of both searches, as an alternative to ``minutes``;
    the result is then the same on every machine."""
    seed: int = 0
    """Seed of the optimiser, from which the seeds of the episodes follow."""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the environment. Drives and loads vary within their tolerances
    unless ``randomise`` is false."""
    population: int = 16
    """Number of candidates in a generation."""
    training: int = 8
    """Number of seeds on which the searches evaluate every candidate."""
    held_out: int = 16
    """Number of seeds reserved for the comparison."""

    def __post_init__(self) -> None:
        if self.optimiser not in OPTIMISERS:
            raise InputError(
                f"optimiser {self.optimiser!r}; accepted: {', '.join(OPTIMISERS)}"
            )
        if self.minutes is not None and self.evaluations is not None:
            raise InputError(
                "minutes and evaluations together; accepted: only one of them"
            )
        if self.minutes is not None and not 0.0 < self.minutes <= 1440.0:
            raise InputError(f"minutes = {self.minutes:g}; accepted: > 0 and <= 1440")
        least = 2 * self.population
        if self.evaluations is not None and self.evaluations < least:
            raise InputError(
                f"evaluations {self.evaluations}; accepted: at least {least}, that is"
                f" one generation of {self.population} for each of two searches"
            )
        if not 0 <= self.seed < 10**6:
            raise InputError(f"seed {self.seed}; accepted: 0 to 999999")

    @property
    def seeds(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Seeds of the episodes: training seeds and held-out seeds."""
        first = 1000 * self.seed
        return (
            tuple(range(first, first + self.training)),
            tuple(range(first + 500, first + 500 + self.held_out)),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class GainCandidate:
    """A controller with its parameter values and its costs."""

    name: str
    controller: str
    values: dict[str, float]
    """Parameter values by key, in the unit of the key."""
    gains: dict[str, float]
    """Gains at the motor by key, in SI units."""
    tuned: bool
    """Whether a search has found the values."""
    training: Array
    """Cost of each training seed [rad or m]."""
    held_out: Array
    """Cost of each held-out seed [rad or m]."""
    trace: Trace
    """Signals of the held-out episodes."""

    def to_json(self, unit: str, size: float) -> dict[str, Any]:
        """Parameters, gains and costs as JSON.

        Args:
            unit: Name of the unit of costs.
            size: Size of the unit [rad or m].
        """
        got: dict[str, Any] = {
            "name": self.name,
            "controller": self.controller,
            "parameters": self.values,
            "gains": self.gains,
        }
        for key, costs in (("training", self.training), ("held_out", self.held_out)):
            got[f"{key}_cost_{unit}"] = float(costs.mean() / size)
            got[f"{key}_spread_{unit}"] = float(costs.std(ddof=1) / size)
            got[f"{key}_costs_{unit}"] = (costs / size).tolist()
        got["broken_limits"] = self.broken
        return got

    @property
    def broken(self) -> int:
        """Number of held-out episodes that exceed a limit."""
        return int((~np.isfinite(self.trace.error).all(axis=0)).sum())


@dataclass(frozen=True, kw_only=True, eq=False)
class Tuned:
    """Result of a tuning run."""

    settings: TuneSettings
    environment: str
    arguments: Mapping[str, Any]
    """Arguments of the environment; ``randomise`` is true unless set otherwise."""
    candidates: tuple[GainCandidate, ...]
    """Compared controllers, from the baseline to the tuned controller."""
    searches: dict[str, GainSearch]
    parameters: tuple[GainParameter, ...]
    """Parameters of the named controller."""
    anti_resonance: float
    """Anti-resonance of the nominal joint [Hz]."""
    unit: str
    """Name of the unit of costs."""
    unit_size: float
    """Size of the unit of costs [rad or m]."""
    error_scale: float
    """Error scale s of the cost [rad or m]."""
    effort_weight: float
    """Effort weight w of the cost [-]."""
    worst: float
    """Largest possible cost [rad or m]."""
    wall: float
    """Wall time, including the time before an interruption [s]."""

    @property
    def baseline(self) -> GainCandidate:
        """PD control with gains by the textbook rule, or the motor loop alone."""
        return self.candidates[0]

    @property
    def best(self) -> GainCandidate:
        """The tuned controller."""
        return self.candidates[-1]

    def improvement(self, candidate: GainCandidate) -> float:
        """Relative reduction of the mean held-out cost against the baseline [-]."""
        return float(1.0 - candidate.held_out.mean() / self.baseline.held_out.mean())

    def to_json(self) -> dict[str, Any]:
        """The JSON object of ``swgjoint tune``, without files."""
        rows = [
            one.to_json(self.unit, self.unit_size)
            | {"improvement_percent": 100.0 * self.improvement(one)}
            for one in self.candidates
        ]
        training, held_out = self.settings.seeds
        unit, size = self.unit, self.unit_size
        return {
            "best": rows[-1],
            "baseline": rows[0],
            "evaluations": sum(s.evaluations for s in self.searches.values()),
            "improvement_percent": rows[-1]["improvement_percent"],
            "candidates": rows,
            "environment": self.environment,
            "arguments": self.arguments,
            "controller": self.best.controller,
            "optimiser": self.settings.optimiser,
            "seed": self.settings.seed,
            "seeds": {"training": list(training), "held_out": list(held_out)},
            "bounds": {p.key: [p.low, p.high] for p in self.parameters},
            "anti_resonance_Hz": self.anti_resonance,
            "cost": "s sqrt(mean(q + w u)), where the reward is 1/(1 + q) - w u",
            f"error_scale_{unit}": self.error_scale / size,
            "effort_weight": self.effort_weight,
            f"worst_cost_{unit}": self.worst / size,
            "wall_s": self.wall,
        }
