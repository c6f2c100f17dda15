"""``swgjoint design``: whether designs can be built, pictures, outlines, new ones."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.text import table
from swgjoint.errors import DesignError, InputError
from swgjoint.files import Outputs, check_output_file, output_folder, write_whole

if TYPE_CHECKING:
    from swgjoint.gear.design.check import Check
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.teeth.tooth_path import ToothPath

ACTIONS = ("check", "show", "export", "new")
ONLY_NEW = ("teeth", "module", "name", "overrides", "output")
"""Options that belong to ``new``."""
MEMBERS = ("flexspline", "circular_spline")
UNREAD = "design file can be read"


def configure(parser: argparse.ArgumentParser) -> None:
    """Action, designs and output folder."""
    parser.add_argument(
        "action",
        choices=ACTIONS,
        help="check: compare figures with their limits; show: draw a picture;"
        " export: write DXF and CSV; new: scale DESIGN to another tooth count or"
        " module and write its file",
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
    new = parser.add_argument_group("new")
    new.add_argument(
        "--teeth", metavar="FS/CS", help="of flexspline and circular spline: 160/162"
    )
    new.add_argument("--module", type=float, metavar="MM", help="module [mm]")
    new.add_argument("--name", help="name of the design; default: that of the file")
    new.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="overrides",
        help="change a value after scaling, e.g. flexspline.rim_mm=0.5; repeatable",
    )
    new.add_argument("-o", "--output", metavar="FILE.toml", help="file to write")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Check designs; draw, export or scale one.

    Returns:
        ``feasible``, ``checks`` (list of name, ok, value, unit, limit; with several
        designs also ``design``), ``design`` or ``designs``, ``tooth_path`` (passage of
        a rigid tooth), ``defaults`` (values that the file does not state), ``files``;
        of ``new`` also ``factors`` and ``moved`` (values that scaling alone made
        infeasible).
    """
    given = [name for name in ONLY_NEW if getattr(args, name)]
    if args.action != "new" and given:
        option = {"overrides": "set"}.get(given[0], given[0])
        raise InputError(f"design {args.action} takes no --{option}: accepted by new")
    if args.action == "check":
        if args.out:
            raise InputError("design check writes nothing: leave out --out")
        return _check(args.designs)
    if len(args.designs) > 1:
        raise InputError(
            f"design {args.action} takes one DESIGN, not {len(args.designs)}"
        )
    if args.action == "new":
        return _new(args)
    if not args.out:
        raise InputError(f"design {args.action} needs --out DIR")
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
    """Scale a design, make it feasible and write it."""
    if args.out:
        raise InputError("design new writes one file: --output FILE.toml, not --out")
    if not args.output:
        raise InputError("design new needs -o FILE.toml")
    path = check_output_file(args.output, ".toml")
    teeth = _teeth(args.teeth) if args.teeth else None
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.design.scaling import scaled_design
    from swgjoint.sim.scene.scene import parse_override

    found = scaled_design(
        Design.load(args.designs[0]),
        name=args.name or path.stem,
        teeth=teeth,
        module=args.module,
        changes=dict(map(parse_override, args.overrides)),
    )
    checks, passage = _all_checks(found.design)
    write_whole(path, found.design.to_toml())
    return {
        "action": "new",
        "design": found.design.drive.name,
        "feasible": True,
        "checks": [_row(check) for check in checks],
        "factors": found.factors,
        "moved": [
            {
                "key": one.key,
                "scaled": one.bound.rejected,
                "value": one.value,
                "at_most" if one.bound.sign == "<=" else "at_least": one.bound.accepted,
                "text": str(one),
            }
            for one in found.moved
        ],
        "tooth_path": _path_numbers(passage),
        "files": [str(path)],
    }


def _teeth(text: str) -> tuple[int, int]:
    """Teeth of both members from ``160/162``."""
    flexspline, slash, circular = text.partition("/")
    if not slash or not (flexspline.isdecimal() and circular.isdecimal()):
        raise InputError(
            f"--teeth {text!r}; accepted: teeth of flexspline and circular spline, e.g."
            " 160/162"
        )
    return int(flexspline), int(circular)


def report(result: dict[str, Any]) -> str:
    """One row per check, or one per design if there are several."""
    lines: list[str] = []
    rows: list[tuple[object, ...]]
    if result["action"] != "check":
        count = len(result["checks"])
        lines = [
            f"{result['design']}: feasible, {count} checks passed",
            *(f"moved: {one['text']}" for one in result.get("moved", ())),
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
    """Overlap of the flanks, and values that the file does not state."""
    lines = []
    path = result.get("tooth_path", {})
    if path.get("interference_um"):
        lines.append(
            f"rigid flanks overlap by {path['interference_um']:.3g} µm,"
            f" {path['angle_deg']:.3g} deg from the lobe ({path['where']}): elasticity"
            " must take it up"
        )
    if "missing" in path:
        lines.append(f"clearance of the flanks over the engagement: {path['missing']}")
    taken = result.get("defaults", {})
    if set(taken) >= {"material.youngs_modulus_GPa", "material.poisson_ratio"}:
        lines.append("material of the members not stated: steel")
    if taken:
        told = ", ".join(f"{key} = {value}" for key, value in taken.items())
        lines.append(f"defaults taken: {told}")
    return lines


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
        "numerical": check.numerical,
    }


def _all_checks(design: Design) -> tuple[list[Check], ToothPath | str]:
    """Checks with those of the engagement, and the passage of a rigid tooth.

    Without a passage the reason: what cannot be built, or a rim without an outline.
    """
    from swgjoint.gear.design.feasibility import design_checks, engagement_checks
    from swgjoint.gear.teeth.tooth_path import tooth_path

    checks = design_checks(design)
    if not all(check.ok for check in checks):
        return checks, "not computed of a design that cannot be built"
    try:
        path = tooth_path(design)
    except DesignError as error:  # a rim on rollers has no outline to follow
        return checks, str(error)
    return [*checks, *engagement_checks(design, path)], path


def _path_numbers(path: ToothPath | str) -> dict[str, Any]:
    """Figures of the passage of a rigid tooth, or why there are none."""
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
    found, path = _all_checks(design)
    return {
        "design": design.drive.name,
        "feasible": all(check.ok for check in found),
        "checks": [_row(check) for check in found],
        "faults": [
            line for check in found if not check.ok for line in check.fault.splitlines()
        ],
        "tooth_path": _path_numbers(path),
        "defaults": defaults_taken(design),
    }


def _show(design: Design, path: ToothPath | str, folder: Path) -> dict[str, Any]:
    """Pictures of the design and of the passage of a rigid tooth, with its numbers."""
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
