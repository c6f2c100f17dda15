r"""Level ``native``: a drive represented by MuJoCo's own elements, without the plugin.

The mean torsion curve becomes one tendon with polynomial stiffness. If that is not
accurate enough, it becomes a linear tendon and up to :data:`MAX_CORNERS` parallel
tendons with dead bands. With x = theta/i - psi,

.. math:: T(x) = a x + c x^3 \quad\text{or}\quad
    T(x) = a x + \sum_j k_j \operatorname{sign}(x) \max(|x| - d_j, 0),

so the three lines of a catalogue become three tendons: K1 everywhere, K2 - K1 beyond
the torsion at T1, K3 - K2 beyond the torsion at T2. Hysteresis becomes parallel tendons
with ``springyield`` (Jenkin elements). Friction becomes ``frictionloss`` and
``damping`` of the rotor (Coulomb, bending and viscous parts), which act against the
housing. This is an approximation: constants cannot represent friction that increases
with load or decreases with speed, and the engine's friction loss is a soft constraint,
so that a loaded rotor creeps instead of sticking.

Hysteresis and friction are added only if the map has them. Kinematic error and the
angle harmonics of the torque have no native equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.typing import Array

MAX_CORNERS = 4
"""Largest number of tendons with a dead band; each adds a few percent to the time of a
step."""
CLOSE = 0.01
"""Torque error relative to rated torque below which no further tendon is added [-]."""
LEAST = 1e-3
"""Smallest slope relative to the mean stiffness, even where the curve is flat [-]."""


@dataclass(frozen=True, kw_only=True)
class Corner:
    """A dead-band tendon: stiffness that acts only beyond a torsion of either sign."""

    torsion: float
    """Half width d of the dead band, > 0 [rad]."""
    stiffness: float
    """Change of the slope at that torsion, negative if the curve softens [N·m/rad]."""


@dataclass(frozen=True, kw_only=True)
class NativeSpring:
    """Elastic and dissipative parts of a drive in native elements."""

    linear: float
    """Linear coefficient a, > 0 [N·m/rad]."""
    cubic: float = 0.0
    """Cubic coefficient c [N·m/rad³]; never negative, because a softening cubic would
    reach negative stiffness."""
    corners: tuple[Corner, ...] = ()
    """Dead-band springs by increasing torsion; the slope beyond each is positive."""
    residual: float
    """Root mean square deviation of the fit from the mean curve [N·m]."""
    fitted_to: float
    """Torque up to which the fit was made [N·m]."""
    note: str = ""
    """Features of the mean curve that the fit does not reproduce."""
    hysteresis: tuple[Jenkin, ...] = ()
    """Jenkin elements of the map."""
    friction: float = 0.0
    """Constant friction torque at the input [N·m]."""
    viscous: float = 0.0
    """Viscous friction coefficient at the input [N·m·s/rad]."""
    friction_note: str = ""
    """Parts of the friction law that constants cannot represent."""

    def torque(self, torsion: Array) -> Array:
        """Elastic torque [N·m] at torsions of any shape [rad], without hysteresis."""
        x = np.asarray(torsion, float)
        total = x * (self.linear + self.cubic * x**2)
        for corner in self.corners:
            beyond = x - np.clip(x, -corner.torsion, corner.torsion)
            total = total + corner.stiffness * beyond
        return np.asarray(total)

    def torsion(self, torque: float) -> float:
        """Torsion [rad] at an elastic torque [N·m], by bisection."""
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
        """Tangent stiffness without hysteresis [N·m/rad] at a torsion [rad]."""
        x = abs(torsion)
        beyond = sum(c.stiffness for c in self.corners if x > c.torsion)
        return self.linear + 3.0 * self.cubic * x**2 + beyond

    def implicit(self, torsion: float) -> float:
        """Positive parts of the slope, which are integrated implicitly [N·m/rad]."""
        x = abs(torsion)
        beyond = sum(max(c.stiffness, 0.0) for c in self.corners if x > c.torsion)
        return self.linear + 3.0 * self.cubic * x**2 + beyond

    def largest_slope(self, torsion: float) -> float:
        """Largest tangent stiffness from zero to a positive torsion [N·m/rad]."""
        ends = [c.torsion * (1.0 + 1e-9) for c in self.corners if c.torsion < torsion]
        return max(self.slope(x) for x in (0.0, *ends, torsion))


def fit_native(drive: DriveMap) -> NativeSpring:
    """Fit the fewest native springs that follow the mean curve of a map.

    The fit extends to the repeated peak torque or 1.5 T2, whichever is larger, within
    the range of the map. The candidates are a x + c x³, dead bands at the torsions of
    T1 and T2, and one to :data:`MAX_CORNERS` dead bands that are denser where the curve
    bends more. The candidates are tried in this order, those with dead bands by
    increasing number of tendons. The first candidate whose torque error is at most
    :data:`CLOSE` of rated torque is used; if there is none, the closest is used.

    The slopes are a least-squares fit in which every slope is at least :data:`LEAST` of
    the mean stiffness. ``note`` reports where this bound or the number of tendons
    limits the fit.
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
        notes.append("the mean curve has no stiffness near zero torsion")
    if least > 5.0 * close:
        share = 100.0 * least / drive.ratings.rated_torque
        notes.append(
            f"deviates from the mean curve by up to {share:.2g} % of rated torque"
        )
    law = drive.friction
    changes = law is not None and (law.load > 0.0 or law.static > law.coulomb)
    return replace(
        best,
        residual=float(np.sqrt(np.mean((best.torque(x) - torque) ** 2))),
        fitted_to=peak,
        note="; ".join(notes),
        hysteresis=constant_elements(drive),
        friction=law.coulomb + law.bending if law else 0.0,
        viscous=law.viscous if law else 0.0,
        friction_note="its dependence on load and speed" if changes else "",
    )


def constant_elements(drive: DriveMap) -> tuple[Jenkin, ...]:
    """Elements of a map with constant yield torques, as native tendons have them.

    Yield torques that depend on the load are taken at half of the rated torque.

    Args:
        drive: Map of the drive.
    """
    torque = 0.5 * drive.ratings.rated_torque
    elements = (element.constant_at(torque) for element in drive.hysteresis)
    return tuple(element for element in elements if element is not None)


def native_map(drive: DriveMap, spring: NativeSpring) -> DriveMap:
    """The law of this level between motor and link, expressed as a map.

    The map contains the elastic part, the hysteresis of :func:`constant_elements` and,
    if the drive has friction, its constant and viscous parts. Native friction acts
    against the housing, but in a map friction acts against the flexspline. If the
    flexspline turns, its speed, 1/i of the input speed, is the difference between the
    two sliding speeds.

    Args:
        drive: Map of the drive.
        spring: Native springs fitted to it, see :func:`fit_native`.
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
        # energy at the knot; it is zero at zero torsion
        potential[0, 0, j, 0] = _energy(spring, left)
    stiffness = spring.slope(end)
    friction = drive.friction
    if friction is not None:
        slip = spring.friction
        friction = replace(friction, coulomb=slip, static=slip, load=0.0, bending=0.0)
    return replace(
        drive,
        friction=friction,
        hysteresis=constant_elements(drive),
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
    """Torsions > 0 [rad], mean torque of both directions and largest torque [N·m]."""
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
    """Candidate springs by increasing number of tendons."""
    r = drive.ratings
    corners = [drive.mean_torsion(t) for t in (r.T1, r.T2)]
    ways = [np.array([d for d in corners if 0.0 < d < 0.99 * x[-1]])]
    ways += [_denser_at_bends(x, torque, n) for n in range(1, MAX_CORNERS + 1)]
    ways = sorted((w for w in ways if w.size), key=lambda w: w.size)
    least = LEAST * drive.mean_stiffness
    return [_cubic(x, torque, least), *(_lines(x, torque, w, least) for w in ways)]


def _cubic(x: Array, torque: Array, least: float) -> NativeSpring:
    """Least-squares fit of a x + c x³ with a >= least and c >= 0."""
    from scipy.optimize import nnls

    unit = float(x[-1])  # scales both columns to similar magnitude
    u = x / unit
    floor = least * unit
    (a, c), _ = nnls(np.column_stack([u, u**3]), torque - floor * u)
    # a cubic part below the round-off of the fit is dropped
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
    """Least-squares fit of lines that meet at the corners, with slopes >= least."""
    from scipy.optimize import nnls

    ends = np.array([0.0, *corners, x[-1]])
    # part of x that each line covers
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
    """Corners of a piecewise linear curve, equally spaced in integrated root curvature.

    Source:
        de Boor (2001), "A Practical Guide to Splines", chapter XII: equal parts of
        |f''|^(1/2) for piecewise linear approximation.
    """
    slope = np.gradient(np.concatenate([[0.0], torque]), np.concatenate([[0.0], x]))
    bend = np.sqrt(np.abs(np.gradient(slope, x[0])))
    bend = bend + 1e-3 * bend.mean() + 1e-300
    part = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]))])
    wanted = (np.arange(count) + 0.5) / count * part[-1]
    inner = np.interp(wanted, part, np.concatenate([[0.0], x]))
    return np.asarray(inner[(inner > 1e-3 * x[-1]) & (inner < 0.99 * x[-1])])
