"""Equilibria of many specimens of one drive, computed in arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array

TOLERANCE = 1e-9
"""Torque that may remain unbalanced, relative to rated torque [-]."""
MAX_STEPS = 50
"""Largest number of Newton steps."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveRest:
    """Specimens of a drive at rest at given motor angles. Shapes (m,)."""

    link_angle: Array
    """Angles of the links [rad]."""
    input_torque: Array
    """Torques of the drives on their inputs [N·m]."""
    output_torque: Array
    """Torques of the drives on their outputs [N·m]."""
    torsion: Array
    """Torsions of the drives [rad]."""


def balance_specimens(
    drive: DriveMap, variations: Array, motor_angle: Array, torque: Array
) -> DriveRest:
    """Equilibria of specimens at given motor angles and output torques.

    The specimens are those of :meth:`swgjoint.joint.variation.Variation.apply_to`,
    without a map for each of them. Newton's method ends for each specimen on its own,
    so that a result does not depend on the other specimens.

    Args:
        drive: Map of the nominal drive.
        variations: ``numbers`` of the :class:`~swgjoint.joint.variation.Variation` of
            each specimen. Shape (m, 5).
        motor_angle: Angles of the motors [rad]. Shape (m,) or ().
        torque: Torques of the drives on their outputs [N·m]. Shape (m,) or ().
    """
    specimens = _Specimens(drive, variations, motor_angle)
    psi = np.full(len(variations), np.asarray(motor_angle) / drive.ratio)
    for _ in range(MAX_STEPS):
        on_input, on_output = specimens.forces(psi)
        missing = torque - on_output
        unbalanced = ~(np.abs(missing) < TOLERANCE * drive.ratings.rated_torque)
        if not unbalanced.any():
            break
        psi = np.where(unbalanced, psi - missing / specimens.stiffness(psi), psi)
    return DriveRest(
        link_angle=psi,
        input_torque=on_input,
        output_torque=on_output,
        torsion=specimens.torsion(psi),
    )


class _Specimens:
    """Forces of specimens, each at its own output angle psi. Shapes (m,).

    Operations have the order of :class:`swgjoint.maps.potential.Potential`, so that
    results are bit-identical to those of the specimens' maps.
    """

    def __init__(self, drive: DriveMap, variations: Array, theta: Array) -> None:
        self._drive, self._theta = drive, theta
        self._size = 1.0 + variations[:, 0, None]
        self._orders = drive.angle_orders.astype(float)
        shift = np.matmul(self._orders, variations[:, 2:4, None])[..., 0]
        self._cos, self._sin = np.cos(shift), np.sin(shift)
        a, b = drive.kinematic_error.T
        share = 1.0 + variations[:, 1, None]
        self._a = share * (a * self._cos + b * self._sin)
        self._b = share * (b * self._cos - a * self._sin)

    def torsion(self, psi: Array) -> Array:
        """Torsions [rad]."""
        cos, sin = self._circle(psi)
        e0 = np.sum(self._a * cos + self._b * sin, axis=-1)
        return np.asarray(self._theta / self._drive.ratio + e0 - psi)

    def forces(self, psi: Array) -> tuple[Array, Array]:
        """Generalised forces on input and output [N·m]."""
        cos, sin = self._circle(psi)
        ratio, (n_theta, n_psi) = self._drive.ratio, self._orders.T
        x = self._theta / ratio - psi
        x = x + np.sum(self._a * cos + self._b * sin, axis=-1)
        slope = self._b * cos - self._a * sin
        g_theta = 1.0 / ratio + np.sum(slope * n_theta, axis=-1)
        g_psi = -1.0 + np.sum(slope * n_psi, axis=-1)
        a, b = self._coefficients(x, 1)
        torque = np.sum(a * cos + b * sin, axis=-1)
        a, b = self._coefficients(x, 0)
        by_phase = b * cos - a * sin
        return (
            -torque * g_theta - np.sum(by_phase * n_theta, axis=-1),
            -torque * g_psi - np.sum(by_phase * n_psi, axis=-1),
        )

    def stiffness(self, psi: Array) -> Array:
        """Torsional stiffnesses [N·m/rad]."""
        cos, sin = self._circle(psi)
        a, b = self._coefficients(self.torsion(psi), 2)
        return np.asarray(np.sum(a * cos + b * sin, axis=-1))

    def _circle(self, psi: Array) -> tuple[Array, Array]:
        """Cosine and sine of the phases. Shapes (m, n_harmonics)."""
        angles = np.stack([np.full_like(psi, self._theta), psi], -1)[:, None]
        phases = np.matmul(angles, self._orders.T)[:, 0]
        return np.cos(phases), np.sin(phases)

    def _coefficients(self, torsion: Array, derivative: int) -> tuple[Array, Array]:
        """A and B or a derivative, with size and phases. Shapes (m, n_harmonics)."""
        drive = self._drive
        knots = drive.torsion_knots
        inside = np.clip(torsion, knots[0], knots[-1])
        j = np.searchsorted(knots, inside, side="right") - 1
        j = np.clip(j, 0, knots.size - 2)
        d, out = (inside - knots[j])[:, None], (torsion - inside)[:, None]
        pieces = self._shift(np.moveaxis(drive.potential, 2, 0)[j])
        ends = self._shift(drive.end_stiffness[None])
        values = []
        for c, end in zip(pieces, ends, strict=True):
            k_end = np.where(out < 0, end[..., 0], end[..., 1])
            v2 = 2 * c[..., 2] + d * (6 * c[..., 3] + d * 12 * c[..., 4])
            v1 = 2 * c[..., 2] + d * (3 * c[..., 3] + d * 4 * c[..., 4])
            v1 = c[..., 1] + d * v1
            v0 = c[..., 1] + d * (c[..., 2] + d * (c[..., 3] + d * c[..., 4]))
            v0 = c[..., 0] + d * v0
            values.append(
                (
                    v0 + out * (v1 + 0.5 * out * k_end),
                    v1 + out * k_end,
                    np.where(out == 0, v2, k_end),
                )[derivative]
            )
        return values[0], values[1]

    def _shift(self, pairs: Array) -> tuple[Array, Array]:
        """Coefficients of A and B (axis 2) with size and phases of the specimens."""
        a, b = pairs[:, :, 0], pairs[:, :, 1]
        size, cos, sin = (x[..., None] for x in (self._size, self._cos, self._sin))
        return size * (a * cos + b * sin), size * (b * cos - a * sin)
