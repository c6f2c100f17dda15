"""Pictures of the recomputed results of the thesis, one per part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from swgjoint.fe.plane.stress import KINDS
from swgjoint.pictures import png

if TYPE_CHECKING:
    from swgjoint.validation.thesis.rows import CaseRecords

_TITLES = {
    "tensile": "tensile",
    "compressive": "compressive",
    "von_mises": "von Mises",
}
_NOMINAL, _TENTH, _SOURCE = "tab:red", "tab:blue", "black"


def group_picture(results: Sequence[CaseRecords]) -> bytes:
    """Draw the stresses of one part as PNG.

    The upper panels show the stresses of all cases over the parameter, or as bars if
    the part has no parameter. The lower panels show the von Mises stress over the turn.
    T is the torque of the case.

    Args:
        results: Cases of one part.
    """
    from matplotlib.figure import Figure

    group = results[0].case.group
    figure = Figure(figsize=(12, 7.5), layout="constrained")
    top = [kind for kind in KINDS for _ in range(2)]
    axes: dict[str, Any] = figure.subplot_mosaic(
        [top, ["turn"] * 3 + ["turn_tenth"] * 3], height_ratios=[1.2, 1.0]
    )
    for kind in KINDS:
        axis = axes[kind]
        if group.keys:
            _sweep(axis, results, kind)
            unit = f" [{group.unit}]" if group.unit else ""
            axis.set_xlabel(group.symbol + unit)
        else:
            _bars(axis, results, kind)
        axis.set_title(f"{_TITLES[kind]} stress [MPa]", fontsize=10)
        axis.grid(alpha=0.3)
    axes[KINDS[0]].legend(fontsize="small")
    _turn(axes["turn"], results, tenth=False)
    _turn(axes["turn_tenth"], results, tenth=True)
    handles, labels = axes["turn"].get_legend_handles_labels()
    if handles:
        figure.legend(
            handles, labels, loc="outside lower center", fontsize="x-small", ncols=7
        )
    figure.suptitle(f"{group.id}: {group.title} ({group.source})", fontsize=11)
    return png(figure, dpi=100)


def _sweep(axis: Any, results: Sequence[CaseRecords], kind: Any) -> None:
    """Draw the stress over the parameter at T and T/10, with the printed values.

    The meshes are refinement 1 and the finest one, if there is a finer one. Crosses are
    the values that the thesis prints.
    """
    values = [result.case.entry.value for result in results]
    for tenth, colour, label in ((False, _NOMINAL, "T"), (True, _TENTH, "T/10")):
        for refinement in dict.fromkeys((1, max(results[0].nominal))):
            stresses = [
                _number(r.value(kind, tenth=tenth, refinement=refinement))
                for r in results
            ]
            style, end = ("o-", "") if refinement == 1 else (".--", ", fine mesh")
            axis.plot(values, stresses, style, color=colour, label=label + end, ms=4)
    printed = [_number(result.case.entry.printed[kind]) for result in results]
    axis.plot(values, printed, "x", color=_SOURCE, label="thesis", ms=9, mew=2)


def _bars(axis: Any, results: Sequence[CaseRecords], kind: Any) -> None:
    """Draw bars of the thesis, T/10 and T; dashes are results on the finest mesh."""
    names = [result.case.group.name_of(result.case.entry) for result in results]
    series = (
        ("thesis", _SOURCE, [r.case.entry.printed[kind] for r in results], None),
        ("T/10", _TENTH, [r.value(kind, tenth=True) for r in results], True),
        ("T", _NOMINAL, [r.value(kind, tenth=False) for r in results], False),
    )
    width = 0.27
    for k, (label, colour, heights, tenth) in enumerate(series):
        places = [n + (k - 1) * width for n in range(len(names))]
        axis.bar(
            places, [_number(h) for h in heights], width, color=colour, label=label
        )
        if tenth is None:
            continue
        fine = [
            r.value(kind, tenth=tenth, refinement=r.meshes[-1])
            if len(r.meshes) > 1
            else None
            for r in results
        ]
        axis.plot(places, [_number(f) for f in fine], "_", color="0.3", ms=14, mew=2)
    turned = {"rotation": 90} if len(names) > 5 else {}
    axis.set_xticks(range(len(names)), names, fontsize=8, **turned)


def _turn(axis: Any, results: Sequence[CaseRecords], *, tenth: bool) -> None:
    """Draw the von Mises stress over the turn, one line per case.

    Cases with fewer than three positions, and repeated results, are omitted.
    """
    from matplotlib import colormaps

    colours = colormaps["viridis"]
    seen = set()
    for k, result in enumerate(results):
        record = (result.tenth if tenth else result.nominal)[1]
        stresses = record.per_position.get("von_mises", [])
        if len(stresses) < 3 or tuple(stresses) in seen:
            continue
        seen.add(tuple(stresses))
        axis.plot(
            record.angle_deg,
            [_number(s) for s in stresses],
            color=colours(0.9 * k / max(len(results) - 1, 1)),
            label=result.case.group.name_of(result.case.entry),
            lw=1.2,
        )
    axis.set_xlabel("wave-generator angle [deg]")
    load = "T/10" if tenth else "T"
    axis.set_title(f"von Mises stress over the turn at {load} [MPa]", fontsize=10)
    axis.grid(alpha=0.3)


def _number(value: float | None) -> float:
    """The value, or NaN if it is missing, which leaves a gap in a line."""
    return float("nan") if value is None else value
