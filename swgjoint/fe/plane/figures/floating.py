r"""Wave generator that is free to move sideways, as in an Oldham coupling.

The teeth push the wave generator off its centre by the force F, the sum of their forces
on the flexspline. With the elastic energy U of the drive at an offset x,

.. math:: F = -\frac{\partial U}{\partial x} = 0

is its equilibrium. Under load the centre is a saddle of U: the teeth of one lobe come
out of mesh as those of the other go deeper. The search descends from there to a minimum
by steps :math:`|H|^{-1} F` with the eigenvalues of H = U'' taken as positive. H results
from finite differences at first and at the end, and is updated in between by the
symmetric rank-one formula (Nocedal, Wright, "Numerical Optimization", equation 6.24).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.arrays import frozen_array
from swgjoint.errors import Outcome
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Array

SHORTEST, LONGEST = 1e-3, 0.03
"""Difference for H, and longest step of the search, in lobe heights [-]."""
BALANCED = 2e-4
"""Force F that may remain, relative to the sum of all tooth forces [-]."""
STEPS = 40
"""Largest number of steps of a search."""
HALVINGS = 4
"""How often a step is halved for which there is no solution."""
LEAST = 1e-2
"""Smallest eigenvalue of |H| in a step, relative to the largest one [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FloatingGenerator:
    """Place of a floating wave generator, and the stiffness there."""

    offset: Array
    """Offset x of the centre in the frame of the wave generator (2,) [m]."""
    stiffness: Array | None = None
    """Estimate of H there (2, 2) [N/m]; None if unknown."""

    def __post_init__(self) -> None:
        offset = frozen_array(self.offset, "offset [m]", shape=(2,))
        object.__setattr__(self, "offset", offset)

    def settle(
        self, follow: Continuation, state: State
    ) -> tuple[State, FloatingGenerator]:
        """Equilibrium with the output held, and the place of the wave generator.

        Args:
            follow: Continuation of a whole drive with the wave generator in its centre,
                at input angle 0.
            state: State from which the search starts, at this place.

        Returns:
            The state, whose outcome says whether there is one, and the place.
        """
        height, place = follow.model.lobe_height, self.offset
        state, curve = _hold(follow, state, place), self.stiffness
        for _ in range(STEPS):
            if not state.outcome.ok:
                break
            force = side_force(follow.model, state)
            still = np.hypot(*force) <= BALANCED * np.sum(np.abs(state.tooth_force))
            if still or curve is None:
                curve = _stiffness(follow, state, place, force)
            values, axes = np.linalg.eigh(curve)
            if still and values[0] >= 0.0:
                return state, FloatingGenerator(offset=place, stiffness=curve)
            if still:
                # balanced on a saddle: leave it along its unstable axis
                step = LONGEST * height * axes[:, 0]
            else:
                sizes = np.maximum(np.abs(values), LEAST * np.abs(values).max())
                step = axes @ ((axes.T @ force) / sizes)
                step *= min(1.0, LONGEST * height / float(np.hypot(*step)))
            moved = _hold(follow, state, place + step)
            for _ in range(HALVINGS):
                if moved.outcome.ok:
                    break
                step = 0.5 * step
                moved = _hold(follow, state, place + step)
            state, place = moved, place + step
            change = force - side_force(follow.model, state)
            curve = _updated(curve, step, change)
        outcome = Outcome.MAX_ITERATIONS if state.outcome.ok else state.outcome
        return replace(state, outcome=outcome), self


def side_force(model: SectorModel, state: State) -> Array:
    """Force of the teeth on the flexspline, and thus on the wave generator (2,) [N].

    Args:
        model: A whole drive without friction.
        state: One of its equilibria.
    """
    contacts = state.contacts
    if contacts is None:
        return np.zeros(2)
    turned = model.frames(state).angle[contacts.sector]
    return np.asarray(state.tooth_force @ rotate(contacts.normal, turned))


def shift_generator(model: SectorModel, offset: Array) -> SectorModel:
    """The model with the centre of the wave generator at an offset.

    Args:
        model: A whole drive.
        offset: Offset in the frame of the wave generator (2,) [m].
    """
    if model.race is None:
        return replace(model, wave_generator_offset=offset)
    balls = replace(model.race.on_balls, cam_offset=offset)
    return replace(model, race=replace(model.race, on_balls=balls))


def _hold(follow: Continuation, state: State, offset: Array) -> State:
    """Equilibrium with output and wave generator held."""
    return replace(follow, model=shift_generator(follow.model, offset)).hold_output(
        state
    )


def _stiffness(follow: Continuation, state: State, place: Array, force: Array) -> Array:
    """H by forward differences of the force at a place (2, 2) [N/m]."""
    length = SHORTEST * follow.model.lobe_height
    columns = [
        force - side_force(follow.model, _hold(follow, state, place + step))
        for step in length * np.eye(2)
    ]
    return np.asarray(np.array(columns) + np.array(columns).T) / (2.0 * length)


def _updated(curve: Array, step: Array, change: Array) -> Array:
    """Symmetric rank-one update of H by the change of -F over a step."""
    miss = change - curve @ step
    along = float(miss @ step)
    if abs(along) < 1e-8 * float(np.hypot(*miss)) * float(np.hypot(*step)):
        return curve
    return np.asarray(curve + np.outer(miss, miss) / along)
