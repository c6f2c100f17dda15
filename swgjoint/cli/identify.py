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
    """The log, what is known of the drive, and where results go."""
    parser.add_argument(
        "log",
        metavar="FILE.csv",
        help="log with time_s, motor_angle_deg (or _rad), link_angle_deg (or _rad,"
        " _arcmin), and output_torque_Nm, motor_torque_Nm or both",
    )
    parser.add_argument(
        "--teeth",
        metavar="FS/CS",
        required=True,
        help="teeth of flexspline and circular spline, for example 200/202",
    )
    parser.add_argument(
        "--rated", type=float, metavar="NM", required=True, help="rated torque"
    )
    parser.add_argument(
        "--corners",
        metavar="T1/T2",
        help="torques at which the stiffness changes; default 0.2 and 0.6 of rated",
    )
    parser.add_argument(
        "--layout", metavar="LAYOUT", help="default circular_spline_fixed"
    )
    parser.add_argument(
        "--spring",
        choices=("three_lines", "cubic"),
        help="stiffness K1, K2, K3 (default), or stiffness and hardening",
    )
    parser.add_argument(
        "--rotor-inertia",
        type=float,
        metavar="KGM2",
        help="of motor and wave generator; identified if omitted",
    )
    parser.add_argument(
        "--orders",
        metavar="P:Q,...",
        help="kinematic error at p alpha + q beta, alpha and beta the rotations of the"
        " wave generator against circular spline and flexspline; for example 2:0,0:2",
    )
    parser.add_argument(
        "--window",
        type=float,
        metavar="S",
        help="samples are averaged over this time; default 0.005",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="write identified.swg and identified.png there"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Read, fit, save.

    Returns:
        ``estimates`` (per name ``value``, ``unit``, ``low`` and ``high`` of the
        interval of 95 %), ``kinematic_error`` (``alpha``, ``beta``, ``error_arcmin``),
        ``residuals`` per channel (``rms_Nm``, ``share`` of the rms torque),
        ``samples``, ``correlation``, ``notes``, ``doubts`` (why the parameters may not
        be those of the drive), ``files``, ``wall_s``.
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
    found = identify(
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
        outputs.hand_over("identified.swg", found.drive.save)
        outputs.write("identified.png", lambda: png(found))
        files = outputs.files
    return result_of(found) | {
        "log": args.log,
        "files": files,
        "wall_s": time.perf_counter() - start,
    }


def result_of(found: Identified) -> dict[str, Any]:
    """The JSON object of an identification, without files."""
    from swgjoint.identify.identification import rms

    measured = found.model.measured_torques()
    drive = found.drive
    return {
        "estimates": {
            e.name: {"value": e.value, "unit": e.unit, "low": e.low, "high": e.high}
            for e in found.estimates.values()
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
            for key, rest in found.residuals.items()
        },
        "samples": len(next(iter(measured.values()))),
        "correlation": found.correlation,
        "notes": list(found.notes),
        "doubts": list(found.doubts),
    }


def report(result: dict[str, Any]) -> str:
    """Table of the parameters with their intervals."""
    rows = [
        (f"{name} [{e['unit']}]", e["value"], e["low"], e["high"])
        for name, e in result["estimates"].items()
    ]
    text = table(rows, header=("parameter", "value", "from", "to (95 %)"))
    lines = [f"identified from {result['log']}", text]
    lines += [
        f"{key}: {r['rms_Nm']:.3g} N·m rms left, {100 * r['share']:.3g} % of it"
        for key, r in result["residuals"].items()
    ]
    doubts = result["doubts"]
    lines += [note for note in result["notes"] if note not in doubts]
    return "\n".join([*lines, *(f"doubt: {line}" for line in doubts), *result["files"]])


def status(result: dict[str, Any]) -> int:
    """1 if the identified parameters are doubtful."""
    return int(bool(result["doubts"]))


def _pair(text: str, option: str, form: str, mark: str, kind: type) -> tuple[Any, Any]:
    try:
        first, second = (kind(part) for part in text.split(mark))
    except ValueError:
        raise InputError(
            f"{option} {text[:40]}; accepted: two numbers, {form}"
        ) from None
    return first, second
