r"""Second derivatives of tooth gaps: part of the tangent of a loaded ring.

A gap g is the smallest distance between two flanks. Its contact point slides along both
flanks as the tooth moves, and the normal n turns with them. Hence a force F on the
contact contributes :math:`-F\,\nabla^2 g` to the tangent of the ring.

With a, the sliding of the material point along the tangent J n of the circular spline,
and :math:`\vartheta`, the rotation of the flank (both per displacement of the nodes),
with the curvature :math:`\kappa_1` of the displaced flank and :math:`\kappa_2` of the
circular spline's flank, and :math:`\kappa = \kappa_1 + \kappa_2 > 0`,

.. math::
    \nabla^2 g = n \cdot \nabla^2 x + \kappa_2\, a a^T
        - \frac{(\vartheta + \kappa_2 a)(\vartheta + \kappa_2 a)^T}{\kappa} .

The first term belongs to a point x that is fixed on the flank, and to a fixed normal.
The second one turns the normal as the foot of the point moves along the circular
spline. The last one follows from the condition that the slope of the gap along the
flank vanishes at the contact point, which eliminates the arc length of that point.

In the frame of the sector, :math:`x = x_0 + W d_b` turns with the angle of the frame,
whose derivative is :math:`\Gamma` and whose second derivative is
:math:`-(\Gamma X_c^T + X_c \Gamma^T)/C`, see :mod:`swgjoint.fe.plane.corotation`. The
tangent of a sector contains the part of a force that turns with the frame; with the
displacement W A d of the flank, the remaining part of the first term is

.. math::
    \Gamma w^T + w \Gamma^T, \quad
    w = -\tfrac12 (n \cdot x)\,\Gamma - P^T A^T W^T J n - \frac{n \cdot Jx}{C} X_c .

The influence of other forces and of the circular spline's rotation and displacement on
a and :math:`\vartheta` is neglected.
"""

from __future__ import annotations

import numpy as np

from swgjoint.fe.plane.circular_spline import MIRROR
from swgjoint.fe.plane.contact_points import Contacts, outward_normals
from swgjoint.fe.plane.corotation import Frames, rotate, rotate_right_angle
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.fe.plane.tooth_contact import ToothContact
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index

CONFORMING = 10.0
"""Relative curvature below which two flanks count as conforming [1/m]. Their contact
point moves so far that the linearised condition for it is of no use; the normal follows
the flank of the flexspline."""


def add_contact_tangents(
    element: Superelement,
    search: ToothContact,
    frames: Frames,
    flank: Array,
    contacts: Contacts,
    force: Array,
    dofs: Index,
    hessian: Array,
) -> None:
    """Add the second derivatives of tooth gaps, times minus their forces.

    Args:
        element: Condensed sector of the flexspline.
        search: Search for tooth contacts at the state.
        frames: Kinematics of the sectors at the state.
        flank: Displacements of the flank nodes in the sector frames, including
            manufacturing errors (N, 2 n_b) [m].
        contacts: Contacts, of which only the places on the flanks are used.
        force: Forces on the contacts (k,) [N].
        dofs: Degrees of freedom of the skeleton within a sector (2 n_a,).
        hessian: Tangent to add to (N, n, n) [N/m].
    """
    sector, side, station = contacts.sector, contacts.side, contacts.station
    mirror, size = MIRROR[side], element.flank_size
    # points of the displaced flanks with two derivatives along the arc length
    shaped = flank.reshape(-1, 2, size, 2)[sector, side] * mirror[:, None]
    base, outward, bend = element.profile.evaluate(station)
    weights = [element.spline(station, order) for order in range(3)]
    moved, sloped, bent = (np.einsum("ks,ksi->ki", w, shaped) for w in weights)
    along = np.stack([outward[:, 1], -outward[:, 0]], axis=-1) + sloped
    point = base + moved
    seen = search.find_feet(point, outward_normals(along), sector, side)
    # in the sector frame, with the tangent J n
    normal, point, along = seen.normal * mirror, point * mirror, along * mirror
    tangent = rotate_right_angle(normal)
    own = np.einsum("ki,ki->k", normal, (bent - bend[:, None] * outward) * mirror)
    slope = np.einsum("ki,ki->k", tangent, along)
    height = np.einsum("ki,ki->k", normal, point)
    lever = -np.einsum("ki,ki->k", tangent, point)
    with np.errstate(invalid="ignore"):  # a search that diverges has infinite gaps
        curved = seen.feet.curvature / (1.0 + seen.feet.curvature * seen.feet.gap)
    # weights of a a^T, of a theta^T and its transpose, and of theta theta^T
    relative = own + curved * slope**2
    held = (relative < CONFORMING) | seen.feet.corner
    low, high = element.flank_range
    ends = (station <= low) | (station >= high)
    safe = np.where(held, 1.0, relative)
    ratio = np.where(ends, 0.0, curved * slope / safe)
    aa = np.where(held, own, curved * (1.0 - slope * ratio))
    at = -np.where(held, slope, ratio)
    tt = np.where(held | ends, 0.0, -1.0 / safe)
    numbers = np.stack([height, lever, slope, aa, at, tt], axis=-1)
    at_contacts = sector, side, np.stack(weights[:2]), normal, numbers, force
    carried = np.ascontiguousarray(element.flank_from_skeleton)
    native = kernels()
    if native is None:
        _add_products(carried, frames, *at_contacts, dofs, hessian)
    else:
        turns = frames.angle, frames.spin, frames.position
        native.add_contact_tangents(carried, *turns, *at_contacts, dofs, hessian)


def _add_products(
    carried: Array,
    frames: Frames,
    sector: Index,
    side: Index,
    weights: Array,
    normal: Array,
    numbers: Array,
    force: Array,
    dofs: Index,
    hessian: Array,
) -> None:
    """Add the products of vectors of which the second derivatives consist.

    Args:
        carried: Displacement of the flank nodes A (2 n_b, n) [-].
        frames: Kinematics of the sectors.
        sector: Sector of each contact (k,).
        side: Flank of each contact (k,).
        weights: Weights of the nodes of this flank in the displacement at the contact
            [-], and their derivatives along the flank [1/m] (2, k, n_nodes).
        normal: Normal n of each contact in the sector frame (k, 2).
        numbers: n . x and n . J x [m], slope of the arc length of the point along J n,
            and weights of a a^T [1/m], of a theta^T and its transpose [-], and of theta
            theta^T [m] (k, 6).
        force: Forces on the contacts (k,) [N].
        dofs: Degrees of freedom of the skeleton within a sector (n,).
        hessian: Tangent to add to [N/m].
    """
    n, nodes = dofs.size, weights.shape[2]
    by_node = carried.reshape(2, nodes, 2, n)[side]
    spin, y = frames.spin[sector], frames.position[sector]
    j_y = rotate_right_angle(y.reshape(len(y), -1, 2)).reshape(y.shape)

    def derivative(direction: Array, weight: Array, lever: Array) -> Array:
        """Displacement along a direction, with the lever arm of the frame's turn."""
        rows = np.einsum("ks,ki,ksin->kn", weight, direction, by_node, optimize=True)
        turned = lever - np.einsum("kn,kn->k", rows, j_y)
        return np.asarray(rows + turned[:, None] * spin)

    height, lever, slope, aa, at, tt = numbers.T
    across = derivative(rotate_right_angle(normal), weights[0], np.zeros(len(sector)))
    slide = across + height[:, None] * spin  # J n . J x = n . x
    turn = derivative(normal, weights[1], -slope)
    # Gamma = J X_c / C
    x_c = -rotate_right_angle(spin.reshape(len(y), -1, 2)).reshape(y.shape)
    w = -0.5 * height[:, None] * spin - across - lever[:, None] * x_c
    beside = 0.5 * aa[:, None] * slide + at[:, None] * turn
    vectors = np.stack([spin, slide, w, beside, turn], axis=1)
    turned = rotate(
        vectors.reshape(len(sector), 5, -1, 2), frames.angle[sector][:, None, None]
    ).reshape(vectors.shape)
    pairs = np.swapaxes(turned[:, :2], 1, 2) @ turned[:, 2:4]
    blocks = pairs + np.swapaxes(pairs, 1, 2)
    blocks += tt[:, None, None] * turned[:, 4, :, None] * turned[:, 4, None]
    into = sector[:, None, None], dofs[:, None], dofs
    np.add.at(hessian, into, -force[:, None, None] * blocks)
