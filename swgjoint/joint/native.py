r"""Level ``native``: what MuJoCo's own elements can hold of a drive, no plugin.

The mean curve becomes the polynomial stiffness of a tendon,
:math:`T(x) = a x + c x^3` with x = theta/i - psi; hysteresis becomes parallel tendons
with ``springyield`` (Jenkin elements), friction ``frictionloss`` and ``damping`` of the
rotor: Coulomb, bending and viscous part, against the housing. That is an approximation:
friction that grows with the load or falls with the speed has no constant, and the
engine's friction loss is a soft constraint, which creeps.

The last two exist only where the map has them. Kinematic error and the angle harmonics
of the torque have no native form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class NativeSpring:
    """Elastic and dissipative parts of a drive in native elements."""

    linear: float
    """a [N·m/rad], > 0."""
    cubic: float
    """c [N·m/rad³], >= 0: a softening spring has no stable native form."""
    residual: float
    """Root mean square of what the fit leaves of the mean curve [N·m]."""
    fitted_to: float
    """Torque up to which the fit was made [N·m]."""
    note: str = ""
    """What the fit could not follow."""
    hysteresis: tuple[Jenkin, ...] = ()
    friction: float = 0.0
    """Constant friction torque at the input [N·m]."""
    viscous: float = 0.0
    """Friction per speed of the input [N·m·s/rad]."""
    friction_note: str = ""
    """What of the friction has no constant."""

    def torque(self, torsion: Array) -> Array:
        """Elastic torque, without hysteresis [N·m]."""
        return np.asarray(torsion * (self.linear + self.cubic * torsion**2))


def fit_native(drive: DriveMap) -> NativeSpring:
    """Least squares of a x + c x³ to the mean curve up to the repeated peak torque.

    Where the curve softens (c < 0) the spring is linear with the map's mean
    stiffness; where it has no stiffness about zero (a <= 0: clearance) a thousandth
    of the mean stiffness stays. ``note`` says so.
    """
    low, high = drive.torque_range
    peak = min(drive.ratings.repeated_peak, -low, high)
    if not peak > 0.0:
        peak = drive.ratings.rated_torque
    x = np.linspace(drive.mean_torsion(-peak), drive.mean_torsion(peak), 401)
    torque = drive.coefficients(x, 1)[:, 0, 0]
    unit = float(np.abs(x).max())  # keeps the two columns of one size
    u = x / unit
    (a, c), *_ = np.linalg.lstsq(np.column_stack([u, u**3]), torque, rcond=None)
    a, c, note = a / unit, c / unit**3, ""
    # below round-off of the fit a linear curve stays linear
    if abs(c) * unit**2 < 1e-9 * abs(a):
        c = 0.0
    if c < 0.0:
        a, c = drive.mean_stiffness, 0.0
        note = "the mean curve softens: linear with its mean stiffness"
    elif a <= 0.0:
        a = 1e-3 * drive.mean_stiffness
        c = max(float(u**3 @ (torque - a * x)) / float(u**3 @ u**3) / unit**3, 0.0)
        note = "the mean curve has no stiffness about zero: cubic"
    rest = torque - x * (a + c * x**2)
    law = drive.friction
    changes = law is not None and (law.load > 0.0 or law.static > law.coulomb)
    return NativeSpring(
        linear=float(a),
        cubic=float(c),
        residual=float(np.sqrt(np.mean(rest**2))),
        fitted_to=float(peak),
        note=note,
        hysteresis=drive.hysteresis,
        friction=law.coulomb + law.bending if law else 0.0,
        viscous=law.viscous if law else 0.0,
        friction_note="its change with load and speed" if changes else "",
    )


def native_map(drive: DriveMap, spring: NativeSpring) -> DriveMap:
    """The law between motor and link of this level as a map.

    The elastic part, hysteresis, and where the map has friction that of the elements:
    constant and viscous. It acts against the housing, here as everywhere in maps
    against the flexspline, which differs by the ratio.
    """
    end = 4.0 * max(
        abs(drive.mean_torsion(sign * drive.ratings.momentary_peak)) for sign in (-1, 1)
    )
    energy = np.polynomial.Polynomial([0, 0, 0.5 * spring.linear, 0, spring.cubic / 4])
    potential = np.zeros((1, 2, 1, 5))
    shifted = energy(np.polynomial.Polynomial([-end, 1.0])).coef
    potential[0, 0, 0, : shifted.size] = shifted
    stiffness = spring.linear + 3.0 * spring.cubic * end**2
    friction = drive.friction
    if friction is not None:
        slip = spring.friction
        friction = replace(friction, coulomb=slip, static=slip, load=0.0, bending=0.0)
    return replace(
        drive,
        friction=friction,
        torsion_knots=np.array([-end, end]),
        orders=np.zeros((1, 2), dtype=np.int64),
        potential=potential,
        end_stiffness=np.array([[[stiffness, stiffness], [0.0, 0.0]]]),
        kinematic_error=np.zeros((1, 2)),
    )
