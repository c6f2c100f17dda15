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
"""Time steps of the reference, used in this order until it converges [s]."""
SETTLED, TRUSTED = 0.02, 0.2
"""Difference of two successive extrapolations, divided by the bound [-]. Up to the
first value the reference has converged; above the second value it is rejected."""


@dataclass(frozen=True, kw_only=True)
class FullReference:
    """Level ``full`` without time-discretisation error."""

    run: Run
    """Extrapolated signals at the samples of the longer of the two last steps."""
    step: float
    """Shortest time step used for the extrapolation [s]."""
    error: float
    """Difference from the previous extrapolation, whose steps are twice as long, in the
    unit of the bound."""


def settle(
    scene: Scene,
    bound: ErrorBound,
    drives: Mapping[str, DriveMap],
    progress: Progress = silent,
) -> FullReference:
    """Compute the reference: halve the step until two extrapolations agree.

    The link angle converges with first order, because the positions of the engine lead
    by half a step; the extrapolation is therefore 2 x(h) - x(2h). A shorter step may
    also resolve harmonics that a longer one leaves out; successive extrapolations then
    differ by these harmonics.

    Args:
        scene: The scene.
        bound: Error for which the reference is computed.
        drives: Maps by drive reference.
        progress: Called after every run.

    Raises:
        ComputationError: If fewer than three successive steps run, or if the
            difference of the last two extrapolations exceeds :data:`TRUSTED` times the
            bound.
    """
    last: Run | None = None
    best: Run | None = None
    apart, step = np.inf, 0.0
    reason: str | None = "fewer than three successive steps were run"
    stage = f"{scene.name}: reference"
    for k, h in enumerate(REFERENCE_STEPS):
        progress(stage, k, len(REFERENCE_STEPS))
        got = attempt(
            scene, Setting(level="full", integrator="discrete", step=h), drives
        )
        if got.run is None:
            # agreement before a failed step says nothing about the steps after it
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
            f"{scene.where}: the reference does not converge within {bound.text}: at a"
            f" step of {1e3 * step:g} ms it still changes by {apart:.3g}"
            f" {bound.unit}; use a larger --error"
        )
    return FullReference(run=best, step=step, error=float(apart))


def _extrapolated(fine: Run, coarse: Run) -> Run:
    """Twice the finer run minus the coarser run, at the samples of the coarser run."""
    own, theirs = common_samples(fine, coarse)
    names = ("position", "torsion", "output_torque", "tool_position")
    return replace(
        coarse,
        **{
            name: 2.0 * getattr(fine, name)[own] - getattr(coarse, name)[theirs]
            for name in names
        },
    )
