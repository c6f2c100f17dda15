"""``swgjoint bench``: error against run time."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from swgjoint.cli.bench import fe_text, joint_text, scaling_text
from swgjoint.errors import InputError
from swgjoint.files import output_folder

PARTS = {
    "fe": "2D and 3D finite-element models with coarse to fine meshes",
    "joint": "model levels, integrators and time steps of the joint",
    "scaling": "run time against number of joints, batch size, harmonics, teeth, nodes,"
    " torque and positions",
}
"""Parts of the benchmark, in the order in which ``all`` runs them."""
DESIGN = "reference-3d-modified"
"""Default design of part ``fe``."""
OPTIONS = {"design": "fe", "only": "joint"}
"""Part to which each option belongs."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: part, options of the parts, output folder."""
    listing = "; ".join(f"{name}: {text}" for name, text in PARTS.items())
    parser.add_argument(
        "part",
        nargs="?",
        choices=(*PARTS, "all"),
        default="fe",
        help=f"{listing}; all: all parts in turn; default: %(default)s",
    )
    parser.add_argument(
        "--design",
        metavar="DESIGN",
        help=f"fe: design with a cup; default: {DESIGN}",
    )
    parser.add_argument(
        "--only",
        metavar="SCENE,...",
        help="joint: run only these scenes (ur5e, iiwa14, bench); default: all",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write tables and plots to this folder; all: one subfolder per part",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the benchmark.

    Returns:
        For one part, the result of its function (``run_fe_cost``, ``run_joint_cost``,
        ``run_scaling``). For ``all``: ``rows`` of all parts, ``parts`` with the result
        of each part, ``files``, ``wall_s``.

    Raises:
        InputError: Before any part runs, if an option does not belong to the part, or
            ``--only`` names an unknown scene.
    """
    _check(args)
    folder = output_folder(args.out) if args.out else None
    if args.part != "all":
        return _run_part(args.part, args, folder)
    begin = time.perf_counter()
    results = {
        name: _run_part(name, args, None if folder is None else folder / name)
        for name in PARTS
    }
    return {
        "rows": [row for one in results.values() for row in one["rows"]],
        "parts": results,
        "files": [path for one in results.values() for path in one["files"]],
        "wall_s": time.perf_counter() - begin,
    }


def _check(args: argparse.Namespace) -> None:
    """Reject bad options before the first part runs, not after minutes of work."""
    for option, part in OPTIONS.items():
        if getattr(args, option) is not None and args.part not in (part, "all"):
            raise InputError(
                f"--{option} does not apply to bench {args.part}; accepted with bench"
                f" {part} or bench all"
            )
    if args.only is not None:
        from swgjoint.bench.joint.cost import check_scenes

        check_scenes(args.only.split(","))


def _run_part(
    name: str, args: argparse.Namespace, folder: Path | None
) -> dict[str, Any]:
    """Run one part with its options; the folder need not exist."""
    if name == "fe":
        from swgjoint.gear.design.design import Design

        design = Design.load(args.design or DESIGN)
        from swgjoint.bench.fe.cost import run_fe_cost

        return run_fe_cost(design=design, folder=folder, progress=args.progress)
    if name == "joint":
        from swgjoint.bench.joint.cost import run_joint_cost

        only = () if args.only is None else tuple(args.only.split(","))
        return run_joint_cost(only=only, folder=folder, progress=args.progress)
    if name == "scaling":
        from swgjoint.bench.scaling.scaling import run_scaling

        return run_scaling(folder=folder, progress=args.progress)
    raise ValueError(f"part {name!r} has no function")


def report(result: dict[str, Any]) -> str:
    """Format the tables of all parts."""
    if "parts" not in result:
        return _report_part(result["rows"][0]["bench"], result)
    texts = [_report_part(name, one) for name, one in result["parts"].items()]
    return "\n\n".join([*texts, f"all: {result['wall_s']:.0f} s"])


def _report_part(name: str, result: dict[str, Any]) -> str:
    if name == "fe":
        return fe_text.report(result)
    if name == "joint":
        return joint_text.report(result)
    if name == "scaling":
        return scaling_text.report(result)
    raise ValueError(f"part {name!r} has no report")
