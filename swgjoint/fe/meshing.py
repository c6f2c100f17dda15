"""Simulation of meshing: the steps of thesis section 3.4.5."""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError, Outcome
from swgjoint.fe.drive2d import Continuation, check_modelled, ring_model
from swgjoint.fe.ring import RingModel
from swgjoint.fe.state import State
from swgjoint.fe.stress import StressMaxima, flexspline_maxima
from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design import Design
from swgjoint.progress import Progress, silent
from swgjoint.units import arcsec, deg

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshingStep:
    """Results at one wave-generator position; failed steps hold NaN."""

    wave_generator_angle: float
    """[rad]."""
    output_error: float
    """Output angle minus theta/i, from the undeformed position [rad]."""
    wave_generator_torque: float
    """External torque on the wave generator [N·m]."""
    tooth_moment: float
    """Moment of the tooth forces on the flexspline [N·m]."""
    energy: float
    """Strain energy [J]."""
    pairs_in_contact: int
    contact_nodes: int
    """Bore nodes that touch the wave generator, whole drive."""
    stress: StressMaxima
    iterations: int


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshingRun:
    """A simulation of meshing with a rigid circular spline."""

    design: Design
    model: RingModel
    torque: float
    steps: tuple[MeshingStep, ...]
    setup: tuple[tuple[str, StressMaxima], ...]
    last_state: State
    outcome: Outcome
    cup_stiffness: float | None
    wall_s: float

    @property
    def nodes(self) -> int:
        """Nodes of the flexspline before condensation."""
        mesh = self.model.element.mesh
        per_sector = mesh.mesh.p.shape[1] - len(mesh.face_last)
        closing = len(mesh.face_last) if self.model.half else 0
        return int(per_sector * self.model.sectors + closing)

    @property
    def elements(self) -> int:
        """Elements of the flexspline before condensation."""
        return int(self.model.element.mesh.mesh.t.shape[1]) * self.model.sectors

    def series(self, name: str) -> Array:
        """One quantity of :class:`MeshingStep` over the steps."""
        return np.array([getattr(step, name) for step in self.steps], dtype=float)

    def to_json(self) -> dict[str, Any]:
        """The JSON object of ``swgjoint meshing``."""
        stress = [step.stress.to_json() for step in self.steps]
        kinds = ("tensile", "compressive", "von_mises")
        level = "nonlinear" if self.model.nonlinear else "linear"
        return {
            "design": self.design.drive.name,
            "label": {
                "model": "2d",
                "level": level,
                "circular_spline": "rigid",
                "half": self.model.half,
                "cup": None
                if self.cup_stiffness is None
                else "closed-form torsion in series",
            },
            "torque_Nm": self.torque,
            "nodes": self.nodes,
            "elements": self.elements,
            "steps": len(self.steps),
            "wall_s": self.wall_s,
            "outcome": self.outcome.name.lower(),
            "flexspline": {
                "average_max_MPa": {
                    kind: float(np.mean([row[kind] for row in stress]))
                    for kind in kinds
                }
            },
            "circular_spline": {"average_max_MPa": dict.fromkeys(kinds)},
            "per_step": {
                "angle_deg": list(self.series("wave_generator_angle") / deg),
                **{f"{kind}_MPa": [row[kind] for row in stress] for kind in kinds},
                "pairs_in_contact": [step.pairs_in_contact for step in self.steps],
                "output_error_arcsec": list(self.series("output_error") / arcsec),
                "wave_generator_torque_Nm": list(self.series("wave_generator_torque")),
                "tooth_moment_Nm": list(self.series("tooth_moment")),
                "energy_J": list(self.series("energy")),
                "iterations": [step.iterations for step in self.steps],
            },
            "setup_MPa": [
                {"state": name, "flexspline": maxima.to_json(), "circular_spline": None}
                for name, maxima in self.setup
            ],
        }


def simulate_meshing(
    design: Design,
    *,
    model: str = "2d",
    torque: float = 0.0,
    steps: int = 35,
    turn: float = 0.5,
    nonlinear: bool = True,
    half: bool = False,
    progress: Progress = silent,
) -> MeshingRun:
    """Simulate meshing: deflect, engage, load, then turn the wave generator.

    Args:
        design: The drive.
        model: Fidelity, ``2d``.
        torque: T that the drive exerts on the output [N·m], constant over the turn.
        steps: Wave-generator positions k turn/steps, k = 0 to steps - 1.
        turn: Turns of the input.
        nonlinear: Large rotations of the sectors; False is the cheap linear level.
        half: Half model; needs even tooth counts.
        progress: Called with the stage, the steps done and their number.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
        ComputationError: If a solve fails; the message carries the outcome's advice.
    """
    check_modelled(design, model)
    begin = time.perf_counter()
    ring = ring_model(design, half=half, nonlinear=nonlinear)
    follow = Continuation(model=ring, ratio=design.ratio)
    cup = None if design.cup is None else cup_torsional_stiffness(design)

    def checked(state: State, what: str) -> State:
        if not state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: {what} failed: {state.outcome.value}"
            )
        return state

    state = checked(follow.deflected(), "deflection by the wave generator")
    setup = [("wave_generator", flexspline_maxima(ring, state))]
    state = checked(follow.meshed(state), "engagement of the teeth")
    setup.append(("meshed", flexspline_maxima(ring, state)))
    if torque != 0.0 or len(state.tooth_force):
        state = checked(follow.to_torque(state, torque), f"loading to {torque:g} N·m")
    setup.append(("torque", flexspline_maxima(ring, state)))

    rows = []
    for k in range(steps):
        angle = 2.0 * pi * turn * k / steps
        if k > 0:
            state = checked(
                follow.to_angle(state, angle),
                f"the wave-generator position {angle / deg:g} deg",
            )
        twist = 0.0 if cup is None else torque / cup
        rows.append(
            MeshingStep(
                wave_generator_angle=angle,
                output_error=state.rotation - twist - angle / design.ratio,
                wave_generator_torque=state.wave_generator_torque,
                tooth_moment=state.tooth_moment,
                energy=state.energy + (0.0 if cup is None else 0.5 * torque**2 / cup),
                pairs_in_contact=_pairs(ring, state),
                contact_nodes=ring.copies * int(state.touching.sum()),
                stress=flexspline_maxima(ring, state),
                iterations=len(state.history),
            )
        )
        progress("meshing", k + 1, steps)
    return MeshingRun(
        design=design,
        model=ring,
        torque=torque,
        steps=tuple(rows),
        setup=tuple(setup),
        last_state=state,
        outcome=Outcome.CONVERGED,
        cup_stiffness=cup,
        wall_s=time.perf_counter() - begin,
    )


def _pairs(model: RingModel, state: State) -> int:
    """Tooth pairs that carry force, whole drive; both flanks of a tooth count once."""
    if state.contacts is None:
        return 0
    return model.copies * len(set(state.contacts.sector.tolist()))
