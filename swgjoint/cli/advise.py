"""``swgjoint advise``: cheapest level, integrator and step within an error bound."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.shared.arm_arguments import add_arm_arguments, add_overrides, scene_of
from swgjoint.cli.shared.text import table


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: scene, error bound, changes of the scene."""
    parser.add_argument(
        "scene", metavar="SCENE", help="scene or arm: a file or a bundled name"
    )
    parser.add_argument(
        "--error",
        required=True,
        metavar="VALUE",
        help="largest accepted rms error, with unit: of the link angle of the worst"
        " joint (0.1arcmin, 5arcsec, 2e-5rad) or of the tool position (0.05mm)",
    )
    add_overrides(parser)
    add_arm_arguments(parser)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Find the cheapest setting.

    Returns:
        See :func:`swgjoint.explore.advise.advise.advise`.
    """
    from swgjoint.explore.advise.advise import advise
    from swgjoint.explore.advise.bound import parse_bound

    bound = parse_bound(args.error)
    scene, _, _ = scene_of(args, args.overrides)
    return advise(scene, bound, progress=args.progress)


def report(result: dict[str, Any]) -> str:
    """Format the recommended setting, then all settings that were tried."""
    parts = result["sub_steps"]
    cut = "" if parts == 1 else f" divided into {parts} sub-steps"
    error = f"{result['expected_error']:.3g} {result['unit']}"
    reference = result["reference"]
    rows = [
        (
            row["level"],
            row["integrator"],
            f"{1e3 * row['step_s']:g}",
            row["outcome"],
            row["cost"],
            row["link_angle_arcmin"],
            row["tool_position_mm"],
        )
        for row in result["rows"]
    ]
    header = (
        "level",
        "integrator",
        "step [ms]",
        "outcome",
        "cost",
        "link [arcmin]",
        "tool [mm]",
    )
    return "\n".join(
        [
            f"{result['scene']} within {result['bound']}: level {result['level']},"
            f" {result['integrator']} at {1e3 * result['step_s']:g} ms{cut}",
            f"error {error} rms, cost {result['cost']:.3g} times that of the rigid arm"
            " at 1 ms",
            "",
            table(rows, header=header),
            "",
            "errors: rms difference from the reference: level full with steps of"
            f" {1e3 * reference['step_s']:g} ms and less, extrapolated to zero step;"
            f" uncertainty {reference['error']:.2g} {result['unit']}",
            f"{result['wall_s']:.0f} s",
        ]
    )
