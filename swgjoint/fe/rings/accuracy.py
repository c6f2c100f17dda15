"""Where the output of a thin-ring drive stands over input turns, errors included."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import ComputationError
from swgjoint.fe.rings.loading import SMALL, solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import thin_ring
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array


def transmission_error(
    design: Design, input_angles: ArrayLike, *, torque: float | None = None
) -> Array:
    """Output less ideal output, psi - theta/i, one direction of the load [rad].

    Every angle is solved by itself, so that any of them will do, in any order.

    Args:
        design: The drive, with its manufacturing errors.
        input_angles: theta, of any number of turns (n,) [rad].
        torque: T [N·m]; by default 1 % of rated, which takes up the play.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
        ComputationError: If an equilibrium cannot be solved.
    """
    model = thin_ring(design)
    load = SMALL * ratings_of(design).rated_torque if torque is None else torque
    found = []
    for theta in np.asarray(input_angles, dtype=float).ravel().tolist():
        state = solve_loaded(model, solve_unloaded(model, theta), load)
        if not state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: no equilibrium at {load:.4g} N·m and input angle"
                f" {theta:.4g} rad: {state.outcome.value}"
            )
        found.append(state.rotation - theta / model.ratio)
    return np.array(found)


def output_turn_angles(design: Design, count: int, seed: int = 0) -> Array:
    """Random input angles over one output turn, one in every equal part (n,) [rad].

    Strewn, so that no order of tooth, ball or turn is met in step.
    """
    turns = abs(design.ratio)
    strewn = np.random.default_rng(seed).uniform(size=count)
    return np.asarray(2.0 * np.pi * turns * (np.arange(count) + strewn) / count)
