"""Part ``experiments``: what changes the effect of the ratio on the stiffness.

Each experiment changes one thing in the drives of the first variant, at both ratios or
at one, and reports how K at the one ratio over K at the other changes.
The experiments test candidates for the part of this effect that the rules leave open;
they are no part of the brackets.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from swgjoint.gear.catalogue import CatalogueRow
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array
from swgjoint.units import arcsec
from swgjoint.validation.catalogue.file import (
    CatalogueFile,
    Experiment,
    variant_design,
)
from swgjoint.validation.catalogue.printed import (
    catalogue_row,
    catalogue_stiffness,
    edges,
    torques_of,
)
from swgjoint.validation.catalogue.rows import friction_of_path
from swgjoint.validation.catalogue.runs import CatalogueTask, Found

UNCHANGED = "no change"


def experiment_tasks(study: CatalogueFile, size: int) -> list[CatalogueTask]:
    """Loading paths of all experiments at both ratios, and of the unchanged drives.

    Args:
        study: Study file.
        size: Size of the drives.
    """
    tasks = []
    for ratio in study.ratio_effect.ratios:
        for experiment in (None, *study.experiments):
            tasks.append(
                CatalogueTask(
                    name=_name(ratio, experiment),
                    kind="path",
                    design=changed_design(study, size, ratio, experiment),
                    torques=torques_of(catalogue_row(size, ratio)),
                    work=0.02 * ratio,
                )
            )
    return tasks


def _name(ratio: int, experiment: Experiment | None) -> str:
    return f"experiment {ratio} {experiment.name if experiment else UNCHANGED}"


def changed_design(
    study: CatalogueFile, size: int, ratio: int, experiment: Experiment | None
) -> Design:
    """Drive of the first variant with the change of an experiment.

    Args:
        study: Study file.
        size: Size of the drive.
        ratio: Ratio of the drive.
        experiment: The experiment; None for the unchanged drive.
    """
    variant = study.variants[0]
    if experiment is None or ratio not in (experiment.ratios or (ratio,)):
        return variant_design(size, ratio, variant)
    if experiment.flank_deg is not None:
        angle = experiment.flank_deg
        flank = next(f for f in study.flanks if f.flank_deg == angle)
        variant = replace(variant, flank=flank)
    if experiment.rim is not None:
        variant = replace(variant, rim=experiment.rim)
    design = variant_design(size, ratio, variant)
    lengths = experiment.per_pitch_diameter.items()
    return design.with_changes(
        {**experiment.changes, **{key: v * 2.54 * size for key, v in lengths}}
    )


def experiment_summary(
    study: CatalogueFile, found: Mapping[str, Found], size: int
) -> dict[str, Any]:
    """Effect of the ratio on K1, K2, K3 in every experiment.

    Args:
        study: Study file.
        found: Results by computation.
        size: Size of the drives.

    Returns:
        ``rows`` and ``lines`` for the terminal.
    """
    ratios = study.ratio_effect.ratios
    printed = [catalogue_stiffness(catalogue_row(size, ratio)) for ratio in ratios]
    rows = []
    base: dict[int, Array] = {}
    for experiment in (None, *study.experiments):
        K = {}
        for ratio in ratios:
            one = found[_name(ratio, experiment)]
            if "fault" not in one:
                design = changed_design(study, size, ratio, experiment)
                play = _play(experiment, ratio)
                K[ratio] = _stiffnesses(one, design, catalogue_row(size, ratio), play)
        base = base or K
        if len(K) < 2 or len(base) < 2:
            continue
        rows.append(
            {
                "experiment": experiment.name if experiment else UNCHANGED,
                "effect": (K[ratios[0]] / K[ratios[1]]).tolist(),
                "over_unchanged": [(K[r] / base[r]).tolist() for r in ratios],
                "over_catalogue": [
                    (K[r] / of).tolist() for r, of in zip(ratios, printed, strict=True)
                ],
            }
        )
    theirs = _text(printed[0] / printed[1])
    lines = [
        f"experiments, size {size}, {study.variants[0].name}: K({ratios[0]})/"
        f"K({ratios[1]}) for K1/K2/K3, catalogue {theirs}"
    ]
    for row in rows:
        parts = ", ".join(
            f"{_text(values)} at ratio {ratio}"
            for ratio, values in zip(ratios, row["over_unchanged"], strict=True)
        )
        lines.append(
            f"  {row['experiment']}: {_text(row['effect'])}; K over unchanged {parts}"
        )
    return {"rows": rows, "lines": lines}


def _play(experiment: Experiment | None, ratio: int) -> float:
    """Half of the play that an experiment adds at the output [rad]."""
    if experiment is None or not experiment.play_arcsec:
        return 0.0
    return 0.5 * experiment.play_arcsec[str(ratio)] * arcsec


def _stiffnesses(found: Found, design: Design, row: CatalogueRow, play: float) -> Array:
    """K1, K2, K3 of a loading path [N·m/rad], with half the play in the torsion."""
    path, torques = friction_of_path(found, design), edges(row)
    x = np.array([0.0, *(path.torsion_at(t) + play for t in torques[1:])])
    return np.asarray(np.diff(torques) / np.diff(x))


def _text(values: Any) -> str:
    return "/".join(f"{value:.2f}" for value in values)
