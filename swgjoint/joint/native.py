r"""Level ``native``: what MuJoCo's own elements can hold of a drive, no plugin.

The mean curve becomes one tendon with a polynomial stiffness or, where that is not
close enough, up to :data:`MAX_CORNERS` parallel tendons with dead bands. With
x = theta/i - psi,

.. math:: T(x) = a x + c x^3 \quad\text{or}\quad
    T(x) = a x + \sum_j k_j \operatorname{sign}(x) \max(|x| - d_j, 0),

so the three lines of a catalogue are three tendons: K1 everywhere, K2 - K1 beyond the
torsion at T1, K3 - K2 beyond that at T2. Hysteresis becomes parallel tendons with
``springyield`` (Jenkin elements), friction ``frictionloss`` and ``damping`` of the
rotor: Coulomb, bending and viscous part, against the housing. That is an approximation:
friction that grows with the load or falls with the speed has no constant, and the
engine's friction loss is a soft constraint, which creeps.

The last two exist only where the map has them. Kinematic error and the angle harmonics
of the torque have no native form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.typing import Array

MAX_CORNERS = 4
"""Most tendons with a dead band: each costs the engine a few percent of a step."""
CLOSE = 0.01
"""Largest error of the torque, as part of the rated torque, at which no further tendon
is added."""
LEAST = 1e-3
"""Smallest slope over the mean stiffness: a clearance keeps that much."""


@dataclass(frozen=True, kw_only=True)
class Corner:
    """Stiffness that begins at a torsion, either way: a tendon with a dead band."""

    torsion: float
    """Half width of the dead band [rad], > 0."""
    stiffness: float
    """Change of the slope there [N·m/rad]; < 0 where the curve softens."""


@dataclass(frozen=True, kw_only=True)
class NativeSpring:
    """Elastic and dissipative parts of a drive in native elements."""

    linear: float
    """a [N·m/rad], > 0."""
    cubic: float = 0.0
    """c [N·m/rad³], >= 0: a softening cubic would end in a negative stiffness."""
    corners: tuple[Corner, ...] = ()
    """By increasing torsion; the slope stays > 0 beyond every one."""
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
        x = np.asarray(torsion, float)
        total = x * (self.linear + self.cubic * x**2)
        for corner in self.corners:
            beyond = x - np.clip(x, -corner.torsion, corner.torsion)
            total = total + corner.stiffness * beyond
        return np.asarray(total)

    def torsion(self, torque: float) -> float:
        """Torsion at an elastic torque [rad]; the torque grows with the torsion."""
        high = abs(torque) / self.linear
        while float(self.torque(np.array(high))) < abs(torque):
            high *= 2.0
        low = 0.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            if float(self.torque(np.array(middle))) < abs(torque):
                low = middle
            else:
                high = middle
        return float(np.copysign(high, torque))

    def slope(self, torsion: float) -> float:
        """Tangent stiffness, without hysteresis [N·m/rad]."""
        x = abs(torsion)
        beyond = sum(c.stiffness for c in self.corners if x > c.torsion)
        return self.linear + 3.0 * self.cubic * x**2 + beyond

    def implicit(self, torsion: float) -> float:
        """What the integrator takes implicitly: the tangents that are > 0 [N·m/rad]."""
        x = abs(torsion)
        beyond = sum(max(c.stiffness, 0.0) for c in self.corners if x > c.torsion)
        return self.linear + 3.0 * self.cubic * x**2 + beyond

    def largest_slope(self, torsion: float) -> float:
        """Largest tangent stiffness up to a torsion [N·m/rad]."""
        ends = [c.torsion * (1.0 + 1e-9) for c in self.corners if c.torsion < torsion]
        return max(self.slope(x) for x in (0.0, *ends, torsion))


def fit_native(drive: DriveMap) -> NativeSpring:
    """The fewest native springs that follow the mean curve of a map.

    Up to the repeated peak torque, at least 1.5 T2, as far as the map reaches. In this
    order, until the torque is off by :data:`CLOSE` of the rated torque at most: a x +
    c x³; dead bands at the torsions of T1 and T2; one to :data:`MAX_CORNERS` dead
    bands, denser where the curve bends more. Else the closest of them.

    Slopes are the least squares for which every slope is at least :data:`LEAST` of the
    mean stiffness; ``note`` says where that or the number of tendons limits the fit.
    """
    x, torque, peak = _mean_curve(drive)
    close = CLOSE * drive.ratings.rated_torque
    best: NativeSpring | None = None
    least = np.inf
    for spring in _candidates(drive, x, torque):
        off = float(np.abs(spring.torque(x) - torque).max())
        if off < least:
            best, least = spring, off
        if off <= close:
            break
    assert best is not None
    notes = []
    floor = LEAST * drive.mean_stiffness
    if best.linear <= 1.001 * floor:
        notes.append("the mean curve has no stiffness about zero")
    if least > 5.0 * close:
        share = 100.0 * least / drive.ratings.rated_torque
        notes.append(f"off the mean curve by up to {share:.2g} % of the rated torque")
    law = drive.friction
    changes = law is not None and (law.load > 0.0 or law.static > law.coulomb)
    return replace(
        best,
        residual=float(np.sqrt(np.mean((best.torque(x) - torque) ** 2))),
        fitted_to=peak,
        note="; ".join(notes),
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
    end = max(end, *(2.0 * c.torsion for c in spring.corners), 0.0)
    inner = [c.torsion for c in spring.corners]
    knots = np.array([-end, *(-d for d in inner[::-1]), *inner, end])
    potential = np.zeros((1, 2, knots.size - 1, 5))
    for j, (left, right) in enumerate(pairwise(knots)):
        law = np.polynomial.Polynomial([0.0, spring.linear, 0.0, spring.cubic])
        middle = 0.5 * (left + right)
        for c in spring.corners:
            if abs(middle) > c.torsion:
                start = np.copysign(c.torsion, middle)
                law = law + c.stiffness * np.polynomial.Polynomial([-start, 1.0])
        shifted = law(np.polynomial.Polynomial([left, 1.0])).integ().coef
        potential[0, 0, j, : shifted.size] = shifted
        # the energy at the knot, zero without torsion
        potential[0, 0, j, 0] = _energy(spring, left)
    stiffness = spring.slope(end)
    friction = drive.friction
    if friction is not None:
        slip = spring.friction
        friction = replace(friction, coulomb=slip, static=slip, load=0.0, bending=0.0)
    return replace(
        drive,
        friction=friction,
        torsion_knots=knots,
        orders=np.zeros((1, 2), dtype=np.int64),
        potential=potential,
        end_stiffness=np.array([[[stiffness, stiffness], [0.0, 0.0]]]),
        kinematic_error=np.zeros((1, 2)),
    )


def _energy(spring: NativeSpring, torsion: float) -> float:
    x = abs(torsion)
    corners = sum(
        0.5 * c.stiffness * max(x - c.torsion, 0.0) ** 2 for c in spring.corners
    )
    return 0.5 * spring.linear * x**2 + 0.25 * spring.cubic * x**4 + corners


def _mean_curve(drive: DriveMap) -> tuple[Array, Array, float]:
    """Torsion > 0, mean torque of both directions there, and the largest torque."""
    low, high = drive.torque_range
    r = drive.ratings
    peak = min(max(r.repeated_peak, 1.5 * r.T2), -low, high)
    if not peak > 0.0:
        peak = r.rated_torque
    end = max(drive.mean_torsion(peak), -drive.mean_torsion(-peak))
    x = np.linspace(0.0, end, 401)[1:]
    both = [drive.coefficients(sign * x, 1)[:, 0, 0] for sign in (1.0, -1.0)]
    return x, np.asarray(0.5 * (both[0] - both[1])), float(peak)


def _candidates(drive: DriveMap, x: Array, torque: Array) -> list[NativeSpring]:
    """Springs with more and more tendons."""
    r = drive.ratings
    corners = [drive.mean_torsion(t) for t in (r.T1, r.T2)]
    ways = [np.array([d for d in corners if 0.0 < d < 0.99 * x[-1]])]
    ways += [_denser_at_bends(x, torque, n) for n in range(1, MAX_CORNERS + 1)]
    ways = sorted((w for w in ways if w.size), key=lambda w: w.size)
    least = LEAST * drive.mean_stiffness
    return [_cubic(x, torque, least), *(_lines(x, torque, w, least) for w in ways)]


def _cubic(x: Array, torque: Array, least: float) -> NativeSpring:
    """Least squares of a x + c x³ with a >= least and c >= 0."""
    from scipy.optimize import nnls

    unit = float(x[-1])  # keeps the two columns of one size
    u = x / unit
    floor = least * unit
    (a, c), _ = nnls(np.column_stack([u, u**3]), torque - floor * u)
    # below round-off of the fit a linear curve stays linear
    if c < 1e-9 * a:
        c = 0.0
        a = float(u @ torque) / float(u @ u) - floor
    return NativeSpring(
        linear=float(max(a, 0.0) + floor) / unit,
        cubic=float(c) / unit**3,
        residual=0.0,
        fitted_to=0.0,
    )


def _lines(x: Array, torque: Array, corners: Array, least: float) -> NativeSpring:
    """Least squares of straight lines that meet at the corners, slopes >= least."""
    from scipy.optimize import nnls

    ends = np.array([0.0, *corners, x[-1]])
    # the way that x goes on every line
    ways = np.clip(x[:, None] - ends[:-1], 0.0, np.diff(ends))
    unit = float(x[-1])
    over, _ = nnls(ways / unit, torque - least * x)
    slopes = least + over / unit
    return NativeSpring(
        linear=float(slopes[0]),
        corners=tuple(
            Corner(torsion=float(d), stiffness=float(k))
            for d, k in zip(corners, np.diff(slopes), strict=True)
            if k
        ),
        residual=0.0,
        fitted_to=0.0,
    )


def _denser_at_bends(x: Array, torque: Array, count: int) -> Array:
    """Corners of broken lines: equal parts of the square root of the bend.

    Source:
        de Boor (2001), "A Practical Guide to Splines", chapter XII: equal parts of
        |f''|^(1/2) for the broken line.
    """
    slope = np.gradient(np.concatenate([[0.0], torque]), np.concatenate([[0.0], x]))
    bend = np.sqrt(np.abs(np.gradient(slope, x[0])))
    bend = bend + 1e-3 * bend.mean() + 1e-300
    part = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]))])
    wanted = (np.arange(count) + 0.5) / count * part[-1]
    inner = np.interp(wanted, part, np.concatenate([[0.0], x]))
    return np.asarray(inner[(inner > 1e-3 * x[-1]) & (inner < 0.99 * x[-1])])
