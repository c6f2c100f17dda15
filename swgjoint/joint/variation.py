r"""Deviations of one specimen of a drive from its map, without recompiling the model.

In every step the engine plugin reads the deviations of a drive from the user data of
its tendon. These are five numbers, all zero for the map itself. They can be written
into the ``tendon_user`` of a compiled model or, separately for each simulation, of a
``mujoco.batch.Batch``::

    got = attach(spec, joint="elbow", drive=drive, rotor_inertia=4e-5, variable=True)
    user = batch.expand("tendon_user")                      # (nsim, ntendon, 5 or more)
    user[:, model.tendon(got.tendon).id, :5] = one_row_per_simulation
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array

SIZE = 5
"""Number of values that the plugin reads."""
_TORQUES = (
    *("stiffness", "damping", "coulomb", "static"),
    *("viscous", "load", "bending"),
)
_SHARES = ("stiffness", "kinematic_error", "losses")


@dataclass(frozen=True, kw_only=True)
class Variation:
    r"""Deviations from a map; those without a unit are fractions of the map's value.

    .. math::
        V' = (1 + s)\,V(\Delta, \theta + a, \psi + b), \quad
        \Delta = \theta/i + (1 + r)\,e_0(\theta + a, \psi + b) - \psi
    """

    stiffness: float = 0.0
    """Relative change s of the potential, i.e. of stiffness and torque ripple [-]."""
    kinematic_error: float = 0.0
    """Relative change r of the amplitude of e0 [-]."""
    theta: float = 0.0
    """Phase offset a of the wave generator at the same motor angle [rad]."""
    psi: float = 0.0
    """Phase offset b of the output at the same link angle [rad]."""
    losses: float = 0.0
    """Relative change of all torques of hysteresis and friction [-]; their yield
    torsions are unchanged."""

    def __post_init__(self) -> None:
        for key, value in zip(self.__dataclass_fields__, self.numbers, strict=True):
            low = -1.0 if key in _SHARES else -np.inf
            if not (isfinite(value) and value > low):
                accepted = "a finite number > -1" if key in _SHARES else "finite"
                raise InputError(f"variation {key} {value}; accepted: {accepted}")

    @property
    def numbers(self) -> Array:
        """Deviations in the order in which the plugin reads them. Shape (5,)."""
        return np.array(
            [self.stiffness, self.kinematic_error, self.theta, self.psi, self.losses],
            float,
        )

    def apply_to(self, drive: DriveMap) -> DriveMap:
        """Map of the specimen, equal to what the plugin evaluates."""
        shift = drive.angle_orders @ np.array([self.theta, self.psi])
        size, losses = 1.0 + self.stiffness, 1.0 + self.losses

        def shifted(pair: Array) -> Array:
            """Amplitudes of cos and sin (axis 1) with every phase shifted forward."""
            a, b = np.moveaxis(pair, 1, 0)
            one = (len(shift), *[1] * (a.ndim - 1))
            c, s = np.cos(shift).reshape(one), np.sin(shift).reshape(one)
            return np.stack([a * c + b * s, b * c - a * s], 1)

        return replace(
            drive,
            potential=size * shifted(drive.potential),
            end_stiffness=size * shifted(drive.end_stiffness),
            kinematic_error=(1.0 + self.kinematic_error)
            * shifted(drive.kinematic_error),
            hysteresis=tuple(
                element.with_torques_scaled(losses) for element in drive.hysteresis
            ),
            friction=drive.friction
            and replace(
                drive.friction,
                **{key: losses * getattr(drive.friction, key) for key in _TORQUES},
            ),
        )
