r"""Cup on an elastic wave generator: lobe force, deflection and tooth clearance.

An elastic wave generator does not prescribe the height of its lobes but presses them
outward with springs. The force F of a lobe follows from its deflection w, the lobe
height :math:`w_0` of the drive, the stiffness k of the springs and their force
:math:`F_0` at that height. Without tooth contact the cup balances it:

.. math:: F = F_0 + k\,(w_0 - w) = F_{cup}(w).

:math:`F_{cup}` is the force of two opposite radial loads on a cup with large rotations
(:mod:`swgjoint.fe.solid.figures.pinched_cup`); to first order it is the radial
stiffness times w. In the limit :math:`k \to \infty` the wave generator is rigid; with
k = 0 its force is constant.

The play of the teeth is the angle by which the unloaded output can rotate between tooth
contact in both directions, with undeformed teeth. It decreases as w increases and is
zero at the take-up deflection. Beyond it the teeth carry the part of the spring force
that exceeds :math:`F_{cup}` (:mod:`swgjoint.fe.solid.wave_generator.lobe_pads`, with an
elastic circular spline).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isinf, nan

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq

from swgjoint.errors import ComputationError, InputError
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.figures.pinched_cup import PinchedCup
from swgjoint.fe.solid.figures.tooth_play import play
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.wave_generator.lobe_pads import force_on_teeth
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import mm

HEIGHTS = (0.25, 0.5, 0.75, 0.85, 0.95, 1.05, 1.15, 1.25)
"""Approximate deflections at which the cup is solved, in lobe heights of the drive [-].
"""
BEYOND = (0.02, 0.05, 0.1, 0.15)
"""Deflections beyond the take-up at which tooth contact is solved, in lobe heights of
the drive [-]."""


@dataclass(frozen=True, kw_only=True)
class ElasticWaveGenerator:
    """Springs that press two lobes outward."""

    stiffness: float
    """Stiffness k of the spring of each lobe [N/m]; infinite for a rigid wave
    generator."""
    preload: float
    """Spring force of each lobe at the lobe height of the drive [N]; unused for a rigid
    wave generator."""


@dataclass(frozen=True, kw_only=True)
class WorkingPoint:
    """Equilibrium of an elastic wave generator and a cup without output torque."""

    deflection: float
    """Outward deflection of a lobe [m]."""
    force: float
    """Force of a lobe [N]."""
    on_teeth: float
    """Part of this force that the teeth carry [N]; zero before the take-up."""
    play: float
    """Play of the output [rad]; zero from the take-up on, NaN if the lobes are so low
    that teeth next to them overlap."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LobeCharacteristic:
    """Force of two opposite lobes on a cup, and play of its teeth, over deflection."""

    height: float
    """Lobe height of the drive [m]."""
    deflection: Array
    """Deflections of a lobe, increasing from zero (n,) [m]."""
    force: Array
    """Forces of a lobe without tooth contact (n,) [N]."""
    play: Array
    """Play of the output (n,) [rad], see :mod:`swgjoint.fe.solid.figures.tooth_play`.
    """
    pressed_deflection: Array
    """Deflections with tooth contact, starting at the take-up (m,) [m]; empty if the
    play does not vanish."""
    pressed_force: Array
    """Part of the force of a lobe that the teeth carry at these deflections, increasing
    from zero (m,) [N]."""

    def force_at(self, deflection: float) -> float:
        """Force of a lobe without tooth contact [N] at a deflection [m].

        Raises:
            InputError: If the deflection is outside the solved range.
        """
        self._check(deflection)
        return float(CubicSpline(self.deflection, self.force)(deflection))

    def play_at(self, deflection: float) -> float:
        """Play of the output [rad] at a deflection [m]; NaN where it is not finite.

        Raises:
            InputError: If the deflection is outside the solved range.
        """
        self._check(deflection)
        finite = np.isfinite(self.play)
        w, play = self.deflection[finite], self.play[finite]
        if len(w) < 2 or not w[0] <= deflection <= w[-1]:
            return nan
        return float(PchipInterpolator(w, play)(deflection))

    @property
    def take_up(self) -> float:
        """Take-up deflection, at which the play vanishes [m].

        It is infinite if the play does not vanish within the solved range.
        """
        finite = np.isfinite(self.play)
        w, play = self.deflection[finite], self.play[finite]
        free = np.flatnonzero(play > 0.0)
        if not len(free):
            return float(w[0]) if len(w) else inf
        if free[-1] == len(w) - 1:
            return inf
        return float(brentq(self.play_at, w[free[-1]], w[free[-1] + 1]))

    def tooth_force_at(self, deflection: float) -> float:
        """Part of the force of a lobe that the teeth carry [N] at a deflection [m].

        Raises:
            InputError: If the deflection is outside the solved range.
        """
        self._check(deflection)
        if not deflection > self.take_up:
            return 0.0
        if deflection > self.highest:
            raise InputError(
                f"lobe deflection = {deflection / mm:.4g} mm: expected at most"
                f" {self.highest / mm:.4g} mm with teeth in contact"
            )
        through = PchipInterpolator(self.pressed_deflection, self.pressed_force)
        return float(through(deflection))

    @property
    def highest(self) -> float:
        """Largest deflection for which the forces of cup and teeth are known [m]."""
        last = float(self.deflection[-1])
        if isinf(self.take_up):
            return last
        return min(last, float(np.max(self.pressed_deflection, initial=self.take_up)))

    def working_point(self, generator: ElasticWaveGenerator) -> WorkingPoint:
        """Equilibrium of springs, cup and teeth.

        Raises:
            InputError: If the equilibrium is outside the solved range.
        """
        k, w = generator.stiffness, self.height
        if not isinf(k):
            low, high = float(self.deflection[0]), self.highest

            def pushed(w: float) -> float:
                springs = generator.preload + k * (self.height - w)
                return springs - self.force_at(w) - self.tooth_force_at(w)

            if not pushed(low) >= 0.0 >= pushed(high):
                least, most = (generator.preload - pushed(end) for end in (low, high))
                raise InputError(
                    f"preload = {generator.preload:.4g} N with a stiffness of"
                    f" {k / 1e3:.4g} N/mm: expected {least:.4g} to {most:.4g} N"
                )
            w = float(brentq(pushed, low, high, xtol=1e-15))
        on_teeth = self.tooth_force_at(w)
        return WorkingPoint(
            deflection=w,
            force=self.force_at(w) + on_teeth,
            on_teeth=on_teeth,
            play=0.0 if w >= self.take_up else self.play_at(w),
        )

    def _check(self, deflection: float) -> None:
        low, high = self.deflection[0], self.deflection[-1]
        if not low <= deflection <= high:
            raise InputError(
                f"lobe deflection = {deflection / mm:.4g} mm: expected"
                f" {low / mm:.4g} to {high / mm:.4g} mm"
            )


def lobe_characteristic(
    design: Design,
    *,
    place: str = "mid_face",
    heights: Sequence[float] = HEIGHTS,
    progress: Progress = silent,
) -> LobeCharacteristic:
    """Compute force and play of a flexspline that two opposite lobes press outward.

    Deflections beyond the take-up for which no equilibrium is found are omitted.

    Args:
        design: The drive, with a ``[cup]``.
        place: Axial position of the lobe force, one of
            :data:`swgjoint.fe.solid.figures.pinched_cup.PLACES`.
        heights: Approximate deflections, increasing, in lobe heights of the drive [-].
        progress: Called after every deflection.

    Raises:
        DesignError: If the design cannot be meshed, has an odd number of teeth or has
            features that the 3D model lacks.
        ComputationError: If a solve fails or the model does not fit in memory.
    """
    # force and play without tooth contact
    model = solid_sector_model(design, half=True)
    cup, height = cup_of(model, design), lobe_height(design)
    stiffness = cup.pull(1.0, place).stiffness
    total = len(heights) + len(BEYOND)
    rows = [(0.0, 0.0, nan)]  # without deflection the teeth of every drive overlap
    for k, share in enumerate(heights):
        pulled = cup.pull(share * stiffness * height, place, nonlinear=True)
        frame = cup.frames(pulled.masters, nonlinear=True)[0]
        load = np.zeros((model.sectors, len(pulled.load)))
        load[0] = pulled.load
        free = play(model, frame, load, design.ratio)
        rows.append((pulled.force, pulled.deflection, free))
        progress("lobe force", k + 1, total)
    force, deflection, plays = np.array(rows).T
    none = np.zeros(0)
    free_teeth = LobeCharacteristic(
        height=height,
        force=force,
        deflection=deflection,
        play=plays,
        pressed_deflection=none,
        pressed_force=none,
    )
    if isinf(free_teeth.take_up):
        return free_teeth
    # force on the teeth beyond the take-up
    pressed, planes = [(free_teeth.take_up, 0.0)], cup.share(place)
    for k, part in enumerate(BEYOND):
        w = free_teeth.take_up + part * height
        if w > deflection[-1]:
            break
        pulled = cup.pull(free_teeth.force_at(w), place, nonlinear=True)
        try:
            taken = force_on_teeth(model, design.ratio, planes, pulled.of_planes)
        except ComputationError:
            break  # the range ends here
        pressed.append((pulled.deflection, taken))
        progress("lobe force", len(heights) + k + 1, total)
    beyond, taken_by_teeth = np.array(pressed).T
    return replace(free_teeth, pressed_deflection=beyond, pressed_force=taken_by_teeth)


def cup_of(model: SolidSectorModel, design: Design) -> PinchedCup:
    """Cup that consists of the condensed flexspline of a half model.

    Args:
        model: Half model of the drive.
        design: The drive.
    """
    strip, flank = model.strip, model.strip.flank_dofs // 3
    return PinchedCup(
        name=design.drive.name,
        sectors=model.sectors,
        strip=strip.mesh,
        masters=strip.masters,
        segments=strip.segments,
        root=design.flexspline_inner_radius + design.flexspline.rim_mm * mm,
        bore=len(strip.bore),
        first=flank,
    )
