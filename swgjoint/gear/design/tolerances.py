"""Manufacturing errors of one drive: actual positions of teeth and wave generator.

The seed of the design determines all random errors and angles. Each has its own random
stream, so that adding one error does not change the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.gear.design.design import Design, MemberName
from swgjoint.gear.wave_generators.oval import Oval
from swgjoint.gear.wave_generators.wave_generator import WaveGenerator, wave_generator
from swgjoint.typing import Array
from swgjoint.units import arcmin, um

HARMONICS = (1, 2, 3, 4)
"""Harmonics k of the cumulative pitch error, with amplitudes proportional to 1/k."""

TEETH = (
    "flexspline_cumulative_pitch_um",
    "circular_spline_cumulative_pitch_um",
    "random_pitch_um",
    "circular_spline_eccentricity_um",
    "circular_spline_ovality_um",
)
"""Keys of errors that displace teeth."""

# random streams of the errors
_PITCH = {"flexspline": 1, "circular_spline": 2}
_RANDOM = {"flexspline": 3, "circular_spline": 4}
_OVALITY, _ECCENTRICITY, _WAVE_GENERATOR, _OUTLINE, _TILT = 5, 6, 7, 8, 9


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothErrors:
    """Displacement of the teeth of one member from their nominal positions."""

    tangential: Array
    """Displacement along the pitch circle, counter-clockwise positive (n_teeth,)
    [m]."""
    radial: Array
    """Radial displacement, positive outwards (n_teeth,) [m]."""

    @property
    def shift(self) -> Array:
        """Displacement in the frames of the teeth, +y outwards (n_teeth, 2) [m]."""
        return np.stack([-self.tangential, self.radial], axis=-1)


def tooth_errors(design: Design, member: MemberName) -> ToothErrors:
    r"""Errors of the teeth of a member.

    * Cumulative pitch error: :math:`\sum_{k=1}^4 \cos(k\varphi - \varphi_k)/k` with
      random phases, scaled to the peak-to-peak value that the design states.
    * Random pitch error: a normally distributed displacement along the pitch circle
      with the stated standard deviation. The mean over all teeth is subtracted.
    * Ovality of the circular spline: a radial displacement. The design states the
      largest minus the smallest radius.
    * Eccentricity of the circular spline: a translation of all teeth.

    Args:
        design: The drive.
        member: Member whose teeth are displaced.
    """
    spec = design.tolerances
    count = getattr(design.drive, f"teeth_{member}")
    angle = 2.0 * np.pi / count * np.arange(count)
    tangential, radial = np.zeros(count), np.zeros(count)
    cumulative = getattr(spec, f"{member}_cumulative_pitch_um") * um
    if cumulative:
        phases = _stream(spec.seed, _PITCH[member]).uniform(0.0, 2.0 * np.pi, 4)
        wave = sum(
            np.cos(k * angle - phase) / k
            for k, phase in zip(HARMONICS, phases, strict=True)
        )
        tangential += cumulative * wave / np.ptp(wave)
    if spec.random_pitch_um:
        noise = _stream(spec.seed, _RANDOM[member]).standard_normal(count)
        tangential += spec.random_pitch_um * um * (noise - noise.mean())
    if member == "circular_spline":
        turn = _stream(spec.seed, _OVALITY).uniform(0.0, np.pi)
        radial += (
            0.5 * spec.circular_spline_ovality_um * um * np.cos(2 * (angle - turn))
        )
        turn = _stream(spec.seed, _ECCENTRICITY).uniform(0.0, 2.0 * np.pi)
        offset = spec.circular_spline_eccentricity_um * um
        radial += offset * np.cos(angle - turn)
        tangential -= offset * np.sin(angle - turn)
    return ToothErrors(tangential=tangential, radial=radial)


def wave_generator_offset(design: Design) -> Array:
    """Centre of the outline in the rotating frame of the wave generator (2,) [m].

    The wave generator rotates about the gear axis, not about this centre.
    """
    turn = _stream(design.tolerances.seed, _WAVE_GENERATOR).uniform(0.0, 2.0 * np.pi)
    size = design.tolerances.wave_generator_eccentricity_um * um
    return size * np.array([-np.sin(turn), np.cos(turn)])


def axis_tilt(design: Design) -> Array:
    """Slopes dx/dz and dy/dz of the axis of the circular spline (2,) [rad].

    The axis intersects the common axis of flexspline and wave generator in the middle
    of the face width. The design states the angle between the two axes, and the seed
    determines the direction of the tilt. The axis is fixed in the bearings, so it does
    not rotate with the circular spline. At the distance z from the middle of the face
    width, the teeth are displaced by z times the slopes.
    """
    turn = _stream(design.tolerances.seed, _TILT).uniform(0.0, 2.0 * np.pi)
    size = design.tolerances.misalignment_arcmin * arcmin
    return size * np.array([-np.sin(turn), np.cos(turn)])


def flawed_wave_generator(design: Design) -> WaveGenerator:
    """Outline of the wave generator with its ovality, about its own centre.

    The design states the largest minus the smallest deviation along the normal. The
    seed determines the angle between the ovality and the major axis.

    Raises:
        DesignError: If the wave generator cannot be built.
    """
    outline = wave_generator(design)
    ovality = design.tolerances.wave_generator_ovality_um * um
    if ovality == 0.0:
        return outline
    angle = _stream(design.tolerances.seed, _OUTLINE).uniform(0.0, np.pi)
    return Oval(nominal=outline, ovality=ovality, angle=float(angle))


def with_perfect_teeth(design: Design) -> Design:
    """The same drive, with manufacturing errors of the wave generator only."""
    keys = (*TEETH, "misalignment_arcmin")
    return design.with_changes({f"tolerances.{key}": 0.0 for key in keys})


def without_errors(design: Design) -> Design:
    """The same drive without any manufacturing error."""
    keys = set(type(design.tolerances).model_fields) - {"seed"}
    return design.with_changes({f"tolerances.{key}": 0.0 for key in keys})


def has_errors(design: Design) -> bool:
    """Whether the design has any manufacturing error."""
    return any(design.tolerances.model_dump(exclude={"seed"}).values())


def _stream(seed: int, number: int) -> np.random.Generator:
    return np.random.default_rng([seed, number])
