"""Superposed errors against full solves: tolerance_superposition.py FILE.json.

For every seed the output error with manufacturing errors at random positions of the
cycle of the teeth, by full solves, by the superposition of the gaps in the linearised
drive, and to first order in the gaps with the contacts of the perfect drive. Deviations
are in percent of the peak to peak of the full solves and of the superposition over the
whole cycle. Not a test: nothing is asserted, failures are counted.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.fe.tolerances.cycle import MEMBERS, pitches_of, shift_errors
from swgjoint.fe.tolerances.full_solves import full_solves
from swgjoint.fe.tolerances.rest import influences
from swgjoint.files import write_whole
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import tooth_errors
from swgjoint.json_text import json_text

LINE = (
    "seed {seed:2d} {torque_Nm:4.0f} N·m: full {peak_to_peak_full_urad:.1f} of"
    " {peak_to_peak_cycle_urad:.1f} urad; superposed {superposed_percent:.2f} %, first"
    " order {first_order_percent:.1f} %, peak to peak {peak_to_peak_percent:.2f} %"
)


def one_seed(design: Design, count: int, parts: list[float]) -> list[dict[str, Any]]:
    """A row for every torque, given as part of the rated one."""
    begin = time.perf_counter()
    follow, found = influences(design, phases=1)
    state, at = found[0].state, found[0].at
    cycle = pitches_of(design)
    rng = np.random.default_rng(design.tolerances.seed)
    positions = np.sort(rng.choice(cycle, count, replace=False))
    torques = [part * ratings_of(design).rated_torque for part in parts]
    solved = full_solves(design, follow, found, positions, torques)
    solve_s = time.perf_counter() - begin

    def gaps(pitches: np.ndarray) -> np.ndarray:
        layout = design.drive.layout
        shifts = [
            shift_errors(tooth_errors(design, m), pitches, layout) for m in MEMBERS
        ]
        return at.gap_change(*shifts)

    rows = []
    everywhere = gaps(np.arange(cycle))
    none = np.zeros((1, everywhere.shape[1]))
    for torque in torques:
        begin = time.perf_counter()
        over_cycle = at.respond(everywhere, torque).output_angle
        superpose_s = time.perf_counter() - begin
        here = solved.torque == torque
        # positions that were solved, by the number of pitches
        pitch = np.round(solved.input_angle[here] / (2.0 * np.pi / cycle_of(design)))
        full = solved.output_error[here]
        perfect = follow.to_torque(state, torque)
        alone = at.respond(none, torque).output_angle
        offset = follow.output_angle(perfect)
        linear = over_cycle[pitch.astype(int)] - alone
        first = gaps(pitch.astype(int)) @ at.angle_by_gap
        spread = float(np.ptp(full))
        rows.append(
            {
                "seed": design.tolerances.seed,
                "torque_Nm": torque,
                "full_solves": int(here.sum()),
                "failed_full": count - int(here.sum()),
                "failed_superposed": int(np.isnan(over_cycle).sum()),
                "peak_to_peak_full_urad": 1e6 * spread,
                "peak_to_peak_cycle_urad": 1e6 * float(np.nanmax(over_cycle))
                - 1e6 * float(np.nanmin(over_cycle)),
                "superposed_percent": percent(linear - (full - offset), spread),
                "first_order_percent": percent(first - (full - offset), spread),
                "peak_to_peak_percent": 100.0 * abs(np.ptp(linear) / spread - 1.0),
                "full_s": solve_s / solved.torque.size,
                "superposed_s": superpose_s / cycle,
            }
        )
    return rows


def cycle_of(design: Design) -> int:
    """Pitches in a turn of the input."""
    if design.drive.layout == "circular_spline_fixed":
        return design.drive.teeth_circular_spline
    return design.drive.teeth_flexspline


def percent(deviation: np.ndarray, spread: float) -> float:
    """Largest magnitude in percent of a peak to peak."""
    return 100.0 * float(np.abs(deviation).max()) / spread


def main() -> None:
    """Run the study and print its rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--design", default="reference-2d-tolerances")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--positions", type=int, default=8)
    args = parser.parse_args()
    design, rows = Design.load(args.design), []
    for seed in range(1, args.seeds + 1):
        drawn = design.with_changes({"tolerances.seed": seed})
        for row in one_seed(drawn, args.positions, [0.0, 1.0]):
            rows.append(row)
            print(LINE.format(**row), flush=True)
    write_whole(args.file, json_text({"design": args.design, "rows": rows}) + "\n")


if __name__ == "__main__":
    main()
