"""Rows of the articles study: closed forms, finite elements and variations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scipy.optimize import brentq

from swgjoint.gear.design.material import Material
from swgjoint.gear.shell_theory import (
    SERIES_SUM,
    FatigueFactors,
    ShellDimensions,
    ring_stiffness,
    shell_safety_factor,
)
from swgjoint.units import MPa, mm
from swgjoint.validation.articles.file import (
    ArticleVariation,
    Deflection,
    Force,
    StressAndFatigue,
    changed_design,
)
from swgjoint.validation.articles.runs import Found
from swgjoint.validation.row_entry import RowEntry, fill_rows
from swgjoint.validation.rows import Row

PLACES = ("mid_face", "open_edge", "face_width")
"""Places at which the two loads of a pinched cup act."""


def deflection_rows(own: Deflection, found: Mapping[str, Found]) -> list[Row]:
    """Rows of deflection and largest stress of the 80:1 drive.

    Args:
        own: Section of the study file.
        found: Results by computation.
    """
    drive = changed_design(own.base).drive
    lobe = (
        0.5 * drive.module_mm * (drive.teeth_circular_spline - drive.teeth_flexspline)
    )
    closed = {"lobe_mm": lobe, "height_mm": 2.0 * lobe}
    base = found["deflection"]
    texts = {"reduced_lobe": f"{own.coefficient * lobe:g}"}
    if "fault" not in base:
        texts |= {
            "z": f"{base['radial_z_mm']:.3g}",
            "angle": f"{base['radial_from_major_deg']:.2g}",
            "part": str(base["von_mises_part"]),
        }
    rows = fill_rows(
        own.rows,
        {**found, "closed form": closed},
        texts,
        case=own.base,
        part="deflection",
    )
    for variation in own.variations:
        entry = _varied(
            variation, "deflection", "largest_radial_mm", "mm", own.varied_quantity
        )
        rows += fill_rows([entry], found, {}, case=own.base, part="deflection")
    return rows


def _varied(
    variation: ArticleVariation, part: str, key: str, unit: str, quantity: str = ""
) -> RowEntry:
    """Row of a variation, which changes one assumption that an article leaves open."""
    return RowEntry(
        quantity=f"{quantity}, {variation.name}" if quantity else variation.name,
        unit=unit,
        ours=(f"{part}, {variation.name}", key),
        reason="not stated by the article",
    )


def force_rows(own: Force, found: Mapping[str, Found]) -> list[Row]:
    """Rows of the force that deforms XB1-100-80: formula, finite elements, variations.

    Args:
        own: Section of the study file.
        found: Results by computation.
    """
    design = changed_design(own.base)
    steel = design.material_of("flexspline")
    assert design.cup is not None
    length = design.cup.length_mm + design.drive.face_width_mm
    per_length = ring_stiffness(
        steel.youngs_modulus,
        design.flexspline.rim_mm * mm,
        own.radius_mm * mm,
        series_sum=own.series_sum,
    )
    theory = per_length * length * mm / 1e3  # N/mm
    closed = {
        "series_sum": SERIES_SUM,
        "stiffness": theory,
        "with_whole_series": theory * own.series_sum / SERIES_SUM,
    }
    texts = {"length": f"{length:g}"}
    values: dict[str, Mapping[str, Any]] = {**found, "closed form": closed}
    for place in PLACES:
        varied = [found[f"force, {v.name}"].get(place) for v in own.variations]
        known = [value for value in varied if value is not None]
        low, high = (min(known), max(known)) if known else (None, None)
        values[f"variations, {place}"] = {"low": low, "high": high}
        texts[f"span_{place}"] = (
            f"; {low:.3g} to {high:.3g} over the variations" if known else ""
        )
    base = found["force"]
    values["influence"] = (
        base if "fault" in base else {"coefficient": base["mid_face"] / theory}
    )
    rows = fill_rows(own.rows, values, texts, case=own.base, part="force")
    for variation in own.variations:
        entry = _varied(variation, "force", "mid_face", "N/mm")
        rows += fill_rows([entry], found, {}, case=own.base, part="force")
    return rows


def stress_rows(own: StressAndFatigue, found: Mapping[str, Found]) -> list[Row]:
    """Rows of the stress without torque: shell theory and finite elements.

    Args:
        own: Section of the study file.
        found: Results by computation.
    """
    shell = ShellDimensions.from_design(changed_design(own.base))
    shape = FatigueFactors().bending_shape
    closed = {
        "bending_MPa": shell.bending_stress() / MPa,
        "with_shape_MPa": shell.bending_stress(shape) / MPa,
    }
    texts = {
        "shape": f"{shape:g}",
        **{
            key: str(found[key].get("von_mises_part")) for key in ("ellipse", "crowned")
        },
    }
    values = {**found, "closed form": closed}
    for name in ("four", "four, fine"):
        values[name] = _at(found[name], 0.0)
    return fill_rows(own.rows, values, texts, case=own.base, part="stress")


def _at(found: Found, torque: float) -> Found:
    """Result of a computation at one torque [N·m]; empty if not computed there."""
    if "fault" in found:
        return found
    rows = found["by_torque"]
    return next((row for row in rows if row["torque_Nm"] == torque), {})


def _torque_at(allowable: float, shell: ShellDimensions, steel: Material) -> float:
    """Torque at which the closed forms reach a safety factor [N·m]."""

    def above(torque: float) -> float:
        return _safety(shell, torque, steel) - allowable

    return float(brentq(above, 0.0, 1e5))


def _safety(shell: ShellDimensions, torque: float, steel: Material) -> float:
    assert steel.fatigue_limit_bending and steel.fatigue_limit_torsion
    return shell_safety_factor(
        shell,
        torque,
        bending_limit=steel.fatigue_limit_bending,
        torsion_limit=steel.fatigue_limit_torsion,
    ).combined


def fatigue_rows(own: StressAndFatigue, found: Mapping[str, Found]) -> list[Row]:
    """Rows of safety factor, nodal force and stress at each torque.

    Args:
        own: Section of the study file.
        found: Results by computation.
    """
    design = changed_design(own.base)
    shell, radius = ShellDimensions.from_design(design), 0.5 * design.pitch_diameter
    steel = design.material_of("flexspline")
    limit = {"torque_Nm": _torque_at(own.allowable, shell, steel)}
    rows = fill_rows(
        own.fatigue_rows,
        {"closed form": limit},
        {"allowable": f"{own.allowable:g}"},
        case=own.base,
        part="fatigue",
    )
    for k, torque in enumerate(own.torques_Nm):
        values = {
            name: _at(result, torque)
            for name, result in found.items()
            if name.startswith(("four", "fatigue"))
        }
        values["closed form"] = {
            "nodal_force_N": torque / (radius * own.nodes),
            "safety": _safety(shell, torque, steel),
        }
        values["printed"] = {
            "nodal_force_N": own.nodal_force_N[k],
            "von_mises_MPa": own.von_mises_MPa[k],
        }
        lifted = values["four"].get("least_force_N", 0.0) < 0.0
        rows += fill_rows(
            own.torque_rows,
            values,
            {"pulls": ", of which one pulls" if lifted else ""},
            case=f"{own.base} {torque:g} N·m",
            part="fatigue",
            torque_Nm=torque,
        )
    return rows
