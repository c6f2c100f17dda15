"""``swgjoint compare``: drives or levels side by side in one scene."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from swgjoint.cli.text import table
from swgjoint.errors import InputError
from swgjoint.files import output_folder, write_whole
from swgjoint.json_text import json_text


def configure(parser: argparse.ArgumentParser) -> None:
    """What to compare, where, how to sort, what to ask for."""
    parser.add_argument(
        "arguments",
        metavar="A",
        nargs="+",
        help="designs, .swg maps, catalogue drives, or levels such as full",
    )
    parser.add_argument(
        "--scene", default="bench", help="scene file or bundled name; default bench"
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="overrides",
        help="change a key of the scene; repeatable",
    )
    parser.add_argument("--model", choices=("ring", "2d", "3d"), help="of designs")
    parser.add_argument("--sort", metavar="KEY", help="best first by this figure")
    parser.add_argument(
        "--spec",
        metavar="FILE",
        help="TOML file with a table [spec] of limits; exit status 1 if one is missed",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write compare.json, a picture, the report and a recording of all runs",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the scene for every argument.

    Returns:
        ``scene``, ``rows``, ``spec``, ``passed`` (null without a spec), ``files``.
    """
    folder = output_folder(args.out) if args.out else None
    from swgjoint.sim.scene import Scene
    from swgjoint.study.compare import LOWER, SLOW, SORTABLE, compare, read_spec
    from swgjoint.study.compare_shown import columns, left_out_notes

    if args.sort is not None and args.sort not in SORTABLE:
        raise InputError(f"--sort {args.sort}; accepted: {', '.join(SORTABLE)}")
    spec = read_spec(args.spec) if args.spec else None
    scene = Scene.load_file(args.scene, args.overrides)
    rows = compare(
        args.arguments,
        scene,
        model=args.model,
        spec=spec,
        fatigue=SLOW in {args.sort, *(spec or {})},
        progress=args.progress,
    )
    if args.sort is not None:
        sign = -1.0 if args.sort in LOWER else 1.0
        known = [row for row in rows if row.told(args.sort) is not None]
        known.sort(key=lambda row: sign * float(row.told(args.sort)))
        rows = known + [row for row in rows if row not in known]
    result: dict[str, Any] = {
        "scene": scene.name,
        "rows": [row.to_json() for row in rows],
        "spec": spec,
        "passed": None if spec is None else not any(row.missed for row in rows),
        "columns": columns(rows),
        "notes": left_out_notes(rows),
        "files": [],
    }
    if folder is not None:
        result["files"] = _write(folder, result, rows, spec, args.progress)
    return result


def _write(
    folder: Path, result: dict[str, Any], rows: Any, spec: Any, progress: Any
) -> list[str]:
    """Picture, figures, report and recording."""
    from swgjoint.study.compare_shown import comparison_picture, comparison_table
    from swgjoint.view.recording import write_recording
    from swgjoint.view.report import write_report

    folder.mkdir(parents=True, exist_ok=True)
    picture = comparison_picture(rows, result["scene"], spec)
    runs: dict[str, Any] = {}
    for row in rows:  # an argument may be given twice, a run of the report has one name
        again = sum(name.split(" (again")[0] == row.argument for name in runs)
        runs[f"{row.argument} (again {again})" if again else row.argument] = row.run
    report = write_report(
        runs,
        folder / "report.html",
        summary=comparison_table(rows, spec),
        pictures={"Figures side by side": picture},
        progress=progress,
    )
    files = [
        write_whole(folder / "compare.png", picture),
        write_whole(folder / "compare.json", json_text(result) + "\n"),
        report,
        write_recording(runs, folder / "run.rrd"),
    ]
    return [str(path) for path in files]


def status(result: dict[str, Any]) -> int:
    """1 where a limit of the spec is missed or a run is not valid."""
    from swgjoint.sim.verdict import VALID

    valid = all(row["verdict"] == VALID for row in result["rows"])
    return int(result["passed"] is False or not valid)


def report(result: dict[str, Any]) -> str:
    """One line an argument, then what misses the spec."""
    from swgjoint.study.compare_shown import cell

    columns, spec = result["columns"], result["spec"]
    verdict = [] if spec is None else ["spec"]
    header = ("", "level", *(name for name, _ in columns.values()), *verdict)
    units = ("", "", *(unit for _, unit in columns.values()), *[""] * len(verdict))
    rows = [
        (
            row["argument"],
            row["level"],
            *(cell(row, key) for key in columns),
            *(["MISSED" if row["missed"] else "kept"] if verdict else []),
        )
        for row in result["rows"]
    ]
    lines = [
        f"scene {result['scene']}, worst joint; K1 and stress of the drive",
        table([units, *rows], header=header),
        *result["notes"],
    ]
    for row in result["rows"]:
        lines += [f"{row['argument']}: {row['verdict']}: {r}" for r in row["reasons"]]
        for key in row["missed"]:
            lines.append(
                f"{row['argument']}: {key} {cell(row, key)}, limit {spec[key]:g}"
            )
    if result["passed"]:
        lines.append("every limit of the spec is kept")
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])
