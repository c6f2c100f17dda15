"""Computations of the articles study, each a picklable task."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError, DesignError
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.figures.fatigue import FatigueLimits, assess, fatigue
from swgjoint.fe.solid.figures.four_forces import four_forces
from swgjoint.fe.solid.figures.pinched_cup import pinched_cup
from swgjoint.fe.solid.stress import SolidMaxima, flexspline_stresses
from swgjoint.fe.solid.strip.elasticity import stress_maxima
from swgjoint.fe.solid.wave_generator.elastic import lobe_characteristic
from swgjoint.gear.design.design import Design
from swgjoint.gear.shell_theory import ShellDimensions
from swgjoint.units import MPa, deg, mm

Found = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class ArticleTask:
    """One computation of the study."""

    name: str
    kind: str
    """Key of :data:`KINDS`."""
    design: Design
    toothless: bool = False
    """Whether the cup has no teeth, for kind ``pinched``."""
    torques: tuple[float, ...] = ()
    """Output torques [N·m]."""
    work: float = 1.0
    """Estimated relative work, so that long computations start first."""


def run_task(task: ArticleTask) -> Found:
    """Run a computation; if it fails, the result has the message under ``fault``."""
    try:
        return KINDS[task.kind](task)
    except (ComputationError, DesignError) as error:
        return {"fault": str(error)}


def _pinched(task: ArticleTask) -> Found:
    """Radial stiffness [N/mm] under two opposite loads, by place of the loads."""
    cup = pinched_cup(task.design, toothless=task.toothless)
    return {
        place: cup.pull(1.0, place).stiffness / 1e3
        for place in ("mid_face", "open_edge", "face_width")
    }


def _rotated(task: ArticleTask) -> Found:
    """Secant radial stiffness [N/mm] at mid-face with large rotations.

    The loads, outward and inward, are those that deflect the cup by the lobe height in
    the linear model.
    """
    cup = pinched_cup(task.design)
    deflection = 0.5 * task.design.drive.module_mm * task.design.tooth_difference * mm
    force = cup.pull(1.0).stiffness * deflection
    return {
        "outward": cup.pull(force, nonlinear=True).stiffness / 1e3,
        "inward": cup.pull(-force, nonlinear=True).stiffness / 1e3,
    }


def _lobes(task: ArticleTask) -> Found:
    """Force of a lobe [N] and play [mrad] as functions of its deflection [mm]."""
    found = lobe_characteristic(task.design)
    return {
        "height_mm": found.height / mm,
        "deflection_mm": (found.deflection / mm).tolist(),
        "force_N": found.force.tolist(),
        "play_mrad": (1e3 * found.play).tolist(),
        "pressed_mm": (found.pressed_deflection / mm).tolist(),
        "on_teeth_N": found.pressed_force.tolist(),
    }


def _four(task: ArticleTask) -> Found:
    """Stress [MPa], radial displacement [mm] and safety factors, by torque.

    The load case is that of the article: four forces in the bore instead of a wave
    generator.
    """
    cup = pinched_cup(task.design)
    shell = ShellDimensions.from_design(task.design)
    loaded = four_forces(cup, shell.deflection)
    limits = FatigueLimits.from_design(task.design)
    rows = []
    for torque in (0.0, *task.torques):
        stresses = loaded.stresses(torque)
        found = assess(cup.strip, stresses, torque, limits, shell)
        rows.append(
            found.to_json()
            | {
                "von_mises_MPa": max(
                    float(stress_maxima(part)[2].max()) / MPa
                    for part in stresses.values()
                ),
                "largest_radial_mm": loaded.largest_radial(torque) / mm,
                "least_force_N": float(
                    (loaded.force + torque * loaded.force_by_torque).min()
                ),
            }
        )
    return {"by_torque": rows}


def _fatigue(task: ArticleTask) -> Found:
    """Safety factors by torque, with the wave generator of the design."""
    return {"by_torque": [a.to_json() for a in fatigue(task.design, task.torques)]}


def _deflected(task: ArticleTask) -> Found:
    """Displacement [mm] and stress [MPa] on the wave generator, no tooth contact."""
    model = solid_sector_model(task.design, half="auto", elastic_circular_spline=False)
    state = SolidContinuation(model=model, ratio=task.design.ratio).deflect()
    if not state.outcome.ok:
        raise ComputationError(f"{task.name}: {state.outcome.value}")
    frame, teeth = model.frames(state)[0], model.strip.teeth
    rest = np.asarray(teeth.mesh.mesh.p).T
    moved = teeth.displacement(frame.displacement, model.loads(state))
    points = np.einsum("sij,snj->sni", frame.turn, rest + moved)
    radial = np.hypot(points[..., 0], points[..., 1]) - np.hypot(rest[:, 0], rest[:, 1])
    sector, node = np.unravel_index(int(radial.argmax()), radial.shape)
    angle = 2.0 * np.pi * np.arange(model.sectors) / model.strip.sectors
    from_major = np.abs((angle + 0.5 * np.pi) % np.pi - 0.5 * np.pi)

    maxima = SolidMaxima.from_state(model, state)
    by_sector = np.max(
        [
            stress_maxima(part)[2].max(axis=1)
            for part in flexspline_stresses(model, state).values()
        ],
        axis=0,
    )
    middle = model.strip.mesh.teeth.nodes[np.argmin(np.abs(model.strip.mesh.teeth.z))]
    return {
        "largest_radial_mm": float(radial.max()) / mm,
        "at_mid_face_mm": float(radial[:, middle].max()) / mm,
        "radial_z_mm": float(rest[node, 2]) / mm,
        "radial_from_major_deg": float(from_major[sector]) / deg,
        "von_mises_MPa": maxima.flexspline.von_mises / MPa,
        "von_mises_part": maxima.place.part,
        "von_mises_from_major_deg": float(from_major[maxima.place.sector]) / deg,
        "at_minor_MPa": float(by_sector[from_major > 80.0 * deg].max()) / MPa,
    }


KINDS: dict[str, Callable[[ArticleTask], Found]] = {
    "pinched": _pinched,
    "rotated": _rotated,
    "lobes": _lobes,
    "four": _four,
    "fatigue": _fatigue,
    "deflected": _deflected,
}
