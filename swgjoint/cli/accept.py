"""``swgjoint accept``: acceptance tests of one drive, simulated or measured."""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.common_options import add_drive, add_model
from swgjoint.cli.shared.limits import add_limits, limits_of
from swgjoint.cli.shared.text import table
from swgjoint.files import Outputs, output_folder

if TYPE_CHECKING:
    from swgjoint.explore.accept.accept import Acceptance


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: drive, fidelity, tests, limits, measured logs, output."""
    add_drive(parser)
    add_model(parser, "a design")
    parser.add_argument(
        "--only",
        metavar="TEST,...",
        action="append",
        default=[],
        help="run only these tests, such as stiffness,resonance; repeatable; default:"
        " all bundled scenes acceptance-TEST",
    )
    add_limits(parser, "lost_motion_arcmin=0.8")
    parser.add_argument(
        "--measured",
        metavar="DIR",
        help="judge measured logs TEST.csv of this folder instead of the simulation;"
        " columns time_s, motor_angle_deg, link_angle_deg, output_torque_Nm and"
        " motor_torque_Nm, as for identify",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write accept.json, accept.png, report.html and the simulated logs as CSV"
        " files to this folder",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the tests.

    Returns:
        ``drive``, ``measured`` (folder, or null), ``rows``, ``missed`` (rows whose
        limit is missed), ``invalid`` (reasons by test), ``passed``, ``files`` and
        ``wall_s``.
    """
    folder, begin = output_folder(args.out) if args.out else None, time.perf_counter()
    from swgjoint.explore.accept.accept import accept
    from swgjoint.explore.accept.figures import LIMITED

    accepted = accept(
        args.drive,
        model=args.model,
        spec=limits_of(args, LIMITED),
        measured=args.measured,
        only=[key.strip() for text in args.only for key in text.split(",")],
        progress=args.progress,
    )
    result: dict[str, Any] = {
        "drive": args.drive,
        "measured": args.measured,
        **accepted.to_json(),
        "files": [],
        "wall_s": time.perf_counter() - begin,
    }
    if folder is not None:
        _write(folder, result, accepted)
    return result


def _write(folder: Path, result: dict[str, Any], accepted: Acceptance) -> None:
    """Write the simulated logs, the picture, the report and the JSON file."""
    from swgjoint.explore.accept.accept import log_csv
    from swgjoint.sim.scene.text import scene_toml
    from swgjoint.view.acceptance import acceptance_picture, acceptance_table
    from swgjoint.view.report.report import write_tables

    outputs, pictures = Outputs(folder), {}

    def picture() -> bytes:
        drawn = acceptance_picture(accepted, result["drive"])
        pictures["Figures and their limits"] = drawn
        return drawn

    for test, log in accepted.logs["simulated"].items():
        outputs.write(f"{test}.csv", partial(log_csv, log))
    outputs.write("accept.png", picture)
    outputs.hand_over(
        "report.html",
        lambda path: write_tables(
            path,
            title=f"Acceptance of {result['drive']}",
            description=_verdict(result),
            tables=[acceptance_table(accepted)],
            pictures=pictures,
            settings={name: scene_toml(one) for name, one in accepted.scenes.items()},
        ),
    )
    outputs.write_json("accept.json", result)


def _verdict(result: dict[str, Any]) -> str:
    """The verdict, and how many limits it leaves open because a value is missing."""
    rows = result["rows"]
    open_limits = sum(
        row["limit"] is not None and row["passed"] is None for row in rows
    )
    text = "passed" if result["passed"] else "not passed"
    if open_limits:
        text += f"; limits not judged because their figure has no value: {open_limits}"
    return text


def status(result: dict[str, Any]) -> int:
    """Return 1 if a limit is missed or a run is not valid, else 0."""
    return int(not result["passed"])


def report(result: dict[str, Any]) -> str:
    """Format one line per figure, then every missed limit and missing value."""
    from swgjoint.view.acceptance import HEADER, cells

    both = result["measured"] is not None
    rows = [cells(row, both=both) for row in result["rows"]]
    judged = "measured" if both else "simulated"
    lines = [
        f"acceptance of {result['drive']}, limits of the {judged} values",
        table(rows, header=[name for name in HEADER if both or name != "measured"]),
    ]
    reasons: dict[str, list[str]] = {}
    for row in result["rows"]:
        if row["reason"]:
            reasons.setdefault(row["reason"], []).append(row["figure"])
    lines += [
        f"- {', '.join(dict.fromkeys(figures))}: {reason}"
        for reason, figures in reasons.items()
    ]
    for test, whys in result["invalid"].items():
        lines += [f"{test}: NOT VALID: {why}" for why in whys]
    for row in result["missed"]:
        value, at = row[judged], f" at {row['condition']}" if row["condition"] else ""
        shown = "has no value" if value is None else f"= {value:.4g}"
        lines.append(
            f"MISSED: {row['test']}: {row['figure']}{at} {shown}; limit"
            f" {row['limit']:g}"
        )
    lines.append(_verdict(result))
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])
