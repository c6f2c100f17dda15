"""``swgjoint run``: simulate an arm with its drives."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.shared.arm_arguments import add_arm_arguments, choice_lines, scene_of
from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError
from swgjoint.files import Outputs, output_folder

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


def configure(parser: argparse.ArgumentParser) -> None:
    """Scene or arm, drive, changes, output folder."""
    parser.add_argument(
        "scene",
        metavar="SCENE|ARM",
        help="scene file, MJCF or URDF file of an arm, or bundled name; an arm gets"
        " a gentle sweep motion and, unless --drive is given, default drives",
    )
    parser.add_argument(
        "--drive",
        metavar="NAME",
        help="design, map or catalogue drive for all joints; for one joint use --set"
        " joints.JOINT.drive=NAME",
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="overrides",
        help="change a key of the scene, e.g. simulation.step_s=0.0005; repeatable",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write run.rrd there, and scene.toml for an arm; by default nothing is"
        " written",
    )
    parser.add_argument(
        "--model",
        choices=("ring", "2d", "3d"),
        help="fidelity of designs; default: 3d for a design with a cup, else 2d",
    )
    parser.add_argument(
        "--strict",
        action="store_true",
        help="also end with exit status 1 if a figure is doubtful: a drive above its"
        " ratings, a ripple that is a lower bound or uncertain, a link that"
        " does not follow its command",
    )
    parser.add_argument(
        "--report", action="store_true", help="also write report.html to DIR"
    )
    parser.add_argument(
        "--live",
        metavar="URL",
        nargs="?",
        const="",
        help="send the run to a viewer on this machine in real time; without URL, a"
        " viewer is started",
    )
    add_arm_arguments(parser)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Simulate the scene.

    Returns:
        ``joints``, ``tool``, ``steps_per_s``, ``contains``, ``files``, ``arm`` and the
        rest of :meth:`swgjoint.sim.run.Run.metrics`.
    """
    if args.report and not args.out:
        raise InputError("--report needs a folder; accepted: --out DIR")
    if args.live:
        from swgjoint.view.recording.live import loopback_port

        loopback_port(args.live)
    folder = output_folder(args.out) if args.out else None
    from swgjoint.view.run import run_scene

    scene, choice = scene_of(args, args.overrides)
    of_arm = choice is not None
    if args.model is not None:
        scene = scene.with_model(args.model)
    recording = folder / "run.rrd" if folder is not None else None
    result = run_scene(scene, recording=recording, progress=args.progress)
    files: list[str] = []
    if folder is not None:
        outputs = Outputs(folder)
        if result.recording is not None:
            outputs.files.append(str(result.recording))
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
        "drives_by_rule": of_arm and args.drive is None,
        "strict": args.strict,
        "drive_choice": choice or {},
        **result.metrics(),
        "contains": result.contains,
        "files": files,
        "live": live,
    }


def status(result: dict[str, Any]) -> int:
    """1 if the run is invalid or, with ``--strict``, if any value is marked."""
    from swgjoint.sim.figures.verdict import VALID
    from swgjoint.view.validity import warnings_of

    if result["verdict"] != VALID:
        return 1
    return int(result["strict"] and bool(warnings_of(result["joints"])))


def report(result: dict[str, Any]) -> str:
    """Verdict, table of the joints, error of the tool, what the model contains."""
    contains = result["contains"]
    lines = [
        *verdict_lines(result),
        f"scene {result['scene']}, {result['window_of']} from"
        f" {result['window_s'][0]:.3g} to {result['window_s'][1]:.3g} s",
        joint_table(result["joints"]),
        *notes(result["joints"]),
        ""
        if result["window_of"] == "constant speed"
        else f"ripple: {result['ripple_of']}",
        tool_line(result["tool"], random="sensors" in contains),
        *(choice_lines(choice) if (choice := result.get("drive_choice")) else []),
        f"model: {contains['degrees_of_freedom']} degrees of freedom,"
        f" {contains['tendons']} tendons, {contains['plugin_instances']} plugin"
        f" instances, {contains['integrator']} at {1e3 * contains['step_s']:g} ms,"
        f" {result['steps_per_s']:.3g} steps/s",
        sub_step_line(contains),
        *assumed_lines(contains),
        *left_out_lines(contains),
        *[f"wrote {path}" for path in result["files"]],
    ]
    return "\n".join(line for line in lines if line)


def verdict_lines(metrics: dict[str, Any]) -> list[str]:
    """Whether the figures describe the scene, and why not."""
    from swgjoint.sim.figures.verdict import VALID

    if metrics["verdict"] == VALID:
        return [metrics["verdict"]]
    return [
        f"{metrics['verdict']}: the figures below do not describe this scene",
        *(f"  {reason}" for reason in metrics["reasons"]),
    ]


def assumed_lines(contains: dict[str, Any]) -> list[str]:
    """Assumed kinematic errors, grouped by joints that share them."""
    found: dict[str, list[str]] = {}
    for name, joint in contains["joints"].items():
        what, _, _ = str(joint["kinematic_error"]).partition(", joint ")
        if what.startswith("assumed"):
            found.setdefault(what, []).append(name)
    return [
        f"kinematic error {what}"
        + ("" if len(names) == len(contains["joints"]) else f" ({', '.join(names)})")
        for what, names in found.items()
    ]


def left_out_lines(contains: dict[str, Any]) -> list[str]:
    """What the model leaves out and why, joints with the same together."""
    found: dict[tuple[str, str], list[str]] = {}
    for item in contains["left_out"]:
        found.setdefault((item["part"], item["reason"]), []).append(item["joint"])
    count = len(contains["joints"])
    return [
        f"not simulated: {part}: {reason}"
        + ("" if len(joints) == count else f" ({', '.join(joints)})")
        for (part, reason), joints in found.items()
    ]


def sub_step_line(contains: dict[str, Any]) -> str:
    """Why the steps were cut, and into how many parts; empty if they were not."""
    if contains["sub_steps"] == 1:
        return ""
    why = ", ".join(
        f"{name}: {what}" for name, what in contains["sub_stepped_for"].items()
    )
    return (
        f"every step in {contains['sub_steps']} sub-steps, because its own length is"
        f" outside the region of the integrator ({why})"
    )


def joint_table(joints: dict[str, Any]) -> str:
    """One line per joint: torsion, transmission error, ripple, orders."""
    return table([JOINT_UNITS, *map(joint_row, joints.items())], header=JOINT_HEADER)


def joint_row(item: tuple[str, dict[str, Any]]) -> tuple[str, ...]:
    """Figures of one joint as the table shows them."""
    from swgjoint.maps.sheet.validity_marks import error_mark, joint_mark

    name, joint = item
    torsion, error = joint["torsion_arcmin"], joint["transmission_error_arcmin"]
    return (
        name,
        joint["level"],
        format_fixed(torsion["mean"]),
        format_fixed(torsion["pp"]),
        format_fixed(error["mean"]),
        _signed(error_mark(joint, error["pp"]), format_fixed(error["pp"])),
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
    """A figure of the ripple: a dash for none, marked where it says less.

    > where it is a lower bound, ~ and ! where the map differs from unseen solves.
    """
    from swgjoint.maps.sheet.validity_marks import joint_mark

    if joint["ripple_missing"]:
        return "-"
    bound = "> " if joint["ripple_is_lower_bound"] else ""
    return _signed(joint_mark(joint), f"{bound}{format_fixed(joint[key])}")


def _signed(sign: str, text: str) -> str:
    return text if not sign or text == "-" else f"{sign} {text}"


def format_fixed(value: float, digits: int = 3) -> str:
    """A number with fixed digits, without a sign on zero."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def notes(joints: dict[str, Any]) -> list[str]:
    """What marks in the table mean, and warnings about the validity of figures."""
    from swgjoint.maps.sheet.validity_marks import error_mark, joint_mark, mark_legend
    from swgjoint.view.validity import warnings_of

    lines = warnings_of(joints)
    whys = {joint["ripple_missing"] for joint in joints.values()} - {None}
    marks = {joint_mark(joint) for joint in joints.values()}
    marks |= {
        error_mark(joint, joint["transmission_error_arcmin"]["pp"])
        for joint in joints.values()
    }
    if marks - {""}:
        lines.insert(0, mark_legend(marks))
    lines += [f"-: no figure for the torque ripple: {why}" for why in sorted(whys)]
    if any(not line["drive_order"] for j in joints.values() for line in j["orders"]):
        lines.insert(
            0,
            "* no order of this joint's drive: vibration, modulation or another joint",
        )
    return lines


def tool_line(tool: dict[str, Any], *, random: bool) -> str:
    """Errors of the tool in one line, those that the motion has.

    Args:
        tool: Figures of the tool.
        random: Whether anything in the scene differs from cycle to cycle; without it a
            repeatability tells nothing.
    """
    parts = []
    if tool["path_rms_mm"] is not None:
        parts.append(
            f"against the commanded path {tool['path_rms_mm']:.4f} mm rms,"
            f" {tool['path_max_mm']:.4f} mm at most"
        )
    if tool["rp_mm"] is not None:
        repeats = f"{tool['rp_mm']:.4f} mm" if random else "- (nothing is random)"
        parts.append(f"AP {tool['ap_mm']:.4f} mm, RP {repeats}")
    elif tool["ap_mm"] is not None:
        parts.append(f"{tool['ap_mm']:.4f} mm at the end")
    for key, name in (("at_mm", "AT"), ("rt_mm", "RT")):
        if tool.get(key) is not None:
            parts.append(f"{name} {tool[key]:.4f} mm")
    return f"tool: {', '.join(parts)}" if parts else ""


def _orders(unresolved: list[dict[str, Any]]) -> str:
    """Orders that were left out, the first few."""
    names = [f"{left['order']:.4g}" for left in unresolved]
    return " ".join(names[:3] + (["..."] if len(names) > 3 else [])) or "-"
