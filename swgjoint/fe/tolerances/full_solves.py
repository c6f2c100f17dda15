"""Equilibria with manufacturing errors, without linearisation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from swgjoint.fe.common.following import Follower
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.tolerances.cycle import gap_errors, pitch_of
from swgjoint.fe.tolerances.rest import SMALL, Rest
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.maps.samples import FullSolves
from swgjoint.maps.unfinished import Unfinished
from swgjoint.typing import Array, Index

_CHECK = "full-solves-{:04d}"


def full_solves(
    design: Design,
    follow: Follower[Any],
    rests: Sequence[Rest],
    positions: Index,
    torques: Array | Sequence[float],
    signs: Array | None = None,
    *,
    offset: float = 0.0,
    tick: Callable[[], None] = lambda: None,
    keep: Unfinished | None = None,
) -> FullSolves:
    """Equilibria with errors at some positions of the cycle, without linearisation.

    Args:
        design: A drive with manufacturing errors.
        follow: Solver of the drive with perfect teeth and axis.
        rests: Unloaded positions of that drive within a pitch. Without an offset, the
            search for an equilibrium may start from their loaded states.
        positions: Numbers of the positions in the cycle, which has ``len(rests)``
            positions per pitch (n,).
        torques: Torques T at each position [N·m].
        signs: Factors of the torques, one per position (n,) [-]; None for one.
        offset: Rotation of the input beyond these positions [rad].
        tick: Called after every position.
        keep: Store of solved positions, which a resumed run reads; None stores none.

    Returns:
        Results at all positions and torques whose solve succeeded.
    """
    tables = []
    step = pitch_of(design) / len(rests)
    pitch, phase = np.divmod(positions, len(rests))
    small = SMALL * ratings_of(design).rated_torque
    starts = [rest.without_load(small) for rest in rests]
    if offset:
        starts = [
            follow.turn_unloaded(start, step * k + offset)
            for k, start in enumerate(starts)
        ]
    theta = step * positions + offset
    factors = np.ones(len(positions)) if signs is None else signs

    def solved(k: int, errors: tuple[Array, ...], loads: Array) -> Array:
        rows = []
        flawed, start = follow.with_errors(*errors), starts[phase[k]]
        loaded = {} if offset else rests[phase[k]].loaded
        sides = start.sides
        state = start.state if sides is None else sides[int(factors[k] < 0.0)]
        for torque in loads.tolist():
            if torque == 0.0 and sides is not None:
                # midway between both ends of the clearance
                states = [flawed.to_torque(s, s.torque) for s in sides]
            else:
                state = flawed.to_torque(_nearer(state, torque, loaded), torque)
                states = [state]
            angle = np.mean(
                [flawed.output_angle(s) if s.outcome.ok else np.nan for s in states]
            )
            error = angle - (step * phase[k] + offset) / follow.ratio
            moment = np.mean([flawed.input_torque(s) for s in states])
            rows.append((theta[k], torque, error, moment))
        return np.array(rows)

    for k, errors in enumerate(zip(*gap_errors(design, pitch), strict=True)):
        loads = factors[k] * np.asarray(torques) + 0.0  # no negative zero
        at = np.array([(theta[k], torque) for torque in loads])
        name = _CHECK.format(k)
        table = None if keep is None else keep.read(name, partial(_checked, at))
        if table is None:
            table = solved(k, errors, loads)
            if keep is not None:
                keep.write(name, {"table": table})
        tables.append(table)
        tick()
    table = np.concatenate(tables).T
    table = table[:, np.isfinite(table[2])]
    return FullSolves(
        input_angle=table[0],
        torque=table[1],
        output_error=table[2],
        input_torque=table[3],
    )


def _nearer(
    state: Any, torque: float, loaded: Mapping[float, tuple[Any, Influence]]
) -> Any:
    """The state whose torque is closest to the given one [N·m]."""
    near = min(loaded, key=lambda level: abs(level - torque), default=state.torque)
    closer = abs(near - torque) < abs(state.torque - torque)
    return loaded[near][0] if closer else state


def _checked(at: Array, arrays: Mapping[str, Any]) -> Array:
    """Rows that an interrupted run stored for a position, see :func:`full_solves`."""
    table = np.asarray(arrays["table"], float)
    if table.shape != (len(at), 4) or not np.array_equal(table[:, :2], at):
        raise ValueError("stored rows belong to another position of the cycle")
    return table
