"""Rows of the force and play of the deflected cup, and of elastic wave generators.

The article computes the force to design an elastic wave generator.
"""

from __future__ import annotations

from math import isfinite, isinf

import numpy as np

from swgjoint.errors import InputError
from swgjoint.fe.solid.wave_generator.elastic import (
    ElasticWaveGenerator,
    LobeCharacteristic,
)
from swgjoint.units import arcmin, mm
from swgjoint.validation.articles.file import Force
from swgjoint.validation.articles.runs import Found
from swgjoint.validation.rows import Row

PLACE = "two loads at mid-face, large rotations"
LOADED = (
    "the article's text applies 2P at each of two points, but its expression for the"
    " work and the resulting formula apply P"
)
PRELOAD = (
    "according to the article, this force preloads the teeth; in fact it bends the cup,"
    " and with the teeth assumed here, the play vanishes at the force listed below"
)


def characteristic_of(found: Found) -> LobeCharacteristic:
    """Convert a result of kind ``lobes`` to a characteristic in SI units."""
    return LobeCharacteristic(
        height=found["height_mm"] * mm,
        deflection=np.array(found["deflection_mm"]) * mm,
        force=np.array(found["force_N"]),
        play=1e-3 * np.array(found["play_mrad"]),
        pressed_deflection=np.array(found["pressed_mm"]) * mm,
        pressed_force=np.array(found["on_teeth_N"]),
    )


def lobe_rows(own: Force, found: Found) -> list[Row]:
    """Rows of force and play of the deflected cup, and of working points with springs.

    Args:
        own: Section of the study file.
        found: Result of the computation of kind ``lobes``.
    """
    cup = None if "fault" in found else characteristic_of(found)

    def row(quantity: str, unit: str, ours: float | None, reason: str) -> Row:
        known = ours is not None and isfinite(ours)
        return Row(
            case=own.base,
            quantity=quantity,
            unit=unit,
            source_value=None,
            ours=ours if known else None,
            reason=str(found.get("fault", reason)),
            more={"part": "force"},
        )

    nominal = wedged = closed = slope = None
    if cup is not None:
        nominal = cup.force_at(cup.height)
        if cup.height <= cup.highest:
            wedged = nominal + cup.tooth_force_at(cup.height)
        take_up = cup.take_up
        if not isinf(take_up):
            closed = cup.force_at(take_up)
            step = 0.01 * take_up
            before = cup.play_at(take_up - step)
            slope = before / arcmin / (step / 1e-6)
    rows = [
        row("lobe force at w_0", "N", nominal, f"{PLACE}; {LOADED}; {PRELOAD}"),
        row(
            "lobe force at w_0 with teeth",
            "N",
            wedged,
            "teeth and circular spline are elastic",
        ),
        row(
            "lobe deflection at which play vanishes",
            "mm",
            None if cup is None else cup.take_up / mm,
            "not printed; smaller under two loads than on an ellipse, because two loads"
            " bend the cup to a more pointed shape",
        ),
        row("lobe force at which play vanishes", "N", closed, "not printed"),
        row(
            "play taken up per micrometre of lobe deflection",
            "arcmin",
            slope,
            "not printed; approximately 2 tan(alpha)/r with pressure angle alpha and"
            " pitch radius r",
        ),
    ]
    for springs in own.springs:
        generator = ElasticWaveGenerator(
            stiffness=1e3 * springs.stiffness_N_mm, preload=springs.preload_N
        )
        name, reason = f"springs, {springs.name}", "assumed; the article prints none"
        values: tuple[float | None, ...] = (None,) * 4
        if cup is not None:
            try:
                at = cup.working_point(generator)
                values = (
                    at.deflection / mm,
                    at.force,
                    at.play / arcmin,
                    at.on_teeth,
                )
            except InputError as error:
                reason = str(error)
        parts = ("lobe deflection", "lobe force", "play", "force on the teeth")
        units = ("mm", "N", "arcmin", "N")
        for part, unit, value in zip(parts, units, values, strict=True):
            rows.append(row(f"{name}: {part}", unit, value, reason))
    return rows
