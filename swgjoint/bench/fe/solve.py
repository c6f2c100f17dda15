"""Solution of one setting of ``swgjoint bench fe`` in a process of its own."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from swgjoint.bench.fe.rings import solve_by_thin_rings
from swgjoint.bench.fe.setting import (
    RIM,
    FeSetting,
    Found,
    mean_of,
    positions,
    require_equilibrium,
    rim_shape,
)
from swgjoint.errors import ComputationError, DesignError
from swgjoint.fe.common.following import Follower
from swgjoint.fe.common.layout_angles import AnyState
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import can_halve, sector_model
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.stress import MemberMaxima, StressMaxima
from swgjoint.fe.rings.loading import SMALL
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.stress import SolidMaxima
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class SettingTask:
    """A setting of a design, to be solved in a process of its own."""

    design: Design
    setting: FeSetting


def solve_in_process(task: SettingTask) -> Found | str:
    """Solve a setting; return the reason if there is no solution.

    CPU time and memory are those of the process, which must be fresh.
    """
    cpu = time.process_time()
    try:
        found = solve_setting(task.design, task.setting)
    except (ComputationError, DesignError) as failure:
        return str(failure)
    return replace(found, cpu_s=time.process_time() - cpu, peak_MB=peak_memory() / 1e6)


def peak_memory() -> float:
    """Largest resident memory of this process so far [B]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak if sys.platform == "darwin" else 1024 * peak)


def solve_setting(design: Design, setting: FeSetting) -> Found:
    """Solve a setting of a design.

    Args:
        design: Design to solve.
        setting: Model and refinement.

    Raises:
        DesignError: If the design has a feature that the model lacks.
        ComputationError: If a position has no solution.
    """
    begin = time.perf_counter()
    if setting.model == "ring":
        return solve_by_thin_rings(design, setting, begin)
    changed = design.with_changes({"mesh.refinement": setting.refinement})
    # the wave generator is rigid, as in 3D
    half = can_halve(changed, bearing=False) and not setting.full
    if setting.model == "3d":
        ring = solid_sector_model(changed, half=half, nonlinear=setting.nonlinear)
        return _measured(
            changed,
            SolidContinuation(
                model=ring, ratio=changed.ratio, layout=changed.drive.layout
            ),
            lambda state: SolidMaxima.from_state(ring, state).flexspline,
            lambda state: _solid_rim(ring, state),
            series=series_compliance(changed, cup=False),
            nodes=sum(s.mesh.mesh.p.shape[1] for s in ring.strip.segments),
            begin=begin,
        )
    plane = sector_model(changed, half=half, nonlinear=setting.nonlinear, bearing=False)
    return _measured(
        changed,
        Continuation(model=plane, ratio=changed.ratio, layout=changed.drive.layout),
        lambda state: MemberMaxima.from_state(plane, state).flexspline,
        lambda state: _plane_rim(plane, state),
        series=series_compliance(changed, cup=True),
        nodes=plane.element.mesh.mesh.p.shape[1],
        begin=begin,
    )


def _measured(
    design: Design,
    follow: Follower[AnyState],
    stress: Callable[[AnyState], StressMaxima],
    rim: Callable[[AnyState], Array],
    *,
    series: float,
    nodes: int,
    begin: float,
) -> Found:
    """Solve a 2D or 3D model at all positions, without torque and at rated torque.

    Args:
        design: Design to solve.
        follow: Continuation of its model.
        stress: Function that returns the largest stresses of the flexspline at a state.
        rim: Function that returns the rim shape at a state.
        series: Compliance in series that the model does not contain [rad/(N·m)].
        nodes: Number of nodes in a sector.
        begin: Start of the setting, from :func:`time.perf_counter` [s].
    """
    rated, theta = ratings_of(design).rated_torque, positions(design)
    rest = follow.unload(
        require_equilibrium(follow.engage(require_equilibrium(follow.deflect()))),
        SMALL * rated,
    )
    state = follow.to_torque(rest.state if rest.sides is None else rest.sides[0], rated)
    error, compliance, tensile, shape = [], [], [], np.zeros(RIM)
    for k, angle in enumerate(theta):
        if k:
            rest = follow.turn_unloaded(rest, float(angle))
            state = follow.to_angle(state, float(angle))
        require_equilibrium(rest.state)
        require_equilibrium(state)
        if not k:
            shape = rim(state)
        error.append(follow.output_angle(rest.state) - angle / design.ratio)
        compliance.append(state.compliance + series)
        tensile.append(stress(state).tensile)
    wall = time.perf_counter() - begin
    return mean_of(
        error, compliance, tensile, rim_shape=shape, wall_s=wall, nodes=nodes
    )


def _plane_rim(model: SectorModel, state: State) -> Array:
    nodes = model.skeleton(state)[:, model.bore_nodes]
    radius = float(np.hypot(*model.element.skeleton[model.bore_nodes[0]]))
    return rim_shape(nodes.reshape(-1, 2), radius, state.wave_generator_angle)


def _solid_rim(model: SolidSectorModel, state: SolidState) -> Array:
    """Rim shape of the bore at mid-face, interpolated between the adjacent planes."""
    frame, strip = model.frames(state)[0], model.strip
    points = np.einsum("sij,spj->spi", frame.turn, model.bore_positions(frame, state))
    points = points.reshape(len(points), strip.planes, -1, 3)
    z = strip.mesh.teeth.z
    middle = 0.5 * (z[0] + z[-1])
    after = int(np.clip(np.searchsorted(z, middle), 1, len(z) - 1))
    part = (middle - z[after - 1]) / (z[after] - z[after - 1])
    flat = (1.0 - part) * points[:, after - 1] + part * points[:, after]
    radius = float(np.hypot(strip.bore[0, 0], strip.bore[0, 1]))
    return rim_shape(flat[..., :2].reshape(-1, 2), radius, state.wave_generator_angle)
