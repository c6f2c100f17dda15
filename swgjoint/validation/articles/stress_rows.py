"""Rows on stress and fatigue of the study of the articles."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from scipy.optimize import brentq

from swgjoint.gear.design.material import Material
from swgjoint.gear.shell_theory import (
    FatigueFactors,
    ShellDimensions,
    shell_safety_factor,
)
from swgjoint.units import MPa
from swgjoint.validation.articles.file import StressAndFatigue, changed_design
from swgjoint.validation.articles.rows import (
    HELD_BACK,
    article_row,
    reason_or_failure,
    value_or_none,
)
from swgjoint.validation.articles.runs import Found
from swgjoint.validation.rows import Row


def _at(found: Found, torque: float) -> Found:
    """What was found at a torque, if it was computed there."""
    rows = found.get("by_torque", [])
    return next((row for row in rows if row["torque_Nm"] == torque), {})


def _at_torque(found: Found, k: int, *keys: str) -> float | None:
    """What a computation says at its torque number k, None where it failed."""

    def value(f: Found) -> float:
        part = f["by_torque"][k]
        for key in keys:
            part = part[key]
        return float(part)

    return value_or_none(found, value)


def stress_rows(own: StressAndFatigue, found: Mapping[str, Found]) -> list[Row]:
    """Stress without torque: shell theory and finite elements."""
    shell = ShellDimensions.from_design(changed_design(own.base))
    four, fine = found["four"], found["four, fine"]

    row = partial(article_row, "stress", own.base)

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
            reason_or_failure(four, "only the sections between the teeth bend"),
            nominal_fine,
        ),
        row(
            "four forces: half range of von Mises stress at a root, mid-face",
            "MPa",
            None,
            peak,
            reason_or_failure(four, "with the notch that the fillet is"),
            peak_fine,
        ),
        row(
            "four forces: largest von Mises stress",
            "MPa",
            None,
            largest,
            reason_or_failure(
                four, f"{HELD_BACK}; ours in a tooth fillet, tooth form chosen"
            ),
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
                value_or_none(result, lambda f: float(f["largest_radial_mm"])),
                reason_or_failure(
                    result, "the source sets w_0 = 0.372 mm by pressure on areas"
                ),
                finer.get("largest_radial_mm"),
            )
        )
        rows.append(
            row(
                f"{text}: largest von Mises stress",
                "MPa",
                None,
                value_or_none(result, lambda f: float(f["von_mises_MPa"])),
                reason_or_failure(
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
            rows.append(article_row("fatigue", case, *values, torque_Nm=torque))

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
            reason_or_failure(
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
            reason_or_failure(
                four, "tooth fillets and the loaded teeth; the source's is a fit"
            ),
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
                reason_or_failure(result, f"{HELD_BACK}; nominal stress times K_sigma"),
                converged=on_fine.get("mid_face", {}).get("S"),
            )
            row(
                f"S, meshing, {text}, worst section",
                pick(name, k, "worst_section", "S"),
                reason_or_failure(
                    result, f"{HELD_BACK}; with the ellipse at the back edge"
                ),
                converged=on_fine.get("worst_section", {}).get("S"),
            )
            row(
                f"S, meshing, {text}, without factors",
                pick(name, k, "S_without_factors_mid_face"),
                reason_or_failure(
                    result, f"{HELD_BACK}; from the peak in the fillet, mid-face"
                ),
                converged=on_fine.get("S_without_factors_mid_face"),
            )
    return rows
