r"""A map near its ideal motion: cheap torques for many positions and harmonics.

The output stays within a milliradian of theta/i, and over this distance the phases of
the harmonics change very little. To second order in the distance s, at each theta,

.. math:: V = V_0(\Delta) + s V_1(\Delta), \quad e_0 = a + s b, \quad
    \Delta = e_0 - s, \quad T = -\frac{dV}{ds} .

The sums over the harmonics are matrix products, computed once per position instead of
once per iteration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.potential import Potential
from swgjoint.typing import Array

_NEWTON = 12
_BEND = 1e-3
"""Largest second-order term, (q s)^2/2, that may be neglected."""


@dataclass(frozen=True, kw_only=True, eq=False)
class IdealMotion:
    """Polynomials of the torsion at n given input angles."""

    drive: Potential
    theta: Array
    """Input angles [rad]. Shape (n,)."""
    error: Array
    """e0 at psi = theta/i [rad] and its derivative by psi [-]. Shape (2, n)."""
    potential: Array
    """Coefficients of V_0 and V_1, as in a map. Shape (2, n, n_knots - 1, 5)."""
    ends: Array
    """V_0'' and V_1'' below and above the knots. Shape (2, n, 2)."""

    @classmethod
    def from_map(cls, drive: Potential, theta: Array) -> IdealMotion:
        """Sum the harmonics at psi = theta/i.

        Args:
            drive: The map.
            theta: Input angles [rad]. Shape (n,).
        """
        phases = drive.phases(theta, theta / drive.ratio)
        cos, sin = np.cos(phases), np.sin(phases)
        n_psi = drive.angle_orders[:, 1]
        # factors of the cosine and sine amplitudes: in the value, in its psi derivative
        value = np.stack([cos, sin], axis=-1).reshape(theta.size, -1)
        slope = np.stack([-n_psi * sin, n_psi * cos], axis=-1).reshape(theta.size, -1)
        both = np.stack([value, slope])
        shape = drive.potential.shape[2:]
        table = drive.potential.reshape(value.shape[1], -1)
        return cls(
            drive=drive,
            theta=theta,
            error=both @ drive.kinematic_error.ravel(),
            potential=(both @ table).reshape(2, theta.size, *shape),
            ends=both @ drive.end_stiffness.reshape(value.shape[1], -1),
        )

    def torque(self, shift: Array) -> tuple[Array, Array]:
        """T on the output at psi = theta/i + shift, and -dT/dpsi [N·m, N·m/rad].

        ``shift`` has the shape (n,) [rad].
        """
        knots = self.drive.torsion_knots
        a, b = self.error
        x = a + (b - 1.0) * shift
        inside = np.clip(x, knots[0], knots[-1])
        j = np.clip(np.searchsorted(knots, inside, "right") - 1, 0, knots.size - 2)
        c = np.moveaxis(self.potential[:, np.arange(x.size), j], -1, 0)  # (5, 2, n)
        d, out = inside - knots[j], x - inside
        v = c[0] + d * (c[1] + d * (c[2] + d * (c[3] + d * c[4])))
        v1 = c[1] + d * (2 * c[2] + d * (3 * c[3] + d * 4 * c[4]))
        v2 = 2 * c[2] + d * (6 * c[3] + d * 12 * c[4])
        end = np.where(out < 0.0, self.ends[..., 0], self.ends[..., 1])
        v, v1 = v + out * (v1 + 0.5 * out * end), v1 + out * end
        v2 = np.where(out == 0.0, v2, end)
        torque = (1.0 - b) * (v1[0] + shift * v1[1]) - v[1]
        stiffness = (1.0 - b) ** 2 * (v2[0] + shift * v2[1]) - 2.0 * (1.0 - b) * v1[1]
        return torque, stiffness

    def output_angle(self, torque: float) -> Array:
        """Psi at which the drive exerts a torque on the output [rad].

        Positions where Newton's method does not converge, and those far from the ideal
        motion, are solved on the map itself.
        """
        drive = self.drive
        shift = self.error[0] - (drive.mean_torsion(torque) if torque else 0.0)
        settled = 1e-12 * float(np.ptp(drive.torsion_knots))
        step = np.full(shift.shape, np.inf)
        for _ in range(_NEWTON):
            exerted, stiffness = self.torque(shift)
            missing = exerted - torque
            soft = np.where(stiffness > 0.0, stiffness, np.nan)
            step = np.where(missing == 0.0, 0.0, missing / soft)
            if not (np.abs(step) > settled).any():
                break
            shift = shift + step
        psi = self.theta / drive.ratio + shift
        order = np.abs(drive.angle_orders[:, 1]).max()
        again = ~(np.abs(step) <= settled) | ((order * shift) ** 2 > 2.0 * _BEND)
        if again.any():
            psi[again] = output_angle(drive, self.theta[again], torque)
        return np.asarray(psi)
