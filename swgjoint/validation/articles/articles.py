"""``swgjoint study articles``: recomputation of three articles on flexsplines.

The parts are ``deflection``, the deflection of the 80:1 drive; ``force``, the force
that deforms the flexspline XB1-100-80; and ``stress`` and ``fatigue`` of a cup. The
printed values and closed forms are compared with 3D finite elements. If the result was
also computed on a finer mesh, ``converged`` contains it. The refinement is then 2
instead of 1 for the linear models, and 1 instead of 0.6 for those with a wave generator
in contact. Refinement 1 is the mesh of the thesis.
"""

from __future__ import annotations

from collections.abc import Mapping

from swgjoint.gear.design.design import Design
from swgjoint.validation.articles.file import ArticlesFile, changed_design
from swgjoint.validation.articles.lobes import lobe_rows
from swgjoint.validation.articles.rows import (
    deflection_rows,
    fatigue_rows,
    force_rows,
    stress_rows,
)
from swgjoint.validation.articles.runs import ArticleTask, Found, run_task
from swgjoint.validation.rows import Row, StudyOptions, StudyResult
from swgjoint.validation.runner import compute_all

PARTS = ("deflection", "force", "stress", "fatigue")
FINE = {"mesh.refinement": 2}
COARSE = {"mesh.refinement": 0.6}
"""Coarsest mesh with a plane of nodes in the middle of the face width."""
FINE_TORQUES = slice(0, None, 3)
"""Torques at which the finer mesh is also computed."""


def run_articles(options: StudyOptions) -> StudyResult:
    """Run the chosen parts, or all of them.

    Raises:
        InputError: If a part is unknown.
    """
    parts = options.chosen(PARTS)
    from swgjoint.view.plots.articles import articles_picture

    study = ArticlesFile.load("articles")
    tasks = [task for part in parts for task in tasks_of(study, part)]
    found = compute_all(run_task, tasks, options)
    rows = [row for part in parts for row in rows_of(study, part, found)]
    failed = [name for name, result in found.items() if "fault" in result]
    summary = [_summary(part, study, found) for part in parts]
    summary += [f"failed: {name}: {found[name]['fault']}" for name in failed]
    more = {"source": study.source, "computations": found, "failed": failed}
    return StudyResult(
        rows=tuple(rows),
        summary=tuple(filter(None, summary)),
        more=more,
        pages={"articles.png": lambda: articles_picture(parts, found)},
    )


def tasks_of(study: ArticlesFile, part: str) -> list[ArticleTask]:
    """Computations of a part.

    Args:
        study: Study file.
        part: One of :data:`PARTS`.
    """
    if part == "deflection":
        own = changed_design(study.deflection.base)
        tasks = _deflected("deflection", own, fine=True)
        for v in study.deflection.variations:
            tasks += _deflected(f"deflection, {v.name}", own.with_changes(v.changes))
        return tasks
    if part == "force":
        force = study.force
        design = changed_design(force.base)
        tasks = [
            ArticleTask(name="force", kind="pinched", design=design),
            ArticleTask(
                name="force, smooth", kind="pinched", design=design, toothless=True
            ),
            ArticleTask(name="force, large", kind="rotated", design=design, work=2),
            ArticleTask(name="force, lobes", kind="lobes", design=design, work=4),
            ArticleTask(
                name="force, fine",
                kind="pinched",
                design=design.with_changes(FINE),
                work=15,
            ),
        ]
        return tasks + [
            ArticleTask(
                name=f"force, {v.name}",
                kind="pinched",
                design=changed_design(force.base, v.changes),
            )
            for v in force.variations
        ]
    stress = study.stress
    design, torques = changed_design(stress.base), stress.torques_Nm
    crowned = design.with_changes(stress.crowned)
    tasks = [
        ArticleTask(name="four", kind="four", design=design, torques=torques, work=2),
        ArticleTask(
            name="four, fine",
            kind="four",
            design=design.with_changes(FINE),
            torques=torques,
            work=16,
        ),
    ]
    if part == "stress":
        tasks += _deflected("ellipse", design, fine=True)
        return tasks + _deflected("crowned", crowned)
    for name, on, size in (
        ("fatigue", design.with_changes(COARSE), 5),
        ("fatigue, crowned", crowned.with_changes(COARSE), 5),
        ("fatigue, fine", design, 20),
    ):
        few = torques[FINE_TORQUES] if name == "fatigue, fine" else torques
        tasks.append(
            ArticleTask(name=name, kind="fatigue", design=on, torques=few, work=size)
        )
    return tasks


def _deflected(name: str, design: Design, *, fine: bool = False) -> list[ArticleTask]:
    """Computations of the cup on the wave generator, on one or two meshes."""
    coarse = design.with_changes(COARSE)
    tasks = [ArticleTask(name=name, kind="deflected", design=coarse, work=2)]
    if fine:
        more = ArticleTask(
            name=f"{name}, fine", kind="deflected", design=design, work=8
        )
        tasks.append(more)
    return tasks


def rows_of(study: ArticlesFile, part: str, found: Mapping[str, Found]) -> list[Row]:
    """Rows of a part.

    Args:
        study: Study file.
        part: One of :data:`PARTS`.
        found: Results by computation.
    """
    build = {
        "deflection": lambda: deflection_rows(study.deflection, found),
        "force": lambda: [
            *force_rows(study.force, found),
            *lobe_rows(study.force, found["force, lobes"]),
        ],
        "stress": lambda: stress_rows(study.stress, found),
        "fatigue": lambda: fatigue_rows(study.stress, found),
    }
    return build[part]()


def _summary(part: str, study: ArticlesFile, found: Mapping[str, Found]) -> str:
    if part == "force" and "fault" not in found["force"]:
        values = [
            result["mid_face"]
            for name, result in found.items()
            if name.startswith("force, ")
            and "mid_face" in result
            and name not in ("force, smooth", "force, fine")
        ]
        return (
            f"radial stiffness of {study.force.base}: {found['force']['mid_face']:.3g}"
            f" N/mm at mid-face; {min(values):.3g} to {max(values):.3g} if each"
            " assumption that the article leaves open is varied alone"
        )
    if part == "fatigue" and "fault" not in found["fatigue"]:
        rows = found["fatigue"]["by_torque"]
        first, last = rows[0], rows[-1]
        return (
            f"safety factor from {first['torque_Nm']:g} to {last['torque_Nm']:g} N·m:"
            f" shell theory {first['shell_theory']['S']:.3g} to"
            f" {last['shell_theory']['S']:.3g}, finite elements at mid-face"
            f" {first['mid_face']['S']:.3g} to {last['mid_face']['S']:.3g}, worst"
            f" section {first['worst_section']['S']:.3g} to"
            f" {last['worst_section']['S']:.3g}"
        )
    return ""
