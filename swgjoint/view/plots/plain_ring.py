"""Picture of a plain ring that two rollers in its bore pull apart."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.gear.pulled_ring import small_deflection
from swgjoint.pictures import png
from swgjoint.units import deg, mm, um

if TYPE_CHECKING:
    from swgjoint.validation.ring import RingCase

LARGER = 8.0
"""Magnification of the drawn deflection."""


def ring_picture(cases: Sequence[RingCase], *, fine: int, total: float) -> bytes:
    """Draw the shape, the deflection around the ring, and b_G over a_G as PNG.

    a_G is the outward deflection above a roller and b_G the inward deflection at 45 deg
    from it.

    Args:
        cases: Rings of different thickness; shape and deflection are those of the first
            one.
        fine: Mesh refinement of the results to draw.
        total: a_G + b_G at the last point of measurement [m].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 4.6), layout="constrained")
    shape, around, inward = figure.subplots(1, 3)
    _shape(shape, cases[0], fine)
    _around(around, cases[0], fine)
    _inward(inward, cases, fine, total)
    return png(figure, dpi=110)


def _shape(ax: Any, case: RingCase, fine: int) -> None:
    """Draw the outer surface at rest and at the largest travel, magnified."""
    radius = case.ring.outer_radius
    phi = np.linspace(0.0, 2.0 * pi, 400)
    ax.plot(*(radius / mm * np.array([np.sin(phi), np.cos(phi)])), "k--", lw=0.8)
    quarter = case.pulled[fine].outline[-1]
    away, polar = np.hypot(*quarter.T) - radius, np.arctan2(*quarter.T)
    drawn = (radius + LARGER * away) / mm
    for x in (1, -1):
        for y in (1, -1):
            ax.plot(x * drawn * np.sin(polar), y * drawn * np.cos(polar), "tab:blue")
    ax.set_aspect("equal")
    ax.set_title(f"{case.name}, deflection x {LARGER:g}", fontsize="medium")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm], through the rollers")


def _around(ax: Any, case: RingCase, fine: int) -> None:
    """Draw the deflection over the angle at the largest travel, next to theory."""
    radius, quarter = case.ring.outer_radius, case.pulled[fine].outline[-1]
    polar, away = np.arctan2(*quarter.T), np.hypot(*quarter.T) - radius
    ax.plot(polar / deg, away / mm, label="finite elements")
    small = away[0] * small_deflection(polar)
    ax.plot(polar / deg, small / mm, "k:", label="thin ring, small deflections")
    ax.axhline(0.0, color="0.6", lw=0.8)
    ax.axvline(45.0, color="0.6", lw=0.8)
    ax.set_title("outward deflection of the outer surface", fontsize="medium")
    ax.set_xlabel("angle from the rollers [deg]")
    ax.set_ylabel("deflection [mm]")
    ax.legend(fontsize="small")
    ax.grid(alpha=0.3)


def _inward(ax: Any, cases: Sequence[RingCase], fine: int, total: float) -> None:
    """Draw b_G over a_G of all rings, both thin-ring results, and the given total."""
    for case in cases:
        deflection = case.pulled[fine].deflection
        ax.plot(deflection[:, 0] / mm, -deflection[:, 1] / um, ".-", label=case.name)
    crown = np.linspace(0.0, float(deflection[-1, 0]), 9)
    bent = [case.elastica_inward(float(a)) / um if a else 0.0 for a in crown]
    ax.plot(crown / mm, bent, "k--", lw=1.0, label="thin ring, large rotations")
    small = -float(small_deflection(pi / 4))
    ax.plot(crown / mm, small * crown / um, "k:", label="thin ring, small deflections")
    top = 1.1 * max(bent)
    label = f"a_G + b_G = {total / mm:g} mm"
    ax.plot([total / mm, (total - top * um) / mm], [0.0, top], "0.6", label=label)
    ax.set_xlim(left=0.0)
    ax.set_ylim(0.0, top)
    ax.set_title("inward deflection at 45 deg", fontsize="medium")
    ax.set_xlabel("outward deflection a_G above a roller [mm]")
    ax.set_ylabel("inward deflection b_G [µm]")
    ax.legend(fontsize="small")
    ax.grid(alpha=0.3)
