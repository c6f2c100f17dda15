"""``swgjoint bench``: error against run time."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from swgjoint.cli.shared import bench_fe, bench_joint, bench_scaling
from swgjoint.errors import InputError
from swgjoint.files import output_folder

PARTS = {
    "fe": "finite elements, 2D and 3D, coarse to fine",
    "joint": "levels, integrators and steps of the joint",
    "scaling": "time over joints, batches, harmonics, teeth, nodes, torque, positions",
}
"""In the order in which ``all`` runs them."""
DESIGN = "reference-3d-modified"
OPTIONS = {"design": "fe", "recompute": "fe", "only": "joint"}
"""With the part that they are of."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Part, its options, output folder."""
    listing = "; ".join(f"{name}: {text}" for name, text in PARTS.items())
    parser.add_argument(
        "part",
        nargs="?",
        choices=(*PARTS, "all"),
        default="fe",
        help=f"{listing}; all: one after the other; default %(default)s",
    )
    parser.add_argument(
        "--design",
        metavar="DESIGN",
        help=f"fe: a design with a cup; default {DESIGN}; other designs skip the slow"
        " settings",
    )
    parser.add_argument(
        "--recompute",
        action="store_true",
        help="fe: also solve the finest references (an hour) instead of reading the"
        " stored ones, and write a new file of references to --out",
    )
    parser.add_argument(
        "--only",
        metavar="SCENE,...",
        help="joint: run only these scenes (ur5e, iiwa14, bench); default all",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write tables and pictures there; all: a folder for each part",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the benchmark.

    Returns:
        Of one part: what its function returns (``run_fe_cost``, ``run_joint_cost``).
        Of ``all``: ``rows`` of all parts, ``parts`` with the rest of each, ``files``,
        ``wall_s``.

    Raises:
        InputError: Before any part runs, if an option is not of this part, lacks
            ``--out``, or names no scene.
    """
    _check(args)
    folder = output_folder(args.out) if args.out else None
    if args.part != "all":
        return _run_part(args.part, args, folder)
    begin = time.perf_counter()
    found = {
        name: _run_part(name, args, None if folder is None else folder / name)
        for name in PARTS
    }
    return {
        "rows": [row for one in found.values() for row in one["rows"]],
        "parts": found,
        "files": [path for one in found.values() for path in one["files"]],
        "wall_s": time.perf_counter() - begin,
    }


def _check(args: argparse.Namespace) -> None:
    """Refuse at once what a part would refuse after an hour of others."""
    for option, part in OPTIONS.items():
        given = getattr(args, option) not in (None, False)
        if given and args.part not in (part, "all"):
            raise InputError(
                f"--{option}: not of bench {args.part}; accepted: bench {part} or all"
            )
    if args.recompute and not args.out:
        raise InputError(
            "--recompute: writes the file of the references anew, and there is no"
            " folder for it; accepted: with --out DIR"
        )
    if args.only is not None:
        from swgjoint.bench.joint.cost import check_scenes

        check_scenes(args.only.split(","))


def _run_part(
    name: str, args: argparse.Namespace, folder: Path | None
) -> dict[str, Any]:
    """One part with its options; the folder need not exist."""
    if name == "fe":
        from swgjoint.gear.design.design import Design

        design = Design.load(args.design or DESIGN)
        from swgjoint.bench.fe.cost import run_fe_cost

        return run_fe_cost(
            design=design,
            folder=folder,
            progress=args.progress,
            recompute=args.recompute,
        )
    if name == "joint":
        from swgjoint.bench.joint.cost import run_joint_cost

        only = () if args.only is None else tuple(args.only.split(","))
        return run_joint_cost(only=only, folder=folder, progress=args.progress)
    if name == "scaling":
        from swgjoint.bench.scaling.scaling import run_scaling

        return run_scaling(folder=folder, progress=args.progress)
    raise ValueError(f"part {name!r} has no function")


def report(result: dict[str, Any]) -> str:
    """The tables of the parts."""
    if "parts" not in result:
        return _report_part(result["rows"][0]["bench"], result)
    texts = [_report_part(name, one) for name, one in result["parts"].items()]
    return "\n\n".join([*texts, f"all: {result['wall_s']:.0f} s"])


def _report_part(name: str, result: dict[str, Any]) -> str:
    if name == "fe":
        return bench_fe.report(result)
    if name == "joint":
        return bench_joint.report(result)
    if name == "scaling":
        return bench_scaling.report(result)
    raise ValueError(f"part {name!r} has no report")
