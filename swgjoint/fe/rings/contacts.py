"""Forces between the thin rings, the balls and the teeth, and their tangent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.rings.assembly import BandedAssembly
from swgjoint.fe.rings.facing import Facing, distances_to_ring
from swgjoint.fe.rings.model import ThinRing
from swgjoint.fe.rings.race_on_balls import PressedBalls, pressed_form
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.typing import Array, Index

PARTS = ("rim", "race", "balls", "bore", "teeth")
"""Parts that store energy; ``bore`` is the contact of rim and race."""


def linearise(
    model: ThinRing, state: ThinRingState, *, teeth: bool
) -> tuple[ThinRingState, BandedAssembly, int]:
    """Forces and tangent at the positions of a state.

    Args:
        model: The rings.
        state: Positions of the rings, and earlier feet of the contacts as initial
            guess.
        teeth: Whether the teeth can touch.

    Returns:
        The state with its forces, the assembled potential, and the number of the
        coordinate that is fixed to prevent rotation of the race.
    """
    total = BandedAssembly(model.size)
    first = model.rim.size
    rim, race = state.q[:first], state.q[first:]
    both = (("rim", model.rim, rim, 0), ("race", model.race, race, first))
    for name, ring, q, shift in both:
        energy, gradient, hessian = ring.forces(q)
        total.energy += energy
        total.gradient[shift : shift + ring.size] += gradient
        total.add(name, ring.dofs + shift, None, hessian)
    state = _balls(model, state, race, total)
    state = _bore(model, state, rim, race, total)
    if teeth:
        state = _teeth(model, state, rim, total)
    else:
        state = replace(state, contacts=None, tooth_force=None, tooth_moment=0.0)
    # the coordinate of race node 0 that is closest to its tangential direction
    node = race.reshape(-1, 2, 2)[0, 0]
    held = first + (0 if abs(node[1]) > abs(node[0]) else 1)
    total.gradient[held] = 0.0
    return replace(state, energy=total.energy), total, held


def race_on_balls(model: ThinRing, state: ThinRingState, race: Array) -> PressedBalls:
    """Contact of the balls of a state with a race.

    Args:
        model: The rings.
        state: State with the wave-generator angle, ball phase and feet of the balls.
        race: Coordinates of the race (race.size,) [m].
    """
    return model.press_balls(race, state.alpha, state.phase, state.ball_feet)


def _balls(
    model: ThinRing, state: ThinRingState, race: Array, total: BandedAssembly
) -> ThinRingState:
    """Contact of the race with the balls."""
    pressed = race_on_balls(model, state, race)
    on = np.flatnonzero(pressed.overlap > 0.0)
    near, overlap, force = pressed.seen.chosen(on), pressed.overlap, pressed.force
    slope = 1.5 * model.ball_constant * np.sqrt(overlap[on])
    total.energy += pressed.energy
    _press(
        total, "balls", near, near.by_ring, near.dofs + model.rim.size, force[on], slope
    )
    return replace(
        state,
        ball_feet=pressed.seen.place,
        ball_force=force,
        wave_generator_torque=pressed.input_torque,
    )


def _bore(
    model: ThinRing,
    state: ThinRingState,
    rim: Array,
    race: Array,
    total: BandedAssembly,
) -> ThinRingState:
    """Unilateral contact of the rim's bore with the race."""
    points = model.bore.points(rim)[0]
    seen = distances_to_ring(model.race, race, points, state.bore_feet, inside=False)
    overlap = 0.5 * model.bearing.race_thickness - seen.distance
    on = np.flatnonzero(overlap > 0.0)
    near, k = seen.chosen(on), model.press_per_point
    force = k * overlap[on]
    dofs, rows, bend = model.bore.chosen(on).rows(rim, near)
    both = np.concatenate([dofs, near.dofs + model.rim.size], axis=1)
    # the rotation of the section has its own row
    by_both = np.zeros((len(on), 4, 16))
    by_both[:, :2, :8], by_both[:, 3, :8] = rows[:, :2], rows[:, 2]
    by_both[:, :3, 8:] = near.by_ring
    total.energy += 0.5 * float(force @ overlap[on])
    _press(total, "bore", near, by_both, both, force, np.full(len(on), k), bend)
    return replace(state, bore_feet=seen.place)


def _teeth(
    model: ThinRing, state: ThinRingState, rim: Array, total: BandedAssembly
) -> ThinRingState:
    """Contact of the tooth flanks."""
    nodes = rim.reshape(-1, 2, 2)[:: model.nodes_per_tooth]
    foot, slope = nodes[:, 0], nodes[:, 1]
    contacts, angle = model.teeth.find_contacts(foot, slope)
    rows, second = model.teeth.rows(contacts, foot, slope, angle)
    k = model.teeth.stiffness
    force = -k * contacts.gap
    j = contacts.sector
    dofs = 4 * model.nodes_per_tooth * j[:, None] + np.arange(4)
    total.energy += -0.5 * float(force @ contacts.gap)
    hessian = k * rows[:, :, None] * rows[:, None, :] - force[:, None, None] * second
    total.add("teeth", dofs, -force[:, None] * rows, hessian)
    point = rotate(contacts.point, angle[j])
    push = force[:, None] * rotate(contacts.normal, angle[j])
    return replace(
        state,
        contacts=contacts,
        tooth_force=force,
        tooth_moment=float(np.sum(rotate_right_angle(point) * push)),
    )


def _press(
    total: BandedAssembly,
    name: str,
    seen: Facing,
    rows: Array,
    dofs: Index,
    force: Array,
    stiffness: Array,
    bend: Array | None = None,
) -> None:
    r"""Add contacts of normal force F and stiffness k.

    The gradient is :math:`-F\,dg`, the Hessian :math:`k\,dg\,dg - F\,d^2g`.

    Args:
        total: Assembly to which the contacts are added.
        name: Name of the part, one of :data:`PARTS`.
        seen: Distances of the points from the ring.
        rows: Derivatives of u_n, u_t, beta and, if m = 4, of the rotation of the
            section with respect to the coordinates (n, m, n_dofs).
        dofs: Numbers of these coordinates (n, n_dofs).
        force: Contact forces F (n,) [N].
        stiffness: Contact stiffnesses k (n,) [N/m].
        bend: Factor of the squared rotation in n . d2p (n,) [m].
    """
    hessian = np.swapaxes(rows, 1, 2) @ (
        pressed_form(seen, rows.shape[1], force, stiffness, bend) @ rows
    )
    total.add(name, dofs, -force[:, None] * rows[:, 0], hessian)
