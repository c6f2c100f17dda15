"""``swgjoint study catalogue``: the drive family compared with a catalogue.

The parts are:

- ``stiffness``: K1, K2, K3, hysteresis loss and lost motion, from thin rings with the
  bearing of the wave generator, and the share of each mechanism in the compliance;
- ``individuals``: scatter of K1, K2, K3 between individual gears with errors, from the
  same rings;
- ``accuracy``: transmission accuracy over an output turn, from the same rings;
- ``ratcheting``: ratcheting torque from 2D finite elements;
- ``losses``: no-load running and starting torque from the friction of teeth and race;
- ``experiments``, only if requested: changes of one thing at a time, which show what
  K at ratio 50 over K at ratio 100 depends on, from the same rings;
- ``coning``, only if requested: K1, K2, K3 from 3D finite elements with a rigid wave
  generator and with one on its bearing, at two ratios (about 20 CPU minutes).

``models/studies/catalogue.toml`` lists the designs. If the sources leave a choice open,
several variants are computed. ``ours`` is then the middle of their bracket, which
extends from the smallest to the largest value.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from swgjoint.gear.design.design import Design
from swgjoint.validation.catalogue.coning import (
    coning_picture,
    coning_summary,
    coning_tasks,
)
from swgjoint.validation.catalogue.experiments import (
    experiment_summary,
    experiment_tasks,
)
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design
from swgjoint.validation.catalogue.losses import loss_lines, loss_rows, loss_tasks
from swgjoint.validation.catalogue.printed import catalogue_row, edges, torques_of
from swgjoint.validation.catalogue.rows import (
    accuracy_rows,
    ratcheting_rows,
    stiffness_rows,
)
from swgjoint.validation.catalogue.runs import CatalogueTask, Found, oval, run_task
from swgjoint.validation.catalogue.shares import (
    cube_scaling,
    friction,
    individual_summary,
    shares,
)
from swgjoint.validation.catalogue.summary import (
    compare_scaling,
    ratcheting_orders,
    summary,
)
from swgjoint.validation.rows import Page, Row, StudyOptions, StudyResult
from swgjoint.validation.runner import compute_all

PARTS = ("stiffness", "individuals", "ratcheting", "accuracy", "losses")
EXTRA = ("experiments", "coning")
"""Parts that run only if requested."""
REFERENCE = 25
"""Size at which shares and friction are listed, and from which ratcheting torque and
accuracy are scaled to the other sizes."""
CHECK = (14, 80)
"""Size and ratio at which both are also computed, to check the scaling."""


def run_catalogue(options: StudyOptions) -> StudyResult:
    """Run the chosen parts, or those in :data:`PARTS` if none is chosen.

    Raises:
        InputError: If a part is unknown.
    """
    from swgjoint.view.plots.catalogue import catalogue_picture

    parts = options.chosen((*PARTS, *EXTRA) if options.only else PARTS)
    study = CatalogueFile.load("catalogue")
    tasks = [task for part in parts for task in tasks_of(study, part)]
    found = compute_all(run_task, tasks, options)
    rows = [row for part in parts for row in rows_of(study, part, found)]
    failed = {name: f["fault"] for name, f in found.items() if "fault" in f}
    lines = summary(study, rows) + loss_lines(rows)
    if "ratcheting" in parts:
        lines += ratcheting_orders(study, found, REFERENCE)
    lines += compare_scaling(study, found, REFERENCE, CHECK)
    more: dict[str, Any] = {
        "source": study.source,
        "variants": [v.name for v in study.variants],
        "computations": found,
        "failed": sorted(failed),
    }
    if "stiffness" in parts:
        more["scaling"] = cube_scaling(study, found, REFERENCE)
        more["shares"] = shares(study, found, REFERENCE)
        more["friction"] = friction(study, found, REFERENCE)
        for key in ("scaling", "shares", "friction"):
            lines += more[key]["lines"]
    if "individuals" in parts:
        more["individuals"] = individual_summary(study, found)
        lines += more["individuals"]["lines"]
    if "experiments" in parts:
        more["experiments"] = experiment_summary(study, found, REFERENCE)
        lines += more["experiments"]["lines"]
    if "coning" in parts:
        more["coning"] = coning_summary(study, found)
        lines += more["coning"]["lines"]
    lines += [f"failed: {name}: {fault}" for name, fault in failed.items()]
    pages: dict[str, Page] = {"catalogue.png": lambda: catalogue_picture(rows)}
    if "coning" in parts:
        pages["coning.png"] = lambda: coning_picture(more["coning"]["rows"])
    return StudyResult(
        rows=tuple(rows),
        summary=tuple(lines),
        more=more,
        content={"summary": lines},
        pages=pages,
    )


def tasks_of(study: CatalogueFile, part: str) -> list[CatalogueTask]:
    """Computations of a part.

    Args:
        study: Study file.
        part: One of :data:`PARTS` or :data:`EXTRA`.
    """
    if part == "losses":
        return loss_tasks(study)
    if part == "coning":
        return coning_tasks(study)
    if part == "experiments":
        return experiment_tasks(study, REFERENCE)
    flanks = {v.flank_deg: v for v in reversed(study.variants)}
    if part == "stiffness":
        sections = {v.section: v for v in reversed(study.variants)}
        tasks = [
            _path(size, ratio, variant_design(size, ratio, variant), section)
            for section, variant in sections.items()
            for ratio in study.ratios
            for size in study.sizes
        ]
        first = study.variants[0]
        for ratio in study.ratios:
            design = variant_design(REFERENCE, ratio, first)
            tight = design.with_changes({"wave_generator.bearing.clearance_um": 0.0})
            tasks.append(_path(REFERENCE, ratio, tight, f"{first.section} tight"))
        return tasks
    if part == "individuals":
        own = study.individuals
        torques = edges(catalogue_row(own.size, own.ratio))[1:]
        return [
            CatalogueTask(
                name=f"individual {seed}",
                kind="individual",
                design=study.individual(seed),
                torques=torques,
                work=8,
            )
            for seed in own.seeds
        ]
    cases = [(REFERENCE, ratio) for ratio in study.ratios] + [CHECK]
    if part == "accuracy":
        changes = {**study.individuals.changes, "tolerances.seed": 1}
        return [
            CatalogueTask(
                name=f"accuracy {size} {ratio}",
                kind="accuracy",
                design=variant_design(size, ratio, study.variants[0]).with_changes(
                    changes
                ),
                work=0.1 * ratio,
            )
            for size, ratio in cases
        ]
    tasks, first_flank = [], study.variants[0].flank_deg
    for flank, variant in flanks.items():
        for size, ratio in cases:
            design = variant_design(size, ratio, variant)
            if (size, ratio) == CHECK and flank != first_flank:
                continue
            name = f"ratcheting {size} {ratio} {flank:g}"
            tasks.append(_teeth(name, oval(design), ratio))
            if size == REFERENCE and flank == first_flank:
                tasks.append(_teeth(f"{name} fixed", design, 0.5 * ratio))
                tasks += [
                    _teeth(f"{name} {mounting}", oval(design), ratio, mounting)
                    for mounting in ("floating", "rigid")
                ]
    return tasks


def _path(size: int, ratio: int, design: Design, section: str) -> CatalogueTask:
    return CatalogueTask(
        name=f"path {size} {ratio} {section}",
        kind="path",
        design=design,
        torques=torques_of(catalogue_row(size, ratio)),
        work=0.02 * ratio,
    )


def _teeth(name: str, design: Design, work: float, mounting: str = "") -> CatalogueTask:
    kind = f"ratcheting {mounting}".strip()
    return CatalogueTask(name=name, kind=kind, design=design, work=work)


def rows_of(study: CatalogueFile, part: str, found: Mapping[str, Found]) -> list[Row]:
    """Rows of a part; none for ``individuals``, ``experiments`` and ``coning``.

    Args:
        study: Study file.
        part: One of :data:`PARTS` or :data:`EXTRA`.
        found: Results by computation.
    """
    cases = [(size, ratio) for ratio in study.ratios for size in study.sizes]
    build = {
        "stiffness": lambda row: stiffness_rows(study, row, found),
        "ratcheting": lambda row: ratcheting_rows(study, row, found, REFERENCE),
        "accuracy": lambda row: accuracy_rows(study, row, found, REFERENCE),
        "losses": lambda row: loss_rows(study, row, found),
    }
    if part not in build:
        return []
    return [one for case in cases for one in build[part](catalogue_row(*case))]
