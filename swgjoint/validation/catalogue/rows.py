"""Rows of the comparison with the catalogue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.rings.friction import RubbedPath
from swgjoint.gear.catalogue import CatalogueRow
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.maps.sheet.loop import LOST_MOTION_TORQUE
from swgjoint.maps.sheet.sampled_accuracy import accuracy_bracket
from swgjoint.typing import Array
from swgjoint.units import arcmin
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design
from swgjoint.validation.catalogue.printed import (
    STIFFNESS,
    catalogue_stiffness,
    edges,
    printed_accuracy,
)
from swgjoint.validation.catalogue.runs import Found
from swgjoint.validation.rows import Row


def friction_of_path(found: Found, design: Design) -> RubbedPath:
    """Loading path of the thin rings in series with the cup of a design.

    Args:
        found: Result of kind ``path``.
        design: Design with the cup.
    """
    torque = np.array(found["torque_Nm"])
    series = series_compliance(design, cup=True)
    work = np.array(found["work_per_mu_J"])
    race = np.array(found["race_part"]) * work
    ring = np.array(found["ring_compliance_rad_Nm"])
    return RubbedPath(
        torque=torque,
        torsion=np.array(found["ring_torsion_rad"]) + series * torque,
        series=series,
        teeth_work=work - race,
        race_work=race,
        compliance=ring + series,
        shares={
            name: np.array(share) * ring / (ring + series)
            for name, share in found["ring_shares"].items()
        },
        balls=np.array(found["balls"]),
        tooth_pairs=np.array(found["tooth_pairs"]),
        outcome=Outcome.CONVERGED,
    )


def stiffnesses(path: RubbedPath, row: CatalogueRow) -> Array:
    """K1, K2, K3 of a loading path [N·m/rad], shape (3,).

    The curve is symmetric in torque, so its segments start at zero torsion.

    Args:
        path: Loading path of the drive.
        row: Ratings with the torques of the segments.
    """
    torques = edges(row)
    x = np.array([0.0, *map(path.torsion_at, torques[1:])])
    return np.asarray(np.diff(torques) / np.diff(x))


def stiffness_rows(
    study: CatalogueFile, row: CatalogueRow, found: Mapping[str, Found]
) -> list[Row]:
    """Rows of K1, K2, K3, hysteresis loss and lost motion, with brackets over variants.

    Args:
        study: Study file.
        row: Ratings of the drive.
        found: Results by computation.
    """
    values: dict[str, list[float]] = {}
    faults = []
    for variant in study.variants:
        one = found[f"path {row.size} {row.ratio} {variant.section}"]
        if "fault" in one:
            faults.append(f"{variant.name}: {one['fault']}")
            continue
        path = friction_of_path(one, variant_design(row.size, row.ratio, variant))
        for key, value in zip(STIFFNESS, stiffnesses(path, row), strict=True):
            values.setdefault(key, []).append(float(value))
        for mu in study.coefficients:
            loss = path.hysteresis_loss(mu) / arcmin
            values.setdefault("hysteresis loss", []).append(loss)
        lost = 2.0 * path.torsion_at(LOST_MOTION_TORQUE * row.rated_torque) / arcmin
        values.setdefault("lost motion", []).append(lost)
    reason = "; ".join(dict.fromkeys(faults)) or None
    whole = not faults
    bounds = printed_accuracy(row)
    printed = dict(zip(STIFFNESS, catalogue_stiffness(row).tolist(), strict=True))
    rows = []
    for key in STIFFNESS:
        goal = study.goal(row.size, row.ratio, key)
        rows.append(
            bracket_row(
                row,
                key,
                "N·m/rad",
                printed[key],
                values.get(key, []),
                reason,
                goal=goal,
                whole=whole,
            )
        )
    bound = "the catalogue states an upper bound"
    for key in ("hysteresis loss", "lost motion"):
        source = bounds[f"{key.replace(' ', '_')}_arcmin"]
        why = f"{bound}; {reason}" if reason else bound
        some = values.get(key, [])
        rows.append(bracket_row(row, key, "arcmin", source, some, why, whole=whole))
    return rows


def bracket_row(
    row: CatalogueRow,
    quantity: str,
    unit: str,
    source: float | None,
    values: Sequence[float],
    reason: str | None,
    *,
    goal: float | None = None,
    whole: bool = True,
    above: Sequence[float] = (),
    conditions: str | None = None,
) -> Row:
    """Row that compares the middle of a bracket with the catalogue.

    Args:
        row: Ratings of the drive.
        quantity: Name of the quantity.
        unit: Unit of all values.
        source: Value of the catalogue; None if it states none.
        values: Values of the variants.
        reason: Reason of the row, see :class:`Row`.
        goal: Accepted relative deviation of the middle; an incomplete bracket does not
            meet it.
        whole: Whether every variant has a value.
        above: Lower bounds of variants without a value; the upper end of the bracket is
            then unknown.
        conditions: Conditions under which the catalogue states its value.
    """
    known = [*values, *above]
    low = min(known) if known else None
    high = max(values) if values and not above else None
    middle = None if low is None or high is None else 0.5 * (low + high)

    def over(value: float | None) -> float | None:
        return None if value is None or not source else value / source

    ratio = over(middle)
    met = None
    if goal is not None:
        met = whole and ratio is not None and abs(ratio - 1.0) <= goal
    return Row(
        case=f"size {row.size}, ratio {row.ratio}",
        quantity=quantity,
        unit=unit,
        source_value=source,
        ours=middle,
        reason=reason,
        more={
            "size": row.size,
            "ratio": row.ratio,
            "low": low,
            "high": high,
            "over_source": ratio,
            "low_over_source": over(low),
            "high_over_source": over(high),
            "whole": whole and not above,
            "goal": goal,
            "met": met,
            "conditions": conditions,
        },
    )


def ratcheting_rows(
    study: CatalogueFile, row: CatalogueRow, found: Mapping[str, Found], size: int
) -> list[Row]:
    """Row of the ratcheting torque, scaled from one size by the cube of the size.

    The bracket covers all flank angles, and a wave generator that floats in its
    coupling. Results for a rigid one, for a circular spline fixed outside, and flank
    angles without a limit are part of the reason.

    Args:
        study: Study file.
        row: Ratings of the drive.
        found: Results by computation.
        size: Size at which the limits were computed.
    """
    scale = (row.size / size) ** 3
    values, above, notes, whole = [], [], [], True
    for flank in dict.fromkeys(v.flank_deg for v in study.variants):
        one = found[f"ratcheting {size} {row.ratio} {flank:g}"]
        if "fault" in one:
            notes.append(f"{flank:g} deg: {one['fault']}")
            whole = False
        elif not one["passed"]:
            above.append(scale * one["limit_Nm"])
            notes.append(f"{flank:g} deg: no limit up to {above[-1]:.3g} N·m")
        else:
            values.append(scale * one["limit_Nm"])
    first = f"ratcheting {size} {row.ratio} {study.variants[0].flank_deg:g}"
    for name, mounting in (
        ("floating", "wave generator floating"),
        ("rigid", "without the bearing"),
        ("fixed", "circular spline fixed outside"),
    ):
        one = found[f"{first} {name}"]
        if "fault" in one:
            continue
        limit = scale * one["limit_Nm"]
        sign = "" if one["passed"] else "no limit up to "
        notes.append(f"{mounting}: {sign}{limit:.3g} N·m")
        if name == "floating" and one["passed"]:
            values.append(limit)
    notes.insert(0, "2D, circular spline free outside, wave generator on its bearing")
    if row.size != size:
        notes.append(f"scaled from size {size}")
    return [
        bracket_row(
            row,
            "ratcheting torque",
            "N·m",
            row.ratcheting_torque,
            values,
            "; ".join(notes),
            whole=whole,
            above=above,
        )
    ]


def accuracy_rows(
    study: CatalogueFile, row: CatalogueRow, found: Mapping[str, Found], size: int
) -> list[Row]:
    """Row of the transmission accuracy, scaled from one size if not computed.

    Tooth errors are lengths, so the resulting angle is inversely proportional to the
    size.

    Args:
        study: Study file.
        row: Ratings of the drive.
        found: Results by computation.
        size: Size from which the accuracy is scaled.
    """
    one = found[f"accuracy {size} {row.ratio}"]
    own = found.get(f"accuracy {row.size} {row.ratio}", {"fault": "not computed"})
    source = printed_accuracy(row)["transmission_accuracy_arcmin"]
    why = (
        "the catalogue states an upper bound; one gear with the errors of the study"
        " file; the bracket starts at the peak-to-peak value of the low orders or of"
        " the samples and ends at that of the low orders plus twice the rms of the"
        " other orders at both peaks"
    )
    values: list[float] = []
    if "fault" not in own:
        design = variant_design(row.size, row.ratio, study.variants[0])
        values += accuracy_bracket(own, design)
    elif "fault" not in one:
        design = variant_design(size, row.ratio, study.variants[0])
        values += [v * size / row.size for v in accuracy_bracket(one, design)]
        why += f"; scaled from size {size}"
    else:
        why = one["fault"]
    return [bracket_row(row, "transmission accuracy", "arcmin", source, values, why)]
