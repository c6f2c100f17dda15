"""``swgjoint export``: write a drive or an arm with drives for other simulators."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.shared.common_options import add_model
from swgjoint.cli.shared.drive_option import add_drive_option, drives_of
from swgjoint.cli.shared.model_text import rotor_lines
from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError

FORMATS = ("mjcf", "fmu")
_ONLY = {"drives": "mjcf", "motors": "mjcf", "fmi": "fmu", "load_inertia": "fmu"}
"""Formats of the options that apply to one format only, by attribute."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: format, arm or drive, output file, options of each format."""
    parser.add_argument(
        "format",
        choices=FORMATS,
        help="mjcf: the arm with its drives at level native, for any MuJoCo 4, without"
        " the plugin; fmu: the drive between a rotor and a load as a Functional Mock-up"
        " Unit (model exchange and co-simulation)",
    )
    parser.add_argument(
        "source",
        metavar="ARM|DRIVE",
        help="mjcf: MJCF or URDF file of an arm, or bundled name; fmu: design, map or"
        " catalogue drive",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        required=True,
        help="file to write (.xml or .fmu)",
    )
    add_model(parser, "designs")
    parser.add_argument(
        "--rotor-inertia",
        type=float,
        metavar="KGM2",
        help="inertia of rotor and wave generator about their axis [kg·m²]; default:"
        " twice the inertia of the wave generator, which follows ratio and rated"
        " torque",
    )
    parser.add_argument(
        "--step",
        type=float,
        metavar="S",
        help="mjcf: time step in the file [s], default: that of the arm; fmu: largest"
        " internal step of co-simulation [s], default: 0.001",
    )
    mjcf = parser.add_argument_group("options of mjcf")
    add_drive_option(
        mjcf, "all hinges", "default: the drives that swgjoint run selects"
    )
    mjcf.add_argument(
        "--motors",
        action="store_true",
        help="add a motor JOINT_motor, whose input is the torque on the rotor [N·m], to"
        " every joint with a drive but without an actuator",
    )
    fmu = parser.add_argument_group("options of fmu")
    fmu.add_argument(
        "--fmi", metavar="VERSION", help="version of FMI: 3.0 (default) or 2.0"
    )
    fmu.add_argument(
        "--load-inertia",
        type=float,
        metavar="KGM2",
        help="inertia of the load [kg·m²], a parameter of the FMU; default: that of the"
        " rotor, reflected to the output",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write the file.

    Returns:
        ``format`` and ``files``; for ``mjcf`` also ``arm``, ``step_s``,
        ``drives_by_rule``, ``rotors_assumed``, ``without_drive`` (hinges that remain as
        in the file), ``joints`` (by name: ``drive``,
        ``ratio``, ``rotor_inertia_kgm2`` and the differences from level full:
        ``up_to_Nm``, ``torsion_arcmin``, ``left_out_error_pp_arcmin``,
        ``left_out_ripple_pp_Nm``, ``link_angle_arcmin``, ``resonance`` with
        frequency and damping ratio at ``native`` and ``full``, ``notes``); for ``fmu``
        also ``drive``, ``fmi``, ``variables`` (list of objects with ``name``, ``kind``,
        ``unit``, ``start`` and ``description``).

    Raises:
        InputError: If an option does not fit the format.
    """
    _check_options(args)
    return _fmu(args) if args.format == "fmu" else _mjcf(args)


def _check_options(args: argparse.Namespace) -> None:
    for name, kind in _ONLY.items():
        if getattr(args, name) not in (None, False, []) and kind != args.format:
            option = {"drives": "drive"}.get(name, name.replace("_", "-"))
            raise InputError(
                f"--{option} does not apply to export {args.format}; accepted with"
                f" export {kind}"
            )


def _fmu(args: argparse.Namespace) -> dict[str, Any]:
    from swgjoint.drives.export_fmu import STEP, export_fmu

    result = export_fmu(
        args.source,
        args.output,
        version=args.fmi or "3.0",
        rotor_inertia=args.rotor_inertia,
        load_inertia=args.load_inertia,
        step=STEP if args.step is None else args.step,
        model=args.model,
    )
    return {
        "format": args.format,
        "drive": result.drive.name,
        "fmi": result.version,
        "variables": [
            {
                "name": one.name,
                "kind": one.kind,
                "unit": one.unit,
                "start": one.start,
                "description": one.text,
            }
            for one in result.variables
        ],
        "files": [str(result.path)],
    }


def _mjcf(args: argparse.Namespace) -> dict[str, Any]:
    from swgjoint.sim.plain_mjcf import export_mjcf

    drives: dict[str, Any] = drives_of(args.drives)
    by_rule = not drives
    if by_rule:
        from swgjoint.files import check_output_file
        from swgjoint.sim.arm.scene import arm_scene

        check_output_file(args.output, ".xml")
        choice = arm_scene(args.source).drive_choice
        drives = {name: one.drive for name, one in choice.items()}
    result = export_mjcf(
        args.source,
        args.output,
        drives,
        rotor_inertia=args.rotor_inertia,
        model=args.model,
        step=args.step,
        motors=args.motors,
    )
    return {
        "format": args.format,
        "arm": args.source,
        "step_s": result.step,
        "drives_by_rule": by_rule,
        "rotors_assumed": args.rotor_inertia is None,
        "joints": {
            name: result.errors[name].as_json(drive)
            for name, drive in result.drives.items()
        },
        "without_drive": list(result.without_drive),
        "files": [str(path) for path in (result.path, *result.assets)],
    }


def report(result: dict[str, Any]) -> str:
    """Format what was written: variables of an FMU, or joints of an arm."""
    return _fmu_text(result) if result["format"] == "fmu" else _mjcf_text(result)


def _fmu_text(result: dict[str, Any]) -> str:
    rows = [
        (one["name"], one["kind"], one["unit"], one["start"], one["description"])
        for one in result["variables"]
        if one["kind"] != "derivative"
    ]
    return "\n".join(
        [
            f"FMI {result['fmi']}, model exchange and co-simulation, of drive"
            f" {result['drive']}",
            table(rows, header=("variable", "kind", "unit", "start", "")),
            *(f"wrote {path}" for path in result["files"]),
        ]
    )


def _mjcf_text(result: dict[str, Any]) -> str:
    rows = [
        ("", "", "arcmin", "arcmin", "arcmin", "Hz", "Hz", "", ""),
        *(
            (
                name,
                joint["drive"],
                joint["torsion_arcmin"],
                joint["left_out_error_pp_arcmin"],
                joint["link_angle_arcmin"],
                *(
                    None if mode is None else mode[key]
                    for key in ("frequency_Hz", "damping_ratio")
                    for mode in joint["resonance"].values()
                ),
            )
            for name, joint in result["joints"].items()
        ),
    ]
    header = (
        *("joint", "drive", "torsion", "left out pp", "link angle"),
        *("resonance", "full", "damping ratio", "full"),
    )
    notes: dict[str, list[str]] = {}
    for name, joint in result["joints"].items():
        for note in joint["notes"]:
            notes.setdefault(note, []).append(name)
    count, bare = len(result["joints"]), ", ".join(result["without_drive"])
    assumed = result["joints"] if result["rotors_assumed"] else ()
    by_rule = (
        "drives selected as by swgjoint run; to select others: --drive [JOINT=]NAME"
    )
    lines = [
        *([by_rule] if result["drives_by_rule"] else []),
        "level native without a plugin; differences from level full at equal motor"
        " angle and torque, and resonance without load at the time step of"
        f" {1e3 * result['step_s']:g} ms:",
        table(rows, header=header),
        *([f"without a drive: {bare}; for all hinges: --drive NAME"] if bare else []),
        *rotor_lines(result["joints"], assumed, "--rotor-inertia VALUE"),
        *(
            note + ("" if len(names) == count else f" ({', '.join(names)})")
            for note, names in notes.items()
        ),
        *(f"wrote {path}" for path in result["files"]),
    ]
    return "\n".join(lines)
