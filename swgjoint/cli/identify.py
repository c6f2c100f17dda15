"""``swgjoint identify``: identify a drive map from a test-bench log."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError
from swgjoint.files import Outputs, output_folder
from swgjoint.units import arcmin

if TYPE_CHECKING:
    from swgjoint.identify.identification import Identified


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: log, known data of the drive, model, output folder."""
    parser.add_argument(
        "log",
        metavar="FILE.csv",
        help="log with columns time_s, motor_angle_deg (or _rad), link_angle_deg (or"
        " _rad, _arcmin), and output_torque_Nm, motor_torque_Nm or both",
    )
    parser.add_argument(
        "--teeth",
        metavar="FS/CS",
        required=True,
        help="numbers of teeth of flexspline and circular spline, e.g. 200/202",
    )
    parser.add_argument(
        "--rated", type=float, metavar="NM", required=True, help="rated torque [N·m]"
    )
    parser.add_argument(
        "--corners",
        metavar="T1/T2",
        help="output torques at which the stiffness changes [N·m]; default: 0.2 and 0.6"
        " times the rated torque",
    )
    parser.add_argument(
        "--layout",
        metavar="LAYOUT",
        help="fixed member: circular_spline_fixed (default), flexspline_fixed or"
        " wave_generator_fixed",
    )
    parser.add_argument(
        "--spring",
        choices=("three_lines", "cubic"),
        help="three_lines: stiffness K1, K2, K3 (default); cubic: stiffness and"
        " hardening",
    )
    parser.add_argument(
        "--rotor-inertia",
        type=float,
        metavar="KGM2",
        help="inertia of motor rotor and wave generator about the input [kg·m²];"
        " identified if omitted",
    )
    parser.add_argument(
        "--orders",
        metavar="P:Q,...",
        help="orders of the kinematic error: each P:Q is a component of phase P alpha +"
        " Q beta, where alpha and beta are the rotations of the wave generator relative"
        " to the circular spline and to the flexspline; e.g. 2:0,0:2",
    )
    parser.add_argument(
        "--window",
        type=float,
        metavar="S",
        help="time over which samples are averaged [s]; default: 0.005",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write identified.swg and identified.png to this folder",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Read the log, fit the parameters and save the map.

    Returns:
        ``estimates`` (per parameter ``value``, ``unit``, and the bounds ``low`` and
        ``high`` of the 95 % confidence interval), ``kinematic_error`` (list of
        ``alpha``, ``beta``, ``error_arcmin``), ``residuals`` per channel (``rms_Nm``
        and ``share`` of the rms torque), ``samples``, ``correlation``, ``notes``,
        ``doubts`` (reasons why the parameters may be wrong), ``log``, ``files``,
        ``wall_s``.

    Raises:
        InputError: If ``--teeth``, ``--corners`` or ``--orders`` is malformed.
    """
    start = time.perf_counter()
    out = None if args.out is None else output_folder(args.out)
    teeth = _pair(args.teeth, "--teeth", "FS/CS", "/", int)
    orders = None
    if args.orders is not None:
        orders = [
            _pair(part, "--orders", "P:Q,...", ":", int)
            for part in args.orders.split(",")
        ]
    from swgjoint.identify.identification import WINDOW, identify
    from swgjoint.identify.log import read_log

    corners = None
    if args.corners is not None:
        corners = _pair(args.corners, "--corners", "T1/T2", "/", float)
    identified = identify(
        read_log(args.log),
        teeth_flexspline=teeth[0],
        teeth_circular_spline=teeth[1],
        ratings=args.rated,
        corners=corners,
        layout=args.layout or "circular_spline_fixed",
        spring=args.spring or "three_lines",
        rotor_inertia=args.rotor_inertia,
        orders=orders,
        window=WINDOW if args.window is None else args.window,
    )
    files: list[str] = []
    if out is not None:
        from swgjoint.view.plots.identification import png

        outputs = Outputs(out)
        outputs.hand_over("identified.swg", identified.drive.save)
        outputs.write("identified.png", lambda: png(identified))
        files = outputs.files
    return result_of(identified) | {
        "log": args.log,
        "files": files,
        "wall_s": time.perf_counter() - start,
    }


def result_of(identified: Identified) -> dict[str, Any]:
    """Convert an identification to the JSON object of the command, without files."""
    from swgjoint.identify.least_squares import rms

    measured = identified.model.measured_torques()
    drive = identified.drive
    return {
        "estimates": {
            e.name: {"value": e.value, "unit": e.unit, "low": e.low, "high": e.high}
            for e in identified.estimates.values()
        },
        "kinematic_error": [
            {"alpha": int(p), "beta": int(q), "error_arcmin": float(size) / arcmin}
            for (p, q), size in zip(
                drive.orders[1:],
                (drive.kinematic_error[1:] ** 2).sum(axis=1) ** 0.5,
                strict=True,
            )
        ],
        "residuals": {
            key: {
                "rms_Nm": rms(rest),
                "share": rms(rest) / rms(measured[key]),
            }
            for key, rest in identified.residuals.items()
        },
        "samples": len(next(iter(measured.values()))),
        "correlation": identified.correlation,
        "notes": list(identified.notes),
        "doubts": list(identified.doubts),
    }


def report(result: dict[str, Any]) -> str:
    """Format the parameters with their confidence intervals, residuals and doubts."""
    rows = [
        (f"{name} [{e['unit']}]", e["value"], e["low"], e["high"])
        for name, e in result["estimates"].items()
    ]
    text = table(rows, header=("parameter", "value", "95 % from", "to"))
    lines = [f"identified from {result['log']}", text]
    lines += [
        f"{key.replace('_', ' ')}: residual {r['rms_Nm']:.3g} N·m rms,"
        f" {100 * r['share']:.3g} % of the measured rms"
        for key, r in result["residuals"].items()
    ]
    doubts = result["doubts"]
    lines += [note for note in result["notes"] if note not in doubts]
    lines += [f"doubtful: {line}" for line in doubts]
    lines += [f"wrote {name}" for name in result["files"]]
    if result["files"]:
        lines.append(_not_in_map(result["estimates"]))
    return "\n".join(lines)


def _not_in_map(estimates: dict[str, Any]) -> str:
    """Line on the parameters that a joint has and the map of its drive has not."""
    line = "the map has no damping: a joint has its damping_ratio, 0.02 by default"
    if "rotor_inertia" not in estimates:
        return line
    return (
        f"{line}; nor a rotor: set rotor_inertia_kgm2 ="
        f" {estimates['rotor_inertia']['value']:.4g} of the joint (--rotor-inertia of"
        " export), by default it follows from ratio and rated torque"
    )


def status(result: dict[str, Any]) -> int:
    """Return 1 if the identified parameters are doubtful, else 0."""
    return int(bool(result["doubts"]))


def _pair(text: str, option: str, form: str, mark: str, kind: type) -> tuple[Any, Any]:
    """Two numbers of type ``kind`` separated by ``mark`` in the value of an option."""
    try:
        first, second = (kind(part) for part in text.split(mark))
    except ValueError:
        what = "integers" if kind is int else "numbers"
        raise InputError(f"{option} {text[:40]}; accepted: {what} as {form}") from None
    return first, second
