"""Plain ring pulled apart by two rollers in its bore, with large displacements.

This model is independent of the models of toothed rings. It uses a total Lagrangian
formulation with quadratic elements on a curved mesh of a quarter of the ring.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse.linalg import spsolve
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad2,
    ElementVector,
    LinearForm,
    MeshQuad,
    MeshQuad2,
    condense,
)
from skfem.helpers import ddot, eye, grad, mul, trace, transpose

from swgjoint.errors import ComputationError, Outcome
from swgjoint.typing import Array

RADIAL, AROUND = 2, 32
"""Numbers of elements through the thickness and along a quarter, coarsest mesh."""


@dataclass(frozen=True, kw_only=True)
class FreeRing:
    """Ring of rectangular cross-section in plane stress."""

    outer_radius: float
    """Outer radius [m]."""
    thickness: float
    """Radial thickness [m]."""
    width: float
    """Axial width [m]."""
    youngs_modulus: float
    """Young's modulus [Pa]."""
    poisson_ratio: float
    """Poisson's ratio [-]."""

    @property
    def mean_radius(self) -> float:
        """Radius of the mean line [m]."""
        return self.outer_radius - 0.5 * self.thickness

    @property
    def bending_stiffness(self) -> float:
        """Bending stiffness E I [N·m^2]."""
        return self.youngs_modulus * self.width * self.thickness**3 / 12.0


@dataclass(frozen=True, kw_only=True, eq=False)
class PulledRing:
    """Equilibria of a ring whose rollers move apart, one row per roller position."""

    angle: Array
    """Directions in which the outside is measured, as angles from the axis through the
    rollers (m,) [rad]."""
    deflection: Array
    """Outward displacement of the outside in these directions (n, m) [m]. The
    directions are fixed in space, like that of a dial indicator."""
    force: Array
    """Force that each of the two rollers exerts on the ring (n,) [N]."""
    outline: Array
    """Deformed outside of a quarter, starting at the roller (n, k, 2) [m]."""


def pull_ring(
    ring: FreeRing, roller_travel: Array, angle: Array, *, refinement: int = 1
) -> PulledRing:
    r"""Equilibria of a ring pulled apart by two opposite rollers without friction.

    The contact stays at the crown because any roller that fits into the bore is more
    curved than the bore.

    .. math:: \int S : F^T \nabla v = 0, \quad S = 2\mu E + \lambda^* \mathrm{tr}E\,I,
        \quad E = \tfrac12 (F^T F - I), \quad F = I + \nabla u

    Args:
        ring: The ring.
        roller_travel: Outward travel of each roller (n,) [m], in the order in which
            the equilibria are followed.
        angle: Directions of measurement, as angles from the axis through the rollers
            (m,) [rad].
        refinement: Factor on the number of elements in each direction.

    Raises:
        ComputationError: If Newton's method fails or the outside folds.
    """
    basis = _quarter(ring, refinement)
    x, y = basis.doflocs
    u_x, u_y = basis.split_indices()
    tiny = 1e-9 * ring.outer_radius
    section = u_y[x[u_y] < tiny]
    crown = section[np.argmin(y[section])]  # where the roller touches
    held = np.concatenate([u_x[x[u_x] < tiny], u_y[y[u_y] < tiny], [crown]])
    radius, polar = np.hypot(x[u_x], y[u_x]), np.arctan2(x[u_x], y[u_x])
    outside = np.flatnonzero(np.abs(radius - ring.outer_radius) < tiny)
    outside = outside[np.argsort(polar[outside])]

    residual, tangent = _forms(ring)
    u = np.zeros(basis.N)
    rows, forces, outlines = [], [], []
    for travel in roller_travel:
        u[crown] = travel
        for _ in range(30):
            state = basis.interpolate(u)
            force = residual.assemble(basis, state=state)
            matrix = tangent.assemble(basis, state=state)
            step = np.zeros(basis.N)
            inside, rhs, step, keep = condense(matrix, -force, x=step, D=held)
            step[keep] = spsolve(inside.tocsc(), rhs)
            u += step
            if np.abs(step).max() < 1e-9 * abs(travel):
                break
        px, py = (x + u)[u_x[outside]], (y + u)[u_y[outside]]
        around = np.arctan2(px, py)
        # no convergence, or a solution whose outside is folded
        if np.abs(step).max() >= 1e-9 * abs(travel) or (np.diff(around) <= 0.0).any():
            raise ComputationError(
                f"plain ring, roller travel = {travel:g} m:"
                f" {Outcome.MAX_ITERATIONS.value}"
            )
        shape = CubicSpline(around, np.hypot(px, py))
        rows.append(shape(angle) - ring.outer_radius)
        # a quarter of the ring carries half of the roller's force
        forces.append(2.0 * residual.assemble(basis, state=basis.interpolate(u))[crown])
        outlines.append(np.stack([px, py], axis=-1))
    return PulledRing(
        angle=np.asarray(angle, float),
        deflection=np.array(rows),
        force=np.array(forces),
        outline=np.array(outlines),
    )


def _quarter(ring: FreeRing, refinement: int) -> Basis:
    """Basis of quadratic elements in the quarter x, y >= 0, finer near the roller."""
    through = np.linspace(-1.0, 0.0, RADIAL * refinement + 1) * ring.thickness
    share = np.linspace(0.0, 1.0, AROUND * refinement + 1)
    mesh = MeshQuad2.from_mesh(MeshQuad.init_tensor(through, 0.5 * pi * share))
    depth, phi = mesh.doflocs
    phi = phi**2 / (0.5 * pi) * 0.5 + 0.5 * phi
    radius = ring.outer_radius + depth
    points = np.stack([radius * np.sin(phi), radius * np.cos(phi)])
    return Basis(MeshQuad2(points, mesh.t), ElementVector(ElementQuad2()), intorder=4)


def _forms(ring: FreeRing) -> tuple[LinearForm, BilinearForm]:
    """Forms of the internal forces and of their derivative at ``state``."""
    nu = ring.poisson_ratio
    lame = ring.youngs_modulus * nu / (1.0 - nu**2)
    shear = ring.youngs_modulus / (2.0 * (1.0 + nu))

    def law(strain: Any) -> Any:
        return 2.0 * shear * strain + lame * eye(trace(strain), 2)

    def kinematics(w: Any) -> tuple[Any, Any]:
        h = grad(w["state"])
        gradient = h + eye(1.0 + 0.0 * h[0, 0], 2)
        strain = 0.5 * (mul(transpose(gradient), gradient) - eye(1.0 + 0 * h[0, 0], 2))
        return gradient, law(strain)

    @LinearForm  # type: ignore[untyped-decorator]
    def residual(v: Any, w: Any) -> Any:
        gradient, stress = kinematics(w)
        return ring.width * ddot(mul(gradient, stress), grad(v))

    @BilinearForm  # type: ignore[untyped-decorator]
    def tangent(u: Any, v: Any, w: Any) -> Any:
        gradient, stress = kinematics(w)
        change = mul(transpose(gradient), grad(u))
        more = law(0.5 * (change + transpose(change)))
        return ring.width * (
            ddot(mul(grad(u), stress), grad(v)) + ddot(mul(gradient, more), grad(v))
        )

    return residual, tangent
