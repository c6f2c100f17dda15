"""``swgjoint optimise``: search for Pareto-optimal designs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.places import configure_places, places_of
from swgjoint.cli.shared.text import short_headers, table
from swgjoint.cli.shared.validity_text import validity_lines
from swgjoint.csv_text import csv_text
from swgjoint.json_text import json_text

if TYPE_CHECKING:
    from swgjoint.explore.optimise.optimise import Optimum
    from swgjoint.explore.sweep.results import ResultStore


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: optimisation file, executor, store of the results."""
    parser.epilog = (
        "Repeat the same command to resume an interrupted search; results of designs"
        " that were already computed are reused. Seed, population and number of designs"
        " are set in FILE."
    )
    parser.add_argument(
        "file", metavar="FILE", help="optimisation file or bundled name"
    )
    configure_places(
        parser,
        out="store the results in this folder, and write the Pareto-optimal designs"
        " (front-01.toml, ...), tried.csv, optimise.png and optimise.json",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Search, and recompute some designs of the front more accurately.

    Returns:
        ``front`` (Pareto-optimal designs, sorted by the first objective: values of the
        parameters, figures, ``missed`` (figures whose limit they miss), ``confirmed``
        figures or null, ``not_worse_than``, the names of compared designs that are not
        better in any objective, and ``beaten_by``, the names of designs within the
        limits that are not worse in any objective and better in one),
        ``evaluations``, ``failed``, ``generations``, ``reused``, ``computed``,
        ``workers``, ``work_s``, ``wall_s``, ``objectives``, ``parameters``,
        ``figures``, ``validity``, ``start``, ``beside`` (compared designs), ``rows``
        (all designs that were tried), ``files``.
    """
    from swgjoint.explore.optimise.file import OptimisationFile
    from swgjoint.explore.optimise.optimise import optimise

    place, executor_of = places_of(args)
    file = OptimisationFile.load(args.file)
    with executor_of(file) as executor:
        optimum = optimise(file, executor=executor, place=place, progress=args.progress)
    result = {"optimisation": args.file, **optimum.to_json(), "files": []}
    if args.out is not None and place is not None:
        result["files"] = _write(place, optimum, result)
    return result


def _write(place: ResultStore, optimum: Optimum, result: dict[str, Any]) -> list[str]:
    """Write the designs of the front, the table of all designs, a plot and JSON."""
    from swgjoint.explore.sweep.results import write_to
    from swgjoint.view.plots.optimise import optimum_picture

    rows = [
        {key: value for key, value in row.items() if key != "confirmed"}
        for row in result["rows"]
    ]
    designs = optimum.designs(result["optimisation"])
    files = write_to(
        place,
        {_front(k): design.to_toml().encode for k, design in enumerate(designs)}
        | {
            "tried.csv": csv_text(rows).encode,
            "optimise.png": lambda: optimum_picture(optimum),
        },
    )
    # remove files of a longer front that an earlier search left in the folder
    left = len(designs)
    while place.read(_front(left)) is not None:
        place.remove(_front(left))
        left += 1
    last = "optimise.json"  # written last, because it lists the other files
    content = {**result, "files": [*files, place.path_of(last)]}
    return files + write_to(place, {last: (json_text(content) + "\n").encode})


def _front(k: int) -> str:
    """File name of a design of the front; ``k`` counts from 0."""
    return f"front-{k + 1:02d}.toml"


def report(result: dict[str, Any]) -> str:
    """Format the compared designs, the Pareto front, remarks and the counts."""
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
        "*: confirmed by a more accurate computation; others: as found by the search"
        if care
        else "",
    ]
    named = [(row["design"], row) for row in rivals]
    named += [(f"front {k + 1}", row) for k, row in enumerate(result["front"])]
    lines += [
        f"{name}: {record['outcome']}: {record['reason']}"
        for name, row in named
        if (record := row["confirmed"] or row)["outcome"] != "ok"
    ]
    lines += [
        f"{name}: its {'confirmed ' * _is_confirmed(row)}values miss the limit of"
        f" {', '.join(row['missed'])}"
        for name, row in named
        if row["missed"]
    ]
    for k, row in enumerate(result["front"]):
        if row["not_worse_than"]:
            others = ", ".join(row["not_worse_than"])
            lines.append(
                f"front {k + 1} is at least as good in all objectives as {others}"
            )
        if row["beaten_by"]:
            others = ", ".join(row["beaten_by"])
            lines.append(f"front {k + 1} is not Pareto-optimal; better: {others}")
    lines += validity_lines(result["validity"])
    lines.append(
        f"{result['evaluations']} designs tried in {result['generations']} generations,"
        f" {result['failed']} failed; {result['computed']} computed,"
        f" {result['reused']} reused, {result['wall_s']:.0f} s"
    )
    return "\n".join(
        [*(x for x in lines if x), *(f"wrote {f}" for f in result["files"])]
    )


def _best(row: dict[str, Any], figures: list[str]) -> list[str]:
    """Figures of a design as text, with a star if they are confirmed."""
    best, mark = (row["confirmed"], "*") if _is_confirmed(row) else (row, "")
    return ["" if (v := best[name]) is None else f"{v:.5g}{mark}" for name in figures]


def _is_confirmed(row: dict[str, Any]) -> bool:
    """Whether the figures of a design come from the confirmation."""
    return row["confirmed"] is not None and row["confirmed"]["outcome"] == "ok"
