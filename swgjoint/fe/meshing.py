"""Simulation of meshing: the steps of thesis section 3.4.5."""

from __future__ import annotations

import time
from math import ceil, copysign, isfinite, pi
from pathlib import Path
from typing import TYPE_CHECKING

from swgjoint.errors import ComputationError, InputError
from swgjoint.fe.meshing_phases import default_steps, overload
from swgjoint.fe.meshing_run import MeshingRun, MeshingStep, SetupState
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import (
    Half,
    can_halve,
    check_modelled,
    in_plane,
    sector_model,
)
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.stress import MemberMaxima
from swgjoint.flags import check_flags
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design, check_design
from swgjoint.gear.mounting import series_compliance
from swgjoint.progress import Progress, silent
from swgjoint.units import deg

if TYPE_CHECKING:
    from swgjoint.fe.solid.meshing import SolidRun

RUN_IN_STEPS = 6
"""Number of steps through half a pitch before a position with friction."""


def simulate_meshing(
    design: Design,
    *,
    model: str = "2d",
    torque: float = 0.0,
    steps: int | None = None,
    turn: float = 0.5,
    nonlinear: bool = True,
    half: Half = False,
    elastic_circular_spline: bool = True,
    throw: bool = True,
    progress: Progress = silent,
    keep: Path | None = None,
    resume: bool = False,
) -> MeshingRun | SolidRun:
    """Simulate meshing: deflect, engage, load, then turn the wave generator.

    Args:
        design: The drive.
        model: Fidelity, ``2d`` or, for a design with a cup, ``3d``.
        torque: Torque T that the drive exerts on the output, constant over the turn
            [N·m].
        steps: Number of input positions; position k, from 0 to steps - 1, is at
            k turn/steps turns. None chooses 35 or the nearest number whose positions
            spread over the tooth pitch (see :mod:`swgjoint.fe.meshing_phases`). An
            explicit number is used even if its positions do not spread; the
            ``warnings`` of the result then report this.
        turn: Rotation of the input [turns].
        nonlinear: Whether sectors may rotate by large angles; False selects the cheaper
            linear model.
        half: Whether to use the half model, which needs even tooth counts and a
            symmetric wave generator without errors; ``auto`` uses it wherever it
            applies.
        elastic_circular_spline: Whether the circular spline deforms; False makes it
            rigid.
        throw: Whether a position that cannot be solved raises an error. If not, the
            position keeps its outcome and the next one starts from the last solved one.
        progress: Called with the stage, the number of finished steps and their total.
        keep: Folder in which a 3D run stores the state of every position; None stores
            none.
        resume: Whether to resume the interrupted run in that folder.

    Returns:
        Results at all positions and at the equilibria before the first one.

    Raises:
        InputError: If ``design`` is not a design, or a number is outside its range.
        DesignError: If the design cannot be built or has features that the model lacks.
        ComputationError: If a solve fails; the message carries the outcome's advice.
            A failed deflection, engagement or loading is always an error, because no
            position can be solved without them.
    """
    _check_arguments(design, torque, steps, turn)
    check_flags(
        nonlinear=nonlinear,
        elastic_circular_spline=elastic_circular_spline,
        throw=throw,
        resume=resume,
    )
    if half not in (True, False, "auto"):
        raise InputError(f"half = {half!r}; accepted: True, False, 'auto'")
    if steps is None:
        steps = default_steps(design, turn)
    if half == "auto":
        half = can_halve(design, bearing=model == "2d")
    if model == "3d":
        from swgjoint.fe.solid.meshing import simulate_solid_meshing

        return simulate_solid_meshing(
            design,
            torque=torque,
            steps=steps,
            turn=turn,
            nonlinear=nonlinear,
            half=half,
            elastic_circular_spline=elastic_circular_spline,
            throw=throw,
            progress=progress,
            keep=keep,
            resume=resume,
        )
    check_modelled(design, model)
    begin = time.perf_counter()
    drive = sector_model(
        in_plane(design),
        half=half,
        nonlinear=nonlinear,
        elastic_circular_spline=elastic_circular_spline,
    )
    follow = Continuation(model=drive, ratio=design.ratio, layout=design.drive.layout)
    series = series_compliance(design, cup=True)

    def checked(state: State, what: str) -> State:
        if not state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: {what} failed: {state.outcome.value}"
            )
        return state

    state = checked(follow.deflect(), "deflection by the wave generator")
    setup = [SetupState.from_state(drive, "wave_generator", state)]
    state = checked(follow.engage(state), "engagement of the teeth")
    setup.append(SetupState.from_state(drive, "meshed", state))
    if torque == 0.0:
        small = 0.01 * ratings_of(design).rated_torque
        unloaded = follow.unload(state, small)
        state = unloaded.state
    else:
        state = follow.to_torque(state, torque)
    checked(state, f"loading to {overload(design, torque) or f'{torque:g} N·m'}")
    setup.append(SetupState.from_state(drive, "torque", state))

    slides = drive.friction is not None and torque != 0.0
    rows = []
    for k in range(steps):
        angle = 2.0 * pi * turn * k / steps
        if slides:
            current = _slide_to(follow, state, angle, turn)
        elif k == 0:
            current = state
        elif torque == 0.0:
            tried = follow.turn_unloaded(unloaded, angle)
            current = tried.state
            # a failed attempt may hold a state under the small torque: continue from
            # the last solved position
            unloaded = tried if current.outcome.ok else unloaded
        else:
            current = follow.to_angle(state, angle)
        if throw:
            checked(current, f"solve at input angle {angle / deg:g} deg")
        if current.outcome.ok:
            state = current
        rows.append(_step(drive, follow, current, angle, torque, series))
        progress("meshing", k + 1, steps)
    return MeshingRun(
        design=design,
        model=drive,
        torque=torque,
        steps=tuple(rows),
        setup=tuple(setup),
        wall_s=time.perf_counter() - begin,
    )


def _check_arguments(
    design: Design, torque: float, steps: int | None, turn: float
) -> None:
    """Reject what no run can be computed from, before anything is computed."""
    check_design(design)
    if not isfinite(torque):
        raise InputError(f"torque {torque:g} N·m; accepted: a finite number")
    if steps is not None and not steps >= 1:
        raise InputError(f"steps {steps}; accepted: >= 1, or None")
    if not (isfinite(turn) and turn != 0.0):
        raise InputError(f"turn {turn:g} turns; accepted: a finite number except 0")


def _slide_to(follow: Continuation, state: State, angle: float, turn: float) -> State:
    """Turn the input to an angle, with friction as in steady motion.

    Friction follows the sliding of the flanks only in small steps. Positions that are
    farther apart, and the first one, are approached through half a pitch of such steps,
    after which friction does not depend on what was before.

    Args:
        follow: The drive.
        state: State at another position or, for the first one, at the same angle.
        angle: Input angle [rad].
        turn: Rotation of the input in the simulation [turns], for its direction.
    """
    step = copysign(
        pi / (RUN_IN_STEPS * follow.model.circular_spline.profile.teeth), turn
    )
    apart = (angle - follow.input_angle(state)) / step
    count = ceil(apart - 1e-6) if 0.5 < apart <= RUN_IN_STEPS else RUN_IN_STEPS
    first = 1 if apart > 0.5 and count < RUN_IN_STEPS else 0
    length = apart / count * step if first else step
    for k in range(first, count + 1):
        if state.outcome.ok:
            state = follow.to_angle(state, angle - (count - k) * length)
    return state


def _step(
    model: SectorModel,
    follow: Continuation,
    state: State,
    angle: float,
    torque: float,
    series: float,
) -> MeshingStep:
    """Results at one position; only the outcome if the solve failed."""
    if not state.outcome.ok:
        return MeshingStep(input_angle=angle, outcome=state.outcome)
    return MeshingStep(
        input_angle=angle,
        wave_generator_angle=state.wave_generator_angle,
        output_error=follow.output_angle(state)
        - series * torque
        - angle / follow.ratio,
        input_torque=follow.input_torque(state),
        wave_generator_torque=state.wave_generator_torque,
        tooth_moment=state.tooth_moment,
        energy=state.energy + 0.5 * series * torque**2,
        friction_work=state.friction_work,
        pairs_in_contact=_pairs(model, state),
        contact_nodes=model.copies * model.stations.nodes_touching(state.touching),
        stress=MemberMaxima.from_state(model, state),
        iterations=len(state.history),
        state=state,
    )


def _pairs(model: SectorModel, state: State) -> int:
    """Number of loaded tooth pairs, whole drive; two loaded flanks count as one."""
    if state.contacts is None:
        return 0
    return model.copies * len(set(state.contacts.sector.tolist()))
