r"""Fatigue of the flexspline from the stresses of a 3D equilibrium.

A point of the flexspline passes all phases of the deflection while the wave generator
makes half a turn relative to it. At a single position of the wave generator the
corresponding points of all sectors are at different phases, so that their stresses
together are the stress history of one point. The phases of tooth contact are sampled in
the same way.

The assessment is that of the article "stress and fatigue", see
:mod:`swgjoint.gear.shell_theory`. Its nominal stress is a shell stress, to which it
applies stress concentration factors. Here the nominal stress is linearised over the
wall between two teeth, from the middle of the root land to the bore: the sum of its
membrane and bending parts at the root. For comparison, half of the largest range of the
von Mises stress in the meshed root fillet is reported without any factor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError, DesignError
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.stress import flexspline_stresses
from swgjoint.fe.solid.strip.mesh import StripMesh
from swgjoint.gear.design.design import Design
from swgjoint.gear.shell_theory import (
    SafetyFactor,
    ShellDimensions,
    safety_factor,
    shell_safety_factor,
)
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import MPa, mm


@dataclass(frozen=True, kw_only=True)
class FatigueLimits:
    """Endurance limits of a material."""

    bending: float
    """Endurance limit in reversed bending [Pa]."""
    torsion: float
    """Endurance limit in reversed torsion [Pa]."""

    @classmethod
    def from_design(cls, design: Design) -> FatigueLimits:
        """Endurance limits of the flexspline's material.

        Raises:
            DesignError: If the design does not state both limits.
        """
        material = design.material_of("flexspline")
        bending, torsion = (
            material.fatigue_limit_bending,
            material.fatigue_limit_torsion,
        )
        if bending is None or torsion is None:
            raise DesignError(
                f"{design.drive.name}: the fatigue safety factor needs"
                " material.fatigue_limit_bending_MPa and"
                " material.fatigue_limit_torsion_MPa"
            )
        return cls(bending=bending, torsion=torsion)


@dataclass(frozen=True, kw_only=True)
class SectionFatigue:
    """Nominal stress at the root in one plane of the mesh, and its safety factor.

    Amplitudes and means are those over one turn of the wave generator relative to the
    flexspline.
    """

    z: float
    """Coordinate z of the plane, zero in the middle of the face width [m]."""
    normal_amplitude: float
    """Amplitude of the circumferential normal stress [Pa]."""
    normal_mean: float
    """Mean of the circumferential normal stress [Pa], which the formulas of the article
    omit."""
    axial_amplitude: float
    """Amplitude of the axial normal stress [Pa]."""
    shear_amplitude: float
    """Amplitude of the shear stress [Pa]."""
    shear_mean: float
    """Mean of the shear stress [Pa]."""
    safety: SafetyFactor
    """Safety factors of the article for these stresses."""

    def to_json(self) -> dict[str, float]:
        """Coordinate [mm], stresses [MPa] and safety factors [-]."""
        return {
            "z_mm": self.z / mm,
            "normal_amplitude_MPa": self.normal_amplitude / MPa,
            "normal_mean_MPa": self.normal_mean / MPa,
            "axial_amplitude_MPa": self.axial_amplitude / MPa,
            "shear_amplitude_MPa": self.shear_amplitude / MPa,
            "shear_mean_MPa": self.shear_mean / MPa,
            "S_normal": self.safety.normal,
            "S_shear": self.safety.shear,
            "S": self.safety.combined,
        }


@dataclass(frozen=True, kw_only=True)
class Fatigue:
    """Fatigue of a flexspline at one torque."""

    torque: float
    """Output torque [N·m]."""
    sections: tuple[SectionFatigue, ...]
    """Nominal stress by plane, from the open edge to the back edge of the teeth."""
    amplitude: Mapping[str, float]
    """Half of the largest range of the von Mises stress by part [Pa]. The toothed
    segment is evaluated up to 0.3 rim thicknesses above the root land, without the
    upper parts of the teeth: ``root`` in all planes, ``root, mid-face`` in the plane
    closest to the middle of the face width. Other parts are whole segments."""
    shell: SafetyFactor
    """Safety factors from the closed forms of the article alone."""
    limits: FatigueLimits
    """Endurance limits of the material."""

    @property
    def worst(self) -> SectionFatigue:
        """Plane with the smallest combined safety factor."""
        return min(self.sections, key=lambda section: section.safety.combined)

    @property
    def middle(self) -> SectionFatigue:
        """Plane closest to the middle of the face width."""
        return min(self.sections, key=lambda section: abs(section.z))

    def local(self, part: str) -> float:
        """Bending limit divided by the amplitude of a part, without any factors [-]."""
        return self.limits.bending / self.amplitude[part]

    def to_json(self) -> dict[str, Any]:
        """Worst and middle plane, amplitudes of the meshed stress and closed forms."""
        return {
            "torque_Nm": self.torque,
            "worst_section": self.worst.to_json(),
            "mid_face": self.middle.to_json(),
            "von_mises_amplitude_MPa": {k: v / MPa for k, v in self.amplitude.items()},
            "S_without_factors_mid_face": self.local("root, mid-face"),
            "shell_theory": {
                "S_normal": self.shell.normal,
                "S_shear": self.shell.shear,
                "S": self.shell.combined,
            },
        }


def fatigue(
    design: Design, torques: Sequence[float], *, progress: Progress = silent
) -> list[Fatigue]:
    """Compute the fatigue of a drive on its rigid wave generator at several torques.

    Args:
        design: The drive, with a ``[cup]`` and endurance limits.
        torques: Torques T of the output on its load, solved in this order [N·m].
        progress: Called after every equilibrium.

    Raises:
        DesignError: If the design cannot be built, has features that the 3D model
            lacks, or does not state both endurance limits.
        ComputationError: If a solve fails or the model does not fit in memory.
    """
    limits, shell = (
        FatigueLimits.from_design(design),
        ShellDimensions.from_design(design),
    )
    model = solid_sector_model(design, half="auto")
    follow = SolidContinuation(
        model=model, ratio=design.ratio, layout=design.drive.layout
    )
    total = 2 + len(torques)

    def reached(state: SolidState, what: str, count: int) -> SolidState:
        if not state.outcome.ok:
            name = design.drive.name
            raise ComputationError(f"{name}: {what} failed: {state.outcome.value}")
        progress("fatigue", count, total)
        return state

    state = reached(follow.deflect(), "deflection by the wave generator", 1)
    state = reached(follow.engage(state), "engagement of the teeth", 2)
    results: list[Fatigue] = []
    for torque in torques:
        state = follow.to_torque(state, torque)
        reached(state, f"loading to {torque:g} N·m", 3 + len(results))
        stresses = flexspline_stresses(model, state)
        results.append(assess(model.strip.mesh, stresses, torque, limits, shell))
    return results


def assess(
    strip: StripMesh,
    stresses: Mapping[str, Array],
    torque: float,
    limits: FatigueLimits,
    shell: ShellDimensions,
) -> Fatigue:
    """Assess the fatigue from the stresses of all sectors.

    Args:
        strip: Mesh of a sector.
        stresses: Stress xx, yy, zz, xy, yz, zx at the nodes by segment (N, n_nodes, 6)
            [Pa], in the sectors of half of the flexspline or of all of it.
        torque: Output torque [N·m].
        limits: Endurance limits of the material.
        shell: Dimensions and material for the closed forms.
    """
    nominal = root_stress(strip, stresses[strip.teeth.segment.name])
    low, high = nominal.min(axis=0), nominal.max(axis=0)
    sections = []
    for z, amplitude, mean in zip(
        strip.teeth.z, 0.5 * (high - low), 0.5 * (high + low), strict=True
    ):
        safety = safety_factor(
            bending_limit=limits.bending,
            torsion_limit=limits.torsion,
            normal_amplitude=float(amplitude[0]),
            shear_amplitude=float(amplitude[2]),
            shear_mean=float(mean[2]),
        )
        sections.append(
            SectionFatigue(
                z=float(z),
                normal_amplitude=float(amplitude[0]),
                normal_mean=float(mean[0]),
                axial_amplitude=float(amplitude[1]),
                shear_amplitude=float(amplitude[2]),
                shear_mean=float(mean[2]),
                safety=safety,
            )
        )
    return Fatigue(
        torque=torque,
        sections=tuple(sections),
        amplitude=_amplitudes(strip, stresses),
        shell=shell_safety_factor(
            shell, torque, bending_limit=limits.bending, torsion_limit=limits.torsion
        ),
        limits=limits,
    )


def root_stress(strip: StripMesh, stress: Array) -> Array:
    r"""Nominal stress at the root between two teeth.

    .. math:: \sigma = \frac1h\int\sigma\,dr
        + \frac6{h^2}\int\sigma\,(r - \bar r)\,dr

    The integrals extend over the wall of thickness h on the first face of a sector, and
    the result applies to the outer surface of the wall.

    Args:
        strip: Mesh of a sector.
        stress: Stress of the toothed segment in its frames (N, n_nodes, 6) [Pa].

    Returns:
        Circumferential, axial and shear stress (N, n_planes, 3) [Pa].
    """
    teeth = strip.teeth
    nodes = teeth.nodes[:, teeth.plane.face_first]
    points = np.asarray(teeth.plane.mesh.p)[:, teeth.plane.face_first]
    r = np.hypot(*points)
    around = np.stack([points[1], -points[0]]) / r
    xx, yy, zz, xy, yz, zx = np.moveaxis(stress[:, nodes], -1, 0)
    x, y = around
    parts = np.stack(
        [x**2 * xx + y**2 * yy + 2.0 * x * y * xy, zz, x * zx + y * yz], axis=-1
    )
    # trapezoidal rule from the outside to the bore
    height, middle = r[0] - r[-1], 0.5 * (r[0] + r[-1])
    step = -np.diff(r)
    weight = np.zeros_like(r)
    weight[:-1] += 0.5 * step
    weight[1:] += 0.5 * step
    arm = r - middle
    linear = weight @ arm**2  # h^3/12, so that a linear stress is reproduced exactly
    return np.asarray(
        np.einsum(
            "spdk,d->spk", parts, weight / height + 0.5 * height * weight * arm / linear
        )
    )


def _amplitudes(strip: StripMesh, stresses: Mapping[str, Array]) -> dict[str, float]:
    teeth, amplitudes = strip.teeth, {}
    r = np.hypot(*np.asarray(teeth.plane.mesh.p))
    land = r[teeth.plane.face_first]
    root = np.flatnonzero(r < land[0] + 0.3 * (land[0] - land[-1]))
    for name, stress in stresses.items():
        if name != teeth.segment.name:
            amplitudes[name] = float(half_range(stress).max())
            continue
        half_ranges = half_range(stress[:, teeth.nodes[:, root]])
        amplitudes["root"] = float(half_ranges.max())
        amplitudes["root, mid-face"] = float(
            half_ranges[np.argmin(np.abs(teeth.z))].max()
        )
    return amplitudes


def half_range(stress: Array) -> Array:
    """Half of the largest von Mises range of a periodic stress history [Pa].

    The range is the von Mises stress of the difference between the stress tensors at
    two times; all pairs of times are considered.

    Args:
        stress: Stress by time in the first axis, with components xx, yy, zz, xy, yz, zx
            in the last axis [Pa].
    """
    largest = np.zeros(stress.shape[1:-1])
    for shift in range(1, len(stress) // 2 + 1):
        xx, yy, zz, xy, yz, zx = np.moveaxis(
            stress - np.roll(stress, shift, axis=0), -1, 0
        )
        square = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2)
        square += 3.0 * (xy**2 + yz**2 + zx**2)
        largest = np.maximum(largest, square.max(axis=0))
    return np.asarray(0.5 * np.sqrt(largest))
