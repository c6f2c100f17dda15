r"""A map expanded about its ideal motion, for many positions and harmonics.

The output angle psi stays within about a milliradian of theta/i, so the phases of the
harmonics change very little over the distance s = psi - psi_0 from psi_0 = theta/i.
Their effect is of second degree in s at each theta:

.. math:: V = V_0(\Delta) + s V_1(\Delta) + \tfrac12 s^2 V_2(\Delta), \quad
    e_0 = a + s b + \tfrac12 s^2 c, \quad
    \Delta = \theta/i - \psi_0 + e_0 - s, \quad T = -\frac{dV}{ds} .

Under load, psi_0 = theta/i minus the mean torsion is closer. Where the highest
harmonics change more, psi_0 is the solution found so far.

The sums over the harmonics are then matrix products or, at equal steps over the whole
period of a map, Fourier transforms. They are computed once per position and interval of
the torsion instead of once per iteration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.equilibrium import output_angle, stays_free
from swgjoint.maps.potential import Potential
from swgjoint.typing import Array, Index

_NEWTON = 12
_CLOSER = 3
"""Largest number of expansions about the solution found so far."""
_BEND = 1e-3
"""Largest second-order term (q s)^2/2; q is the largest order of psi [-]. The neglected
term (q s)^3/6 is then at most 1.5e-5."""
_FLAT = 1e-8
"""The same where the map is expanded about the solution found so far [-]."""
_CHUNK = 256
"""Number of positions that are expanded again at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Polynomials:
    """The potential as a polynomial of the torsion at n positions.

    Each position has one interval of the torsion, in which the polynomial is valid.
    """

    interval: Index
    """Number of the interval between two knots (n,)."""
    coefficients: Array
    """Coefficients of V_0, V_1 and V_2 [J/rad^k, J/rad^(k+1), J/rad^(k+2)].

    Shape (3, n, 5).
    """


@dataclass(frozen=True, kw_only=True, eq=False)
class IdealMotion:
    """Sums over the harmonics at n input angles."""

    drive: Potential
    """The full map."""
    theta: Array
    """Input angles [rad]. Shape (n,)."""
    about: Array
    """Output angles psi_0 about which the map is expanded [rad]. Shape (n,)."""
    error: Array
    """a [rad], b [-] and c [1/rad]: e0 and its derivatives by psi at psi_0. (3, n)."""
    sums: Callable[[Array, Index | slice], Array]
    """Function of amplitudes (n_harmonics, 2, m) and of positions (n_there,). It
    returns the sums over the harmonics and two derivatives by psi (3, n_there, m).
    """
    ends: Array
    """Second derivatives of V_0, V_1 and V_2 by Delta below and above the knots.

    Shape (3, n, 2).
    """
    known: dict[int, Array] | None
    """Sums over the potential in an interval of the torsion (3, n, 5), by its number.

    A transform yields them at all positions, so it runs once per interval. None if the
    harmonics are summed only at the positions that need an interval.
    """

    @classmethod
    def from_map(
        cls, drive: Potential, theta: Array, about: Array | None = None
    ) -> IdealMotion:
        """The harmonics of a map, summed at psi = psi_0.

        Args:
            drive: The map.
            theta: Input angles [rad]. Shape (n,).
            about: Output angles psi_0 [rad]. Shape (n,). None takes theta/i.
        """
        if about is None:
            about = theta / drive.ratio
        phases = drive.phases(theta, about)
        n_psi = drive.angle_orders[:, 1]
        factors = np.empty((3, *phases.shape, 2))
        value, slope, bend = factors
        np.cos(phases, out=value[..., 0])
        np.sin(phases, out=value[..., 1])
        np.multiply(-n_psi, value[..., 1], out=slope[..., 0])
        np.multiply(n_psi, value[..., 0], out=slope[..., 1])
        np.multiply(-(n_psi[:, None] ** 2), value, out=bend)
        every = factors.reshape(3, theta.size, -1)

        def sums(amplitudes: Array, there: Index | slice) -> Array:
            return every[:, there] @ amplitudes.reshape(every.shape[2], -1)

        return cls._summed(drive, theta, about, sums, None)

    @classmethod
    def over_period(
        cls, drive: Potential, turns: float, count: int, lag: float = 0.0
    ) -> IdealMotion:
        """The harmonics of a map, summed over its period at psi_0 = theta/i - lag.

        Args:
            drive: The map.
            turns: Period of the map [input turns].
            count: Number of equal steps of theta, more than two per shortest wave.
            lag: Distance of psi_0 from theta/i [rad].
        """
        theta = 2.0 * np.pi * turns * np.arange(count) / count
        n_theta, n_psi = drive.angle_orders.T
        waves = np.rint((n_theta + n_psi / drive.ratio) * turns).astype(np.int64)
        cos, sin = np.cos(n_psi * lag)[:, None], np.sin(n_psi * lag)[:, None]

        def transform(amplitudes: Array) -> Array:
            a, b = amplitudes[:, 0], amplitudes[:, 1]
            if lag:
                a, b = a * cos - b * sin, a * sin + b * cos
            # cosines are even and sines are odd in the number of waves
            terms = a - 1j * np.where(waves < 0, -1.0, 1.0)[:, None] * b
            spectrum = np.zeros((terms.shape[1], count // 2 + 1), dtype=complex)
            np.add.at(spectrum.T, np.abs(waves), 0.5 * count * terms)
            spectrum[:, 0] *= 2.0
            return np.asarray(np.fft.irfft(spectrum, count).T)

        def sums(amplitudes: Array, there: Index | slice) -> Array:
            slope = amplitudes[:, ::-1] * (n_psi[:, None] * [1, -1])[..., None]
            bend = amplitudes * -(n_psi**2)[:, None, None]
            parts = (amplitudes, slope, bend)
            return np.stack([transform(part)[there] for part in parts])

        return cls._summed(drive, theta, theta / drive.ratio - lag, sums, {})

    @classmethod
    def _summed(
        cls,
        drive: Potential,
        theta: Array,
        about: Array,
        sums: Callable[[Array, Index | slice], Array],
        known: dict[int, Array] | None,
    ) -> IdealMotion:
        """The map with the sums that do not depend on the torsion."""
        return cls(
            drive=drive,
            theta=theta,
            about=about,
            error=sums(drive.kinematic_error[..., None], slice(None))[..., 0],
            sums=sums,
            ends=sums(drive.end_stiffness, slice(None)),
            known=known,
        )

    def polynomials(self, interval: Index, known: Polynomials | None) -> Polynomials:
        """Polynomials of V_0 to V_2 in one interval of the torsion per position.

        The positions of an interval are summed at once.

        Args:
            interval: Number of the interval between two knots at each position (n,).
            known: Polynomials that are kept where their interval is the same; None if
                there are none.
        """
        if known is None:
            changed = np.arange(interval.size)
            coefficients = np.empty((3, interval.size, self.drive.potential.shape[-1]))
        else:
            changed = np.flatnonzero(interval != known.interval)
            if not changed.size:
                return known
            coefficients = known.coefficients.copy()
        order = changed[np.argsort(interval[changed], kind="stable")]
        ends = np.flatnonzero(np.diff(interval[order])) + 1
        for rows in np.split(order, ends):
            coefficients[:, rows] = self._in_interval(int(interval[rows[0]]), rows)
        return Polynomials(interval=interval, coefficients=coefficients)

    def _in_interval(self, number: int, rows: Index) -> Array:
        """Polynomials in one interval at some positions. Shape (3, n_rows, 5)."""
        amplitudes = self.drive.potential[:, :, number]
        if self.known is None:
            return self.sums(amplitudes, rows)
        if number not in self.known:
            self.known[number] = self.sums(amplitudes, slice(None))
        return self.known[number][:, rows]

    def torque(
        self, shift: Array, known: Polynomials | None = None
    ) -> tuple[Array, Array, Polynomials]:
        """Torque T on the output [N·m] and stiffness -dT/dpsi [N·m/rad]. Shapes (n,).

        Args:
            shift: Distance s = psi - psi_0 [rad]. Shape (n,).
            known: Polynomials of the preceding call; None in the first one.

        Returns:
            Torque, stiffness, and the polynomials for the next call.
        """
        knots = self.drive.torsion_knots
        a, b, c = self.error
        from_ideal = self.theta / self.drive.ratio - self.about
        x = from_ideal + a + shift * (b - 1.0 + 0.5 * shift * c)
        dx = b - 1.0 + shift * c
        inside = np.clip(x, knots[0], knots[-1])
        j = np.clip(np.searchsorted(knots, inside, "right") - 1, 0, knots.size - 2)
        there = self.polynomials(j, known)
        p = np.moveaxis(there.coefficients, -1, 0)  # (5, 3, n)
        d, out = inside - knots[j], x - inside
        v = p[0] + d * (p[1] + d * (p[2] + d * (p[3] + d * p[4])))
        v1 = p[1] + d * (2 * p[2] + d * (3 * p[3] + d * 4 * p[4]))
        v2 = 2 * p[2] + d * (6 * p[3] + d * 12 * p[4])
        end = np.where(out < 0.0, self.ends[..., 0], self.ends[..., 1])
        v, v1 = v + out * (v1 + 0.5 * out * end), v1 + out * end
        v2 = np.where(out == 0.0, v2, end)
        # derivatives of V by Delta at fixed s, and by s at fixed Delta
        by_x, by_xx = (
            part[0] + shift * (part[1] + 0.5 * shift * part[2]) for part in (v1, v2)
        )
        by_s, by_xs = (part[1] + shift * part[2] for part in (v, v1))
        torque = -(dx * by_x + by_s)
        stiffness = dx * (dx * by_xx + 2.0 * by_xs) + c * by_x + v[2]
        return torque, stiffness, there

    def output_angle(self, torque: float) -> Array:
        """Output angle psi at which the drive exerts a torque [rad]. Shape (n,).

        Where the second-order term exceeds :data:`_BEND`, the map is expanded again.
        The full map is solved where this does not converge.

        Args:
            torque: Torque T on the output [N·m].

        Raises:
            ValueError: If the mean torsion curve does not reach the torque.
            ComputationError: If the map reaches it at no output angle.
        """
        drive = self.drive
        twist = drive.mean_torsion(torque) if torque else 0.0
        first = self.theta / drive.ratio - self.about + self.error[0] - twist
        psi, near = self._solve(torque, first, _BEND)
        for _ in range(_CLOSER):
            again = np.flatnonzero(np.isfinite(psi) & ~near)
            if not again.size:
                break
            for k in range(0, again.size, _CHUNK):
                few = again[k : k + _CHUNK]
                at = IdealMotion.from_map(drive, self.theta[few], psi[few])
                psi[few], near[few] = at._solve(torque, np.zeros(few.size), _FLAT)
        far = ~near
        if far.any():
            psi[far] = output_angle(drive, self.theta[far], torque)
        return psi

    def _solve(
        self, torque: float, shift: Array, bend: float
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Output angles by Newton's method from a first distance s (n,) [rad].

        Args:
            torque: Torque T on the output [N·m].
            shift: First distance s [rad]. Shape (n,).
            bend: Largest second-order term (q s)^2/2 of a valid expansion [-].

        Returns:
            Output angles [rad], NaN where the method does not converge, and whether
            the expansion holds there. Shapes (n,).
        """
        drive = self.drive
        settled = 1e-12 * float(np.ptp(drive.torsion_knots))
        step, there = np.full(shift.shape, np.inf), None
        for _ in range(_NEWTON):
            exerted, stiffness, there = self.torque(shift, there)
            missing = exerted - torque
            if torque == 0.0:
                free = stays_free(drive, exerted, stiffness)
                missing = np.where(free, 0.0, missing)
            soft = np.where(stiffness > 0.0, stiffness, np.nan)
            step = np.where(missing == 0.0, 0.0, missing / soft)
            if not (np.abs(step) > settled).any():
                break
            shift = shift + step
        order = np.abs(drive.angle_orders[:, 1]).max()
        converged = np.abs(step) <= settled
        near = converged & ((order * shift) ** 2 <= 2.0 * bend)
        return np.where(converged, self.about + shift, np.nan), near
