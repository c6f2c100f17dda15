"""Errors superposed at one position, over the torque."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from swgjoint.fe.common.influence import Response
from swgjoint.fe.tolerances.rest import Rest
from swgjoint.fe.tolerances.sampling import CHUNK, respond_over_torque


class Spring:
    """A drive without contacts, which turns by 1 mrad/(N·m) and by the errors."""

    torque, angle = 0.0, 0.0

    def __init__(self) -> None:
        self.solved: list[float] = []

    def gap_change(self, errors: np.ndarray) -> np.ndarray:
        """The errors themselves."""
        return errors

    def respond(self, change: np.ndarray, torque: float, start: object) -> Response:
        """Angle of the spring; takes note of the torque."""
        self.solved.append(torque)
        angle = change - 1e-3 * torque
        return Response(
            output_angle=angle,
            potential=torque * angle + 0.5e-3 * torque**2,
            compliance=np.full(len(change), 1e-3),
            active=np.zeros((len(change), 1), dtype=bool),
        )


def test_both_ends_of_a_clearance_are_solved_once():
    """They are rows of the table, and the unloaded output is midway between them."""
    up, down, state = Spring(), Spring(), SimpleNamespace(energy=0.0)
    rest = Rest(state=state, at=up, opposite=(state, down))
    errors, levels, parts = np.linspace(0.0, 1e-3, CHUNK), np.array([0.5, 4.0]), []
    table, free = respond_over_torque(
        rest, (errors,), levels, 0.5, lambda n=1: parts.append(n)
    )
    assert up.solved == [0.5, 4.0] and down.solved == [-0.5, -4.0]
    torque = np.array([-4.0, -0.5, 0.0, 0.5, 4.0])
    assert np.allclose(table[0], errors - 1e-3 * torque[:, None], atol=1e-15)
    assert free == CHUNK and sum(parts) == torque.size
