"""``swgjoint meshing``: simulate the meshing of a design over an input turn."""

from __future__ import annotations

import argparse
import math
from functools import partial
from typing import Any

from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError, Outcome
from swgjoint.files import Outputs, attempt_output, output_folder
from swgjoint.json_text import plain


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: design, torque, positions, kind of model, output folder."""
    parser.add_argument("design", metavar="DESIGN", help="design file or bundled name")
    parser.add_argument(
        "--model",
        choices=("2d", "3d"),
        help="finite-element model; default: 3d for a design with a cup, else 2d",
    )
    parser.add_argument(
        "--torque",
        type=float,
        metavar="NM",
        help="torque that the drive exerts on the output [N·m]; default: rated torque",
    )
    parser.add_argument(
        "--steps",
        type=int,
        metavar="N",
        help="number of wave-generator positions k TURNS/N, k = 0 to N-1; default: 35,"
        " or the nearest number whose positions cover the tooth pitch evenly",
    )
    parser.add_argument(
        "--turn",
        type=float,
        default=0.5,
        metavar="TURNS",
        help="simulated rotation of the input [turns]; default: 0.5",
    )
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument(
        "--nonlinear",
        dest="nonlinear",
        action="store_true",
        default=True,
        help="account for large rotations (default)",
    )
    kind.add_argument(
        "--linear",
        dest="nonlinear",
        action="store_false",
        help="assume small displacements",
    )
    parser.add_argument(
        "--half",
        action="store_true",
        help="model half of the drive, which requires perfect geometry and even numbers"
        " of teeth",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write meshing.json and plots to this folder; a 3D run also stores its"
        " states, from which the same command resumes after an interruption",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="require an interrupted 3D run in --out DIR and resume it; without this"
        " option, a run with the same design and options is resumed if there is one",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the simulation.

    Returns:
        The keys of ``MeshingRun.to_json``, and ``files``.

    Raises:
        InputError: If a number is out of range, or ``--resume`` lacks a 3D model or
            ``--out``.
    """
    _check(args)
    folder = output_folder(args.out) if args.out else None
    from swgjoint.gear.design.design import Design

    design = Design.load(args.design)
    # importing the finite elements takes half a second, so the design is read first
    from swgjoint.fe.meshing import simulate_meshing
    from swgjoint.gear.catalogue import ratings_of

    torque = ratings_of(design).rated_torque if args.torque is None else args.torque
    from swgjoint.drives.fidelity import default_model

    model = args.model or default_model(design)
    if args.resume and (folder is None or model != "3d"):
        raise InputError(
            "--resume needs a 3D model and the folder of the interrupted run; accepted:"
            " with --model 3d and --out DIR"
        )
    meshing = simulate_meshing(
        design,
        model=model,
        torque=torque,
        steps=args.steps,
        turn=args.turn,
        nonlinear=args.nonlinear,
        half=args.half,
        throw=False,
        progress=args.progress,
        keep=folder / "states" if folder is not None and model == "3d" else None,
        resume=args.resume,
    )
    result: dict[str, Any] = plain(meshing.to_json())
    result["files"] = []
    if folder is not None:
        from swgjoint.fe.meshing_run import MeshingRun
        from swgjoint.view.plots.meshing import meshing_picture

        outputs = Outputs(folder)
        outputs.write("meshing.png", lambda: meshing_picture(result))
        with attempt_output(folder / "pictures of the fields"):
            if isinstance(meshing, MeshingRun):
                from swgjoint.view.plots.fields import field_pictures

                pictures = field_pictures(meshing)
            else:
                from swgjoint.view.plots.solid import solid_pictures

                pictures = solid_pictures(meshing)
            for name, picture in pictures.items():
                outputs.write(f"{name}.png", partial(bytes, picture))
        outputs.write_json("meshing.json", result)
    return result


def _check(args: argparse.Namespace) -> None:
    """Reject options outside their range before anything is computed."""
    faults = []
    if args.torque is not None and not abs(args.torque) <= 1e6:
        faults.append(f"--torque {args.torque:g} N·m; accepted: -1e6 to 1e6 N·m")
    if args.steps is not None and not 1 <= args.steps <= 100_000:
        faults.append(f"--steps {args.steps}; accepted: 1 to 100000")
    if not math.isfinite(args.turn) or not 0 < abs(args.turn) <= 1000:
        faults.append(
            f"--turn {args.turn:g} turns; accepted: -1000 to 1000 turns except 0"
        )
    if faults:
        raise InputError("\n".join(faults))


def _labelled(label: dict[str, Any]) -> list[str]:
    """Entries of the validity label in words, without absent ones."""
    answers = {True: "yes", False: "no"}
    return [
        f"{key.replace('_', ' ')} {answers[v] if isinstance(v, bool) else v}"
        for key, v in label.items()
        if v is not None
    ]


def status(result: dict[str, Any]) -> int:
    """Return 1 if a position could not be solved, else 0."""
    return int(result["outcome"] != "converged")


def report(result: dict[str, Any]) -> str:
    """Format the size of the run, its validity, the stresses and the outcome."""
    kinds = ("tensile", "compressive", "von_mises")
    rows = []
    label = result.get("label") or {}
    where = f", {label['positions']}" if label.get("positions") else ""
    for member in ("flexspline", "circular_spline"):
        for state in result["setup_MPa"]:
            if state.get(member):
                values = [state[member].get(kind) for kind in kinds]
                text = f"{member}, {state['state']}".replace("_", " ")
                rows.append((text, *values))
        mean = result.get(member) and result[member].get("average_max_MPa")
        values = [mean.get(kind) for kind in kinds] if mean else []
        if any(value is not None for value in values):  # null for a rigid member
            name = member.replace("_", " ")
            rows.append((f"{name}, mean of the maxima{where}", *values))
    lines = [
        f"meshing of {result.get('design', 'the design')}:"
        f" {result['nodes']} nodes, {result['elements']} elements,"
        f" {result['steps']} positions, {result['wall_s']:.1f} s",
        f"validity: {', '.join(_labelled(label))}",
        table(rows, header=("[MPa]", "tensile", "compressive", "von Mises")),
    ]
    steps = result["per_step"]
    for key, text in (
        ("wave_generator_torque_Nm", "wave-generator (input) torque [N·m]: mean"),
        ("pairs_in_contact", "pairs in contact: mean"),
    ):
        values = [v for v in steps.get(key) or [] if v is not None]
        if values:
            spread = f", peak to peak {max(values) - min(values):.4g}"
            lines.append(f"{text} {sum(values) / len(values):.5g}{spread}")
    error = [v for v in steps.get("output_error_arcsec") or [] if v is not None]
    if error:
        lines.append(
            f"output error under this torque, peak to peak{where}:"
            f" {max(error) - min(error):.4g} arcsec"
        )
    for state in result.get("coning_mm") or []:
        cone = "; ".join(
            f"{axis} axis {state[axis]['open_edge']:.4f} at the open edge,"
            f" {state[axis]['closed_edge']:.4f} at the closed edge"
            for axis in ("major", "minor")
        )
        lines.append(f"radial displacement [mm], {state['state']}: {cone}")
    lines += [f"warning: {line}" for line in result.get("warnings") or []]
    lines.append(f"outcome: {result['outcome']}")
    failed = sum(name != "converged" for name in steps["outcome"])
    if failed:
        advice = Outcome[result["outcome"].upper()].value
        lines.append(f"{failed} of {len(steps['outcome'])} positions failed: {advice}")
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])
