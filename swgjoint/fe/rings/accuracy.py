"""Transmission error of a thin-ring drive with manufacturing errors."""

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
    """Output minus ideal output, psi - theta/i, under a constant torque (n,) [rad].

    Every angle is solved independently, so the order of the angles does not matter.

    Args:
        design: The drive, with its manufacturing errors.
        input_angles: Input angles theta, any number of turns (n,) [rad].
        torque: Output torque T, not zero [N·m]; None selects 1 % of the rated torque,
            which takes up the clearance.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks.
        ComputationError: If an equilibrium cannot be solved.
    """
    model = thin_ring(design)
    load = SMALL * ratings_of(design).rated_torque if torque is None else torque
    errors = []
    for theta in np.asarray(input_angles, dtype=float).ravel().tolist():
        state = solve_loaded(model, solve_unloaded(model, theta), load)
        if not state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: no equilibrium at {load:.4g} N·m and input angle"
                f" {theta:.4g} rad: {state.outcome.value}"
            )
        errors.append(state.rotation - theta / model.ratio)
    return np.array(errors)


def output_turn_angles(design: Design, count: int, seed: int = 0) -> Array:
    """Random input angles, one in each of n equal parts of an output turn (n,) [rad].

    The random positions avoid aliasing with the orders of teeth, balls and turns.

    Args:
        design: The drive.
        count: Number n of angles.
        seed: Seed of the random generator.
    """
    turns = abs(design.ratio)
    inside = np.random.default_rng(seed).uniform(size=count)
    return np.asarray(2.0 * np.pi * turns * (np.arange(count) + inside) / count)
