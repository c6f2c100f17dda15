"""``swgjoint study thesis``: recomputation of the studies of the thesis.

By default these are the studies of chapters 4 to 6 with the 2D model; with
``--model 3d`` they are those of chapter 7.

Every case is simulated at the stated torque T and at T/10. The printed stresses
increase with torque about ten times less than the stated torque and face width require,
so the thesis probably applied T/10. Nothing else is scaled. Unless a case reads one
state or angle, its value is the largest nodal stress of the flexspline, averaged over
the positions, on the mesh of the thesis (refinement 1). The average without nodes next
to loaded tooth contacts, and the values on finer meshes, are additional columns. 2D
rows are judged at T/10, 3D rows at T; in 3D, finer meshes are computed at T only.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from swgjoint.gear.design.design import Design
from swgjoint.validation.reasons import WITHIN
from swgjoint.validation.rows import Row, StudyOptions, StudyResult
from swgjoint.validation.runner import compute_all
from swgjoint.validation.thesis.cases import Case, StudyFile, case_of
from swgjoint.validation.thesis.checks import (
    RankCheck,
    TrendCheck,
    rank_checks,
    trend_checks,
)
from swgjoint.validation.thesis.record import RunRecord, RunSpec, record_run
from swgjoint.validation.thesis.report import report_pages
from swgjoint.validation.thesis.rows import CaseRecords, increase_rows, stress_rows

TENTH = 0.1


def run_thesis(options: StudyOptions) -> StudyResult:
    """Run the chosen parts of the study of the chosen model, or all of them.

    Raises:
        InputError: If a part is unknown.
    """
    name = "thesis-3d" if options.model == "3d" else "thesis"
    return run_cases(StudyFile.load(name), options)


def run_cases(study: StudyFile, options: StudyOptions) -> StudyResult:
    """Simulate the cases of a study file and compare them with its printed values.

    Args:
        study: Study file.
        options: Parts, number of processes and progress.

    Raises:
        InputError: If a part is unknown.
    """
    begin = time.perf_counter()
    cases = [
        case_of(study, group, entry)
        for group in study.chosen(options.only)
        for entry in group.cases
    ]
    plan = {case.name: _specs(study, case) for case in cases}
    specs = [spec for row in plan.values() for spec in row.values()]
    records = compute_all(record_run, specs, options, stage="meshing simulations")
    results = [_collect(study, case, plan[case.name], records) for case in cases]
    return _result(study, results, begin, len(records))


def _specs(study: StudyFile, case: Case) -> dict[tuple[bool, float], RunSpec]:
    """Runs of a case by (whether the load is T/10, refinement)."""
    if case.design is None:
        return {}
    specs: dict[tuple[bool, float], RunSpec] = {}
    for tenth in (False, True):
        torque = case.torque * (TENTH if tenth else 1.0)
        angle, group = case.entry.angle_deg, case.group
        turn = (group.turn_deg or study.turn_deg) / 360.0
        specs[tenth, 1] = RunSpec(
            design=case.design,
            torque=torque,
            positions=group.positions or study.positions if angle is None else 2,
            turn=turn if angle is None else 2.0 * angle / 360.0,
            model=study.model,
        )
        fine = study.refinements if group.converge else ()
        for refinement in fine if study.by_tenth or not tenth else ():
            specs[tenth, refinement] = RunSpec(
                design=case.design.with_changes({"mesh.refinement": refinement}),
                torque=torque,
                positions=study.fine_positions,
                turn=1.0 / _fixed_teeth(case.design),
                model=study.model,
            )
    return specs


def _fixed_teeth(design: Design) -> int:
    """Number of teeth of the fixed member; the pattern repeats with its pitch."""
    drive = design.drive
    if drive.layout == "flexspline_fixed":
        return drive.teeth_flexspline
    return drive.teeth_circular_spline


def _collect(
    study: StudyFile,
    case: Case,
    specs: Mapping[tuple[bool, float], RunSpec],
    found: Mapping[str, RunRecord],
) -> CaseRecords:
    records = {key: found[spec.name] for key, spec in specs.items()}
    if case.fault is not None:
        refused = RunRecord(outcome="refused", message=case.fault)
        records = {(False, 1): refused, (True, 1): refused}
    nominal = {fine: r for (tenth, fine), r in records.items() if not tenth}
    tenth = {fine: r for (tenth, fine), r in records.items() if tenth}
    return CaseRecords(case=case, nominal=nominal, tenth=tenth, by_tenth=study.by_tenth)


def _result(
    study: StudyFile,
    results: Sequence[CaseRecords],
    begin: float,
    runs: int,
) -> StudyResult:
    order = list(dict.fromkeys(result.case.group.id for result in results))
    rows = sorted(
        [*stress_rows(results), *increase_rows(results)],
        key=lambda row: order.index(row.more["part"]),
    )
    ranks, trends = rank_checks(results), trend_checks(results)
    shares = {
        key: _share(rows, column)
        for key, column in (
            ("tenth", "deviation_tenth_percent"),
            ("nominal", "deviation_percent"),
            ("converged_tenth", "deviation_converged_tenth_percent"),
            ("converged", "deviation_converged_percent"),
        )
    }
    failed = [
        result.case.name
        for result in results
        if not (result.nominal[1].ok and result.tenth[1].ok)
    ]
    more = {
        "source": study.source,
        "within_percent": WITHIN,
        "shares": shares,
        "ranks": [check.to_json() for check in ranks],
        "trends": [check.to_json() for check in trends],
        "failed_cases": failed,
        "contradictions": list(study.contradictions),
        "runs": runs,
    }
    summary = (
        *_summary(shares, ranks, trends, failed, runs),
        *(f"contradiction in the source: {text}" for text in study.contradictions),
    )
    lines = (*summary, f"{time.perf_counter() - begin:.0f} s")
    return StudyResult(
        rows=tuple(rows),
        summary=summary,
        more=more,
        pages=report_pages(study, results, rows, trends, lines),
    )


def _share(rows: Sequence[Row], column: str) -> dict[str, int]:
    """Count the rows with a printed value, those computed, and those within 15 %."""
    printed = [row for row in rows if row.source_value is not None]
    found = [d for row in printed if (d := row.more[column]) is not None]
    within = sum(abs(d) <= WITHIN for d in found)
    return {"printed": len(printed), "computed": len(found), "within": within}


def _summary(
    shares: Mapping[str, Mapping[str, int]],
    ranks: Sequence[RankCheck],
    trends: Sequence[TrendCheck],
    failed: Sequence[str],
    runs: int,
) -> tuple[str, ...]:
    lines = [
        f"{runs} meshing simulations; {len(failed)} cases with a failure"
        + (f": {'; '.join(failed)}" if failed else "")
    ]
    names = {
        "tenth": "T/10",
        "nominal": "T",
        "converged_tenth": "T/10, finest mesh",
        "converged": "T, finest mesh",
    }
    for key, share in shares.items():
        total = share["computed" if key.startswith("converged") else "printed"]
        if total:
            lines.append(
                f"at {names[key]}: {share['within']} of {total} printed values within"
                f" {WITHIN:g} % ({100 * share['within'] / total:.0f} %)"
            )
    lines += [check.text for check in ranks]
    for tenth, name in ((True, "T/10"), (False, "T")):
        for refinement in sorted({check.refinement for check in trends}):
            here = [
                check
                for check in trends
                if check.tenth == tenth and check.refinement == refinement
            ]
            if not here:
                continue
            agree = sum(check.agrees for check in here)
            lines.append(
                f"at {name}, refinement {refinement:g}: {agree} of {len(here)} stated"
                " trends confirmed"
            )
            lines += [f"{c.part} at {c.text}" for c in here if not c.agrees]
    return tuple(lines)
