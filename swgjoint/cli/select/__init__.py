"""``swgjoint select``: the cheapest drives of an arm that meet a specification."""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint.cli.select.text import selection_lines
from swgjoint.cli.shared.arm_arguments import add_arm_arguments, add_overrides, scene_of
from swgjoint.cli.shared.limits import add_limits, limits_of
from swgjoint.errors import InputError
from swgjoint.files import Outputs, output_folder

if TYPE_CHECKING:
    from swgjoint.explore.select.options import DriveOption
    from swgjoint.explore.select.result import DriveSelection
    from swgjoint.sim.scene.scene import Scene


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: arm, task, limits, drives, cost, output folder."""
    parser.add_argument(
        "arm",
        metavar="ARM|SCENE",
        help="MJCF or URDF file of an arm, scene file, or bundled name; without a task,"
        " an arm is moved through the slow sweep of swgjoint run, and if no set meets a"
        " limit of the tool, the controller gets feedback of the link angles",
    )
    parser.add_argument(
        "--task",
        metavar="SCENE",
        help="scene with the motion, duty cycle, payload and controller of the arm",
    )
    parser.add_argument(
        "--payload",
        metavar="KG",
        type=float,
        help="mass at the tool, known to the controller",
    )
    add_limits(parser, "tool_path_rms_mm=0.3")
    parser.add_argument(
        "--table",
        metavar="FILE",
        help="CSV table of further drives: a column drive (design, map or catalogue"
        " name), and mass_kg, max_input_speed_rpm, average_input_speed_rpm,"
        " rotor_inertia_kgm2, L50_h or other numbers",
    )
    parser.add_argument(
        "--without-catalogue",
        action="store_true",
        help="select from the drives of --table only",
    )
    parser.add_argument(
        "--by",
        metavar="COLUMN",
        default="mass",
        help="column of the cost, summed over the joints; drives without a value are"
        " not selected; default: mass",
    )
    add_overrides(parser)
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write scene.toml (the scene with the selected drives), select.json,"
        " select.png and report.html to this folder, if a set meets the limits",
    )
    add_arm_arguments(parser)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Select the drives.

    Returns:
        ``scene``, ``by`` (column of the cost), ``spec``, ``passed``, ``failure``
        (joint and limit that leave no set), ``careful`` (whether no set was dropped for
        a predicted tool error close to its limit), ``cost``, ``drives`` (by joint;
        null without a set), ``joints`` (every drive at every joint, with its checks and
        why it was dropped), ``simulated`` (sets in the order of their simulation),
        ``feedback`` (side whose angles the controller holds),
        ``motor_feedback_failure`` (why no set meets the limits with feedback of the
        motor angles; null if that was not tried first), ``files`` and ``wall_s``.
    """
    folder, begin = output_folder(args.out) if args.out else None, time.perf_counter()
    from swgjoint.explore.select.options import MASS, read_options
    from swgjoint.explore.select.select import LIMITED, select_drives

    by = MASS if args.by == "mass" else args.by
    spec = limits_of(args, LIMITED)
    options = read_options(
        args.table,
        by=by,
        catalogue=not args.without_catalogue,
        progress=args.progress,
    )
    scene, free = _scene_of(args, options)

    def select(scene: Scene) -> DriveSelection:
        return select_drives(scene, options, spec=spec, progress=args.progress)

    selection, motor_failure = select(scene), None
    if free and selection.misses_tool_error:
        motor_failure = selection.failure
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the first selection has shown them
            selection = select(scene.with_changes({"controller.feedback": "link"}))
    result = {
        **selection.to_json(),
        "feedback": scene.controller.feedback if motor_failure is None else "link",
        "motor_feedback_failure": motor_failure,
        "by": by,
        "files": [],
    }
    result["wall_s"] = time.perf_counter() - begin
    if folder is not None and selection.winner is not None:
        _write(folder, result, selection)
    return result


def _scene_of(
    args: argparse.Namespace, options: tuple[DriveOption, ...]
) -> tuple[Scene, bool]:
    """Scene of the arm and its task, with a step that resolves every drive.

    The second value is whether the user has left the controller open.
    """
    from swgjoint.explore.compare.scene import resolve_step
    from swgjoint.sim.arm.scene import is_arm

    changes = list(args.overrides)
    if args.payload is not None:
        if not 0.0 < args.payload <= 1000.0:
            raise InputError(
                f"--payload {args.payload:g}; accepted: above 0 to 1000 (kg)"
            )
        changes.insert(0, f"payload.mass_kg={args.payload!r}")
    args.scene = args.arm
    if args.task is not None:
        if not is_arm(args.arm) or is_arm(args.task):
            raise InputError(
                f"--task {args.task} with {args.arm}; accepted: an arm with a scene as"
                " its task, or a scene alone"
            )
        args.scene = args.task
        changes.insert(0, f"arm={args.arm}")
    scene, _, _ = scene_of(args, changes)
    stepped = any(text.startswith("simulation.step_s") for text in changes)
    if is_arm(args.scene) and not stepped:
        scene = resolve_step(scene, [option.drive for option in options])
    stated = any(text.startswith("controller.") for text in changes)
    return scene, is_arm(args.scene) and not stated


def _write(folder: Path, result: dict[str, Any], selection: DriveSelection) -> None:
    """Write the scene, the picture, the report and the JSON file."""
    from swgjoint.sim.scene.text import scene_toml
    from swgjoint.view.report.report import write_tables
    from swgjoint.view.selection import selection_picture, selection_tables

    assert selection.scene is not None
    text = scene_toml(selection.scene)
    outputs, pictures = Outputs(folder), {}

    def picture() -> bytes:
        drawn = selection_picture(result)
        pictures["Drives by joint and cost"] = drawn
        return drawn

    outputs.write("scene.toml", lambda: text)
    outputs.write("select.png", picture)
    outputs.hand_over(
        "report.html",
        lambda path: write_tables(
            path,
            title=f"Drives of {result['scene']}",
            description=f"cheapest set by {result['by']}: {result['cost']:g}",
            tables=selection_tables(result),
            pictures=pictures,
            settings={"scene.toml": text},
        ),
    )
    outputs.write_json("select.json", result)


def status(result: dict[str, Any]) -> int:
    """Return 1 if no set of drives meets the limits, else 0."""
    return int(not result["passed"])


def report(result: dict[str, Any]) -> str:
    """Format the selected drives and the simulated sets, or why there is none."""
    return "\n".join(
        [*selection_lines(result), *(f"wrote {name}" for name in result["files"])]
    )
