"""``swgjoint design``: check, plot, export and rescale designs."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.arm_arguments import add_overrides
from swgjoint.cli.shared.text import table
from swgjoint.errors import DesignError, InputError
from swgjoint.files import Outputs, check_output_file, output_folder, write_whole

if TYPE_CHECKING:
    from swgjoint.gear.design.check import Check
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.teeth.tooth_path import ToothPath

ACTIONS = ("check", "show", "export", "new")
ONLY_NEW = ("teeth", "module", "name", "overrides", "output")
"""Options that only ``new`` accepts."""
MEMBERS = ("flexspline", "circular_spline")
UNREAD = "design file can be read"
"""Name of the check that fails if a file is not a valid design."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: action, designs, output and the options of ``new``."""
    parser.add_argument(
        "action",
        choices=ACTIONS,
        help="check: test whether DESIGN can be built; show: plot DESIGN; export:"
        " write its outlines as DXF and CSV; new: scale DESIGN to another tooth count"
        " or module and write the result to a new file",
    )
    parser.add_argument(
        "designs",
        metavar="DESIGN",
        nargs="+",
        help="design file, bundled name, or size-NN-RRR (size and ratio); check accepts"
        " several",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="output folder: show writes design.png and tooth-path.png, export writes"
        " outlines.dxf and one CSV file per part",
    )
    new = parser.add_argument_group("options of new")
    new.add_argument(
        "--teeth",
        metavar="FS/CS",
        help="numbers of teeth of flexspline and circular spline, e.g. 160/162",
    )
    new.add_argument("--module", type=float, metavar="MM", help="module [mm]")
    new.add_argument(
        "--name", help="name of the new design; default: the name of the output file"
    )
    add_overrides(new, "set a value after scaling, e.g. flexspline.rim_mm=0.5")
    new.add_argument(
        "-o", "--output", metavar="FILE.toml", help="file of the new design"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Check designs, or plot, export or scale one design.

    Returns:
        ``action``, ``feasible``, ``checks`` (list of objects with name, ok, value,
        unit, limit, numerical; for several designs also ``design``), ``design`` or
        ``designs``, ``tooth_path`` (passage of a rigid tooth), ``defaults`` (default
        values of keys that the file does not state), ``files``; for ``export`` also
        ``points`` (number of points by part); for ``new`` also ``factors`` and
        ``moved`` (values changed because scaling alone made the design infeasible).

    Raises:
        InputError: If an option does not fit the action.
        DesignError: If a design to show, export or scale is not feasible.
    """
    new_options = [name for name in ONLY_NEW if getattr(args, name)]
    if args.action != "new" and new_options:
        option = {"overrides": "set"}.get(new_options[0], new_options[0])
        raise InputError(
            f"--{option} does not apply to design {args.action}; accepted with design"
            " new"
        )
    if args.action == "check":
        if args.out:
            raise InputError(
                "--out does not apply to design check, which writes no files; accepted"
                " with design show or design export"
            )
        return _check(args.designs)
    if len(args.designs) > 1:
        raise InputError(
            f"design {args.action}: {len(args.designs)} designs; accepted: one DESIGN"
        )
    if args.action == "new":
        return _new(args)
    if not args.out:
        raise InputError(
            f"design {args.action} writes files and needs a folder; accepted: with"
            " --out DIR"
        )
    folder = output_folder(args.out)
    from swgjoint.gear.design.check import raise_faults
    from swgjoint.gear.design.defaults import defaults_taken
    from swgjoint.gear.design.design import Design

    design = Design.load(args.designs[0])
    checks, path = _all_checks(design)
    raise_faults(checks)
    result: dict[str, Any] = {
        "action": args.action,
        "design": design.drive.name,
        "feasible": True,
        "checks": [_row(check) for check in checks],
        "defaults": defaults_taken(design),
    }
    if args.action == "show":
        result |= _show(design, path, folder)
    else:
        result |= _export(design, folder)
    return result


def _new(args: argparse.Namespace) -> dict[str, Any]:
    """Scale a design, make it feasible and write it to a file."""
    if args.out:
        raise InputError(
            "--out does not apply to design new; accepted: with -o FILE.toml"
        )
    if not args.output:
        raise InputError(
            "design new writes a file and needs its name; accepted: with -o FILE.toml"
        )
    path = check_output_file(args.output, ".toml")
    template = args.designs[0]
    if path.exists() and os.path.exists(template) and path.samefile(template):
        raise InputError(
            f"output file {str(path)!r} is the design itself; accepted: another file"
        )
    teeth = _teeth(args.teeth) if args.teeth else None
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.design.scaling import scaled_design
    from swgjoint.sim.scene.overrides import parse_override

    scaled = scaled_design(
        Design.load(args.designs[0]),
        name=args.name or path.stem,
        teeth=teeth,
        module=args.module,
        changes=dict(map(parse_override, args.overrides)),
    )
    checks, passage = _all_checks(scaled.design)
    write_whole(path, scaled.design.to_toml())
    return {
        "action": "new",
        "design": scaled.design.drive.name,
        "feasible": True,
        "checks": [_row(check) for check in checks],
        "factors": scaled.factors,
        "moved": [
            {
                "key": one.key,
                "scaled": one.bound.rejected,
                "value": one.value,
                "at_most" if one.bound.sign == "<=" else "at_least": one.bound.accepted,
                "text": str(one),
            }
            for one in scaled.moved
        ],
        "tooth_path": _path_numbers(passage),
        "files": [str(path)],
    }


def _teeth(text: str) -> tuple[int, int]:
    """Numbers of teeth of flexspline and circular spline from ``160/162``."""
    flexspline, slash, circular = text.partition("/")
    if not slash or not (flexspline.isdecimal() and circular.isdecimal()):
        raise InputError(
            f"--teeth {text!r}; accepted: numbers of teeth of flexspline and circular"
            " spline, e.g. 160/162"
        )
    return int(flexspline), int(circular)


def report(result: dict[str, Any]) -> str:
    """Format one row per check, or one row per design if there are several."""
    lines: list[str] = []
    rows: list[tuple[object, ...]]
    if result["action"] != "check":
        count = len(result["checks"])
        lines = [
            f"{result['design']}: feasible, {count} checks passed",
            *(
                f"changed to make the design feasible: {one['text']}"
                for one in result.get("moved", ())
            ),
            *_remarks(result),
        ]
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
            if not (check["numerical"] and check["ok"])
        ]
        lines = [
            f"{result['design']}: {word}",
            table(rows, header=("", "value", "limit", "unit", "")),
            *_remarks(result),
        ]
        if all(check["name"] == UNREAD for check in result["checks"]):
            lines = [f"{result['design']}: cannot be read"]
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])


def _remarks(result: dict[str, Any]) -> list[str]:
    """Remarks on the overlap of the flanks and on default values."""
    lines = []
    path = result.get("tooth_path", {})
    if path.get("interference_um"):
        lines.append(
            f"rigid flanks overlap by {path['interference_um']:.3g} µm at"
            f" {path['angle_deg']:.3g} deg from the lobe ({path['where']}); the parts"
            " must deform elastically by this amount"
        )
    if "missing" in path:
        lines.append(f"clearance of the flanks during engagement: {path['missing']}")
    taken = result.get("defaults", {})
    if set(taken) >= {"material.youngs_modulus_GPa", "material.poisson_ratio"}:
        lines.append("material is not stated; steel is assumed")
    if taken:
        values = ", ".join(f"{key} = {value}" for key, value in taken.items())
        lines.append(f"default values used: {values}")
    return lines


def status(result: dict[str, Any]) -> int:
    """Return 2 if a design cannot be built, else 0."""
    return 0 if result["feasible"] else 2


def _row(check: Check) -> dict[str, Any]:
    return {
        "name": check.name,
        "ok": check.ok,
        "value": check.value,
        "unit": check.unit,
        "limit": check.limit,
        "numerical": check.numerical,
    }


def _all_checks(design: Design) -> tuple[list[Check], ToothPath | str]:
    """All checks of a design, and the passage of a rigid tooth.

    The passage is replaced by a reason if the design cannot be built or if its rim has
    no outline to follow.
    """
    from swgjoint.gear.design.feasibility import design_checks, engagement_checks
    from swgjoint.gear.teeth.tooth_path import tooth_path

    checks = design_checks(design)
    if not all(check.ok for check in checks):
        return checks, "not computed for a design that cannot be built"
    try:
        path = tooth_path(design)
    except DesignError as error:  # a rim on rollers has no outline to follow
        return checks, str(error)
    return [*checks, *engagement_checks(design, path)], path


def _path_numbers(path: ToothPath | str) -> dict[str, Any]:
    """Key figures of the passage of a rigid tooth, or the reason why it is missing."""
    from swgjoint.units import deg, um

    if isinstance(path, str):
        return {"missing": path}
    return {
        "smallest_clearance_um": path.smallest_clearance / um,
        "interference_um": path.interference / um,
        "where": path.where[path.worst],
        "angle_deg": float(path.theta[path.worst]) / deg,
        "engaged_deg": path.engaged / deg,
    }


def _check(references: list[str]) -> dict[str, Any]:
    """Check every design and print one line on stderr for each fault."""
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
    """Check one design; a file that cannot be read counts as a failed check."""
    from swgjoint.gear.design.defaults import defaults_taken
    from swgjoint.gear.design.design import Design

    try:
        design = Design.load(reference)
    except DesignError as error:
        faults = str(error).splitlines()
        unread = {"ok": False, "value": None, "unit": "", "limit": None}
        checks = [{"name": UNREAD, **unread, "numerical": False}]
        return {
            "design": reference,
            "feasible": False,
            "checks": checks,
            "faults": faults,
        }
    results, path = _all_checks(design)
    return {
        "design": design.drive.name,
        "feasible": all(check.ok for check in results),
        "checks": [_row(check) for check in results],
        "faults": [
            line
            for check in results
            if not check.ok
            for line in check.fault.splitlines()
        ],
        "tooth_path": _path_numbers(path),
        "defaults": defaults_taken(design),
    }


def _show(design: Design, path: ToothPath | str, folder: Path) -> dict[str, Any]:
    """Plot the design and the passage of a rigid tooth; return its key figures."""
    from swgjoint.view.plots.design import design_picture
    from swgjoint.view.plots.tooth_path import tooth_path_picture

    outputs = Outputs(folder)
    outputs.write("design.png", lambda: design_picture(design))
    if not isinstance(path, str):
        outputs.write("tooth-path.png", lambda: tooth_path_picture(design, path))
    return {"tooth_path": _path_numbers(path), "files": outputs.files}


def _export(design: Design, folder: Path) -> dict[str, Any]:
    from swgjoint.gear.design.export import (
        curves_csv,
        dxf_text,
        tooth_curve,
        wave_generator_curves,
    )
    from swgjoint.gear.teeth.tooth_profile import tooth_profile
    from swgjoint.gear.wave_generators.wave_generator import wave_generator

    curves = {
        member: [tooth_curve(tooth_profile(design, member))] for member in MEMBERS
    }
    curves["wave_generator"] = wave_generator_curves(wave_generator(design))
    texts = {"outlines.dxf": dxf_text(curves)}
    texts |= {f"{layer}.csv": curves_csv(members) for layer, members in curves.items()}
    folder.mkdir(parents=True, exist_ok=True)
    files = [str(write_whole(folder / name, text)) for name, text in texts.items()]
    points = {
        layer: sum(len(curve.points) for curve in members)
        for layer, members in curves.items()
    }
    return {"points": points, "files": files}
