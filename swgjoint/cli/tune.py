"""``swgjoint tune``: tune a controller in an environment, and compare the result."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.shared.arm_arguments import add_overrides
from swgjoint.cli.shared.text import table
from swgjoint.files import output_folder


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: environment, controller, optimiser, budget, output folder."""
    parser.add_argument(
        "environment",
        metavar="ENV",
        help="environment: JointTracking-v0, RippleSuppression-v0 or ArmTracking-v0",
    )
    parser.add_argument(
        "--controller",
        metavar="NAME",
        default="pd-flexible",
        help="controller to tune: pd, pd-feedforward, pd-flexible (default),"
        " compensation (of RippleSuppression-v0), or a class or function of your own as"
        " FILE.py:NAME",
    )
    parser.add_argument(
        "--optimiser",
        metavar="NAME",
        default="de",
        help="optimiser: de (differential evolution, default), cma (CMA-ES) or optuna"
        " (TPE)",
    )
    parser.add_argument(
        "--minutes", type=float, metavar="M", help="wall time [min]; default: 3"
    )
    parser.add_argument(
        "--evaluations",
        type=int,
        metavar="N",
        help="number of candidates; replaces --minutes and makes the result independent"
        " of the speed of the machine",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="random seed; default: 0"
    )
    add_overrides(
        parser,
        "set an argument of the environment, e.g. drive=CSG-20-100 or randomise=false",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write report.html, tune.png and tune.json to this folder, and after every"
        " generation tune.npz, from which the same command resumes after an"
        " interruption",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="require tune.npz in --out DIR and resume from it; without this option, a"
        " tune.npz with the same settings is resumed if there is one",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Tune a controller.

    Returns:
        ``best`` and ``baseline`` (``parameters``, ``gains``, ``held_out_cost_arcmin``,
        of an arm ``held_out_cost_mm``, and more), ``evaluations``,
        ``improvement_percent``, ``candidates`` (including the untuned controller and,
        where there is no motor loop, PD with only its gains tuned), ``summary``,
        ``seeds``, ``bounds``, ``files``, ``wall_s`` and the settings.
    """
    folder = output_folder(args.out) if args.out else None
    from swgjoint.explore.tune.result import TuneSettings
    from swgjoint.explore.tune.tune import tune
    from swgjoint.sim.scene.overrides import parse_override
    from swgjoint.view.plots.tune import claims, write_files

    settings = TuneSettings(
        environment=args.environment,
        controller=args.controller,
        optimiser=args.optimiser,
        minutes=args.minutes,
        evaluations=args.evaluations,
        seed=args.seed,
        arguments=dict(map(parse_override, args.overrides)),
    )
    tuned = tune(settings, folder=folder, resume=args.resume, progress=args.progress)
    files = write_files(tuned, folder) if folder is not None else []
    return tuned.to_json() | {"summary": claims(tuned), "files": files}


def report(result: dict[str, Any]) -> str:
    """Format the candidates, the best gains and the summary."""
    unit = "mm" if "error_scale_mm" in result else "arcmin"
    costs = (
        f"held_out_cost_{unit}",
        f"held_out_spread_{unit}",
        f"training_cost_{unit}",
    )
    rows = [
        (one["name"], *(one[key] for key in costs), one["improvement_percent"])
        for one in result["candidates"]
    ]
    header = (
        "",
        f"held-out cost [{unit}]",
        f"spread [{unit}]",
        f"training cost [{unit}]",
        "improvement [%]",
    )
    best = result["best"]
    gains = [*best["parameters"].items(), *best["gains"].items()]
    lines = [
        f"{result['controller']} in {result['environment']}",
        table(rows, header=header),
        "",
        table(gains),
        "",
        *result["summary"],
        *(f"wrote {name}" for name in result["files"]),
    ]
    return "\n".join(
        [*lines, f"{result['evaluations']} candidates, {result['wall_s']:.0f} s"]
    )
