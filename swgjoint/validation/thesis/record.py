"""Record of one meshing simulation: the values that the thesis study stores."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from swgjoint.code_hash import code_hash
from swgjoint.errors import ComputationError, DesignError
from swgjoint.gear.design.design import Design
from swgjoint.maps.cache import key_of, recall
from swgjoint.units import MPa
from swgjoint.validation.thesis.cases import KINDS

NUMBER = float | None


@dataclass(frozen=True, kw_only=True)
class RunSpec:
    """Inputs of a meshing simulation."""

    design: Design
    torque: float
    """Output torque [N·m]."""
    positions: int
    """Number of wave-generator positions."""
    turn: float
    """Input rotation over which the positions are distributed [turns]."""
    model: str = "2d"
    """``2d`` or ``3d``."""

    @property
    def parts(self) -> dict[str, Any]:
        """Parts of the cache key: inputs, and the code that determines a record."""
        return {
            "study": _own_version(),
            "design": self.design.content_hash(),
            "torque": self.torque,
            "positions": self.positions,
            "turn": self.turn,
            "model": self.model,
        }

    @property
    def name(self) -> str:
        """Cache key: hash of the parts and of the code that computes maps."""
        return key_of(self.parts)

    @property
    def work(self) -> float:
        """Estimated relative work, positions times nodes; long runs start first."""
        fine = float(self.design.mesh.refinement)
        work = fine**2 if self.model == "2d" else 30.0 * fine**3
        return self.positions * work


@lru_cache
def _own_version() -> str:
    """Hash of the code in this package that determines a record."""
    here = "validation/thesis"
    return code_hash(f"{here}/record.py", f"{here}/stress_places.py")


@dataclass(frozen=True, kw_only=True)
class RunRecord:
    """Outcome of a run, and stresses of the flexspline by kind [MPa].

    A stress is None if it was not computed.
    """

    outcome: str
    """``converged``, the outcome of the first failed position, ``failed`` if the set-up
    was not solved, or ``refused`` for an invalid design."""
    message: str | None = None
    """Message of the first failure; None if there was none."""
    failed_positions: int = 0
    """Number of positions that were not solved."""
    wall_s: float = 0.0
    """Wall time of the run [s]."""
    average: Mapping[str, NUMBER] = field(default_factory=dict)
    """Largest nodal stress, averaged over the solved positions."""
    away: Mapping[str, NUMBER] = field(default_factory=dict)
    """``average`` without the nodes next to loaded tooth contacts; None in 3D."""
    last: Mapping[str, NUMBER] = field(default_factory=dict)
    """Largest nodal stress at the last position."""
    places: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    """Number of positions with the largest stress at each place, by kind; in 3D only
    for the von Mises stress, with the part of the flexspline as place."""
    setup: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Largest stresses by state of the set-up, then by kind."""
    per_position: Mapping[str, list[NUMBER]] = field(default_factory=dict)
    """Largest nodal stress at each position, by kind."""
    angle_deg: list[float] = field(default_factory=list)
    """Input angle at each position [deg]."""
    pairs_in_contact: list[int | None] = field(default_factory=list)
    """Number of tooth pairs in contact at each position."""

    @property
    def ok(self) -> bool:
        """Whether every position was solved."""
        return self.outcome == "converged"


def record_run(spec: RunSpec) -> RunRecord:
    """Record of a run, read from the cache or computed and stored there."""
    return recall("studies", spec.parts, RunRecord, lambda: compute(spec))


def compute(spec: RunSpec) -> RunRecord:
    """Simulate meshing; a failure is part of the record, not an error."""
    from swgjoint.fe.meshing import simulate_meshing

    begin = time.perf_counter()
    try:
        run = simulate_meshing(
            spec.design,
            model=spec.model,
            torque=spec.torque,
            steps=spec.positions,
            turn=spec.turn,
            half="auto",
            throw=False,
        )
    except (ComputationError, DesignError) as error:
        outcome = "refused" if isinstance(error, DesignError) else "failed"
        wall = time.perf_counter() - begin
        return RunRecord(outcome=outcome, message=str(error), wall_s=wall)
    return _record(run, spec.model, begin)


_Largest = tuple[dict[str, float], dict[str, float], dict[str, str]]
"""Three mappings by kind of stress: largest stress over all nodes [Pa], largest stress
away from tooth contacts [Pa], and place of the former."""


def _plane(run: Any) -> list[_Largest | None]:
    """Largest stresses of the 2D model at each position; None if not solved."""
    from swgjoint.validation.thesis.stress_places import StressPlaces

    places = StressPlaces(model=run.model)
    return [
        None if step.state is None else places.largest(step.state) for step in run.steps
    ]


def _solid(run: Any) -> list[_Largest | None]:
    """Largest stresses of the 3D model at each position; None if not solved.

    Stresses away from tooth contacts are missing, because the 3D model does not mark
    the nodes next to contacts.
    """
    rows: list[_Largest | None] = []
    for step in run.steps:
        if step.stress is None:
            rows.append(None)
            continue
        largest = step.stress.flexspline
        values: dict[str, float] = {kind: getattr(largest, kind) for kind in KINDS}
        rows.append((values, {}, {"von_mises": step.stress.place.part}))
    return rows


def _record(run: Any, model: str, begin: float) -> RunRecord:
    rows = _plane(run) if model == "2d" else _solid(run)
    solved = [row for row in rows if row is not None]

    def mean(which: int, kind: str) -> NUMBER:
        values: list[float] = [
            row[which][kind]  # type: ignore[misc]
            for row in solved
            if kind in row[which]
        ]
        return float(np.mean(values)) / MPa if values else None

    bad = [step for step in run.steps if not step.outcome.ok]
    last = rows[-1]
    return RunRecord(
        outcome=run.outcome.name.lower(),
        message=bad[0].outcome.value if bad else None,
        failed_positions=len(bad),
        average={kind: mean(0, kind) for kind in KINDS},
        away={kind: mean(1, kind) for kind in KINDS},
        last={kind: None if last is None else last[0][kind] / MPa for kind in KINDS},
        places={
            kind: dict(Counter(row[2][kind] for row in solved if kind in row[2]))
            for kind in KINDS
        },
        setup={state.name: state.stress.flexspline.to_json() for state in run.setup},
        per_position={
            kind: [None if row is None else row[0][kind] / MPa for row in rows]
            for kind in KINDS
        },
        angle_deg=[float(np.rad2deg(step.input_angle)) for step in run.steps],
        pairs_in_contact=[step.pairs_in_contact for step in run.steps],
        wall_s=time.perf_counter() - begin,
    )
