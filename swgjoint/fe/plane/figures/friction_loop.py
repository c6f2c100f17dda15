"""Loops of torque against torsion with tooth friction, for the hysteresis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from math import pi
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.state import State
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import without_errors
from swgjoint.gear.mounting import series_compliance
from swgjoint.gear.wave_generators.wave_generator import has_mirror_symmetry
from swgjoint.maps.fit.friction_loop import FrictionLoop
from swgjoint.maps.unfinished import Unfinished
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array

POSITIONS = 4
"""Number of input positions over one pitch; the first and the last one are half a step
from its ends. With a symmetric wave generator only two of the four are solved, because
the others are their mirror images. Width and work of the loop vary by half between
positions; their mean over four positions is within 2 % of that over eight."""
STEPS = 12
"""Number of torque steps from zero to the largest torque, smaller at small torques."""
FIRST_STEPS = 4
"""Number of torque steps in each part of the first loading and unloading, which only
erases the memory of the initial state."""
SMALL_STEPS = 4
"""Number of torque steps in each quarter of a small loop."""
SMALL = 0.25
"""Amplitude of the small loops as a fraction of the rated torque [-]."""
APPROACH = 4
"""Number of torque steps between two small loops."""
_LOOP, _FIELDS = "friction-loop-{:04d}", fields(FrictionLoop)


def loop_torques(top: float, steps: int = STEPS) -> Array:
    """Torque path 0 -> T -> 0 -> -T in a few steps, then -T -> T -> -T -> T.

    Args:
        top: Largest torque T [N·m].
        steps: Number of steps from zero to the largest torque, a multiple of
            :data:`FIRST_STEPS`.

    Returns:
        Torques (3 FIRST_STEPS + 6 steps + 1,) [N·m].
    """
    up = top * (np.arange(steps + 1) / steps) ** 1.5
    few = up[:: steps // FIRST_STEPS]
    rise = np.concatenate([-up[-2::-1], up[1:]])
    path = np.concatenate([few, few[-2::-1], -few[1:], rise, -rise, rise])
    return np.asarray(path + 0.0)  # no negative zero


def small_loop_torques(top: float, rated: float) -> list[Array]:
    """Torque paths of small loops, one after the other, which begin at the top torque.

    The loops are about the largest torque that their amplitude permits, and about the
    full, half and zero rated torque, as far as these are smaller. Each is run twice;
    the second round is closed.

    Args:
        top: Largest torque [N·m].
        rated: Rated torque [N·m].
    """
    amplitude = min(SMALL * rated, 0.5 * top)
    part = np.arange(1, 2 * SMALL_STEPS + 1) / SMALL_STEPS
    once = np.concatenate([1.0 - part, part - 1.0])
    paths: list[Array] = []
    last = top
    for mean in (top - amplitude, rated, 0.5 * rated, 0.0):
        start = mean + amplitude
        if mean > top - amplitude or (paths and start >= last):
            continue
        steps = [mean + amplitude * once] * 2
        if paths:
            steps.insert(0, np.linspace(last, start, APPROACH + 1)[1:])
        # equal torques are equal bit for bit, also those of the large loop
        paths.append(np.round(np.concatenate(steps) / top, 9) * top + 0.0)
        last = start
    return paths


def whole_path(
    top: float, rated: float | None, steps: int = STEPS
) -> tuple[Array, list[tuple[int, int]]]:
    """Torques of the large loop, followed by those of the small loops.

    Args:
        top: Largest torque [N·m].
        rated: Rated torque, which adds the small loops [N·m]; None adds none.
        steps: Number of steps from zero to the largest torque, a multiple of
            :data:`FIRST_STEPS`.

    Returns:
        Torques (n,) [N·m]; by loop, the number of torques up to its end and the number
        of steps in a quarter of its last round.
    """
    paths = [loop_torques(top, steps)]
    if rated is not None:
        paths += small_loop_torques(top, rated)
    ends = np.cumsum([path.size for path in paths]).tolist()
    quarters = [steps, *[SMALL_STEPS] * (len(paths) - 1)]
    return np.concatenate(paths), list(zip(ends, quarters, strict=True))


def friction_loops(
    design: Design,
    *,
    top: float,
    rated: float | None = None,
    positions: int = POSITIONS,
    steps: int = STEPS,
    progress: Progress = silent,
    keep: Unfinished | None = None,
) -> tuple[FrictionLoop, ...]:
    """Torque loops at several locked input positions, with friction between the teeth.

    Manufacturing errors are not included. If the model contains the bearing of the wave
    generator, its cage is fixed to the cam.

    Args:
        design: The drive; its friction coefficient may be zero.
        top: Largest torque [N·m].
        rated: Rated torque, which adds the small loops of
            :func:`small_loop_torques` [N·m]; None adds none.
        positions: Number of input positions over one period of the gear without errors,
            see :func:`swgjoint.gear.kinematics.periodicity`.
        steps: Number of steps from zero to the largest torque, a multiple of
            :data:`FIRST_STEPS`.
        progress: Called with the stage, the number of finished equilibria and the
            number of all equilibria.
        keep: Store of finished loops, from which an interrupted run resumes; None
            stores none.

    Returns:
        One loop per solved position, followed by its small loops: all positions or,
        with a symmetric wave generator, the first half.

    Raises:
        ComputationError: If an equilibrium cannot be found.
    """
    perfect, drive = without_errors(design), design.drive
    period = 2.0 * pi / design.periodicity
    parts = (np.arange(positions) + 0.5) / positions
    if has_mirror_symmetry(design):
        parts = parts[: (positions + 1) // 2]
    model = sector_model(perfect, half="auto", cage_held=True)
    rubbing = Continuation(model=model, ratio=design.ratio, layout=drive.layout)
    smooth = replace(rubbing, model=replace(model, friction=None))
    torque, ends = whole_path(top, rated, steps)
    outward = np.unique(torque)
    series = series_compliance(design, cup=True)
    loops: list[FrictionLoop] = []  # along the whole path
    stage = f"{drive.name}: friction loops"
    each = outward.size + torque.size
    done, total = 0, each * len(parts)

    def tick(count: int = 1) -> None:
        nonlocal done
        done += count
        progress(stage, done, total)

    progress(stage, 0, total)
    angles = [period * float(part) for part in parts]
    kept = [_kept(keep, k, theta, torque) for k, theta in enumerate(angles)]
    # an output that is free at one position makes the loops at all others useless
    unloaded = {
        k: _unloaded(smooth, angles[k], tick)
        for k, there in enumerate(kept)
        if there is None
    }
    for k, (theta, there) in enumerate(zip(angles, kept, strict=True)):
        if there is not None:
            loops.append(there)
            tick(each)
            continue
        elastic: dict[float, State] = {}
        for side in (outward[outward >= 0.0], outward[outward <= 0.0][::-1]):
            states = _along(smooth, unloaded[k], side, tick)
            elastic |= dict(zip(side.tolist(), states, strict=True))
        rubbed = _along(rubbing, _unloaded(rubbing, theta, tick), torque, tick)
        still = [elastic[t] for t in torque.tolist()]
        ideal = theta / design.ratio
        loops.append(
            FrictionLoop(
                input_angle=theta,
                quarter=ends[-1][1],
                torque=torque,
                torsion=np.array([ideal - rubbing.output_angle(s) for s in rubbed])
                + series * torque,
                elastic_torsion=np.array(
                    [ideal - smooth.output_angle(s) for s in still]
                )
                + series * torque,
                stiffness=1.0 / (np.array([s.compliance for s in still]) + series),
                work=np.array([s.friction_work for s in rubbed]),
            )
        )
        if keep is not None:
            values = {item.name: getattr(loops[-1], item.name) for item in _FIELDS}
            keep.write(_LOOP.format(k), values)
    return tuple(loop.cut_path(end, quarter) for loop in loops for end, quarter in ends)


def _kept(
    keep: Unfinished | None, number: int, theta: float, torque: Array
) -> FrictionLoop | None:
    """Loop from the store of an interrupted run; None if it is not stored there."""

    def taken(arrays: dict[str, Any]) -> FrictionLoop:
        numbers = {
            "input_angle": float(arrays["input_angle"]),
            "quarter": int(arrays["quarter"]),
        }
        loop = FrictionLoop(**arrays | numbers)
        if loop.input_angle != theta or not np.array_equal(loop.torque, torque):
            raise ValueError("stored loop: input angle or torques differ")
        return loop

    return None if keep is None else keep.read(_LOOP.format(number), taken)


def _unloaded(follow: Continuation, theta: float, tick: Callable[[], None]) -> State:
    """Equilibrium without load at a locked input angle [rad].

    Raises:
        ComputationError: If the output moves freely in a clearance.
    """
    state = follow.engage(follow.deflect(theta))
    if state.outcome.ok:
        state = follow.to_torque(state, 0.0)
    if not state.outcome.ok:
        raise ComputationError(
            f"no equilibrium at zero torque and input angle {theta:.4g} rad: friction"
            " loops need an output that cannot move freely in a clearance"
        )
    tick()
    return state


def _along(
    follow: Continuation, start: State, torques: Array, tick: Callable[[], None]
) -> list[State]:
    """Equilibria along a torque path, with the input locked.

    Args:
        follow: Continuation of the equilibria.
        start: Equilibrium at the first torque.
        torques: Output torques (n,) [N·m].
        tick: Called after every equilibrium except the first.

    Raises:
        ComputationError: If an equilibrium cannot be found.
    """
    states = [start]
    for torque in torques[1:].tolist():
        state = follow.to_torque(states[-1], torque)
        if not state.outcome.ok:
            raise ComputationError(
                f"no equilibrium at {torque:.4g} N·m and input angle"
                f" {follow.input_angle(start):.4g} rad with a friction coefficient of"
                f" {_coefficient(follow):g}: {state.outcome.value}"
            )
        states.append(state)
        tick()
    return states


def _coefficient(follow: Continuation) -> float:
    """Friction coefficient of the flanks [-]."""
    law = follow.model.friction
    return 0.0 if law is None else law.coefficient
