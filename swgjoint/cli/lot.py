"""``swgjoint lot``: accuracy, ripple and yield of a production lot."""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

from swgjoint.cli.shared.common_options import MAX_JOBS, add_jobs
from swgjoint.cli.shared.text import table
from swgjoint.csv_text import csv_text
from swgjoint.errors import InputError
from swgjoint.files import Outputs, output_folder

MAX_DRIVES = 100_000
MAX_CLEARANCE_UM = 2000.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: design, size of the lot, distribution, limits, output."""
    parser.add_argument(
        "design",
        metavar="DESIGN",
        help="design file or bundled name; the design has a [tolerances] table",
    )
    parser.add_argument(
        "--model",
        choices=("2d", "ring"),
        default="2d",
        help="2d: 2D elements on a rigid wave generator (default); ring: thin rings on"
        " the bearing of the wave generator, with lost motion and K1",
    )
    parser.add_argument(
        "--clearance-um",
        type=float,
        nargs=2,
        metavar=("LOW", "HIGH"),
        help="with --model ring: draw the bearing clearance uniformly between these"
        " limits; default: the clearance of the design",
    )
    parser.add_argument(
        "--drives",
        type=int,
        default=500,
        metavar="N",
        help="number of drives in the lot; default: %(default)s",
    )
    parser.add_argument(
        "--sizes",
        choices=("limit", "uniform"),
        default="limit",
        help="magnitude of the errors: limit: equal to the tolerances (worst case,"
        " default); uniform: uniformly distributed between zero and the tolerances",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=1,
        help="random seed of the first drive; default: %(default)s",
    )
    parser.add_argument(
        "--spec",
        metavar="FILE",
        help="TOML file with a [spec] table of limits for the yield; keys:"
        " transmission_accuracy_arcmin, ripple_rms_percent, torsional_stiffness_Nm_rad;"
        " with --model ring: transmission_accuracy_arcmin, lost_motion_arcmin,"
        " K1_Nm_rad",
    )
    add_jobs(parser)
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write lot.json, lot.csv and lot.png to this folder",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Draw the errors of the drives at random and evaluate the lot.

    Returns:
        The result of :func:`swgjoint.explore.lot.run_lot` or
        :func:`swgjoint.explore.bearing_lot.run_bearing_lot`, and ``files``.

    Raises:
        InputError: If a number is out of range.
    """
    for name, value, most in (
        ("drives", args.drives, MAX_DRIVES),
        ("jobs", args.jobs, MAX_JOBS),
        ("seed", args.seed, 2**31 - 1 - max(args.drives, 0)),
    ):
        if not 1 <= value <= most:
            raise InputError(f"--{name} {value}; accepted: 1 to {most}")
    limits = args.clearance_um
    if limits is not None and (args.model != "ring" or not _accepts(limits)):
        raise InputError(
            f"--clearance-um {limits[0]:g} {limits[1]:g}; accepted: with --model ring,"
            f" two increasing values from 0 to {MAX_CLEARANCE_UM:g}"
        )
    folder = output_folder(args.out) if args.out else None
    from swgjoint.explore.bearing_lot import FIGURES as RING_FIGURES
    from swgjoint.explore.bearing_lot import run_bearing_lot
    from swgjoint.explore.compare.limits import read_spec
    from swgjoint.explore.lot import FIGURES, LOWER, run_lot
    from swgjoint.gear.design.design import Design
    from swgjoint.view.plots.lot import lot_picture

    ring = args.model == "ring"
    figures = RING_FIGURES if ring else FIGURES
    spec = read_spec(args.spec, figures) if args.spec else None
    solve = run_lot
    if ring:
        between = None if limits is None else (limits[0], limits[1])
        solve = partial(run_bearing_lot, clearance_um=between)
    result = solve(
        Design.load(args.design),
        count=args.drives,
        seed=args.seed,
        sizes=args.sizes,
        spec=spec,
        jobs=args.jobs,
        progress=args.progress,
    )
    result = {**result, "files": []}
    if folder is not None:
        outputs = Outputs(folder)
        outputs.write("lot.csv", lambda: csv_text(result["rows"]))
        outputs.write("lot.png", lambda: lot_picture(result, lower=LOWER))
        outputs.write_json("lot.json", result)
    return result


def _accepts(limits: list[float]) -> bool:
    """Whether two limits of the bearing clearance can be used."""
    return 0.0 <= limits[0] <= limits[1] <= MAX_CLEARANCE_UM


def report(result: dict[str, Any]) -> str:
    """Format percentiles, mean and deviation of every figure, then the yield."""
    columns = ("p1", "p5", "p50", "p95", "p99", "mean", "std")
    rows = [
        [key, *(figure[column] for column in columns)]
        for key, figure in result["figures"].items()
        if figure is not None
    ]
    count = len(result["rows"])
    lines = [table(rows, header=("", *columns)), ""] if rows else []
    if result["failed"]:
        lines.append(
            f"no equilibrium was found for {result['failed']} of {count} drives"
        )
    off = result["validity"]["superposition_error"]
    error = (
        "an unknown amount"
        if off is None
        else f"{100.0 * off:.1f} % of the peak-to-peak value"
    )
    lines.append(
        f"superposition of errors: the first drive differs by {error} from full solves"
    )
    lines += _conditions(result)
    if result["yield"] is not None:
        yields = result["yield"]
        lines.append(
            f"yield: {_share(yields)} of {count} drives, errors: {result['sizes']}"
        )
        lines += [
            f"  limit {key} = {result['spec'][key]:g} alone: {_share(one)}"
            for key, one in yields["by_limit"].items()
        ]
    lines += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*lines, f"{result['wall_s']:.0f} s"])


def _conditions(result: dict[str, Any]) -> list[str]:
    """State under which conditions the figures apply, and what the model leaves out."""
    from swgjoint.maps.sheet.sampled_accuracy import MIDDLE, SPREAD

    validity = result["validity"]
    lines = [
        "transmission accuracy: peak to peak of the kinematic error over one output"
        f" turn, without torque, estimated from some of its angles: {MIDDLE:g} times"
        f" that of all angles in trials, with a standard deviation of {SPREAD:g}"
    ]
    if "ripple_rms_percent" in result["figures"]:
        lines.append(
            f"ripple and stiffness: at the rated torque of {validity['torque_Nm']:g}"
            " N·m; ripple of the output torque in % of it, with both shafts turning at"
            " a constant ratio: in an arm the output gives way, and swgjoint run"
            " computes the ripple that is left"
        )
    if validity["left_out"]:
        lines.append(f"level {validity['level']}, without {validity['left_out']}")
    return lines


def _share(yields: dict[str, Any]) -> str:
    """A yield with its 95 % confidence interval, as text."""
    low, high = 100.0 * yields["low"], 100.0 * yields["high"]
    return f"{100.0 * yields['part']:.1f} % ({low:.1f} to {high:.1f} %)"
