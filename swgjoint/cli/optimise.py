"""``swgjoint optimise``: designs that are good in several figures at once."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.places import configure_places, places_of
from swgjoint.cli.shared.text import short_headers, table
from swgjoint.csv_text import csv_text
from swgjoint.json_text import json_text

if TYPE_CHECKING:
    from swgjoint.explore.optimise.optimise import Optimum
    from swgjoint.explore.sweep.results import ResultStore


def configure(parser: argparse.ArgumentParser) -> None:
    """File of the search, where it is computed, where results are kept."""
    parser.epilog = (
        "A search that was stopped goes on with the same command: designs that were"
        " computed are kept. Seed, population and number of designs are in FILE."
    )
    parser.add_argument(
        "file", metavar="FILE", help="optimisation file or bundled name"
    )
    configure_places(
        parser,
        out="keep results there, with the designs of the front (front-01.toml, ...),"
        " tried.csv, optimise.png and optimise.json",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Search, and compute some of the front again with more care.

    Returns:
        ``front`` (designs that no other one beats, by the first objective: values of
        the parameters, figures, ``confirmed`` figures or null, ``not_worse_than``, in
        every objective, of the designs beside), ``evaluations``, ``failed``,
        ``generations``, ``reused``, ``computed``, ``workers``, ``work_s``, ``wall_s``,
        ``objectives``, ``parameters``, ``figures``, ``validity``, ``start``,
        ``beside``, ``rows`` (all that were tried), ``files``.
    """
    from swgjoint.explore.optimise.file import OptimisationFile
    from swgjoint.explore.optimise.optimise import optimise

    place, executor_of = places_of(args)
    file = OptimisationFile.load(args.file)
    with executor_of(file) as executor:
        found = optimise(file, executor=executor, place=place, progress=args.progress)
    result = {"optimisation": args.file, **found.to_json(), "files": []}
    if args.out is not None and place is not None:
        result["files"] = _write(place, found, result)
    return result


def _write(place: ResultStore, found: Optimum, result: dict[str, Any]) -> list[str]:
    """Designs of the front, all that were tried, the picture, the whole as JSON."""
    from swgjoint.explore.sweep.results import write_to
    from swgjoint.view.plots.optimise import optimum_picture

    rows = [
        {key: value for key, value in row.items() if key != "confirmed"}
        for row in result["rows"]
    ]
    designs = found.designs(result["optimisation"])
    files = write_to(
        place,
        {_front(k): design.to_toml().encode for k, design in enumerate(designs)}
        | {
            "tried.csv": csv_text(rows).encode,
            "optimise.png": lambda: optimum_picture(found),
        },
    )
    # a longer front that an earlier search left there is none of this one
    left = len(designs)
    while place.read(_front(left)) is not None:
        place.remove(_front(left))
        left += 1
    last = "optimise.json"  # which names them all
    content = {**result, "files": [*files, place.path_of(last)]}
    return files + write_to(place, {last: (json_text(content) + "\n").encode})


def _front(k: int) -> str:
    """File of a design of the front, counted from 0."""
    return f"front-{k + 1:02d}.toml"


def report(result: dict[str, Any]) -> str:
    """The start and the compared designs, the Pareto front, and all designs tried."""
    names, figures = result["parameters"], result["figures"]
    rivals = [result["start"], *result["beside"]]
    header = ("", *short_headers(names), *short_headers(figures))
    rows = [(r["design"], *("" for _ in names), *_best(r, figures)) for r in rivals]
    rows += [
        (f"front {k + 1}", *(r[n] for n in names), *_best(r, figures))
        for k, r in enumerate(result["front"])
    ]
    goals = [f"{figure}: {goal}" for figure, goal in result["objectives"].items()]
    care = any(row["confirmed"] is not None for row in rivals)
    lines = [
        ", ".join(goals),
        table(rows, header=header),
        "*: confirmed; the rest as the search has seen it" if care else "",
    ]
    named = [(row["design"], row) for row in rivals]
    named += [(f"front {k + 1}", row) for k, row in enumerate(result["front"])]
    lines += [
        f"{name}: {record['outcome']}: {record['reason']}"
        for name, row in named
        if (record := row["confirmed"] or row)["outcome"] != "ok"
    ]
    lines += [
        f"{name}: confirmed, it misses the limit of {', '.join(row['missed'])}"
        for name, row in named
        if row["missed"]
    ]
    for k, row in enumerate(result["front"]):
        if row["not_worse_than"]:
            told = ", ".join(row["not_worse_than"])
            lines.append(f"front {k + 1} is in no objective worse than {told}")
    for task, label in result["validity"].items():
        absent = [f"{part}: {what}" for part, what in label["not_modelled"].items()]
        told = "; ".join([f"level {label['level']}, {label['torque']}", *absent])
        lines.append(f"validity of {task}: {told}")
    lines.append(
        f"{result['evaluations']} designs tried in {result['generations']} generations,"
        f" {result['failed']} of them without figures; {result['computed']} computed,"
        f" {result['reused']} reused, {result['wall_s']:.0f} s"
    )
    return "\n".join(
        [*(x for x in lines if x), *(f"wrote {f}" for f in result["files"])]
    )


def _best(row: dict[str, Any], figures: list[str]) -> list[str]:
    """Figures of a design, with a star where they are confirmed."""
    confirmed = row["confirmed"]
    ok = confirmed is not None and confirmed["outcome"] == "ok"
    best, mark = (confirmed, "*") if ok else (row, "")
    return ["" if (v := best[name]) is None else f"{v:.5g}{mark}" for name in figures]
