"""The reference of ``swgjoint advise``: level ``full`` extrapolated to step zero."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.explore.advise.bound import ErrorBound
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.accuracy import Setting, attempt, common_samples, errors
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene

REFERENCE_STEPS = tuple(1e-3 / 2**k for k in range(1, 7))
"""Steps of the reference, used in this order until it converges [s]."""
SETTLED, TRUSTED = 0.02, 0.2
"""Disagreement of two extrapolations, over the bound: below the first value the
reference has converged, above the second one the scene has no reference."""


@dataclass(frozen=True, kw_only=True)
class FullReference:
    """Level ``full`` without time-discretisation error."""

    run: Run
    step: float
    """Smallest step that was used for the extrapolation [s]."""
    error: float
    """Difference from the extrapolation from twice that step, in the unit of the
    bound."""


def settle(
    scene: Scene,
    bound: ErrorBound,
    drives: Mapping[str, DriveMap],
    progress: Progress = silent,
) -> FullReference:
    """Compute the reference: halve the step until two extrapolations agree.

    The scheme is of first order in the link angle, because the positions of the engine
    lead by half a step; the extrapolation is 2 x(h) - x(2h). A shorter step also
    resolves more harmonics, about which the two extrapolations then disagree.

    Args:
        scene: The scene.
        bound: Error for which the reference is computed.
        drives: Maps by drive reference.
        progress: Called after every run.

    Raises:
        ComputationError: If the disagreement stays above :data:`TRUSTED` times the
            bound.
    """
    last: Run | None = None
    best: Run | None = None
    apart, step = np.inf, 0.0
    reason: str | None = "fewer than three steps in a row run"
    stage = f"{scene.name}: reference"
    for k, h in enumerate(REFERENCE_STEPS):
        progress(stage, k, len(REFERENCE_STEPS))
        got = attempt(
            scene, Setting(level="full", integrator="discrete", step=h), drives
        )
        if got.run is None:
            # what disagreed before is no word on the steps that follow
            last, best, apart, step = None, None, np.inf, 0.0
            reason = got.reason
            continue
        if last is not None:
            finer = _extrapolated(got.run, last)
            if best is not None:
                apart, step = errors(finer, best)[bound.quantity], h
            best = finer
        last = got.run
        if apart <= SETTLED * bound.value:
            break
    progress(stage, len(REFERENCE_STEPS), len(REFERENCE_STEPS))
    if best is None or not np.isfinite(apart):
        raise ComputationError(f"{scene.where}: level full has no reference: {reason}")
    if apart > TRUSTED * bound.value:
        raise ComputationError(
            f"{scene.where}: the reference does not settle within {bound.text}: at"
            f" steps down to {1e3 * step:g} ms it still moves by {apart:.3g}"
            f" {bound.unit}; use a larger --error"
        )
    return FullReference(run=best, step=step, error=float(apart))


def _extrapolated(fine: Run, coarse: Run) -> Run:
    """Twice the finer run minus the coarser one, at the samples of the coarser one."""
    own, theirs = common_samples(fine, coarse)
    names = ("position", "torsion", "output_torque", "tool_position")
    return replace(
        coarse,
        **{
            name: 2.0 * getattr(fine, name)[own] - getattr(coarse, name)[theirs]
            for name in names
        },
    )
