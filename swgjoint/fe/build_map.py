"""Sample a design by finite elements and fit its drive map."""

from __future__ import annotations

import time
from collections.abc import Callable
from math import pi
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.fe.continuation import Continuation
from swgjoint.fe.drive2d import can_halve, check_modelled, ring_model
from swgjoint.fe.state import State
from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design import Design
from swgjoint.gear.kinematics import angle_coefficients, periodicity
from swgjoint.maps.cache import cached
from swgjoint.maps.catalogue import ratings_of
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit import fit_map
from swgjoint.maps.samples import MapSamples
from swgjoint.progress import Progress, silent

Array = NDArray[np.float64]

ANGLES = 48
"""Wave-generator positions over one pitch: contact events leave corners in the error,
and 24 positions alias them into a tenth of the ripple, 48 into a few percent."""
LEVELS = (0.05, 0.15, 0.35, 0.65, 1.0)
"""Sampled torques, of both signs, as parts of the repeated peak torque."""


def build_map(
    design: Design,
    *,
    model: str | None = None,
    angles: int = ANGLES,
    progress: Progress = silent,
    cache: bool = True,
) -> DriveMap:
    """Drive map of a design.

    Args:
        design: The drive.
        model: Fidelity; default ``2d``.
        angles: Wave-generator positions over one pitch of the fixed member.
        progress: Called with the stage, the solves done and their number.
        cache: Whether to look in the cache of maps, and to store there.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
        ComputationError: If no torque at all can be solved.
    """
    model = model or ("3d" if design.cup is not None else "2d")
    check_modelled(design, model)

    def build() -> DriveMap:
        return fit_map(sample_map(design, angles=angles, progress=progress))

    if not cache:
        return build()
    parts = {"design": design.content_hash(), "model": model, "angles": angles}
    return cached(parts, build, name=design.drive.name)


def sample_map(
    design: Design, *, angles: int = ANGLES, progress: Progress = silent
) -> MapSamples:
    """Equilibria over one pitch and both signs of torque, by the nonlinear 2D model.

    One pitch suffices without tolerances; the claim is checked on a second pitch at
    rated torque. Torques at which a solve fails, and those beyond, are left out, and
    the record says so.
    """
    begin = time.perf_counter()
    drive = design.drive
    ratings = ratings_of(design)
    teeth = (drive.teeth_flexspline, drive.teeth_circular_spline)
    cycles = periodicity(drive.layout, *teeth)
    follow = Continuation(
        model=ring_model(design, half=can_halve(design)),
        ratio=design.ratio,
        layout=drive.layout,
    )
    cup = None if design.cup is None else cup_torsional_stiffness(design)
    parts = np.array(LEVELS) * ratings.repeated_peak
    torque = np.concatenate([-parts[::-1], [0.0], parts])
    zero = len(parts)
    period = 2.0 * pi / cycles
    theta = period * np.arange(angles) / angles
    total = angles * (torque.size + 1)
    done = 0

    def tick(label: str = "samples") -> None:
        nonlocal done
        done += 1
        progress(f"{drive.name}: {label}", done, total)

    # the first position: out from zero torque in both directions
    start = follow.meshed(follow.deflected())
    if start.outcome.ok:
        start = follow.to_torque(start, 0.0)
    if not start.outcome.ok:
        raise ComputationError(
            f"{drive.name}: no equilibrium without torque: {start.outcome.value}"
        )
    row: dict[int, State] = {zero: start}
    for step in (1, -1):
        j = zero
        while 0 <= j + step < torque.size:
            state = follow.to_torque(row[j], float(torque[j + step]))
            if not state.outcome.ok:
                break
            j += step
            row[j] = state
    low, high = min(row), max(row)
    table: dict[int, list[State]] = {j: [row[j]] for j in range(low, high + 1)}
    for _ in row:
        tick()
    for k in range(1, angles):
        for j in list(table):
            state = follow.to_angle(table[j][-1], float(theta[k]))
            if not state.outcome.ok and table[zero][-1] is not table[j][-1]:
                state = follow.to_torque(table[zero][k], float(torque[j]))
            if state.outcome.ok:
                table[j].append(state)
            elif j == zero:
                raise ComputationError(
                    f"{drive.name}: no equilibrium without torque at wave-generator "
                    f"position {k} of {angles}: {state.outcome.value}"
                )
            else:
                for beyond in [i for i in table if (i - j) * (j - zero) >= 0]:
                    del table[beyond]
                continue
            tick()
    kept = sorted(table)
    if kept[0] > zero - 2 or kept[-1] < zero + 2:
        raise ComputationError(
            f"{drive.name}: too few torques of either sign can be solved; the smallest "
            f"is {parts[0]:g} N·m of {ratings.repeated_peak:g} N·m repeated peak"
        )
    # the second pitch, at the torque next to rated
    check = min(kept, key=lambda j: abs(torque[j] - ratings.rated_torque))
    state, second = table[check][-1], []
    for k in range(angles):
        state = follow.to_angle(state, period + float(theta[k]))
        second.append(follow.output_angle(state) if state.outcome.ok else np.nan)
        tick("second pitch")

    used = torque[kept]
    twist = np.zeros_like(used) if cup is None else used / cup
    states = [table[j] for j in kept]

    def collect(quantity: Callable[[State], float]) -> Array:
        return np.array([[quantity(state) for state in line] for line in states])

    error = collect(follow.output_angle) - theta / design.ratio - twist[:, None]
    energy = collect(attrgetter("energy")) + 0.5 * (used * twist)[:, None]
    again = np.array(second) - (period + theta) / design.ratio
    first = error[kept.index(check)] + twist[kept.index(check)]
    # the pattern follows the gear angle that depends on the input alone, written so
    # that its phase grows with theta
    alpha, beta = angle_coefficients(drive.layout)
    order = (cycles, 0) if alpha == (1, 0) else (0, cycles * beta[0])
    return MapSamples(
        name=drive.name,
        level="2d",
        layout=drive.layout,
        teeth_flexspline=drive.teeth_flexspline,
        teeth_circular_spline=drive.teeth_circular_spline,
        ratings=ratings,
        damping_ratio=design.joint.damping_ratio,
        order=order,
        input_angle=theta,
        torque=used,
        output_error=error,
        energy=energy,
        compliance=collect(attrgetter("compliance"))
        + (0.0 if cup is None else 1.0 / cup),
        input_torque=collect(follow.input_torque),
        info={
            "design_hash": design.content_hash(),
            "label": {
                "model": "2d",
                "level": "nonlinear",
                "circular_spline": "elastic, outside fixed",
                "cup": None if cup is None else "closed-form torsion in series",
            },
            "ratings_source": ratings.source,
            "truncated": len(kept) < torque.size,
            "second_pitch": {
                "torque_Nm": float(torque[check]),
                "largest_difference_rad": float(np.abs(again - first).max()),
                "peak_to_peak_rad": float(np.ptp(first)),
            },
            "solves": done,
            "sampling_wall_s": time.perf_counter() - begin,
        },
    )
