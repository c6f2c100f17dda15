"""``swgjoint design``: whether designs can be built, their picture, their outlines."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint.cli.text import table
from swgjoint.errors import DesignError, InputError
from swgjoint.files import output_folder, write_whole

if TYPE_CHECKING:
    from swgjoint.gear.check import Check
    from swgjoint.gear.design import Design

ACTIONS = ("check", "show", "export")
MEMBERS = ("flexspline", "circular_spline")


def configure(parser: argparse.ArgumentParser) -> None:
    """Action, designs and output folder."""
    parser.add_argument(
        "action",
        choices=ACTIONS,
        help="check: figures against their limits; show: picture; export: DXF and CSV",
    )
    parser.add_argument(
        "designs",
        metavar="DESIGN",
        nargs="+",
        help="design file, bundled name, or size-NN-RRR; several for check",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="show writes design.png there; export outlines.dxf and one CSV per part",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Check designs; draw or export one.

    Returns:
        ``feasible``, ``checks`` (list of name, ok, value, unit, limit; with several
        designs also ``design``), ``design`` or ``designs``, ``files``.
    """
    if args.action == "check":
        if args.out:
            raise InputError("design check writes nothing: leave out --out")
        return _check(args.designs)
    if len(args.designs) > 1:
        raise InputError(
            f"design {args.action} takes one DESIGN, not {len(args.designs)}"
        )
    if not args.out:
        raise InputError(f"design {args.action} needs --out DIR")
    folder = output_folder(args.out)
    from swgjoint.gear.check import raise_faults
    from swgjoint.gear.design import Design
    from swgjoint.gear.feasibility import design_checks

    design = Design.load(args.designs[0])
    checks = design_checks(design)
    raise_faults(checks)
    result: dict[str, Any] = {
        "action": args.action,
        "design": design.drive.name,
        "feasible": True,
        "checks": [_row(check) for check in checks],
    }
    if args.action == "show":
        result |= _show(design, folder)
    else:
        result |= _export(design, folder)
    return result


def report(result: dict[str, Any]) -> str:
    """One row per check, or one per design if there are several."""
    lines: list[str] = []
    rows: list[tuple[object, ...]]
    if result["action"] != "check":
        count = len(result["checks"])
        lines = [f"{result['design']}: feasible, {count} checks passed"]
    elif "designs" in result:
        rows = [
            (
                one["design"],
                "feasible" if one["feasible"] else "INFEASIBLE",
                len(one["checks"]),
            )
            for one in result["designs"]
        ]
        lines = [table(rows, header=("design", "", "checks"))]
    else:
        word = "feasible" if result["feasible"] else "INFEASIBLE"
        rows = [
            (
                check["name"],
                check["value"],
                check["limit"],
                check["unit"],
                "ok" if check["ok"] else "BAD",
            )
            for check in result["checks"]
        ]
        lines = [
            f"{result['design']}: {word}",
            table(rows, header=("", "value", "limit", "unit", "")),
        ]
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])


def status(result: dict[str, Any]) -> int:
    """2 if a design cannot be built."""
    return 0 if result["feasible"] else 2


def _row(check: Check) -> dict[str, Any]:
    return {
        "name": check.name,
        "ok": check.ok,
        "value": check.value,
        "unit": check.unit,
        "limit": check.limit,
    }


def _check(references: list[str]) -> dict[str, Any]:
    """Checks of every design; one line on stderr for each fault."""
    designs = [_checked(reference) for reference in references]
    for design in designs:
        for line in design.pop("faults"):
            print(f"swgjoint design: {line}", file=sys.stderr)
    if len(designs) == 1:
        return {"action": "check", **designs[0], "files": []}
    return {
        "action": "check",
        "feasible": all(design["feasible"] for design in designs),
        "checks": [
            check | {"design": design["design"]}
            for design in designs
            for check in design["checks"]
        ],
        "designs": designs,
        "files": [],
    }


def _checked(reference: str) -> dict[str, Any]:
    """Checks of one design; a file that cannot be read is a failed check."""
    from swgjoint.gear.design import Design
    from swgjoint.gear.feasibility import design_checks

    try:
        design = Design.load(reference)
    except DesignError as error:
        faults = str(error).splitlines()
        unread = {"ok": False, "value": None, "unit": "", "limit": None}
        checks = [{"name": "design file can be read", **unread}]
        return {
            "design": reference,
            "feasible": False,
            "checks": checks,
            "faults": faults,
        }
    found = design_checks(design)
    return {
        "design": design.drive.name,
        "feasible": all(check.ok for check in found),
        "checks": [_row(check) for check in found],
        "faults": [
            line for check in found if not check.ok for line in check.fault.splitlines()
        ],
    }


def _show(design: Design, folder: Path) -> dict[str, Any]:
    """Pictures of the design and of the passage of a rigid tooth, with its numbers."""
    from swgjoint.gear.tooth_path import tooth_path
    from swgjoint.units import deg, um
    from swgjoint.view.design_plots import design_picture
    from swgjoint.view.tooth_path_plots import tooth_path_picture

    pictures = {"design.png": design_picture(design)}
    try:
        path = tooth_path(design)
    except DesignError as error:  # a rim on rollers has no outline to follow
        numbers: dict[str, Any] = {"missing": str(error)}
    else:
        pictures["tooth-path.png"] = tooth_path_picture(design, path)
        numbers = {
            "smallest_clearance_um": path.smallest_clearance / um,
            "interference_um": path.interference / um,
            "where": path.where[path.worst],
            "angle_deg": float(path.theta[path.worst]) / deg,
            "engaged_deg": path.engaged / deg,
        }
    folder.mkdir(parents=True, exist_ok=True)
    files = [str(write_whole(folder / name, data)) for name, data in pictures.items()]
    return {"tooth_path": numbers, "files": files}


def _export(design: Design, folder: Path) -> dict[str, Any]:
    from swgjoint.gear.export import (
        csv_text,
        dxf_text,
        tooth_curve,
        wave_generator_curves,
    )
    from swgjoint.gear.profile import tooth_profile
    from swgjoint.gear.wave_generator import wave_generator

    curves = {
        member: [tooth_curve(tooth_profile(design, member))] for member in MEMBERS
    }
    curves["wave_generator"] = wave_generator_curves(wave_generator(design))
    texts = {"outlines.dxf": dxf_text(curves)}
    texts |= {f"{layer}.csv": csv_text(members) for layer, members in curves.items()}
    folder.mkdir(parents=True, exist_ok=True)
    files = [str(write_whole(folder / name, text)) for name, text in texts.items()]
    points = {
        layer: sum(len(curve.points) for curve in members)
        for layer, members in curves.items()
    }
    return {"points": points, "files": files}
