"""Thin ring under two opposite outward forces: closed form and elastica."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicSpline

from swgjoint.errors import ComputationError
from swgjoint.typing import Array


def small_deflection(angle: ArrayLike) -> Array:
    r"""Outward deflection, divided by the deflection under the force [-].

    For small deflections of an inextensional ring:

    .. math:: w = \frac{F R^3}{4 E I}
        \left(\cos\psi + \psi\sin\psi - \frac4\pi\right), \quad
        \psi = \frac\pi2 - \varphi

    Args:
        angle: Angle from the axis of the forces, 0 to pi/2 [rad].

    Source:
        Timoshenko, "Strength of Materials", part II, thin ring under two opposite
        forces.

    >>> float(small_deflection(0.0))
    1.0
    """
    across = 0.5 * np.pi - np.asarray(angle, dtype=float)
    shape = np.cos(across) + across * np.sin(across) - 4.0 / np.pi
    return np.asarray(shape / (0.5 * np.pi - 4.0 / np.pi))


@dataclass(frozen=True, kw_only=True, eq=False)
class Elastica:
    """One quarter of an inextensional ring with large rotations."""

    deflection: Array
    """Outward deflection in the requested directions [m]. The directions are fixed in
    space and do not follow the points of the ring."""
    force: float
    """Dimensionless force F R^2/(E I) [-]."""
    curvature: float
    """Magnitude of the curvature under the force, multiplied by R [-]; 1 in the
    undeformed ring."""


def elastica(radius: float, crown: float, angle: ArrayLike) -> Elastica:
    r"""Large deflection of a thin ring that two opposite forces pull outwards.

    The crowns are the two points under the forces. The equations

    .. math:: \theta' = \kappa, \quad \kappa' = \frac{F}{2EI}\cos\theta, \quad
        x' = \cos\theta, \quad y' = \sin\theta

    are solved along one quarter of the ring, from a crown (s = 0) to the side. The
    force acts along y and, by symmetry, no force acts along x. The angle theta falls
    along the quarter, so the curvature kappa is negative there.

    Args:
        radius: Radius R of the undeformed ring [m].
        crown: Outward displacement of each crown [m].
        angle: Directions in which the deflection is returned, from the axis of the
            forces, 0 to pi/2 [rad].

    Raises:
        ComputationError: If the boundary value problem does not converge.
    """
    rise = 1.0 + crown / radius

    def slope(s: Array, state: Array, force: Array) -> Array:
        _, _, theta, bend = state
        return np.stack(
            [np.cos(theta), np.sin(theta), bend, 0.5 * force[0] * np.cos(theta)]
        )

    def ends(first: Array, last: Array, force: Array) -> Array:
        del force
        return np.array(
            [first[0], first[1] - rise, first[2], last[1], last[2] + 0.5 * np.pi]
        )

    s = np.linspace(0.0, 0.5 * np.pi, 201)
    start = np.stack([np.sin(s), np.cos(s), -s, np.full_like(s, -1.0)])
    solution = solve_bvp(slope, ends, s, start, p=[0.0], tol=1e-10, max_nodes=20000)
    if not solution.success:
        raise ComputationError(f"elastica at {crown:g} m: {solution.message}")
    x, y = solution.sol(np.linspace(0.0, 0.5 * np.pi, 801))[:2]
    shape = CubicSpline(np.arctan2(x, y), np.hypot(x, y))
    return Elastica(
        deflection=radius * (shape(np.asarray(angle, dtype=float)) - 1.0),
        force=float(solution.p[0]),
        curvature=-float(solution.y[3, 0]),
    )
