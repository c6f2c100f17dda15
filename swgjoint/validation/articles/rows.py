"""Rows of the study of the articles: printed values, ours, and reasons."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from swgjoint.gear.shell_theory import SERIES_SUM, ring_stiffness
from swgjoint.units import mm
from swgjoint.validation.articles.file import Deflection, Force, changed_design
from swgjoint.validation.articles.runs import Found
from swgjoint.validation.rows import Row

HELD_BACK = "held back"


def value_or_none(found: Found, pick: Callable[[Found], float]) -> float | None:
    """A figure of a computation; None if the computation failed."""
    return None if "fault" in found else pick(found)


def reason_or_failure(found: Found, reason: str) -> str:
    """The reason of a row, or why its computation failed."""
    return str(found.get("fault", reason))


def deflection_rows(own: Deflection, results: Mapping[str, Found]) -> list[Row]:
    """Deflection of the 80:1 drive and where its largest stress lies."""
    found, fine = results["deflection"], results["deflection, fine"]
    drive = changed_design(own.base).drive
    lobe = (
        0.5 * drive.module_mm * (drive.teeth_circular_spline - drive.teeth_flexspline)
    )

    def row(
        quantity: str,
        unit: str,
        source: float | None,
        ours: float | str,
        reason: str,
    ) -> Row:
        """A value of ours, or the key of one that was computed."""
        value: float | None
        if isinstance(ours, float):
            value, better, why = ours, None, reason
        else:
            key = ours
            value = value_or_none(found, lambda f: float(f[key]))
            better = value_or_none(fine, lambda f: float(f[key]))
            why = reason_or_failure(found, reason)
        return article_row(
            "deflection", own.base, quantity, unit, source, value, why, better
        )

    coned = ""
    if "fault" not in found:
        coned = (
            f"at z = {found['radial_z_mm']:.3g} mm and"
            f" {found['radial_from_major_deg']:.2g} deg from the major axis: the cup"
            " is coned, so that its open edge moves by more than w_0; face width and"
            " hat are chosen"
        )
    where = str(found.get("von_mises_part", ""))
    return [
        row(
            "w_0 = m (Z_c - Z_f)/2",
            "mm",
            own.theory_mm,
            lobe,
            f"the table's w_0* = {own.coefficient:g} would make it"
            f" {own.coefficient * lobe:g} mm",
        ),
        row(
            "wave generator height 2 w_0",
            "mm",
            own.table_mm,
            2.0 * lobe,
            "the printed m Z_f/n is 40 mm; 2 w_0 is twice the deflection",
        ),
        row(
            "largest radial displacement",
            "mm",
            own.largest_radial_mm,
            "largest_radial_mm",
            coned,
        ),
        row(
            "the same at mid-face",
            "mm",
            None,
            "at_mid_face_mm",
            "not printed",
        ),
        row(
            "largest von Mises stress",
            "MPa",
            None,
            "von_mises_MPa",
            f"not printed; ours at the {where}, which grows on finer meshes",
        ),
        row(
            "its angle from the major axis",
            "deg",
            0.0,
            "von_mises_from_major_deg",
            "stated: at the major axis, in root and transition",
        ),
        row(
            "von Mises stress at the minor axis",
            "MPa",
            None,
            "at_minor_MPa",
            "stated: significantly lower; bending around is as large there in shell"
            " theory, too",
        ),
        *(
            Row(
                case=own.base,
                quantity=f"largest radial displacement, {v.name}",
                unit="mm",
                source_value=None,
                ours=value_or_none(
                    results[f"deflection, {v.name}"],
                    lambda f: float(f["largest_radial_mm"]),
                ),
                reason=reason_or_failure(
                    results[f"deflection, {v.name}"], "not stated by the article"
                ),
                more={"part": "deflection"},
            )
            for v in own.variations
        ),
    ]


def article_row(
    part: str,
    case: str,
    quantity: str,
    unit: str,
    source: float | None,
    ours: float | None,
    reason: str | None,
    converged: float | None = None,
    **more: Any,
) -> Row:
    """A row of one part of the study."""
    return Row(
        case=case,
        quantity=quantity,
        unit=unit,
        source_value=source,
        ours=ours,
        converged=converged,
        reason=reason,
        more={"part": part} | more,
    )


def force_rows(own: Force, found: Mapping[str, Found]) -> list[Row]:
    """Deformation force of XB1-100-80: formula, finite elements, what is open."""
    design = changed_design(own.base)
    steel = design.material_of("flexspline")
    assert design.cup is not None
    length = design.cup.length_mm + design.drive.face_width_mm
    theory = ring_stiffness(
        steel.youngs_modulus,
        design.flexspline.rim_mm * mm,
        own.radius_mm * mm,
        series_sum=own.series_sum,
    )
    theory *= length * mm / 1e3  # N/mm

    def row(
        quantity: str,
        source: float | None,
        ours: float | None,
        reason: str,
        *,
        unit: str = "N/mm",
        converged: float | None = None,
        **more: Any,
    ) -> Row:
        return article_row(
            "force", own.base, quantity, unit, source, ours, reason, converged, **more
        )

    base, fine, smooth = (found[f"force{n}"] for n in ("", ", fine", ", smooth"))
    varied = {v.name: found[f"force, {v.name}"] for v in own.variations}
    rows = [
        row(
            "sum of the series",
            own.series_sum,
            SERIES_SUM,
            "its first three terms are 0.1164",
            unit="-",
        ),
        row(
            f"theory, smooth shell of {length:g} mm",
            own.slope_N_mm,
            theory,
            "the formula is per length, 1161 N/mm per metre; the printed slope is 20"
            f" times that of {length:g} mm",
            converged=theory * own.series_sum / SERIES_SUM,
        ),
    ]
    places = {
        "mid_face": "radial stiffness, loads at mid-face",
        "open_edge": "the same at the open edge",
        "face_width": "the same, loads spread over the face width",
    }
    for place, text in places.items():
        values = [v[place] for v in varied.values() if "fault" not in v]
        low, high = (min(values), max(values)) if values else (None, None)
        span = (
            "" if low is None else f"; {low:.3g} to {high:.3g} with what it leaves open"
        )
        rows.append(
            row(
                text,
                None,
                value_or_none(base, lambda f, place=place: f[place]),  # type: ignore[misc]
                reason_or_failure(base, f"experiment {HELD_BACK}{span}"),
                converged=value_or_none(fine, lambda f, place=place: f[place]),  # type: ignore[misc]
                low=low,
                high=high,
            )
        )
    large = found["force, large"]
    for key, text in (("outward", "pulled apart"), ("inward", "pressed together")):
        rows.append(
            row(
                f"the same at mid-face, {text} by w_0",
                None,
                value_or_none(large, lambda f, key=key: f[key]),  # type: ignore[misc]
                reason_or_failure(large, f"{HELD_BACK}; large rotations, secant"),
            )
        )
    ratio = None
    if "fault" not in base:
        ratio = base["mid_face"] / theory
    rows.append(
        row(
            "influence coefficient K",
            None,
            ratio,
            reason_or_failure(
                base,
                f"{HELD_BACK}; at mid-face, over the theory of {length:g} mm",
            ),
            unit="-",
        )
    )
    rows.append(
        row(
            "without teeth, loads at mid-face",
            None,
            value_or_none(smooth, lambda f: float(f["mid_face"])),
            reason_or_failure(
                smooth,
                "teeth stiffen the wall; the article's shell is stiffer because it"
                " bends all of its length as much as the loaded end",
            ),
        )
    )
    rows += [
        row(
            name,
            None,
            value_or_none(result, lambda f: float(f["mid_face"])),
            reason_or_failure(result, "not stated by the article"),
        )
        for name, result in varied.items()
    ]
    return rows
