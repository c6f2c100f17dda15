"""``swgjoint compare``: compare drives or model levels in one scene."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from swgjoint.cli.shared.arm_arguments import add_overrides
from swgjoint.cli.shared.common_options import add_model
from swgjoint.cli.shared.limits import add_limits, limits_of
from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError
from swgjoint.files import Outputs, output_folder

_ERROR_RIPPLE = "transmission_error_ripple_arcmin"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: drives or levels, scene, sorting, limits, output folder."""
    parser.add_argument(
        "arguments",
        metavar="DRIVE|LEVEL",
        nargs="+",
        help="drives (designs, .swg maps, catalogue names) or model levels such as"
        " full",
    )
    parser.add_argument(
        "--scene",
        metavar="SCENE|ARM",
        default="bench",
        help="scene file, MJCF or URDF file of an arm, or bundled name; an arm is moved"
        " through a slow sweep and gets default drives in the joints that are not"
        " compared; default: bench",
    )
    parser.add_argument(
        "--joints",
        "--joint",
        metavar="PATTERN,...",
        action="append",
        default=[],
        help="compare drives only in these joints, such as shoulder_lift or"
        " 'wrist_*'; the other joints keep the drives of the scene; repeatable",
    )
    add_overrides(parser)
    add_model(parser, "designs")
    parser.add_argument(
        "--sort", metavar="KEY", help="sort by this quantity, best first"
    )
    add_limits(parser, "tool_path_rms_mm=0.2")
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write compare.json, compare.png, report.html and run.rrd (a recording of"
        " all runs) to this folder",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the scene for every argument.

    Returns:
        ``scene``, ``joints`` (names of the compared joints; null for all), ``rows``,
        ``spec``, ``passed`` and ``kept_by`` (arguments that meet every limit), both
        null without limits, ``columns``, ``assumed_rotors`` (joints in which the
        rotor inertia assumed for a drive comes with it; the others keep that of the
        scene), ``notes``, ``files``.

    Raises:
        InputError: If ``--sort`` names an unknown quantity.
    """
    folder = output_folder(args.out) if args.out else None
    from swgjoint.explore.compare.compare import SLOW, compare
    from swgjoint.explore.compare.limits import SORTABLE, require_cycle
    from swgjoint.explore.compare.scene import joints_named, resolve_step, scene_or_arm
    from swgjoint.models_path import near_names
    from swgjoint.sim.arm.scene import is_arm
    from swgjoint.sim.figures.keys import LOWER
    from swgjoint.view.plots.compare import columns, left_out_notes

    if args.sort is not None and args.sort not in SORTABLE:
        near = near_names(args.sort, SORTABLE)
        hint = f"did you mean {' or '.join(near)}? " if near else ""
        raise InputError(
            f"--sort {args.sort}: unknown key; {hint}accepted: {', '.join(SORTABLE)}"
        )
    spec = limits_of(args, SORTABLE)
    scene, assumed_rotors = scene_or_arm(args.scene, args.overrides)
    require_cycle(scene, {args.sort, *(spec or {})} - {None})
    joints = joints_named(scene, args.joints)
    stepped = any(text.startswith("simulation.step_s") for text in args.overrides)
    if is_arm(args.scene) and not stepped:
        scene = resolve_step(scene, args.arguments, joints)
    rows = compare(
        args.arguments,
        scene,
        model=args.model,
        spec=spec,
        fatigue=SLOW in {args.sort, *(spec or {})},
        joints=joints,
        assumed_rotors=assumed_rotors,
        progress=args.progress,
    )
    if args.sort is not None:
        sign = -1.0 if args.sort in LOWER else 1.0
        known = [row for row in rows if row.figure(args.sort) is not None]
        known.sort(key=lambda row: sign * float(row.figure(args.sort)))
        rows = known + [row for row in rows if row not in known]
    result: dict[str, Any] = {
        "scene": scene.name,
        "joints": list(joints) or None,
        "rows": [row.to_json() for row in rows],
        "spec": spec,
        "passed": None if spec is None else not any(row.missed for row in rows),
        "kept_by": None
        if spec is None
        else [row.argument for row in rows if not row.missed],
        "columns": columns(rows),
        "assumed_rotors": list(assumed_rotors),
        "notes": left_out_notes(rows),
        "files": [],
    }
    if folder is not None:
        _write(folder, result, rows, spec, args.progress)
    return result


def _write(
    folder: Path, result: dict[str, Any], rows: Any, spec: Any, progress: Any
) -> None:
    """Write the picture, the report, the recording and the JSON file."""
    from swgjoint.view.plots.compare import comparison_picture, comparison_table
    from swgjoint.view.recording.recording import write_recording
    from swgjoint.view.report.report import write_report

    runs: dict[str, Any] = {}
    for row in rows:  # arguments may repeat, but runs of the report have unique names
        again = sum(name.split(" (again")[0] == row.argument for name in runs)
        runs[f"{row.argument} (again {again})" if again else row.argument] = row.run
    outputs, pictures = Outputs(folder), {}

    def picture() -> bytes:
        drawn = comparison_picture(rows, result["scene"], spec)
        pictures["Figures side by side"] = drawn
        return drawn

    outputs.write("compare.png", picture)
    outputs.hand_over(
        "report.html",
        lambda path: write_report(
            runs,
            path,
            summary=comparison_table(rows, spec),
            pictures=pictures,
            progress=progress,
        ),
    )
    outputs.hand_over("run.rrd", lambda path: write_recording(runs, path))
    outputs.write_json("compare.json", result)


def status(result: dict[str, Any]) -> int:
    """Return 1 if a limit is missed or a run is not valid, else 0."""
    from swgjoint.sim.figures.verdict import VALID

    valid = all(row["verdict"] == VALID for row in result["rows"])
    return int(result["passed"] is False or not valid)


def report(result: dict[str, Any]) -> str:
    """Format one line per argument, then every missed limit."""
    from swgjoint.sim.figures.keys import is_lower_bound
    from swgjoint.view.plots.compare import cell

    columns, spec = result["columns"], result["spec"]
    verdict = [] if spec is None else ["spec"]
    header = ("", "level", *(name for name, _ in columns.values()), *verdict)
    units = ("", "", *(unit for _, unit in columns.values()), *[""] * len(verdict))
    rows = [
        (
            row["argument"],
            row["level"],
            *(cell(row, key) for key in columns),
            *(["MISSED" if row["missed"] else "met"] if verdict else []),
        )
        for row in result["rows"]
    ]
    which = "worst joint"
    if result["joints"]:
        which += f" of {', '.join(result['joints'])}"
    lines = [
        f"scene {result['scene']}, values of the {which}; torque ripple of the moving"
        " arm, as by run; K1 and stress of the drive",
        table([units, *rows], header=header),
        *worst_joints(result["rows"]),
        rotor_line(result["assumed_rotors"]),
        *result["notes"],
    ]
    for row in result["rows"]:
        lines += [f"{row['argument']}: {row['verdict']}: {r}" for r in row["reasons"]]
        for key in row["missed"]:
            value = cell(row, key)
            found = "has no value" if value == "-" else f"= {value}"
            if value != "-" and is_lower_bound(row, key):
                found = f"{value}, a lower bound, because the step leaves out orders"
            if key == _ERROR_RIPPLE and row[key] is None:
                found += ", because the inputs turn too little for it"
            lines.append(f"{row['argument']}: {key} {found}; limit {spec[key]:g}")
    if spec is not None:
        passing = ", ".join(result["kept_by"])
        lines.append(f"all limits are met by: {passing or 'none'}")
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])


def worst_joints(rows: list[dict[str, Any]]) -> list[str]:
    """Name the joints with the largest ripple, which may differ between the rows."""
    shown = [row for row in rows if row["ripple_missing"] is None]
    arguments: dict[str, list[str]] = {}
    for row in shown:
        arguments.setdefault(row["joint"], []).append(row["argument"])
    every = len(arguments) == 1
    where = [
        joint + ("" if every else f" ({', '.join(names)})")
        for joint, names in arguments.items()
    ]
    return [f"largest torque ripple: {', '.join(where)}"] if where else []


def rotor_line(assumed: list[str]) -> str:
    """State whether the rotor inertia changes with the drive."""
    if assumed:
        return (
            "rotor inertia: assumed for each drive, as by run of the arm; to keep one:"
            " --set defaults.rotor_inertia_kgm2=VALUE"
        )
    return "rotor inertia: that of the scene with every drive"
