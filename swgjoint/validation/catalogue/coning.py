"""Part ``coning``: why 2D models are too stiff at a low ratio.

The deflected cup is conical, so that the contact forces of teeth and wave generator
move towards its open end. Models of the section, such as the thin rings, lack this
effect. The 3D cases are a rigid wave generator and one on its bearing, each with teeth
and wave generator straight or relieved along the face width.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from swgjoint.pictures import png
from swgjoint.validation.catalogue.file import CatalogueFile
from swgjoint.validation.catalogue.printed import (
    STIFFNESS,
    catalogue_row,
    catalogue_stiffness,
    edges,
)
from swgjoint.validation.catalogue.runs import CatalogueTask, Found

CASES = (
    ("rings", "coning ring", False),
    ("rigid, straight", "coning rigid", True),
    ("rigid, relieved", "coning rigid", False),
    ("bearing, straight", "coning free", True),
    ("bearing, relieved", "coning free", False),
    ("bearing held axially, relieved", "coning held", False),
)
"""Cases: name, kind of computation, and whether relief along the face width is
omitted."""


def coning_tasks(study: CatalogueFile) -> list[CatalogueTask]:
    """Computations of all cases at all ratios."""
    size = study.coning.size
    return [
        CatalogueTask(
            name=f"coning {ratio} {name}",
            kind=kind,
            design=study.coned_design(ratio, straight=straight),
            torques=edges(catalogue_row(size, ratio))[1:],
            work=ratio * {"coning ring": 0.02, "coning rigid": 0.5}.get(kind, 1.5),
        )
        for ratio in study.coning.ratios
        for name, kind, straight in CASES
    ]


def coning_summary(study: CatalogueFile, found: Mapping[str, Found]) -> dict[str, Any]:
    """Compare K1, K2, K3 of each case with the catalogue, and list the force centres.

    Args:
        study: Study file.
        found: Results by computation.

    Returns:
        ``rows``, ``lines`` for the terminal and ``assumptions``.
    """
    rows, lines = [], []
    for ratio in study.coning.ratios:
        row = catalogue_row(study.coning.size, ratio)
        printed, torques = catalogue_stiffness(row), edges(row)
        for name, _, _ in CASES:
            one = found[f"coning {ratio} {name}"]
            if "fault" in one:
                continue
            # the centre line of a loop starts at zero: K1 includes half the play
            K = np.diff(torques) / np.diff(one["torsion_rad"], prepend=0.0)
            rows.append(
                {
                    "ratio": ratio,
                    "case": name,
                    **{
                        f"{key}_Nm_rad": float(value)
                        for key, value in zip(STIFFNESS, K, strict=True)
                    },
                    "over_catalogue": (K / printed).tolist(),
                    **{k: v for k, v in one.items() if k != "wall_s"},
                }
            )
            lines.append(_line(row.size, rows[-1]))
    lines += _drops(rows)
    return {"rows": rows, "lines": lines, "assumptions": study.coning.assumptions}


def _line(size: int, row: Mapping[str, Any]) -> str:
    text = "/".join(f"{value:.2f}" for value in row["over_catalogue"])
    line = f"coning, size {size}, ratio {row['ratio']}, {row['case']}: K1/K2/K3"
    line += f" over catalogue {text}"
    if "half_play_rad" in row:
        part = round(100.0 * row["half_play_rad"] / row["torsion_rad"][0])
        line += f"; half the play is {part} % of the torsion at T1"
    if "tooth_centre_over_face" in row:
        for what in ("tooth", "bore"):
            centre = row[f"{what}_centre_over_face"]
            line += f"; {what} forces centred at"
            line += f" {'/'.join(f'{c:+.2f}' for c in centre)} face widths"
    return line


def _drops(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines on K1, K2, K3 of one case divided by those of another, by drive ratio."""
    K = {(row["ratio"], row["case"]): np.array(row["over_catalogue"]) for row in rows}
    ratios = sorted({ratio for ratio, _ in K})
    lines = []
    for case, base in (
        ("bearing, straight", "rigid, straight"),
        ("bearing, relieved", "rigid, relieved"),
        ("bearing, straight", "rings"),
        ("bearing, relieved", "rings"),
        ("bearing, relieved", "bearing, straight"),
        ("bearing held axially, relieved", "bearing, relieved"),
    ):
        parts = [
            f"{'/'.join(f'{v:.2f}' for v in K[r, case] / K[r, base])} at ratio {r}"
            for r in ratios
            if (r, case) in K and (r, base) in K
        ]
        if parts:
            lines.append(f"K1/K2/K3 of {case} over {base}: {', '.join(parts)}")
    return lines


def coning_picture(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Plot K relative to the catalogue, and the centre of the tooth forces, as PNG."""
    from matplotlib.figure import Figure

    ratios = sorted({row["ratio"] for row in rows})
    cases = [name for name, _, _ in CASES if any(row["case"] == name for row in rows)]
    figure = Figure(figsize=(10.0, 7.0), layout="constrained")
    axes = figure.subplots(2, max(len(ratios), 1), sharey="row", squeeze=False)
    for k, ratio in enumerate(ratios):
        stiff, centre = axes[:, k]
        stiff.axhline(1.0, color="0.3", lw=1.0)
        for number, case in enumerate(cases):
            own = [r for r in rows if (r["ratio"], r["case"]) == (ratio, case)]
            colour = f"C{number}"
            for row in own:
                x = np.arange(3) + 0.1 * (number - 0.5 * len(cases))
                stiff.plot(x, row["over_catalogue"], "o", color=colour, label=case)
                if "tooth_centre_over_face" in row:
                    torque, at = row["torque_Nm"], row["tooth_centre_over_face"]
                    centre.plot(torque, at, "o-", color=colour)
        stiff.set_xticks(range(3), STIFFNESS)
        stiff.set_title(f"ratio {ratio}")
        centre.set_xlabel("torque [N·m]")
        for axis in (stiff, centre):
            axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("model over catalogue")
    axes[0, 0].set_ylim(bottom=0.0)
    axes[0, 0].legend(fontsize="small")
    axes[1, 0].set_ylabel("centre of tooth forces\nfrom mid-face, open end < 0 [face]")
    axes[1, 0].set_ylim(-0.55, 0.25)
    return png(figure, dpi=130)
