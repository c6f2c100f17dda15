"""``swgjoint map``: build the map of a design or of a measured torsion loop."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.map_validity_text import validation_table
from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError
from swgjoint.faults import split_unit
from swgjoint.files import Outputs, check_output_file
from swgjoint.maps.sheet.validation_notes import validation_of_map

if TYPE_CHECKING:
    from swgjoint.maps.drive_map import DriveMap

_MEASURED = ("measured_teeth", "measured_rated", "measured_error", "measured_layout")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: design or measurement, output file, fidelity."""
    parser.add_argument(
        "design",
        metavar="DESIGN",
        help="design file or bundled name; or a .csv file with a measured"
        " torque-torsion loop, together with the options --measured-...",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="map file to write (.swg)"
    )
    parser.add_argument(
        "--model",
        choices=("ring", "2d", "3d"),
        help="fidelity: ring (thin ring, fastest), 2d or 3d (finite elements); default:"
        " 3d for a design with a cup, else 2d",
    )
    parser.add_argument(
        "--no-fields",
        action="store_true",
        help="omit the stresses and shapes that recordings display; the file shrinks"
        " from about 1 MB to tens of kB and the drive behaves the same",
    )
    measured = parser.add_argument_group("options for a measured loop")
    measured.add_argument(
        "--measured-teeth",
        metavar="FS/CS",
        help="numbers of teeth of flexspline and circular spline, e.g. 200/202",
    )
    measured.add_argument(
        "--measured-rated", type=float, metavar="NM", help="rated torque [N·m]"
    )
    measured.add_argument(
        "--measured-error",
        metavar="FILE",
        help=".csv file with the kinematic error over one output turn (optional)",
    )
    measured.add_argument(
        "--measured-layout",
        metavar="LAYOUT",
        help="fixed member: circular_spline_fixed (default), flexspline_fixed or"
        " wave_generator_fixed",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Build the map, or read it from the cache, and save it.

    Returns:
        ``design``, ``level``, ``residual``, ``energy_check`` and ``harmonics`` of the
        map's record, ``validation`` against unseen solves (null with
        ``validation_reason``), ``stiffness_Nm_rad``, ``torque_range_Nm``, ``info``
        (the rest of the record), ``files``, ``wall_s``;
        for a measured loop also ``fit``: ``hysteresis_loss_arcmin`` and
        ``lost_motion_arcmin`` of the loop and of the map, ``rms_arcmin`` (difference
        between loop and map), ``warnings``.

    Raises:
        InputError: If the options do not fit a design or a measured loop.
    """
    start = time.perf_counter()
    path = check_output_file(args.output, ".swg")
    drive = _measured(args) if args.design.endswith(".csv") else _built(args)
    if args.no_fields:
        drive = replace(drive, fields=None)
    outputs = Outputs(path.parent)
    outputs.hand_over(path.name, drive.save)
    info = dict(drive.info)
    info.pop("validation", None)
    return {
        "design": drive.name,
        "level": drive.level,
        "residual": info.pop("residual", None),
        "energy_check": info.pop("energy_check", None),
        **validation_of_map(drive),
        "harmonics": info.pop("harmonics", None)
        or [{"alpha": int(p), "beta": int(q)} for p, q in drive.orders],
        "stiffness_Nm_rad": drive.mean_stiffness,
        "torque_range_Nm": _sampled(drive),
        "fit": (info.get("fit") or {}).get("loop"),
        "info": info,
        "files": outputs.files,
        "wall_s": time.perf_counter() - start,
    }


def _sampled(drive: DriveMap) -> tuple[float, float]:
    """Range of torque that was sampled and that the map covers [N·m].

    With tooth errors, the mean torque at the ends of the map differs from the torque of
    the outermost samples.
    """
    low, high = drive.torque_range
    first, last = drive.info.get("sampled_torque_Nm", (low, high))
    return max(low, first), min(high, last)


def _built(args: argparse.Namespace) -> DriveMap:
    """Build the map of a design."""
    options = [name for name in _MEASURED if getattr(args, name) is not None]
    if options:
        raise InputError(
            f"--{options[0].replace('_', '-')} does not apply to a design; accepted"
            " with a .csv file"
        )
    from swgjoint.gear.design.design import Design

    design = Design.load(args.design)
    # importing the finite elements takes half a second, so the design is read first
    from swgjoint.drives.build_map import build_map

    return build_map(design, model=args.model, progress=args.progress)


def _measured(args: argparse.Namespace) -> DriveMap:
    """Fit the map of a measured loop."""
    if args.model is not None:
        raise InputError(
            f"--model {args.model} does not apply to a measured loop; accepted with a"
            " design"
        )
    if args.measured_teeth is None or args.measured_rated is None:
        raise InputError(
            f"{args.design}: a measured loop needs --measured-teeth FS/CS and"
            " --measured-rated NM"
        )
    teeth = args.measured_teeth.split("/")
    if len(teeth) != 2 or not all(part.isdecimal() for part in teeth):
        raise InputError(
            f"--measured-teeth {args.measured_teeth}; accepted: integers as FS/CS"
        )
    from swgjoint.maps.drive_map import DriveMap

    options = {} if args.measured_layout is None else {"layout": args.measured_layout}
    return DriveMap.from_measurement(
        args.design,
        teeth_flexspline=int(teeth[0]),
        teeth_circular_spline=int(teeth[1]),
        ratings=args.measured_rated,
        kinematic_error=args.measured_error,
        **options,
    )


def report(result: dict[str, Any]) -> str:
    """Format the key figures of the map, its validation and the name of the file."""
    low, high = result["torque_range_Nm"]
    rows = [
        ("level", result["level"]),
        ("harmonics", len(result["harmonics"])),
        ("mean stiffness up to rated torque [N·m/rad]", result["stiffness_Nm_rad"]),
        ("sampled output torque [N·m]", f"{low:.4g} to {high:.4g}"),
        *_flat("residual", result["residual"]),
        *_flat("energy check", result["energy_check"]),
        ("wall time [s]", result["wall_s"]),
    ]
    where = ", ".join(result["files"]) or "not written"
    lines = [f"map of {result['design']}: {where}", table(rows)]
    lines += validation_table(result)
    fit = result.get("fit")
    if fit:
        pairs = [
            (
                key.removesuffix("_arcmin").replace("_", " "),
                pair["measured"],
                pair["predicted"],
            )
            for key, pair in fit.items()
            if isinstance(pair, dict)
        ]
        pairs.append(("rms difference of the loops", None, fit["rms_arcmin"]))
        lines.append(table(pairs, header=("[arcmin]", "measured", "map")))
        lines += [f"warning: {line}" for line in fit["warnings"]]
    if fit or (result["info"].get("label") or {}).get("friction"):
        left_out = (result["info"].get("missing") or {}).get("hysteresis_loss_arcmin")
        if left_out:
            lines.append(f"no hysteresis in the map: {left_out}")
    return "\n".join(lines)


_CHECKED = {
    "energy check input torque pp": "input torque, largest peak to peak at one load",
    "energy check input torque error": "largest error of the input torque",
}
"""Displayed names of rows whose key does not say which quantity they mean."""


def _flat(name: str, value: Any) -> list[tuple[str, Any]]:
    """Rows of a table for a nested object, named by the path of keys with the unit."""
    if isinstance(value, dict):
        return [row for key, v in value.items() for row in _flat(f"{name} {key}", v)]
    text, unit = split_unit(name)
    label = text.replace("_", " ")
    label = _CHECKED.get(label, label) + (f" [{unit}]" if unit else "")
    return [] if value is None else [(label, value)]
