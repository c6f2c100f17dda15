r"""The reduced drive: a potential of torsion and of the two gear angles.

.. math::
    V(\Delta, \alpha, \beta) = \sum_k \left[ A_k(\Delta) \cos\varphi_k
        + B_k(\Delta) \sin\varphi_k \right],
    \quad \varphi_k = p_k \alpha + q_k \beta,

with :math:`\Delta = \theta/i + e_0(\alpha, \beta) - \psi`. The coefficients are
piecewise polynomials of degree four, so the torque is piecewise cubic. Outside the
sampled torsion every coefficient continues as a parabola and the torque linearly.

In addition to the potential, a map may have hysteresis (Jenkin elements along the
torsion, see :mod:`swgjoint.maps.hysteresis`) and friction of the wave generator (see
:mod:`swgjoint.maps.friction`). The forces that this module computes exclude both and
are therefore conservative.
"""

from __future__ import annotations

import copy
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swgjoint.arrays import frozen_array
from swgjoint.errors import InputError
from swgjoint.gear.kinematics import LAYOUTS, angle_coefficients, ratio
from swgjoint.gear.ratings import Ratings
from swgjoint.maps import sums
from swgjoint.maps.fields import DriveFields
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import (
    Jenkin,
    accepted_stiffness,
    check_elements,
    check_loads,
    vary_with_load,
)
from swgjoint.maps.phase_bounds import max_stiffness
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class Law:
    """Torsion and generalised forces at given angles, in the shape of the angles."""

    torsion: Array
    """Torsion [rad]."""
    by_theta: Array
    """Derivative of the torsion by the input angle theta [-]."""
    by_psi: Array
    """Derivative of the torsion by the output angle psi [-]."""
    torque: Array
    """Elastic torque dV/d(torsion) at fixed angles [N·m]."""
    input_force: Array
    """Generalised force on the input, -dV/dtheta [N·m]."""
    output_force: Array
    """Torque on the output, -dV/dpsi [N·m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Potential:
    """Potential, hysteresis and friction of one drive; immutable.

    Users work with a :class:`~swgjoint.maps.drive_map.DriveMap`, which adds
    constructors, files and the spec sheet.
    """

    name: str
    level: str
    """Origin: ``ring``, ``2d``, ``3d``, ``catalogue``, ``measurement``, ``linear``."""
    layout: str
    """Which member is fixed, one of :data:`~swgjoint.gear.kinematics.LAYOUTS`."""
    teeth_flexspline: int
    teeth_circular_spline: int
    torsion_knots: Array
    """Torsions at which the polynomials join, increasing [rad]. Shape (n_knots,)."""
    orders: NDArray[np.int64]
    """(p, q) of every harmonic, the mean (0, 0) first. Shape (n_harmonics, 2)."""
    potential: Array
    """Coefficients of A and B in ascending powers of (torsion - knot) [J/rad^k].

    Shape (n_harmonics, 2, n_knots - 1, 5).
    """
    end_stiffness: Array
    """Second derivative of A and B below and above the knots [N·m/rad].

    Shape (n_harmonics, 2, 2).
    """
    kinematic_error: Array
    """Cosine and sine amplitude of e0 for every harmonic [rad]. (n_harmonics, 2)."""
    ratings: Ratings
    damping_ratio: float = 0.02
    """Default damping of a joint with this drive, as a fraction of critical [-]."""
    hysteresis: tuple[Jenkin, ...] = ()
    """Jenkin elements whose torque is added to that of the potential."""
    friction: Friction | None = None
    """Friction between wave generator and flexspline; None for a map without it."""
    fields: DriveFields | None = None
    """Shape and stress of the flexspline for display; None if not computed."""
    info: Mapping[str, Any] = field(default_factory=dict)
    """Provenance and residuals; JSON values only."""

    def __post_init__(self) -> None:
        if self.layout not in LAYOUTS:
            raise ValueError(f"layout {self.layout!r}; accepted: {', '.join(LAYOUTS)}")
        knots = frozen_array(self.torsion_knots, "torsion knots [rad]", ndim=1)
        if knots.size < 2 or (np.diff(knots) <= 0).any():
            raise ValueError("torsion knots [rad] must be at least two and increasing")
        orders = np.array(self.orders, dtype=np.int64)
        if orders.ndim != 2 or orders.shape[1] != 2 or tuple(orders[0]) != (0, 0):
            raise ValueError("orders need shape (n, 2), the mean (0, 0) first")
        orders.setflags(write=False)
        n, m = len(orders), knots.size - 1
        object.__setattr__(self, "torsion_knots", knots)
        object.__setattr__(self, "orders", orders)
        for key, unit, shape in (
            ("potential", "J", (n, 2, m, 5)),
            ("end_stiffness", "N·m/rad", (n, 2, 2)),
            ("kinematic_error", "rad", (n, 2)),
        ):
            array = frozen_array(getattr(self, key), f"{key} [{unit}]", shape=shape)
            object.__setattr__(self, key, array)
        self._check_parts()

    def _check_parts(self) -> None:
        """Check hysteresis and friction."""
        elements = tuple(self.hysteresis)
        check_elements(elements, self.name)
        object.__setattr__(self, "hysteresis", elements)
        if vary_with_load(elements):
            largest = max_stiffness(self, enough=accepted_stiffness(elements))
            check_loads(elements, self.name, largest)
        if not isinstance(self.friction, Friction | None):
            raise InputError(
                f"friction of {self.name!r}: {self.friction!s:.40}; accepted: Friction"
                " or None"
            )

    # -- kinematics -----------------------------------------------------------

    @property
    def ratio(self) -> float:
        """Signed ratio i [-]; the ideal output angle is theta/i."""
        return ratio(self.layout, self.teeth_flexspline, self.teeth_circular_spline)

    @cached_property
    def angle_orders(self) -> NDArray[np.int64]:
        """Derivatives of each phase by theta and psi [-]. Shape (n_harmonics, 2)."""
        alpha, beta = angle_coefficients(self.layout)
        orders = np.asarray(self.orders @ np.array([alpha, beta], dtype=np.int64))
        orders.setflags(write=False)
        return orders

    @cached_property
    def wave_numbers(self) -> tuple[Array, Array, Index]:
        """Different orders of theta and of psi, and their indices (n_harmonics, 2)."""
        u, v = (np.unique(n, return_inverse=True) for n in self.angle_orders.T)
        return u[0].astype(float), v[0].astype(float), np.stack([u[1], v[1]], axis=-1)

    @property
    def friction_direction(self) -> tuple[int, int]:
        """Derivatives by theta and psi of beta, the rotation that friction opposes."""
        return angle_coefficients(self.layout)[1]

    def phases(self, theta: ArrayLike, psi: ArrayLike) -> Array:
        """Phases of the harmonics [rad], appended as the last axis.

        Args:
            theta: Input angle [rad].
            psi: Output angle [rad], of a shape that broadcasts with theta.
        """
        angles = np.stack(
            np.broadcast_arrays(np.asarray(theta, float), np.asarray(psi, float)), -1
        )
        return np.asarray(angles @ self.angle_orders.T.astype(float))

    def error_at(self, phases: Array) -> tuple[Array, Array, Array]:
        """Kinematic error e0 [rad] and its derivatives by theta and psi [-].

        ``phases`` are those of :meth:`phases` [rad]. Shape (..., n_harmonics).
        """
        return sums.error_sums(self, phases)[2]

    def torsion(self, theta: ArrayLike, psi: ArrayLike) -> Array:
        """Torsion theta/i + e0 - psi [rad].

        Args:
            theta: Input angle [rad].
            psi: Output angle [rad], of a shape that broadcasts with theta.
        """
        e0, _, _ = self.error_at(self.phases(theta, psi))
        ideal = np.asarray(theta, float) / self.ratio
        return np.asarray(ideal + e0 - np.asarray(psi, float))

    # -- potential ------------------------------------------------------------

    def coefficients(
        self, torsion: ArrayLike, derivative: int = 0, *, count: int | None = None
    ) -> Array:
        """A and B, or their first or second derivative, at the given torsion.

        Args:
            torsion: Torsion of any shape [rad].
            derivative: Order of the derivative by the torsion, 0 to 2.
            count: Number of harmonics to evaluate, 1 for the mean; None for all.

        Returns:
            A and B [J], their first [N·m] or second derivative [N·m/rad]. Shape (...,
            n_harmonics, 2) with the axes of ``torsion`` first.
        """
        x = np.asarray(torsion, float)
        knots = self.torsion_knots
        inside = np.clip(x, knots[0], knots[-1])
        j = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, knots.size - 2)
        d = (inside - knots[j])[..., None, None]
        c = np.moveaxis(self.potential[:count], 2, 0)[j]  # (..., n_harmonics, 2, 5)
        out = (x - inside)[..., None, None]
        beyond = bool(out.any())
        low, high = np.moveaxis(self.end_stiffness[:count], 2, 0)
        k_end = np.where(out < 0, low, high) if beyond else high
        if derivative == 2:
            v2 = 2 * c[..., 2] + d * (6 * c[..., 3] + d * 12 * c[..., 4])
            return np.asarray(np.where(out == 0, v2, k_end))
        if derivative == 1 or beyond:
            v1 = 2 * c[..., 2] + d * (3 * c[..., 3] + d * 4 * c[..., 4])
            v1 = c[..., 1] + d * v1
            if derivative == 1:
                return np.asarray(v1 + out * k_end if beyond else v1)
        v0 = c[..., 1] + d * (c[..., 2] + d * (c[..., 3] + d * c[..., 4]))
        v0 = c[..., 0] + d * v0
        return np.asarray(v0 + out * (v1 + 0.5 * out * k_end) if beyond else v0)

    def _sum(self, torsion: ArrayLike, phases: Array, derivative: int) -> Array:
        """A derivative of V by the torsion at given phases."""
        cos, sin, _ = sums.error_sums(self, phases)
        return sums.derivative_sum(self, torsion, cos, sin, derivative)

    def energy(self, torsion: ArrayLike, theta: ArrayLike, psi: ArrayLike) -> Array:
        """Potential V at given torsion and angles [J].

        Args:
            torsion: Torsion [rad].
            theta: Input angle [rad].
            psi: Output angle [rad], of a shape that broadcasts with theta.
        """
        return self._sum(torsion, self.phases(theta, psi), 0)

    def torque(self, torsion: ArrayLike, theta: ArrayLike, psi: ArrayLike) -> Array:
        """Torque dV/d(torsion) at fixed angles [N·m].

        Args:
            torsion: Torsion [rad].
            theta: Input angle [rad].
            psi: Output angle [rad], of a shape that broadcasts with theta.
        """
        return self._sum(torsion, self.phases(theta, psi), 1)

    def stiffness(self, torsion: ArrayLike, theta: ArrayLike, psi: ArrayLike) -> Array:
        """Second derivative of V by the torsion at fixed angles [N·m/rad].

        Args:
            torsion: Torsion [rad].
            theta: Input angle [rad].
            psi: Output angle [rad], of a shape that broadcasts with theta.
        """
        return self._sum(torsion, self.phases(theta, psi), 2)

    def forces(self, theta: ArrayLike, psi: ArrayLike) -> tuple[Array, Array]:
        """Generalised forces -dV/dtheta and -dV/dpsi of the drive [N·m].

        The second is the torque T that the drive exerts on the output. The negative of
        the first is the external torque that holds the input in slow motion.

        Args:
            theta: Input angle [rad].
            psi: Output angle [rad], of a shape that broadcasts with theta.
        """
        law = self.law(theta, psi)
        return law.input_force, law.output_force

    def law(self, theta: ArrayLike, psi: ArrayLike) -> Law:
        """Torsion, its derivatives and both generalised forces at given angles.

        Args:
            theta: Input angle [rad].
            psi: Output angle [rad], of a shape that broadcasts with theta.
        """
        found = sums.law_sums(self, theta, psi)
        g_theta, g_psi = 1.0 / self.ratio + found.error_by_theta, found.error_by_psi - 1
        torque, by_theta, by_psi = found.torque, found.by_theta, found.by_psi
        return Law(
            torsion=found.torsion,
            by_theta=g_theta,
            by_psi=g_psi,
            torque=torque,
            input_force=-torque * g_theta - by_theta,
            output_force=-torque * g_psi - by_psi,
        )

    # -- figures used by joints -----------------------------------------------

    @cached_property
    def mean_stiffness(self) -> float:
        """Secant stiffness of the mean curve from -rated to +rated torque [N·m/rad]."""
        low, high = (
            self.mean_torsion(sign * self.ratings.rated_torque) for sign in (-1, 1)
        )
        return 2.0 * self.ratings.rated_torque / (high - low)

    @cached_property
    def max_stiffness(self) -> float:
        """Largest stiffness over the torsion, bounded over all angles [N·m/rad].

        The bound is evaluated at nine torsions per knot interval (of many harmonics,
        three) and in the linear continuation beyond the knots.
        """
        return max_stiffness(self)

    @property
    def torque_range(self) -> tuple[float, float]:
        """Range of the sampled torques [N·m]; beyond it the map continues.

        It ends at the mean torque at the outermost knots. Those of a drive with tooth
        errors cover the torsion of its softest positions and lie further out; the range
        then ends at the largest sampled torques in :attr:`info`.
        """
        ends = self.coefficients(self.torsion_knots[[0, -1]], 1)[:, 0, 0]
        low, high = self.info.get("sampled_torque_Nm", (-np.inf, np.inf))
        return max(float(ends[0]), float(low)), min(float(ends[1]), float(high))

    def mean_torsion(self, torque: float) -> float:
        """Torsion of the mean curve [rad] at an output torque [N·m].

        Raises:
            ValueError: If the mean curve does not reach the torque.

        >>> from swgjoint import DriveMap
        >>> DriveMap.linear(1e4, rated_torque=50.0).mean_torsion(20.0)
        0.002
        """
        from scipy.optimize import brentq

        # for the single points of a root search, plain floats are five times faster
        knots, pieces = self.torsion_knots.tolist(), self.potential[0, 0].tolist()
        before, after = self.end_stiffness[0, 0].tolist()

        def residual(x: float) -> float:
            inside = min(max(x, knots[0]), knots[-1])
            j = min(bisect_right(knots, inside), len(pieces)) - 1
            d, out = inside - knots[j], x - inside
            _, c1, c2, c3, c4 = pieces[j]
            mean = c1 + d * (2 * c2 + d * (3 * c3 + d * 4 * c4))
            return float(mean + out * (before if out < 0.0 else after) - torque)

        span = knots[-1] - knots[0]
        low, high = knots[0], knots[-1]
        for _ in range(60):
            if residual(low) <= 0.0 <= residual(high):
                return float(brentq(residual, low, high, xtol=1e-18, rtol=1e-14))
            low, high, span = low - span, high + span, 2.0 * span
        raise ValueError(f"this map does not reach a torque of {torque} N·m")

    def with_harmonics(self, keep: ArrayLike) -> Self:
        """A copy with the mean and the harmonics where the mask ``keep`` is true."""
        mask = np.array(keep, dtype=bool)
        mask[0] = True
        return replace(
            self,
            orders=self.orders[mask],
            potential=self.potential[mask],
            end_stiffness=self.end_stiffness[mask],
            kinematic_error=self.kinematic_error[mask],
        )

    def with_parts(self, **parts: Any) -> Self:
        """A copy with the same potential, whose bounds are not computed again.

        Args:
            parts: New values of the fields name, hysteresis, friction and info.

        Raises:
            InputError: If hysteresis or friction is not valid.
        """
        assert parts.keys() <= {"name", "hysteresis", "friction", "info"}
        changed = copy.copy(self)
        for key, value in parts.items():
            object.__setattr__(changed, key, value)
        changed._check_parts()
        return changed
