"""Results of a meshing simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, pi
from typing import Any

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.common.stress_state import stress_state_label
from swgjoint.fe.meshing_phases import alike, overload, unspread
from swgjoint.fe.plane.drive2d import unmodelled_parts
from swgjoint.fe.plane.fields import root_stress, tooth_forces, wave_generator_contact
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.stress import KINDS, MemberMaxima, StressMaxima
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors
from swgjoint.gear.mounting import springs_of
from swgjoint.typing import Array
from swgjoint.units import arcsec, deg


@dataclass(frozen=True, kw_only=True, eq=False)
class SetupState:
    """One of the equilibria that precede the first input position."""

    name: str
    """``wave_generator`` (no tooth contact), ``meshed`` or ``torque``."""
    state: State
    """The equilibrium."""
    stress: MemberMaxima
    """Largest stresses of each member [Pa]."""

    @classmethod
    def from_state(cls, model: SectorModel, name: str, state: State) -> SetupState:
        """Setup state with the stresses recovered from its equilibrium.

        Args:
            model: 2D sector model of the drive.
            name: Name of the equilibrium, see :attr:`name`.
            state: The equilibrium.
        """
        return cls(name=name, state=state, stress=MemberMaxima.from_state(model, state))


@dataclass(frozen=True, kw_only=True, eq=False)
class Position:
    """Results at one input position; NaN or None where the solve failed."""

    input_angle: float
    """Input angle theta [rad]."""
    outcome: Outcome = Outcome.CONVERGED
    """Outcome of the solve."""
    output_error: float = nan
    """Output angle minus theta/i, measured from the undeformed position [rad]."""
    input_torque: float = nan
    """External torque on the input [N·m]."""
    wave_generator_torque: float = nan
    """External torque on the wave generator [N·m]."""
    tooth_moment: float = nan
    """Moment of the tooth forces on the flexspline [N·m]."""
    energy: float = nan
    """Strain energy [J]."""
    pairs_in_contact: int | None = None
    """Number of loaded tooth pairs, whole drive."""
    iterations: int = 0
    """Number of iterations of the solve."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshingStep(Position):
    """Results of a 2D model at one input position."""

    wave_generator_angle: float = nan
    """Angle of the wave generator in the frame of the fixed member [rad]; zero if the
    wave generator itself is fixed."""
    friction_work: float = nan
    """Work dissipated by tooth friction since the deflection [J]."""
    contact_nodes: int | None = None
    """Number of bore nodes that touch the wave generator, whole drive."""
    stress: MemberMaxima | None = None
    """Largest stresses of each member [Pa]."""
    state: State | None = None
    """The equilibrium, from which fields and figures are computed."""


class Positions:
    """Results that 2D and 3D runs derive from their input positions."""

    design: Design
    """The drive."""
    torque: float
    """Torque T that the drive exerts on the output [N·m]."""
    steps: tuple[Any, ...]
    """Results at every input position."""

    @property
    def turn(self) -> float:
        """Rotation of the input [turns]; zero for a single position."""
        if len(self.steps) < 2:
            return 0.0
        return float(self.steps[1].input_angle * len(self.steps) / (2.0 * pi))

    @property
    def unspread(self) -> str | None:
        """Text that reports how few phases the positions have; None if they spread."""
        return unspread(self.design, len(self.steps), self.turn)

    def warnings(self) -> list[str]:
        """Warnings that limit the validity of the results, one line each."""
        lines = [alike(self.design, len(self.steps), self.turn)]
        over = overload(self.design, self.torque)
        if over is not None:
            lines.append(
                f"torque = {over}: far above the load capacity of a strain wave gear"
            )
        return [line for line in lines if line is not None]

    @property
    def outcome(self) -> Outcome:
        """``CONVERGED``, or the outcome of the first position that failed."""
        failed = (s.outcome for s in self.steps if not s.outcome.ok)
        return next(failed, Outcome.CONVERGED)

    @property
    def states(self) -> tuple[Any, ...]:
        """Equilibria of the solved positions."""
        return tuple(step.state for step in self.steps if step.state is not None)

    def series(self, name: str) -> Array:
        """One quantity at all positions, NaN where a solve failed."""
        return np.array([getattr(step, name) for step in self.steps], dtype=float)

    def averages(self) -> dict[str, Any]:
        """Means of the per-step stress maxima by member [MPa]; None for a rigid one."""
        solved = [step.stress for step in self.steps if step.stress is not None]
        members = ("flexspline", "circular_spline")
        return {name: _averages([getattr(s, name) for s in solved]) for name in members}

    def common_series(self) -> dict[str, list[Any]]:
        """Entries of ``per_step`` that 2D and 3D runs share; flexspline stresses."""
        return {
            "angle_deg": list(self.series("input_angle") / deg),
            **{
                f"{kind}_MPa": [
                    None
                    if step.stress is None
                    else getattr(step.stress.flexspline, kind) / 1e6
                    for step in self.steps
                ]
                for kind in KINDS
            },
            "pairs_in_contact": [step.pairs_in_contact for step in self.steps],
            "output_error_arcsec": list(self.series("output_error") / arcsec),
            "wave_generator_torque_Nm": list(self.series("wave_generator_torque")),
            "tooth_moment_Nm": list(self.series("tooth_moment")),
            "energy_J": list(self.series("energy")),
            "iterations": [step.iterations for step in self.steps],
            "outcome": [step.outcome.name.lower() for step in self.steps],
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshingRun(Positions):
    """Results of a meshing simulation with the 2D model."""

    design: Design
    """The drive."""
    model: SectorModel
    """2D sector model of the drive."""
    torque: float
    """Torque T that the drive exerts on the output [N·m]."""
    steps: tuple[MeshingStep, ...]
    """Results at every input position."""
    setup: tuple[SetupState, ...]
    """Equilibria before the first position: deflected, meshed and under torque."""
    wall_s: float
    """Wall-clock time of the run [s]."""

    def _members(self) -> list[tuple[Superelement, int]]:
        """Sector and number of sectors of every deformable member."""
        compliance = self.model.circular_spline.compliance
        flexspline = (self.model.element, self.model.sectors)
        if compliance is None:
            return [flexspline]
        return [flexspline, (compliance.element, self.model.circular_spline_teeth)]

    @property
    def nodes(self) -> int:
        """Number of nodes of the deformable members before condensation."""
        total = 0
        for element, sectors in self._members():
            face = element.face_size
            total += (element.mesh.mesh.p.shape[1] - face) * sectors
            total += face if self.model.half else 0
        return int(total)

    @property
    def elements(self) -> int:
        """Number of elements of the deformable members before condensation."""
        return sum(int(e.mesh.mesh.t.shape[1]) * n for e, n in self._members())

    def to_json(self) -> dict[str, Any]:
        """JSON object that ``swgjoint meshing`` writes."""
        elastic = self.model.circular_spline.compliance is not None
        cup = None if self.design.cup is None else "closed-form torsion in series"
        rim = f"elastic, outside {self.design.circular_spline.outer_rim}"
        return {
            "design": self.design.drive.name,
            "label": {
                "model": "2d",
                "layout": self.design.drive.layout,
                "level": "nonlinear" if self.model.nonlinear else "linear",
                "circular_spline": rim if elastic else "rigid",
                "bearing": None if self.model.race is None else "balls roll",
                "half": self.model.half,
                "cup": cup,
                "stress_state": stress_state_label(self.design),
                "springs_Nm_rad": springs_of(self.design),
                "tooth_friction": self.design.friction.tooth_coefficient or None,
                "tolerances": has_errors(self.design) or None,
                "left_out": unmodelled_parts(self.design),
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
                "friction_work_J": list(self.series("friction_work")),
                "contact_arc_deg": [self._arcs(step.state) for step in self.steps],
            },
            "contact_forces_N": self._tooth_forces(),
            "root_stress": self._root_stress(),
            "setup_MPa": [
                {"state": found.name} | found.stress.to_json() for found in self.setup
            ],
        }

    def _arcs(self, state: State | None) -> list[list[list[float]]] | None:
        """Contact arcs of the wave generator, measured from each lobe [deg]."""
        if state is None:
            return None
        contact = wave_generator_contact(self.model, state, self.design.lobes)
        return [
            [[low / deg, high / deg] for low, high in arcs] for arcs in contact.arcs
        ]

    def _tooth_forces(self) -> dict[str, list[float]] | None:
        """Forces on all flexspline teeth at the last solved position [N]."""
        if not self.states:
            return None
        force = tooth_forces(self.model, self.states[-1])
        return {"right": list(force[:, 0]), "left": list(force[:, 1])}

    def _root_stress(self) -> dict[str, Any] | None:
        """Stresses at one tooth root over the position of the lobe [MPa]."""
        if not self.states:
            return None
        stress = root_stress(self.model, self.states, self.design.lobes)
        return {
            "tooth": stress.tooth,
            "lobe_deg": list(stress.lobe_position[:, stress.tooth] / deg),
        } | {
            f"{kind}_MPa": list(getattr(stress, kind)[:, stress.tooth] / 1e6)
            for kind in KINDS
        }


def _averages(maxima: Sequence[StressMaxima | None]) -> dict[str, Any]:
    """Means of the per-step stress maxima [MPa]; None for a rigid member."""
    rows = [m.to_json() for m in maxima if m is not None]
    return {
        "average_max_MPa": {
            kind: float(np.mean([row[kind] for row in rows])) if rows else None
            for kind in KINDS
        }
    }
