"""Rows of the study of the articles: printed values beside ours, with reasons."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
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
    Deflection,
    Force,
    StressAndFatigue,
    changed_design,
)
from swgjoint.validation.articles.runs import Found
from swgjoint.validation.rows import Row

HELD_BACK = "held back"


def _value(found: Found, pick: Callable[[Found], float]) -> float | None:
    return None if "fault" in found else pick(found)


def _reason(found: Found, reason: str) -> str:
    return str(found.get("fault", reason))


def _at(found: Found, torque: float) -> Found:
    """What was found at a torque, if it was computed there."""
    rows = found.get("by_torque", [])
    return next((row for row in rows if row["torque_Nm"] == torque), {})


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
            value = _value(found, lambda f: float(f[key]))
            better = _value(fine, lambda f: float(f[key]))
            why = _reason(found, reason)
        return _row("deflection", own.base, quantity, unit, source, value, why, better)

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
                ours=_value(
                    results[f"deflection, {v.name}"],
                    lambda f: float(f["largest_radial_mm"]),
                ),
                reason=_reason(
                    results[f"deflection, {v.name}"], "not stated by the article"
                ),
                more={"part": "deflection"},
            )
            for v in own.variations
        ),
    ]


def _row(
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


def _at_torque(found: Found, k: int, *keys: str) -> float | None:
    """What a computation says at its torque number k, None where it failed."""

    def value(f: Found) -> float:
        part = f["by_torque"][k]
        for key in keys:
            part = part[key]
        return float(part)

    return _value(found, value)


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
        return _row(
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
                _value(base, lambda f, place=place: f[place]),  # type: ignore[misc]
                _reason(base, f"experiment {HELD_BACK}{span}"),
                converged=_value(fine, lambda f, place=place: f[place]),  # type: ignore[misc]
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
                _value(large, lambda f, key=key: f[key]),  # type: ignore[misc]
                _reason(large, f"{HELD_BACK}; large rotations, secant"),
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
            _reason(
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
            _value(smooth, lambda f: float(f["mid_face"])),
            _reason(
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
            _value(result, lambda f: float(f["mid_face"])),
            _reason(result, "not stated by the article"),
        )
        for name, result in varied.items()
    ]
    return rows


def stress_rows(own: StressAndFatigue, found: Mapping[str, Found]) -> list[Row]:
    """Stress without torque: shell theory and finite elements."""
    shell = ShellDimensions.from_design(changed_design(own.base))
    four, fine = found["four"], found["four, fine"]

    row = partial(_row, "stress", own.base)

    def at_rest(*keys: str) -> tuple[float | None, float | None]:
        return _at_torque(four, 0, *keys), _at_torque(fine, 0, *keys)

    nominal, nominal_fine = at_rest("mid_face", "normal_amplitude_MPa")
    peak, peak_fine = at_rest("von_mises_amplitude_MPa", "root, mid-face")
    largest, largest_fine = at_rest("von_mises_MPa")
    factor = FatigueFactors().bending_shape
    rows = [
        row(
            "bending stress, 1.5 E s_1 w_0/r_m^2",
            "MPa",
            own.bending_MPa,
            shell.bending_stress() / MPa,
            "the printed formula and numbers give this",
        ),
        row(
            f"the same with C_sigma = {factor:g}",
            "MPa",
            own.bending_MPa,
            shell.bending_stress(factor) / MPa,
            "four forces at 25 deg",
        ),
        row(
            "four forces: nominal stress at the roots, mid-face",
            "MPa",
            None,
            nominal,
            _reason(four, "only the sections between the teeth bend"),
            nominal_fine,
        ),
        row(
            "four forces: half range of von Mises stress at a root, mid-face",
            "MPa",
            None,
            peak,
            _reason(four, "with the notch that the fillet is"),
            peak_fine,
        ),
        row(
            "four forces: largest von Mises stress",
            "MPa",
            None,
            largest,
            _reason(four, f"{HELD_BACK}; ours in a tooth fillet, tooth form chosen"),
            largest_fine,
        ),
    ]
    for name, text in (
        ("ellipse", "rigid ellipse"),
        ("crowned", "rigid ellipse, crowned and sloped"),
    ):
        result, finer = found[name], found.get(f"{name}, fine", {})
        place = str(result.get("von_mises_part", ""))
        rows.append(
            row(
                f"{text}: largest radial displacement",
                "mm",
                own.largest_radial_mm if name == "ellipse" else None,
                _value(result, lambda f: float(f["largest_radial_mm"])),
                _reason(result, "the source sets w_0 = 0.372 mm by pressure on areas"),
                finer.get("largest_radial_mm"),
            )
        )
        rows.append(
            row(
                f"{text}: largest von Mises stress",
                "MPa",
                None,
                _value(result, lambda f: float(f["von_mises_MPa"])),
                _reason(
                    result,
                    f"at the {place}; a straight generator bends the cup at its edge,"
                    " which four forces do not",
                ),
                finer.get("von_mises_MPa"),
            )
        )
    return rows


def _torque_at(allowable: float, shell: ShellDimensions, steel: Material) -> float:
    """Torque at which the closed forms reach a safety factor [N·m]."""
    assert steel.fatigue_limit_bending and steel.fatigue_limit_torsion
    limits = steel.fatigue_limit_bending, steel.fatigue_limit_torsion

    def above(torque: float) -> float:
        found = shell_safety_factor(
            shell, torque, bending_limit=limits[0], torsion_limit=limits[1]
        )
        return found.combined - allowable

    return float(brentq(above, 0.0, 1e5))


def fatigue_rows(own: StressAndFatigue, found: Mapping[str, Found]) -> list[Row]:
    """Safety factors over the torque."""
    design = changed_design(own.base)
    shell, radius = ShellDimensions.from_design(design), 0.5 * design.pitch_diameter
    steel = design.material_of("flexspline")
    assert steel.fatigue_limit_bending and steel.fatigue_limit_torsion
    rows = [
        Row(
            case=own.base,
            quantity=f"torque at S = {own.allowable:g}, shell theory",
            unit="N·m",
            source_value=None,
            ours=_torque_at(own.allowable, shell, steel),
            reason=f"{HELD_BACK}; the torque is even shear alone here",
            more={"part": "fatigue"},
        )
    ]

    def pick(name: str, k: int, *keys: str) -> float | None:
        return _at_torque(found[name], k, *keys)

    for k, torque in enumerate(own.torques_Nm):

        def row(
            quantity: str,
            ours: float | None,
            reason: str,
            *,
            unit: str = "-",
            source: float | None = None,
            converged: float | None = None,
            torque: float = torque,
        ) -> None:
            case = f"{own.base} {torque:g} N·m"
            values = quantity, unit, source, ours, reason, converged
            rows.append(_row("fatigue", case, *values, torque_Nm=torque))

        theory = shell_safety_factor(
            shell,
            torque,
            bending_limit=steel.fatigue_limit_bending,
            torsion_limit=steel.fatigue_limit_torsion,
        ).combined
        row(
            "nodal force T/(R N)",
            torque / (radius * own.nodes),
            "58 N by the formula at 20 N·m; R chosen with the teeth",
            unit="N",
            source=own.nodal_force_N[k],
        )
        row(
            "S, shell theory",
            theory,
            f"{HELD_BACK}; its torque is even shear alone",
        )
        four, fine = found["four"], found["four, fine"]
        lifted = (pick("four", k + 1, "least_force_N") or 0.0) < 0.0
        row(
            "S, four forces, mid-face",
            pick("four", k + 1, "mid_face", "S"),
            _reason(
                four,
                f"{HELD_BACK}; forces on 11 teeth bend the ring between its supports"
                + (", of which one pulls" if lifted else ""),
            ),
            converged=None
            if "fault" in fine
            else pick("four, fine", k + 1, "mid_face", "S"),
        )
        row(
            "largest von Mises stress, four forces",
            pick("four", k + 1, "von_mises_MPa"),
            _reason(four, "tooth fillets and the loaded teeth; the source's is a fit"),
            unit="MPa",
            source=own.von_mises_MPa[k],
            converged=pick("four, fine", k + 1, "von_mises_MPa"),
        )
        for name, text in (("fatigue", "ellipse"), ("fatigue, crowned", "crowned")):
            result = found[name]
            on_fine = {}
            if name == "fatigue":
                on_fine = _at(found["fatigue, fine"], torque)
            row(
                f"S, meshing, {text}, mid-face",
                pick(name, k, "mid_face", "S"),
                _reason(result, f"{HELD_BACK}; nominal stress times K_sigma"),
                converged=on_fine.get("mid_face", {}).get("S"),
            )
            row(
                f"S, meshing, {text}, worst section",
                pick(name, k, "worst_section", "S"),
                _reason(result, f"{HELD_BACK}; with the ellipse at the back edge"),
                converged=on_fine.get("worst_section", {}).get("S"),
            )
            row(
                f"S, meshing, {text}, without factors",
                pick(name, k, "S_without_factors_mid_face"),
                _reason(result, f"{HELD_BACK}; from the peak in the fillet, mid-face"),
                converged=on_fine.get("S_without_factors_mid_face"),
            )
    return rows
