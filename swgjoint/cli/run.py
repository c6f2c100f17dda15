"""``swgjoint run``: simulate an arm with its drives."""

from __future__ import annotations

import argparse
import re
from typing import Any

from swgjoint.cli.shared.arm_arguments import (
    add_arm_arguments,
    add_overrides,
    choice_lines,
    scene_of,
)
from swgjoint.cli.shared.common_options import add_model
from swgjoint.cli.shared.drive_option import add_drive_option
from swgjoint.cli.shared.life_text import joint_lines, life_lines
from swgjoint.cli.shared.load_text import design_line, load_line, loss_line
from swgjoint.cli.shared.model_text import (
    assumed_lines,
    left_out_lines,
    rotor_lines,
    sub_step_line,
    tool_line,
)
from swgjoint.cli.shared.ripple_text import ripple_line
from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError
from swgjoint.files import Outputs, output_folder
from swgjoint.view.words import NOISE_NOTE, above_noise

JOINT_HEADER = (
    "joint",
    "level",
    "torsion",
    "pp",
    "trans. error",
    "pp",
    "ripple pp",
    "rms",
    "strongest orders (%)",
    "unresolved",
)
JOINT_UNITS = ("", "", "arcmin", "arcmin", "arcmin", "arcmin", "%", "%", "", "")
"""Units of the columns of :data:`JOINT_HEADER`."""
_MODEL_OF_A_JOINT = re.compile(r"\s*joints\.[^=]+\.model\s*=")
"""Changes of a scene that state the model of one joint."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: scene or arm, drive, changes, output, options of an arm."""
    parser.add_argument(
        "scene",
        metavar="SCENE|ARM",
        help="scene file, MJCF or URDF file of an arm, or bundled name; an arm is moved"
        " through a slow sweep and gets default drives unless --drive is specified",
    )
    add_drive_option(
        parser,
        "all joints",
        "default: the drives of the scene, or those that a rule selects for an arm;"
        " --set joints.JOINT.drive replaces that of a pattern or of all joints",
    )
    add_overrides(parser, "change a key of the scene, e.g. simulation.step_s=0.0005")
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write run.rrd, the picture run.png (and scene.toml for an arm) to this"
        " folder; default: write no files",
    )
    add_model(parser, "designs")
    parser.add_argument(
        "--strict",
        action="store_true",
        help="return exit status 1 also if a result is doubtful: a drive exceeds its"
        " ratings, a ripple is a lower bound or uncertain, or a link does not follow"
        " its command",
    )
    parser.add_argument(
        "--report", action="store_true", help="also write report.html to --out DIR"
    )
    parser.add_argument(
        "--live",
        metavar="URL",
        nargs="?",
        const="",
        help="after the simulation, send the run in real time to a viewer on this"
        " machine; without URL, a viewer is started",
    )
    add_arm_arguments(parser)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Simulate the scene.

    Returns:
        ``scene``, ``arm``, ``drives_by_rule`` (whether the drives of an arm were
        selected by rule, as listed in ``drive_choice``), ``rotors_assumed`` (whether
        rotor inertias are assumed, for the joints in ``assumed_rotors``), ``strict``,
        ``contains``,
        ``files``, ``live`` (address of the viewer, or null) and the keys of
        :meth:`swgjoint.sim.run.Run.metrics`, such as ``joints``, ``tool`` and
        ``steps_per_s``.

    Raises:
        InputError: If ``--report`` lacks ``--out``, or the URL of ``--live`` is not on
            this machine.
    """
    if args.report and not args.out:
        raise InputError("--report needs a folder; accepted: with --out DIR")
    if args.live:
        from swgjoint.view.recording.live import loopback_port

        loopback_port(args.live)
    folder = output_folder(args.out) if args.out else None
    from swgjoint.sim.rigid_drives import rigid_drives
    from swgjoint.view.run import run_scene

    scene, choice, assumed_rotors = scene_of(args, args.overrides)
    of_arm = choice is not None
    if args.model is not None:
        # models of single joints on the command line have priority
        own = [text for text in args.overrides if _MODEL_OF_A_JOINT.match(text)]
        scene = scene.with_model(args.model).with_changes(own)
    recording = folder / "run.rrd" if folder is not None else None
    # a report has the spec sheets of all drives
    drives = None if args.report else rigid_drives(scene)
    result = run_scene(
        scene, drives=drives, recording=recording, progress=args.progress
    )
    files: list[str] = []
    if folder is not None:
        from swgjoint.view.run_picture import run_png

        outputs = Outputs(folder)
        if result.recording is not None:
            outputs.files.append(str(result.recording))
        outputs.write("run.png", lambda: run_png(result))
        if of_arm:
            from swgjoint.sim.scene.text import scene_toml

            outputs.write("scene.toml", lambda: scene_toml(scene))
        if args.report:
            from swgjoint.view.report.report import write_report

            outputs.hand_over(
                "report.html",
                lambda path: write_report({"": result}, path, progress=args.progress),
            )
        files = outputs.files
    live = None
    if args.live is not None:
        from swgjoint.view.recording.live import stream_runs

        live = stream_runs({"": result}, url=args.live or None, pace=1.0)
    arm = result.assembly.arm
    return {
        "scene": scene.name,
        "arm": {"file": str(arm.path), "held": arm.held, "pose": scene.pose},
        "drives_by_rule": bool(choice),
        "rotors_assumed": bool(assumed_rotors),
        "assumed_rotors": list(assumed_rotors),
        "strict": args.strict,
        "drive_choice": choice or {},
        **result.metrics(),
        "contains": result.contains,
        "files": files,
        "live": live,
    }


def status(result: dict[str, Any]) -> int:
    """Return 1 if the run is not valid or, with ``--strict``, doubtful, else 0."""
    from swgjoint.sim.figures.verdict import VALID
    from swgjoint.view.validity import warnings_of

    if result["verdict"] != VALID:
        return 1
    return int(result["strict"] and bool(warnings_of(result["joints"])))


def report(result: dict[str, Any]) -> str:
    """Format the verdict, the joints, the tool error and the content of the model."""
    contains = result["contains"]
    lines = [
        *verdict_lines(result),
        f"scene {result['scene']}, values from the period of {result['window_of']},"
        f" {result['window_s'][0]:.3g} to {result['window_s'][1]:.3g} s",
        joint_table(result["joints"]),
        *notes(result["joints"]),
        load_line(result["joints"]),
        loss_line(result["joints"]),
        ripple_line(result),
        tool_line(result["tool"], random="sensors" in contains),
        *life_lines(result),
        *joint_lines(result),
        *(
            [*choice_lines(choice), design_line(choice)]
            if (choice := result.get("drive_choice"))
            else []
        ),
        f"model: degrees of freedom: {contains['degrees_of_freedom']}, tendons:"
        f" {contains['tendons']}, plugin instances: {contains['plugin_instances']};"
        f" integrator {contains['integrator']}, step {1e3 * contains['step_s']:g} ms,"
        f" {result['steps_per_s']:.3g} steps/s",
        sub_step_line(contains),
        *rotor_lines(
            contains["joints"],
            result.get("assumed_rotors", ()),
            "--set joints.JOINT.rotor_inertia_kgm2=VALUE",
        ),
        *assumed_lines(contains),
        *left_out_lines(contains),
        *[f"wrote {path}" for path in result["files"]],
    ]
    return "\n".join(line for line in lines if line)


def verdict_lines(metrics: dict[str, Any]) -> list[str]:
    """Format the verdict: whether the results describe the scene, and why not."""
    from swgjoint.sim.figures.verdict import NEXT, VALID

    if metrics["verdict"] == VALID:
        return [metrics["verdict"]]
    lines = [f"{metrics['verdict']}: the results below do not describe this scene"]
    remedies: dict[str, list[str]] = {}
    for reason in metrics["reasons"]:
        fact, _, remedy = reason.partition(NEXT)
        lines.append(f"  {fact}")
        if remedy:
            name = fact.partition(":")[0]
            general = remedy.replace(f"joints.{name}.", "joints.JOINT.")
            remedies.setdefault(general, []).append(remedy)
    # joints with the same map share one line
    shown = [g if len(same) > 1 else same[0] for g, same in remedies.items()]
    return lines + [f"  {NEXT.removeprefix('; ')}{remedy}" for remedy in shown]


def joint_table(joints: dict[str, Any]) -> str:
    """Format one line per joint: torsion, transmission error, ripple, orders."""
    return table([JOINT_UNITS, *map(joint_row, joints.items())], header=JOINT_HEADER)


def joint_row(item: tuple[str, dict[str, Any]]) -> tuple[str, ...]:
    """Cells of one joint in the table; ``item`` is its name and its figures."""
    from swgjoint.maps.sheet.validity_marks import error_mark, joint_mark

    name, joint = item
    torsion, error = joint["torsion_arcmin"], joint["transmission_error_arcmin"]
    return (
        name,
        joint["level"],
        _fixed(torsion["mean"]),
        _fixed(torsion["pp"]),
        _fixed(error["mean"]),
        _signed(error_mark(joint, error["pp"]), _fixed(error["pp"])),
        ripple_cell(joint, "ripple_pp_percent"),
        ripple_cell(joint, "ripple_rms_percent"),
        _signed(
            joint_mark(joint),
            "  ".join(
                f"{line['order']:.1f}{'' if line['drive_order'] else '*'}"
                f" ({line['amplitude_percent']:.3f})"
                for line in joint["orders"]
            )
            or "-",
        ),
        _orders(joint["unresolved"]),
    )


def ripple_cell(joint: dict[str, Any], key: str) -> str:
    """Format a ripple figure with its marks, or a dash if it is missing.

    The mark ``>`` means a lower bound; ``~`` and ``!`` mean that the map differs from
    unseen solves.

    Args:
        joint: Figures of the joint.
        key: Key of the ripple figure [% of rated torque].
    """
    from swgjoint.maps.sheet.validity_marks import joint_mark

    if joint["ripple_missing"]:
        return "-"
    bound = "> " if joint["ripple_is_lower_bound"] else ""
    return _signed(joint_mark(joint), f"{bound}{format_fixed(joint[key])}")


def _fixed(value: float) -> str:
    """Text of a torsion or an error [arcmin]; a dash below the noise."""
    shown = above_noise(value)
    return "-" if shown is None else format_fixed(shown)


def _signed(sign: str, text: str) -> str:
    """Text with a mark in front, unless there is no mark or no figure."""
    return text if not sign or text == "-" else f"{sign} {text}"


def format_fixed(value: float) -> str:
    """Format a number in any unit with three decimals, without a sign on zero."""
    return f"{round(value, 3) + 0.0:.3f}"


def notes(joints: dict[str, Any]) -> list[str]:
    """Explain the marks in the table of joints, and list warnings on the validity."""
    from swgjoint.maps.sheet.validity_marks import error_mark, joint_mark, mark_legend
    from swgjoint.view.ratings_text import joint_rule_lines
    from swgjoint.view.validity import shared_orders, warnings_of

    lines = [*warnings_of(joints), *joint_rule_lines(joints)]
    whys = {joint["ripple_missing"] for joint in joints.values()} - {None}
    marks = {joint_mark(joint) for joint in joints.values()}
    marks |= {
        error_mark(joint, joint["transmission_error_arcmin"]["pp"])
        for joint in joints.values()
    }
    if marks - {""}:
        lines.insert(0, mark_legend(marks))
    lines += [f"-: no value for the torque ripple: {why}" for why in sorted(whys)]
    if any("-" in joint_row(item)[2:6] for item in joints.items()):
        lines.append(NOISE_NOTE)
    if any(not line["drive_order"] for j in joints.values() for line in j["orders"]):
        lines.insert(
            0,
            "* not an order of this joint's drive: vibration, modulation or another"
            " joint",
        )
    lines += shared_orders(joints)
    return lines


def _orders(unresolved: list[dict[str, Any]]) -> str:
    """The first three orders that the step does not resolve, as text."""
    names = [f"{left['order']:.4g}" for left in unresolved]
    return " ".join(names[:3] + (["..."] if len(names) > 3 else [])) or "-"
