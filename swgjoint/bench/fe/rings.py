"""Solution of the settings ``ring`` of ``swgjoint bench fe``: rings or closed forms."""

from __future__ import annotations

import time
from dataclasses import replace
from math import pi

import numpy as np

from swgjoint.bench.fe.setting import (
    POSITIONS,
    RIM,
    FeSetting,
    Found,
    mean_of,
    positions,
    require_equilibrium,
    rim_shape,
)
from swgjoint.fe.rings.equilibrium import ThinRingSolver
from swgjoint.fe.rings.loading import SMALL, solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import ThinRing, thin_ring
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design import family
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.gear.shell_theory import ShellDimensions
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.typing import Array
from swgjoint.units import mm


def solve_by_thin_rings(design: Design, setting: FeSetting, begin: float) -> Found:
    """Solve a design with thin rings or closed forms.

    Args:
        design: Design to solve.
        setting: Setting of model ``ring``.
        begin: Start of the setting, from :func:`time.perf_counter` [s].

    Raises:
        ComputationError: If a position has no equilibrium.
    """
    if not setting.refinement:
        return _closed_form(design, begin)
    if design.wave_generator.bearing is None:
        design = design.with_changes(
            {"wave_generator.bearing": bearing_by_rule(design)}
        )
    model = thin_ring(design)
    nodes = max(1, round(2 * setting.refinement))
    count = model.rim.elements // model.nodes_per_tooth * nodes
    model = replace(
        model,
        rim=replace(model.rim, elements=count),
        race=replace(model.race, elements=count),
        nodes_per_tooth=nodes,
    )
    rated, solver = ratings_of(design).rated_torque, ThinRingSolver()
    series, shape = series_compliance(design, cup=True), np.zeros(RIM)
    error, compliance, tensile = list[float](), list[float](), list[float]()
    for angle in positions(design):
        rest = solve_unloaded(model, float(angle))
        sides = [solve_loaded(model, rest, t * SMALL * rated) for t in (1.0, -1.0)]
        psi = 0.5 * sum(require_equilibrium(side).rotation for side in sides)
        middle = require_equilibrium(solver(model, rest, rotation=psi))
        if middle.loaded_teeth:
            middle = require_equilibrium(solver(model, middle, torque=0.0))
        state = require_equilibrium(solve_loaded(model, sides[0], rated))
        if not error:
            place: Array = np.arange(4 * count, dtype=np.float64) / 4.0
            points, _, _ = model.rim.evaluate_at(state.q[: model.rim.size], place)
            shape = rim_shape(points, model.rim.radius, state.alpha)
        error.append(middle.rotation - angle / design.ratio)
        compliance.append(state.compliance + series)
        tensile.append(_rim_stress(design, model, state))
    wall = time.perf_counter() - begin
    return mean_of(
        error, compliance, tensile, rim_shape=shape, wall_s=wall, nodes=nodes
    )


def bearing_by_rule(design: Design) -> dict[str, float]:
    """Ball bearing without clearance, with the proportions of the design family.

    Thin rings need a bearing; this one serves for designs without one.
    """
    pitch = design.drive.module_mm * design.drive.teeth_flexspline
    return {
        "balls": family.BALLS,
        "ball_diameter_mm": family.BALL * pitch,
        "race_thickness_mm": family.RACE * pitch,
        "race_width_mm": min(family.RACE_WIDTH * pitch, design.drive.face_width_mm),
        "groove_inertia_factor": family.GROOVE,
    }


def _rim_stress(design: Design, model: ThinRing, state: ThinRingState) -> float:
    r"""Largest tensile stress of the rim between the teeth, without notch effect [Pa].

    .. math:: \sigma = E\,(\varepsilon + y\,\Delta\kappa)

    The stress is evaluated at the bore and at the root circle, at distance y from the
    neutral line, and in the middle of every element, where the curvature of a cubic
    element is accurate.
    """
    rim, outside = model.rim, design.flexspline.rim_mm * mm
    centre: Array = np.arange(rim.elements, dtype=np.float64) + 0.5
    change = []
    for q in (state.q[: rim.size], rim.reference.ravel()):
        _, v, w = rim.evaluate_at(q, centre)
        length = np.hypot(v[:, 0], v[:, 1])
        turning = (v[:, 0] * w[:, 1] - v[:, 1] * w[:, 0]) / length**2 / rim.step
        change.append((length / rim.step, turning))
    stretch, bend = change[0][0] - change[1][0], change[0][1] - change[1][1]
    bore = model.bearing.bore_radius - rim.radius
    strain = [stretch + y * bend for y in (bore, bore + outside)]
    modulus = design.material_of("flexspline").youngs_modulus
    return float(modulus * np.max(strain))


def _closed_form(design: Design, begin: float) -> Found:
    """Thin shell on an unloaded wave generator; the kinematic error is zero."""
    phi = pi * np.arange(RIM) / RIM
    return Found(
        stiffness=1.0 / series_compliance(design, cup=True),
        kinematic_error=np.zeros(POSITIONS),
        tensile=ShellDimensions.from_design(design).bending_stress(),
        rim_shape=np.asarray(lobe_height(design) * np.cos(2.0 * phi)),
        wall_s=time.perf_counter() - begin,
    )
