"""Lines of the terminal that summarise the rows of the catalogue study."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from swgjoint.maps.sheet.sampled_accuracy import accuracy_bracket
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design
from swgjoint.validation.catalogue.printed import STIFFNESS, catalogue_row
from swgjoint.validation.catalogue.runs import Found
from swgjoint.validation.rows import Row


def summary(study: CatalogueFile, rows: Sequence[Row]) -> list[str]:
    """Summarise model over catalogue and the goals met, by quantity and ratio.

    A case without a value, or with a failed variant, counts as a missed goal.

    Args:
        study: Study file.
        rows: Rows of the study.

    Returns:
        Lines for the terminal.
    """
    lines = []
    for quantity in dict.fromkeys(row.quantity for row in rows):
        for ratio in study.ratios:
            every = [
                row
                for row in rows
                if (row.quantity, row.more["ratio"]) == (quantity, ratio)
            ]
            some = [row for row in every if row.more["over_source"] is not None]
            judged = [row for row in every if row.more["goal"] is not None]
            floor = [
                row.more["low_over_source"]
                for row in every
                if row not in some and row.more["low_over_source"] is not None
            ]
            if not some and not judged and not floor:
                continue
            text = f"{quantity}, ratio {ratio}: {_range(some)}"
            if 0 < len(some) < len(every):
                text += (
                    f"; {len(every) - len(some)} of {len(every)} cases have no middle"
                )
            if floor:
                text += f"; lower bounds {min(floor):.2f} to {max(floor):.2f}"
            if judged:
                met = sum(bool(row.more["met"]) for row in judged)
                goal = 100.0 * judged[0].more["goal"]
                text += f"; within {goal:.0f} %: {met} of {len(judged)}"
                lost = sum(not row.more["whole"] for row in judged)
                if lost:
                    text += f" ({lost} with missing variants count as not met)"
            lines.append(text)
    return lines + _rising(rows) + _goals_met(study, rows) + _ratio_effect(study, rows)


def _range(rows: Sequence[Row]) -> str:
    """Range of the middles relative to the catalogue, and ends of the brackets."""
    if not rows:
        return "no middle"
    middle = [row.more["over_source"] for row in rows]
    ends = [row.more[f"{end}_over_source"] for row in rows for end in ("low", "high")]
    return (
        f"model over catalogue {_part(min(middle))} to {_part(max(middle))} (brackets"
        f" {_part(min(ends))} to {_part(max(ends))})"
    )


def _part(value: float) -> str:
    """Value with two decimals, or with two significant digits if below 0.05."""
    return f"{value:.2f}" if value >= 0.05 else f"{value:.2g}"


def _rising(rows: Sequence[Row]) -> list[str]:
    """Line on the number of cases in which K1 < K2 < K3 fails or is unknown."""
    cases: dict[str, list[float]] = {}
    for row in rows:
        if row.quantity in STIFFNESS:
            values = cases.setdefault(row.case, [])
            values += [] if row.ours is None else [row.ours]
    if not cases:
        return []
    known = [values for values in cases.values() if len(values) == len(STIFFNESS)]
    fails = sum(not values[0] < values[1] < values[2] for values in known)
    line = f"K1 < K2 < K3 fails in {fails} of {len(cases)} cases"
    lost = len(cases) - len(known)
    return [line + f" and is unknown in {lost}" * (lost > 0)]


def _goals_met(study: CatalogueFile, rows: Sequence[Row]) -> list[str]:
    """Line on the number of stiffness figures that meet their goal."""
    judged = [row for row in rows if row.more["goal"] is not None]
    if not judged:
        return []
    met = sum(bool(row.more["met"]) for row in judged)
    return [
        f"stiffness figures within their goal: {met} of {len(judged)} (goal:"
        f" {study.figures_within_goals})"
    ]


def _ratio_effect(study: CatalogueFile, rows: Sequence[Row]) -> list[str]:
    """Lines on K at one ratio over K at another, mean over the sizes with both."""
    own = study.ratio_effect
    values = {(row.quantity, row.more["size"], row.more["ratio"]): row for row in rows}
    lines = []
    for key in STIFFNESS:
        pairs = [
            [values.get((key, size, ratio)) for ratio in own.ratios]
            for size in own.sizes
        ]
        both = [
            (row.ours / other.ours, row.source_value / other.source_value)
            for row, other in pairs
            if row and other and row.ours and other.ours
            if row.source_value and other.source_value
        ]
        if not both:
            continue
        ours, theirs = (sum(column) / len(both) for column in zip(*both, strict=True))
        deviation = ours / theirs - 1.0
        met = len(both) == len(own.sizes) and abs(deviation) <= own.goal
        lines.append(
            f"{key}({own.ratios[0]})/{key}({own.ratios[1]}), mean over {len(both)} of"
            f" {len(own.sizes)} sizes: model {ours:.2f}, catalogue {theirs:.2f},"
            f" {100 * deviation:+.0f} % (goal {100 * own.goal:.0f} %:"
            f" {'met' if met else 'missed'})"
        )
    return lines


def ratcheting_orders(
    study: CatalogueFile, found: Mapping[str, Found], size: int
) -> list[str]:
    """Compare the order of the ratios by ratcheting torque with the catalogue.

    There is one line per flank angle, for the ratios whose ratcheting torque was found;
    it is omitted if there are fewer than two.

    Args:
        study: Study file.
        found: Results by computation.
        size: Size of the drives.
    """
    lines = []
    for flank in dict.fromkeys(v.flank_deg for v in study.variants):
        limits = {}
        for ratio in study.ratios:
            one = found[f"ratcheting {size} {ratio} {flank:g}"]
            if "fault" not in one and one["passed"]:
                limits[ratio] = one["limit_Nm"]
        if len(limits) < 2:
            continue
        theirs = {r: catalogue_row(size, r).ratcheting_torque for r in limits}
        orders = [
            " > ".join(str(ratio) for ratio in sorted(of, key=lambda r: -of[r]))
            for of in (limits, theirs)
        ]
        lines.append(
            f"ratcheting torque, size {size}, flank {flank:g} deg, by ratio: model"
            f" {orders[0]}, catalogue {orders[1]}"
        )
    return lines


def compare_scaling(
    study: CatalogueFile,
    found: Mapping[str, Found],
    size: int,
    check: tuple[int, int],
) -> list[str]:
    """Compare values scaled from one size with values computed at another.

    Args:
        study: Study file.
        found: Results by computation.
        size: Size from which values are scaled.
        check: Size and ratio at which values are also computed.

    Returns:
        Lines for the terminal, for the quantities that were computed at both sizes.
    """
    other, ratio = check
    first = study.variants[0]

    def over(kind: str, end: str, factor: float, value: Callable[..., float]) -> str:
        values = []
        for one in (size, other):
            result = found.get(f"{kind} {one} {ratio}{end}", {"fault": "not run"})
            if "fault" in result or not result.get("passed", True):
                return ""
            values.append(value(result, variant_design(one, ratio, first)))
        return (
            f"{kind}, ratio {ratio}: value scaled from size {size} over value computed"
            f" at size {other}: {factor * values[0] / values[1]:.3f}"
        )

    scale = other / size
    lines = [
        over(
            "ratcheting",
            f" {first.flank_deg:g}",
            scale**3,
            lambda result, design: float(result["limit_Nm"]),
        ),
        over(
            "accuracy",
            "",
            1.0 / scale,
            lambda result, design: sum(accuracy_bracket(result, design)),
        ),
    ]
    return [line for line in lines if line]
