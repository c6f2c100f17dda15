r"""Influence of every tooth gap on the output of the thin rings, linearised at a state.

The tangent K of the rings contains the springs k of the tooth contacts that carry load.
With the derivatives B of the gaps with respect to the coordinates q and the derivative
:math:`t` of the output angle psi, the changes of gaps and output angle under additional
forces y along the contacts and an additional torque are

.. math:: \Delta g = B K^{-1} (B^T y - t\,\Delta T), \quad
    \Delta\psi = t^T K^{-1} (B^T y - t\,\Delta T) .

A contact without load that closes has :math:`y = F`. A loaded contact keeps its spring
in K, so that :math:`y = k\,(v - \delta g)` with its opening v and its gap change
:math:`\delta g` due to errors. Balls and the contact of rim and race stay as they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.rings.contacts import linearise
from swgjoint.fe.rings.equilibrium import ThinRingSolver, rim_rotation
from swgjoint.fe.rings.model import ThinRing
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.typing import Array

LEAST = 1e-9
"""Least force per opening of a loaded contact, relative to its stiffness [-]."""


def with_shifting_teeth(model: ThinRing) -> ThinRing:
    """The same rings, whose contacts state the effect of shifts of both members' teeth.

    Args:
        model: Rings whose circular spline has perfect teeth or errors.
    """
    teeth = model.teeth
    if teeth.circular_spline_shift is not None:
        return model
    none = np.zeros((teeth.circular_spline.teeth, 2))
    return replace(model, teeth=replace(teeth, circular_spline_shift=none))


def tooth_influence(model: ThinRing, state: ThinRingState, reach: float) -> Influence:
    """Complementarity problem of the tooth contacts at an equilibrium.

    Args:
        model: Rings of :func:`with_shifting_teeth`.
        state: Equilibrium under load, so that its teeth hold the output.
        reach: Largest gap of a contact without load that errors may close [m].
    """
    state, total, held = linearise(model, state, teeth=True)
    psi, turn = rim_rotation(model, state.q, state.rotation)
    nodes = state.q[: model.rim.size].reshape(-1, 2, 2)[:: model.nodes_per_tooth]
    contacts, angle = model.teeth.find_contacts(nodes[:, 0], nodes[:, 1], reach=reach)
    rows, _ = model.teeth.rows(contacts, nodes[:, 0], nodes[:, 1], angle)
    right = np.zeros((model.size, len(contacts) + 1))
    dofs = 4 * model.nodes_per_tooth * contacts.sector[:, None] + np.arange(4)
    right[dofs, np.arange(len(contacts))[:, None]] = rows
    right[:, -1] = turn
    moved = total.solve(model.order, held, right, ThinRingSolver().anchor)
    product = right.T @ moved
    product = 0.5 * (product + product.T)
    by_force, by_turn = product[:-1, :-1], -product[:-1, -1]

    k, closed = model.teeth.stiffness, contacts.gap < 0.0
    # force per unknown: the opening of a loaded contact, the force of another one
    scale = np.where(closed, k, 1.0)
    sign = np.where(closed, -k, 1.0)
    matrix = sign[:, None] * by_force * scale + np.diag(np.where(closed, k, 1.0 / k))
    # a contact that carries the torque alone has the force of statics at any opening:
    # its entry is zero but for the turning of its flank, which can make it negative
    least = np.where(closed, LEAST * k, 0.0)
    np.fill_diagonal(matrix, np.maximum(np.diag(matrix), least))
    by_gap = -sign[:, None] * by_force * np.where(closed, k, 0.0) + np.diag(sign)
    return Influence(
        sector=contacts.sector,
        tooth=contacts.tooth,
        direction=shift_directions(contacts),
        by_tilt=np.zeros((len(contacts), 2)),
        closed=closed,
        torque=state.torque,
        matrix=matrix,
        slack=sign * contacts.gap,
        by_gap=by_gap,
        by_torque=sign * by_turn,
        angle=psi,
        angle_by_value=-scale * by_turn,
        angle_by_gap=np.where(closed, k * by_turn, 0.0),
        angle_by_torque=-float(product[-1, -1]),
    )


def shift_directions(contacts: Contacts) -> Array:
    """Derivatives of gaps with respect to the shifts of the teeth of both members.

    Args:
        contacts: Contacts of a circular spline whose flanks can shift (n).

    Returns:
        Derivatives for the flexspline tooth and the circular-spline tooth (2, n, 2).
    """
    weight = contacts.circular_spline_weight.reshape(len(contacts), -1, 2)
    return np.stack([contacts.normal, weight.sum(axis=1)])
