"""``swgjoint bench fe``: what finite elements of less effort miss, and their time.

Every setting solves the same positions over one pitch: without torque for the kinematic
error, at rated torque for stiffness and stress. The finest model in space is the
reference; the plane model has the cup as closed-form torsion in series.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError, DesignError
from swgjoint.fe.continuation import Continuation
from swgjoint.fe.drive2d import can_halve, ring_model
from swgjoint.fe.following import AnyState, Follower
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import check_modelled, solid_ring
from swgjoint.fe.solid.stress import SolidMaxima
from swgjoint.fe.stress import MemberMaxima, StressMaxima
from swgjoint.fe.tolerance_rest import SMALL
from swgjoint.files import write_whole
from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design import Design
from swgjoint.gear.kinematics import periodicity
from swgjoint.json_text import json_text
from swgjoint.maps.catalogue import ratings_of
from swgjoint.progress import Progress, silent
from swgjoint.units import arcsec

Array = NDArray[np.float64]

POSITIONS = 4
"""Over one pitch; the same ones in every setting."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One model and its effort."""

    model: str
    refinement: float
    nonlinear: bool = True

    @property
    def name(self) -> str:
        """As the table has it."""
        return f"refinement {self.refinement:g}" + (
            "" if self.nonlinear else ", linear"
        )


SETTINGS = (
    Setting(model="2d", refinement=1.0),
    Setting(model="2d", refinement=2.0),
    Setting(model="3d", refinement=0.5, nonlinear=False),
    Setting(model="3d", refinement=1.0, nonlinear=False),
    Setting(model="3d", refinement=0.5),
    Setting(model="3d", refinement=0.7),
    Setting(model="3d", refinement=1.0),
    Setting(model="3d", refinement=1.4),
)
"""The last one is the reference."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """What a setting says of the drive."""

    stiffness: float
    """Mean tangent at rated torque [N·m/rad]."""
    kinematic_error: Array
    """Unloaded output error less its mean (POSITIONS,) [rad]."""
    tensile: float
    """Mean over the positions of the largest tensile stress of the flexspline [Pa]."""
    wall_s: float


def run_fe_cost(
    *,
    design: Design,
    settings: Sequence[Setting] = SETTINGS,
    folder: Path | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Solve every setting; the last one is the reference.

    Returns:
        ``rows``: ``bench``, ``model``, ``setting``, ``quantity``, ``value``, ``error``,
        ``unit``, ``wall_s``, ``reference``, ``outcome``, three a setting; ``design``,
        ``files``, ``wall_s``.

    Raises:
        DesignError: If the design has no cup or holds what is not modelled in space.
        ComputationError: If the reference fails.
    """
    begin = time.perf_counter()
    if design.cup is None:
        raise DesignError(
            f"{design.drive.name}: bench fe goes by the model in space, which needs a"
            " [cup]; accepted: a design with one, such as reference-3d-modified"
        )
    check_modelled(design)
    found: list[Found | None] = []
    outcomes = []
    stage = f"{design.drive.name}: settings"
    progress(stage, 0, len(settings))
    for k, setting in enumerate(settings):
        try:
            found.append(_solved(design, setting))
            outcomes.append("converged")
        except (ComputationError, DesignError) as failure:
            found.append(None)
            outcomes.append(str(failure))
        progress(stage, k + 1, len(settings))
    best = found[-1]
    if best is None:
        raise ComputationError(f"the reference, {settings[-1].name}: {outcomes[-1]}")
    reference = f"{settings[-1].model}, {settings[-1].name}"
    rows = [
        row
        for setting, one, outcome in zip(settings, found, outcomes, strict=True)
        for row in _rows(setting, one, outcome, best, reference)
    ]
    files = []
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        picture = cost_picture(design.drive.name, rows)
        files = [
            write_whole(folder / "bench-fe.json", json_text({"rows": rows}) + "\n"),
            write_whole(folder / "bench-fe.png", picture),
        ]
    return {
        "design": design.drive.name,
        "rows": rows,
        "files": [str(path) for path in files],
        "wall_s": time.perf_counter() - begin,
    }


def _solved(design: Design, setting: Setting) -> Found:
    begin = time.perf_counter()
    changed = design.with_changes({"mesh.refinement": setting.refinement})
    half = can_halve(changed)
    if setting.model == "3d":
        ring = solid_ring(changed, half=half, nonlinear=setting.nonlinear)
        return _measured(
            changed,
            SolidContinuation(
                ring=ring, ratio=changed.ratio, layout=changed.drive.layout
            ),
            lambda state: SolidMaxima.at(ring, state).flexspline,
            0.0,
            begin,
        )
    plane = ring_model(changed, half=half, nonlinear=setting.nonlinear)
    return _measured(
        changed,
        Continuation(model=plane, ratio=changed.ratio, layout=changed.drive.layout),
        lambda state: MemberMaxima.at(plane, state).flexspline,
        1.0 / cup_torsional_stiffness(changed),
        begin,
    )


def _measured(
    design: Design,
    follow: Follower[AnyState],
    stress: Callable[[AnyState], StressMaxima],
    series: float,
    begin: float,
) -> Found:
    """Unloaded and loaded positions of any model.

    Args:
        design: The drive.
        follow: Its model.
        stress: Largest stresses of the flexspline at a state.
        series: Compliance that the model lacks [rad/(N·m)].
        begin: When the setting began [s].
    """
    drive, rated = design.drive, ratings_of(design).rated_torque
    cycles = periodicity(
        drive.layout, drive.teeth_flexspline, drive.teeth_circular_spline
    )
    theta = 2.0 * pi / cycles * np.arange(POSITIONS) / POSITIONS

    def checked(state: AnyState) -> AnyState:
        if not state.outcome.ok:
            raise ComputationError(state.outcome.value)
        return state

    rest = follow.unloaded(checked(follow.meshed(follow.deflected())), SMALL * rated)
    loaded = follow.to_torque(
        rest.state if rest.sides is None else rest.sides[0], rated
    )
    error, compliance, tensile = [], [], []
    for k, angle in enumerate(theta):
        if k:
            rest = follow.unloaded_to(rest, float(angle))
            loaded = follow.to_angle(loaded, float(angle))
        checked(rest.state)
        checked(loaded)
        error.append(follow.output_angle(rest.state) - angle / design.ratio)
        compliance.append(loaded.compliance + series)
        tensile.append(stress(loaded).tensile)
    return Found(
        stiffness=1.0 / float(np.mean(compliance)),
        kinematic_error=np.array(error) - np.mean(error),
        tensile=float(np.mean(tensile)),
        wall_s=time.perf_counter() - begin,
    )


def _rows(
    setting: Setting, found: Found | None, outcome: str, best: Found, reference: str
) -> list[dict[str, Any]]:
    same = {
        "bench": "fe",
        "model": setting.model,
        "setting": setting.name,
        "wall_s": None if found is None else found.wall_s,
        "reference": reference,
        "outcome": outcome,
    }
    if found is None:
        nothing = {"value": None, "error": None, "unit": "%"}
        return [same | nothing | {"quantity": "torsional_stiffness_Nm_rad"}]
    apart = found.kinematic_error - best.kinematic_error
    return [
        same
        | {
            "quantity": "torsional_stiffness_Nm_rad",
            "value": found.stiffness,
            "error": 100.0 * (found.stiffness / best.stiffness - 1.0),
            "unit": "%",
        },
        same
        | {
            "quantity": "kinematic_error_pp_arcsec",
            "value": float(np.ptp(found.kinematic_error)) / arcsec,
            "error": float(np.ptp(apart)) / arcsec,
            "unit": "arcsec",
        },
        same
        | {
            "quantity": "tensile_MPa",
            "value": found.tensile / 1e6,
            "error": 100.0 * (found.tensile / best.tensile - 1.0),
            "unit": "%",
        },
    ]


def cost_picture(name: str, rows: Sequence[dict[str, Any]]) -> bytes:
    """PNG: magnitude of the error over wall time, one panel a quantity."""
    from matplotlib.figure import Figure

    solved = [row for row in rows if row["error"] is not None]
    quantities = list(dict.fromkeys(row["quantity"] for row in solved))
    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    panels = figure.subplots(1, len(quantities), squeeze=False)[0]
    for ax, quantity in zip(panels, quantities, strict=True):
        for row in solved:
            size = abs(row["error"])
            if row["quantity"] != quantity or size == 0.0:
                continue
            linear = row["setting"].endswith("linear")
            marker = "x" if linear else "s" if row["model"] == "2d" else "o"
            ax.loglog(
                row["wall_s"], size, marker, color=f"C{'23'.index(row['model'][0])}"
            )
            label = f" {row['model']} {row['setting'].removeprefix('refinement ')}"
            ax.annotate(label, (row["wall_s"], size), fontsize=7)
        unit = next(row["unit"] for row in solved if row["quantity"] == quantity)
        ax.set(title=quantity, xlabel="wall time [s]", ylabel=f"error [{unit}]")
        ax.margins(x=0.25)
        ax.grid(alpha=0.3, which="both")
    figure.suptitle(f"{name} against {rows[0]['reference']}")
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110)
    return out.getvalue()
