"""Normal force times sliding distance of teeth and of rim and race."""

from __future__ import annotations

import numpy as np

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.rings.facing import distances_to_ring
from swgjoint.fe.rings.model import ThinRing
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.typing import Array


def sliding_sums(
    model: ThinRing, first: ThinRingState, last: ThinRingState
) -> tuple[float, float]:
    r"""Sums of N abs(sigma) of the teeth and of the race between two equilibria [J].

    N is the mean normal force of both equilibria, so that a tooth loaded in only one of
    them counts half; sigma is the sliding distance.

    Args:
        model: The rings.
        first: Equilibrium before the motion.
        last: Equilibrium after the motion.
    """
    teeth = [_teeth(model, *pair) for pair in ((first, last), (last, first))]
    weight, slid = _race(model, first, last)
    return (
        0.5 * sum(float(force @ np.abs(sigma)) for force, sigma in teeth),
        float(weight @ np.abs(slid)),
    )


def sticking_sum(
    model: ThinRing,
    first: ThinRingState,
    last: ThinRingState,
    *,
    tooth: float,
    race: float,
) -> float:
    r"""Sum of :math:`k \sigma^2` over the loaded contacts between two equilibria [J].

    If no contact slides, each one deforms by sigma along its tangent, so that this sum
    divided by the squared torsion is the stiffness that sticking adds to the drive.

    Args:
        model: The rings.
        first: Equilibrium before the motion.
        last: Equilibrium after the motion.
        tooth: Tangential stiffness k of a tooth contact [N/m].
        race: Tangential stiffness k of a contact point of bore and race [N/m].
    """
    teeth = [_teeth(model, *pair)[1] for pair in ((first, last), (last, first))]
    weight, slid = _race(model, first, last)
    return 0.5 * tooth * sum(float(sigma @ sigma) for sigma in teeth) + race * float(
        np.sum(slid[weight > 0.0] ** 2)
    )


def _teeth(
    model: ThinRing, state: ThinRingState, other: ThinRingState
) -> tuple[Array, Array]:
    """Normal forces N and distances sigma of a state's contacts to another state."""
    contacts, force = state.contacts, state.tooth_force
    if contacts is None or force is None or not len(force):
        return np.zeros(0), np.zeros(0)
    j = contacts.sector
    feet, angles = zip(*(_tooth_frames(model, s) for s in (state, other)), strict=True)
    point = rotate(contacts.point, angles[0][j])
    turn = angles[1][j] - angles[0][j]
    moved = feet[1][j] + rotate(point - feet[0][j], turn) - point
    along = rotate(contacts.tangent, angles[0][j])
    return force, np.einsum("ni,ni->n", moved, along)


def _tooth_frames(model: ThinRing, state: ThinRingState) -> tuple[Array, Array]:
    """Positions of the teeth on the rim (N, 2) [m] and their angles (N,) [rad]."""
    nodes = state.q[: model.rim.size].reshape(-1, 2, 2)[:: model.nodes_per_tooth]
    slope = nodes[:, 1]
    return nodes[:, 0], np.arctan2(-slope[:, 1], -slope[:, 0])


def _race(
    model: ThinRing, first: ThinRingState, last: ThinRingState
) -> tuple[Array, Array]:
    """Normal forces N and distances sigma of bore and race.

    The creep of the race minimises the sum of N abs(sigma).
    """
    forces, places = zip(*(_pressed(model, s) for s in (first, last)), strict=True)
    count = model.race.elements
    slid = np.mod(places[1] - places[0] + 0.5 * count, count) - 0.5 * count
    # from the mean line of the race to its outside, where the rim slides
    outside = 1.0 + 0.5 * model.bearing.race_thickness / model.race.radius
    slid *= model.race.step * outside
    weight = 0.5 * (forces[0] + forces[1])
    return weight, slid - weighted_median(slid, weight)


def _pressed(model: ThinRing, state: ThinRingState) -> tuple[Array, Array]:
    """Forces at the contact points of the bore [N], and their feet on the race."""
    rim, race = np.split(state.q, [model.rim.size])
    points = model.bore.points(rim)[0]
    seen = distances_to_ring(model.race, race, points, state.bore_feet, inside=False)
    overlap = 0.5 * model.bearing.race_thickness - seen.distance
    return model.press_per_point * np.maximum(overlap, 0.0), seen.place


def weighted_median(values: Array, weight: Array) -> float:
    """Value with the smallest weighted sum of distances from all values.

    Args:
        values: The values (n,).
        weight: Their weights, not negative (n,).

    Returns:
        One of the values; zero if all weights are zero.
    """
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    if not total[-1] > 0.0:
        return 0.0
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])
