"""``swgjoint bench scaling``: growth of the run time with the size of the problem.

The benchmark measures time steps of chains of driven joints, of batches of arms and of
a joint whose map has more and more harmonics. It also measures evaluations of the map
in Python, positions of the 2D finite-element model over teeth, nodes, torque and
number of positions, and lots of drives with tooth errors. Times are CPU times. An
exponent p is fitted to time ~ size^p. For chains, harmonics and teeth, the fit uses
only the larger sizes, where constant overhead is negligible.
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
    """One varied parameter and the function that measures the run time."""

    name: str
    label: str
    """Label of the size axis."""
    per: str
    """Unit of work to which ``seconds`` of a row refer."""
    sizes: tuple[float, ...]
    """Values of the varied parameter."""
    measure: Callable[[float], dict[str, Any]]
    """Function of the size that returns ``seconds`` and further columns of the row."""
    from_size: float = 0.0
    """Smallest size used for the fit of the exponent."""


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
        per="torque (1000 at once)",
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
        label="torque / rated torque",
        per="position",
        sizes=(0.25, 1, 4),
        measure=scaling_fe.torque,
    ),
    SizeSweep(
        name="angles",
        label="positions of a run",
        per="run",
        sizes=(2, 8, 32),
        measure=scaling_fe.angles,
    ),
    SizeSweep(
        name="lot",
        label="drives of a lot",
        per="lot",
        sizes=(4, 16, 64),
        measure=scaling_fe.lot,
    ),
)


def run_scaling(
    *,
    folder: Path | None = None,
    sweeps: Sequence[SizeSweep] = SWEEPS,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Measure all sweeps.

    Args:
        folder: Folder for table, JSON and picture; None writes nothing.
        sweeps: Sweeps to measure.
        progress: Called after every size.

    Returns:
        ``rows``: ``bench``, ``sweep``, ``model``, ``setting``, ``size``, ``seconds``,
        ``per``, ``wall_s`` of the measurement, ``outcome``, and columns of the sweep;
        ``error``, ``unit`` and ``reference`` exist as in the other benchmarks but are
        None, because nothing is compared. ``fits``: ``sweep``, ``per``, ``exponent``,
        ``coefficient`` [s], ``from_size``, ``spread`` (largest factor between fit and
        measurement), ``seconds_per_unit`` (slope between the smallest and the largest
        fitted size). Also ``provenance``, ``files``, ``wall_s``.
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
    """Fit the exponent of a sweep by least squares in the logarithms.

    Args:
        sweep: Sweep to fit.
        rows: Rows of all sweeps.

    Returns:
        Entry of ``fits``; None if fewer than two sizes can be fitted.
    """
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
