"""``swgjoint bench scaling``: how time grows with the size of what is computed.

Steps of a chain of driven joints, of batches, and of a joint whose map has ever more
harmonics; evaluations of the map in Python; positions of the plane finite elements over
teeth, nodes, torque and their number. Time is that of one core's process; an exponent p
is fitted to time ~ size^p, and of the chain and the harmonics to the end of the sweep,
where what does not grow no longer counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.bench.scaling import fe as scaling_fe
from swgjoint.bench.scaling import joint as scaling_joint
from swgjoint.csv_text import csv_text
from swgjoint.errors import ComputationError
from swgjoint.files import Outputs
from swgjoint.json_text import json_text
from swgjoint.progress import Progress, silent
from swgjoint.provenance import provenance
from swgjoint.view.plots.scaling import scaling_picture


@dataclass(frozen=True, kw_only=True)
class SizeSweep:
    """One parameter, and what takes time with it."""

    name: str
    label: str
    """Label of the axis."""
    per: str
    """What ``seconds`` of a row are per."""
    sizes: tuple[float, ...]
    measure: Callable[[float], dict[str, Any]]
    """By size: ``seconds`` and more columns of the row."""
    from_size: float = 0.0
    """From which on the exponent is fitted."""


SWEEPS = (
    SizeSweep(
        name="joints",
        label="driven joints of a chain",
        per="step",
        sizes=(1, 2, 4, 8, 15, 30, 60),
        measure=scaling_joint.chain,
        from_size=8,
    ),
    SizeSweep(
        name="batch",
        label="arms of a batch",
        per="batch step",
        sizes=(1, 4, 16, 64, 256, 1024),
        measure=scaling_joint.batch,
    ),
    SizeSweep(
        name="harmonics",
        label="harmonics of the map",
        per="joint step",
        sizes=(1, 4, 16, 64, 256),
        measure=scaling_joint.step_with_harmonics,
        from_size=16,
    ),
    SizeSweep(
        name="map evaluation",
        label="harmonics of the map",
        per="evaluation of 1,000",
        sizes=(1, 4, 16, 64, 256),
        measure=scaling_joint.evaluation,
        from_size=16,
    ),
    SizeSweep(
        name="teeth",
        label="teeth of the flexspline",
        per="position",
        sizes=(60, 120, 240, 400),
        measure=scaling_fe.teeth,
        from_size=120,
    ),
    SizeSweep(
        name="nodes",
        label="nodes of the half model",
        per="position",
        sizes=(0.5, 1, 2, 3),
        measure=scaling_fe.mesh,
    ),
    SizeSweep(
        name="torque",
        label="torque over the rated one",
        per="position",
        sizes=(0.25, 1, 4),
        measure=scaling_fe.torque,
    ),
    SizeSweep(
        name="angles",
        label="positions of a turn",
        per="turn",
        sizes=(2, 8, 32),
        measure=scaling_fe.angles,
    ),
)


def run_scaling(
    *,
    folder: Path | None = None,
    sweeps: Sequence[SizeSweep] = SWEEPS,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Measure all sweeps.

    Returns:
        ``rows``: ``bench``, ``sweep``, ``model``, ``setting``, ``size``, ``seconds``,
        ``per``, ``wall_s`` of the measurement, ``outcome``; ``error``, ``unit`` and
        ``reference`` as in the other parts, null: nothing is compared here. ``fits``:
        ``sweep``, ``exponent``, ``coefficient``, ``from_size``, ``spread``, the largest
        factor between fit and measurement, ``seconds_per_unit`` between the smallest
        and the largest size. ``provenance``, ``files``, ``wall_s``.
    """
    begin = time.perf_counter()
    rows: list[dict[str, Any]] = []
    total = sum(len(sweep.sizes) for sweep in sweeps)
    progress("sizes", 0, total)
    for sweep in sweeps:
        for size in sweep.sizes:
            start = time.perf_counter()
            row = {
                "bench": "scaling",
                "sweep": sweep.name,
                "model": "",
                "setting": f"{sweep.name} {size:g}",
                "size": float(size),
                "seconds": None,
                "per": sweep.per,
                "error": None,
                "unit": None,
                "reference": None,
            }
            try:
                row |= {"outcome": "ok"} | sweep.measure(size)
            except ComputationError as failure:
                row["outcome"] = str(failure)
            rows.append(row | {"wall_s": time.perf_counter() - start})
            progress("sizes", len(rows), total)
    result: dict[str, Any] = {
        "rows": rows,
        "fits": [
            fit for sweep in sweeps if (fit := fit_exponent(sweep, rows)) is not None
        ],
        "provenance": provenance(),
    }
    files: list[str] = []
    if folder is not None:
        outputs, labels = Outputs(folder), {sweep.name: sweep.label for sweep in sweeps}
        outputs.write("bench-scaling.json", lambda: json_text(result) + "\n")
        outputs.write("bench-scaling.csv", lambda: csv_text(rows))
        outputs.write("bench-scaling.png", lambda: scaling_picture(result, labels))
        files = outputs.files
    return result | {"files": files, "wall_s": time.perf_counter() - begin}


def fit_exponent(
    sweep: SizeSweep, rows: Sequence[dict[str, Any]]
) -> dict[str, Any] | None:
    """Least squares of the logarithms; None with fewer than two sizes."""
    used = [r for r in rows if r["sweep"] == sweep.name and r["seconds"]]
    used = [r for r in used if r["size"] >= sweep.from_size]
    if len(used) < 2:
        return None
    x, y = (np.log([row[key] for row in used]) for key in ("size", "seconds"))
    p, c = np.polyfit(x, y, 1)
    return {
        "sweep": sweep.name,
        "per": sweep.per,
        "exponent": float(p),
        "coefficient": float(np.exp(c)),
        "from_size": float(np.exp(x.min())),
        "seconds_per_unit": float(np.ptp(np.exp(y[[0, -1]])) / np.ptp(np.exp(x))),
        "spread": float(np.exp(np.abs(y - p * x - c).max())),
    }
