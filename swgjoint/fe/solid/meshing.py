"""3D simulation of meshing: deflect, engage, load, turn (thesis chapter 7)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.meshing_phases import overload
from swgjoint.fe.meshing_run import Position, Positions
from swgjoint.fe.plane.stress import KINDS
from swgjoint.fe.solid.checkpoint import Checkpoint
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import check_modelled, solid_sector_model
from swgjoint.fe.solid.figures.axial_section import coning
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.stress import SolidMaxima, StressPlace
from swgjoint.fe.solid.strip.masters import Orders
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors
from swgjoint.gear.mounting import series_compliance, springs_of
from swgjoint.progress import Progress
from swgjoint.units import deg


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidSetup:
    """One of the equilibria before the first wave-generator position."""

    name: str
    """``wave_generator`` (no tooth contact), ``meshed`` (teeth in contact, no torque)
    or ``torque``."""
    state: SolidState
    """The equilibrium."""
    stress: SolidMaxima
    """Its largest stresses."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidStep(Position):
    """Results of the 3D model at one wave-generator position."""

    stress: SolidMaxima | None = None
    """Largest stresses; None where the solve failed."""
    state: SolidState | None = None
    """The equilibrium; None where the solve failed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidRun(Positions):
    """Results of a 3D simulation of meshing."""

    design: Design
    model: SolidSectorModel
    torque: float
    """Torque T of the output on its load [N·m]."""
    steps: tuple[SolidStep, ...]
    """Results at the wave-generator positions."""
    setup: tuple[SolidSetup, ...]
    """The equilibria before the first position."""
    wall_s: float
    """Elapsed time of the simulation [s]."""

    @property
    def nodes(self) -> int:
        """Number of nodes of the deformable members before condensation."""
        total = _nodes(self.model)
        gear = self.model.teeth.elastic_circular_spline
        if gear is not None:
            face = len(gear.mesh.teeth.segment.first)
            total += (gear.mesh.nodes - face) * self.model.teeth.circular_spline_teeth
        return total

    @property
    def elements(self) -> int:
        """Number of elements of the deformable members before condensation."""
        total = self.model.strip.mesh.elements * self.model.sectors
        gear = self.model.teeth.elastic_circular_spline
        if gear is not None:
            total += gear.mesh.elements * self.model.teeth.circular_spline_teeth
        return total

    def to_json(self) -> dict[str, Any]:
        """The JSON object that ``swgjoint meshing`` prints for a 3D model."""
        solved = [step.stress for step in self.steps if step.stress is not None]
        elastic = self.model.teeth.elastic_circular_spline is not None
        gear = f"elastic, outside {self.design.circular_spline.outer_rim}"
        shapes = self.design.micro_geometry.model_dump(exclude={"crowning_kind"})
        missing = {
            "wave_generator.bearing": self.design.wave_generator.bearing is not None,
            "friction.tooth_coefficient": self.design.friction.tooth_coefficient > 0.0,
        }
        return {
            "design": self.design.drive.name,
            "label": {
                "model": "3d",
                "layout": self.design.drive.layout,
                "level": "nonlinear" if self.model.nonlinear else "linear",
                "circular_spline": gear if elastic else "rigid",
                "half": self.model.half,
                "springs_Nm_rad": springs_of(self.design),
                "tolerances": has_errors(self.design) or None,
                "micro_geometry": any(shapes.values()),
                "stress": "largest nodal value; at edges and at the step from rim to"
                " cup it does not converge with mesh refinement",
                "left_out": " and ".join(k for k, v in missing.items() if v) or None,
                "positions": self.unspread,
            },
            "torque_Nm": self.torque,
            "nodes": self.nodes,
            "elements": self.elements,
            "steps": len(self.steps),
            "wall_s": self.wall_s,
            "outcome": self.outcome.name.lower(),
            "warnings": self.warnings(),
            **self.averages(),
            "per_step": self.common_series()
            | {
                "input_torque_Nm": list(self.series("input_torque")),
                "von_mises_at": [
                    None if step.stress is None else _place(step.stress.place)
                    for step in self.steps
                ],
            },
            "parts_MPa": _parts(solved),
            "setup_MPa": [
                {"state": found.name} | found.stress.to_json() for found in self.setup
            ],
            "coning_mm": [
                {"state": found.name} | coning(self.model, found.state).to_json()
                for found in self.setup
            ],
        }


def simulate_solid_meshing(
    design: Design,
    *,
    torque: float,
    steps: int,
    turn: float,
    nonlinear: bool,
    half: bool,
    elastic_circular_spline: bool,
    throw: bool,
    progress: Progress,
    keep: Path | None,
    resume: bool,
) -> SolidRun:
    """Simulate meshing in 3D, see :func:`swgjoint.fe.meshing.simulate_meshing`.

    Args:
        design: The drive, with a ``[cup]``.
        torque: Torque T of the output on its load [N·m].
        steps: Number of positions of the input, at k turn/steps with k = 0 to
            steps - 1.
        turn: Rotation of the input that the positions divide [turns].
        nonlinear: Whether segments may rotate by large angles.
        half: Whether to use the half model, which requires a drive that is symmetric
            under a rotation by 180 deg.
        elastic_circular_spline: Whether the circular spline is elastic instead of
            rigid.
        throw: Whether a position that cannot be solved raises an error; if not, its
            results are NaN or None.
        progress: Called with the stage, the number of finished steps and their total.
        keep: Folder in which the state of every position is stored; None stores
            nothing. If it contains an interrupted run with the same settings and code,
            that run is resumed with bit-identical results.
        resume: Whether that folder must already contain a run to resume.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks,
            or if the half model does not apply.
        ComputationError: If a solve fails or the model does not fit in memory.
        InputError: If the folder contains another run or other files, or if there is no
            run to resume.
    """
    begin = time.perf_counter()
    check_modelled(design)
    kept = None
    if keep is not None:
        settings = {
            "design": design.content_hash(),
            "torque": torque,
            "steps": steps,
            "turn": turn,
            "nonlinear": nonlinear,
            "half": half,
            "elastic_circular_spline": elastic_circular_spline,
            "orders": asdict(Orders()),
        }
        kept = Checkpoint.open(keep, settings, resume=resume)
        if kept.count:
            # three states of the set-up; the first position is the last of them
            stage = f"resuming the run in {keep}: finished states"
            progress(stage, kept.count, steps + 2)
    model = solid_sector_model(
        design,
        half=half,
        nonlinear=nonlinear,
        elastic_circular_spline=elastic_circular_spline,
    )
    follow = SolidContinuation(
        model=model, ratio=design.ratio, layout=design.drive.layout
    )

    series = series_compliance(design, cup=False)

    def checked(state: SolidState, what: str) -> SolidState:
        if not state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: {what} failed: {state.outcome.value}"
            )
        return state

    setup = []

    def reached(name: str, solve: Callable[[], SolidState]) -> SolidState:
        state = kept.read(name) if kept is not None else None
        if state is None:
            state = solve()
            if kept is not None and state.outcome.ok:
                kept.write(name, state)
        return state

    def set_up(name: str, what: str, solve: Callable[[], SolidState]) -> SolidState:
        state = checked(reached(name, solve), what)
        stress = SolidMaxima.from_state(model, state)
        setup.append(SolidSetup(name=name, state=state, stress=stress))
        progress("setting up", len(setup), 3)
        return state

    alone = set_up("wave_generator", "deflection by the wave generator", follow.deflect)
    meshed = set_up("meshed", "engagement of the teeth", lambda: follow.engage(alone))
    state = set_up(
        "torque",
        f"loading to {overload(design, torque) or f'{torque:g} N·m'}",
        lambda: follow.to_torque(meshed, torque),
    )

    rows = []
    for k in range(steps):
        angle = 2.0 * pi * turn * k / steps
        current = state
        if k:
            current = reached(
                f"position-{k:04d}", partial(follow.to_angle, state, angle)
            )
        if throw:
            checked(current, f"the input position {angle / deg:g} deg")
        if current.outcome.ok:
            state = current
        rows.append(_step(follow, current, angle, series))
        progress("meshing", k + 1, steps)
    return SolidRun(
        design=design,
        model=model,
        torque=torque,
        steps=tuple(rows),
        setup=tuple(setup),
        wall_s=time.perf_counter() - begin,
    )


def _step(
    follow: SolidContinuation, state: SolidState, angle: float, series: float
) -> SolidStep:
    model = follow.model
    if not state.outcome.ok:
        return SolidStep(input_angle=angle, outcome=state.outcome)
    pairs = set() if state.held is None else set(state.held.contacts.sector.tolist())
    return SolidStep(
        input_angle=angle,
        output_error=follow.output_angle(state)
        - series * state.torque
        - angle / follow.ratio,
        input_torque=follow.input_torque(state),
        wave_generator_torque=state.wave_generator_torque,
        tooth_moment=state.tooth_moment,
        energy=state.energy + 0.5 * series * state.torque**2,
        pairs_in_contact=model.copies * len(pairs),
        stress=SolidMaxima.from_state(model, state),
        iterations=len(state.history),
        state=state,
    )


def _nodes(model: SolidSectorModel) -> int:
    """Number of nodes of the flexspline; nodes on common faces are counted once."""
    face = sum(len(segment.mesh.first) for segment in model.strip.segments)
    rows = [s.begin.shape[1] for s in model.strip.mesh.cup if s.begin is not None]
    return int((model.strip.mesh.nodes - face + sum(rows)) * model.sectors)


def _place(place: StressPlace) -> dict[str, Any]:
    return {
        "part": place.part,
        "sector": place.sector,
        "position_mm": [1e3 * x for x in place.position],
    }


def _parts(solved: list[SolidMaxima]) -> dict[str, dict[str, float]]:
    """Mean over the positions of the flexspline's largest stresses by segment [MPa]."""
    if not solved:
        return {}
    return {
        name: {
            kind: float(np.mean([getattr(s.by_part[name], kind) for s in solved])) / 1e6
            for kind in KINDS
        }
        for name in solved[0].by_part
    }
