"""Rows of the comparison with the catalogue, and what they add up to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError, Outcome
from swgjoint.fe.ring_friction import RubbedPath
from swgjoint.gear.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.maps.catalogue import CatalogueRow, catalogue_rows, table
from swgjoint.maps.friction_bending import without_friction
from swgjoint.maps.loop import LOST_MOTION_TORQUE
from swgjoint.study.catalogue_file import CatalogueFile, variant_design
from swgjoint.study.catalogue_runs import Found
from swgjoint.study.rows import Row
from swgjoint.units import arcmin

Array = NDArray[np.float64]

STIFFNESS = ("K1", "K2", "K3")
RATIO_CLASS = 80
"""Of the stiffness and accuracy tables: this ratio and above."""


def rubbed(found: Found, design: Design) -> RubbedPath:
    """A path of the rings behind the cup of a design."""
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


def catalogue_row(size: int, ratio: int) -> CatalogueRow:
    """Ratings of a component set.

    Raises:
        InputError: If the catalogue has none.
    """
    for row in catalogue_rows():
        if (row.size, row.ratio) == (size, ratio):
            return row
    raise InputError(f"the catalogue has no size {size}, ratio {ratio}")


def edges(row: CatalogueRow) -> tuple[float, float, float, float]:
    """0, T1, T2 and the end of the standard loop [N·m]."""
    return 0.0, row.T1, row.T2, max(row.repeated_peak, 1.5 * row.T2)


def stiffnesses(path: RubbedPath, row: CatalogueRow) -> Array:
    """K1, K2, K3: both signs are mirror images, so torsion begins at zero [N·m/rad]."""
    torques = edges(row)
    x = [0.0, *(path.at(torque) for torque in torques[1:])]
    return np.array(
        [
            (high - low) / (b - a)
            for (low, high), (a, b) in zip(pairwise(torques), pairwise(x), strict=True)
        ]
    )


def catalogue_stiffness(row: CatalogueRow) -> Array:
    """K1, K2, K3 as printed [N·m/rad]."""
    ratio_class = float(min(row.ratio, RATIO_CLASS))
    for line in table("stiffness"):
        if (line["size"], line["ratio_class"]) == (float(row.size), ratio_class):
            values = [line[f"{key}_1e4Nm_rad"] for key in STIFFNESS]
            return 1e4 * np.array([float(v) for v in values if v is not None])
    raise ValueError(f"no stiffness of size {row.size}, ratio {row.ratio}")


def printed_accuracy(row: CatalogueRow) -> dict[str, float | None]:
    """Upper bounds of transmission accuracy, hysteresis loss and lost motion."""
    ratio_class = float(min(row.ratio, RATIO_CLASS))
    keys = ("transmission_accuracy_arcmin", "hysteresis_loss_arcmin")
    for line in table("accuracy"):
        same = (line["size"], line["ratio_class"]) == (float(row.size), ratio_class)
        if line["series"] == "CHA" and same:
            return {
                key: None if line[key] is None else float(line[key])  # type: ignore[arg-type]
                for key in (*keys, "lost_motion_arcmin")
            }
    return dict.fromkeys((*keys, "lost_motion_arcmin"))


def stiffness_rows(
    study: CatalogueFile, row: CatalogueRow, found: Mapping[str, Found]
) -> list[Row]:
    """K1, K2, K3, hysteresis loss and lost motion, brackets over the variants."""
    values: dict[str, list[float]] = {}
    faults = []
    for variant in study.variants:
        one = found[f"path {row.size} {row.ratio} {variant.flank_deg:g}"]
        if "fault" in one:
            faults.append(f"{variant.name}: {one['fault']}")
            continue
        path = rubbed(one, variant_design(row.size, row.ratio, variant))
        for key, value in zip(STIFFNESS, stiffnesses(path, row), strict=True):
            values.setdefault(key, []).append(float(value))
        for mu in study.coefficients:
            loss = path.hysteresis_loss(mu) / arcmin
            values.setdefault("hysteresis loss", []).append(loss)
        lost = 2.0 * path.at(LOST_MOTION_TORQUE * row.rated_torque) / arcmin
        values.setdefault("lost motion", []).append(lost)
    reason = "; ".join(dict.fromkeys(faults)) or None
    bounds = printed_accuracy(row)
    printed = dict(zip(STIFFNESS, catalogue_stiffness(row).tolist(), strict=True))
    rows = []
    for key in STIFFNESS:
        goal = study.goal(row.size, row.ratio, key)
        rows.append(
            _row(row, key, "N·m/rad", printed[key], values.get(key, []), reason, goal)
        )
    bound = "catalogue states an upper bound"
    for key in ("hysteresis loss", "lost motion"):
        source = bounds[f"{key.replace(' ', '_')}_arcmin"]
        why = f"{bound}; {reason}" if reason else bound
        rows.append(_row(row, key, "arcmin", source, values.get(key, []), why, None))
    return rows


def _row(
    row: CatalogueRow,
    quantity: str,
    unit: str,
    source: float | None,
    values: Sequence[float],
    reason: str | None,
    goal: float | None,
) -> Row:
    """Middle of the bracket beside the catalogue."""
    low, high = (min(values), max(values)) if values else (None, None)
    middle = None if low is None or high is None else 0.5 * (low + high)

    def over(value: float | None) -> float | None:
        return None if value is None or not source else value / source

    ratio = over(middle)
    met = None
    if goal is not None:
        met = ratio is not None and abs(ratio - 1.0) <= goal
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
            "goal": goal,
            "met": met,
        },
    )


def ratcheting_rows(
    study: CatalogueFile, row: CatalogueRow, found: Mapping[str, Found], size: int
) -> list[Row]:
    """Limits of both flanks at one size, scaled by the cube of the size."""
    scale = (row.size / size) ** 3
    values, notes = [], []
    for flank in dict.fromkeys(v.flank_deg for v in study.variants):
        one = found[f"ratcheting {size} {row.ratio} {flank:g}"]
        if "fault" in one:
            notes.append(f"{flank:g} deg: {one['fault']}")
        elif not one["passed"]:
            bound = scale * one["limit_Nm"]
            notes.append(f"{flank:g} deg: no limit up to {bound:.3g} N·m")
        else:
            values.append(scale * one["limit_Nm"])
    fixed = found[
        f"ratcheting {size} {row.ratio} {study.variants[0].flank_deg:g} fixed"
    ]
    if "fault" not in fixed:
        bound = scale * fixed["limit_Nm"]
        sign = "limit" if fixed["passed"] else "no limit up to"
        notes.append(f"circular spline fixed outside: {sign} {bound:.3g} N·m")
    notes.insert(0, "circular spline free outside, wave generator rigid, in the plane")
    if row.size != size:
        notes.append(f"scaled from size {size}")
    source = row.ratcheting_torque
    return [
        _row(row, "ratcheting torque", "N·m", source, values, "; ".join(notes), None)
    ]


def accuracy_rows(
    row: CatalogueRow, found: Mapping[str, Found], size: int
) -> list[Row]:
    """Accuracy at one size; the errors are micrometres, so their angle scales down."""
    key = "transmission_accuracy_arcmin"
    one = found[f"accuracy {size} {row.ratio}"]
    own = found.get(f"accuracy {row.size} {row.ratio}", {})
    source = printed_accuracy(row)[key]
    why = "catalogue states an upper bound; one gear with the stated errors"
    if "fault" in one:
        return [
            _row(row, "transmission accuracy", "arcmin", source, [], one["fault"], None)
        ]
    value = own.get(key)
    if value is None:
        value = one[key] * size / row.size
        why += f"; scaled from size {size}"
    return [_row(row, "transmission accuracy", "arcmin", source, [value], why, None)]


def loss_rows(row: CatalogueRow) -> list[Row]:
    """No-load running torque: the models hold no friction at speed."""
    for line in table("losses"):
        if line["size"] == float(row.size) and row.ratio == 100:
            value = line["no_load_running_mNm"]
            assert isinstance(value, float)
            design = Design.preset(f"size-{row.size}-{row.ratio}")
            why = without_friction(design)
            return [_row(row, "no-load running torque", "mN·m", value, [], why, None)]
    return []


def summary(study: CatalogueFile, rows: Sequence[Row]) -> list[str]:
    """Range of model over catalogue by quantity and ratio, goals that are met."""
    lines = []
    for quantity in dict.fromkeys(row.quantity for row in rows):
        for ratio in study.ratios:
            some = [
                row
                for row in rows
                if (row.quantity, row.more["ratio"]) == (quantity, ratio)
                and row.more["over_source"] is not None
            ]
            if not some:
                continue
            middle = [row.more["over_source"] for row in some]
            ends = [
                row.more[f"{e}_over_source"] for row in some for e in ("low", "high")
            ]
            text = (
                f"{quantity}, ratio {ratio}: model over catalogue {min(middle):.2f} to"
                f" {max(middle):.2f} (brackets {min(ends):.2f} to {max(ends):.2f})"
            )
            judged = [row for row in some if row.more["goal"] is not None]
            if judged:
                met = sum(bool(row.more["met"]) for row in judged)
                goal = 100.0 * judged[0].more["goal"]
                text += f"; within {goal:.0f} %: {met} of {len(judged)}"
            lines.append(text)
    lines += _ratcheting_order(study, rows)
    rising = [
        "<".join(f"{v:.3g}" for v in values)
        for case in dict.fromkeys(row.case for row in rows)
        if len(values := _stiffness_of(rows, case)) == 3
        and not values[0] < values[1] < values[2]
    ]
    if any(row.quantity == "K1" for row in rows):
        lines.append(f"K1 < K2 < K3 fails in {len(rising)} cases")
    return lines


def _ratcheting_order(study: CatalogueFile, rows: Sequence[Row]) -> list[str]:
    """Ratios from the largest ratcheting torque to the smallest, ours and theirs."""
    lines = []
    for size in study.sizes:
        some = [
            row
            for row in rows
            if (row.quantity, row.more["size"]) == ("ratcheting torque", size)
            and row.ours is not None
        ]
        if len(some) < 2:
            continue
        orders = [
            " > ".join(
                str(row.more["ratio"])
                for row in sorted(some, key=lambda row: -(getattr(row, key) or 0.0))
            )
            for key in ("ours", "source_value")
        ]
        lines.append(
            f"ratcheting torque, size {size}, by ratio: model {orders[0]}, catalogue"
            f" {orders[1]}"
        )
    return lines


def _stiffness_of(rows: Sequence[Row], case: str) -> list[float]:
    return [
        row.ours
        for row in rows
        if row.case == case and row.quantity in STIFFNESS and row.ours is not None
    ]
