r"""Hysteresis of a drive: parallel Jenkin (Maxwell-slip) elements along the torsion.

An element is a spring k in series with a slider that yields at a torque f. With r the
torsion at which its spring is relaxed,

.. math:: q = k (\Delta - r), \qquad r \in [\Delta - f/k, \Delta + f/k],

and r changes only when an end of that interval moves past it. For a constant f, in
increments: :math:`q \leftarrow \mathrm{clip}(q + k\,d\Delta, \pm f)`.

The yield torque may depend on the elastic torque
:math:`T = \partial V/\partial\Delta` of the drive, because tooth friction depends on
the tooth forces: :math:`f = f(|T|) \ge 0`, piecewise linear. When f shrinks below the
torque of the spring, the slider slips back.

The element is passive for any history of :math:`f \ge 0`. It stores :math:`q^2/2k`, and

.. math:: q\,d\Delta = d\!\left(\frac{q^2}{2k}\right) + q\,dr.

The slider moves only when :math:`|q|` would exceed f, and then in the direction in
which the spring pulls it, whether f has shrunk or the torsion has grown. Hence
:math:`q\,dr = |q|\,|dr| \ge 0`: the work is the change of the stored energy plus a
loss. No work is gained over a closed cycle of torsion and elements, or from relaxed
elements on. The same holds for every step of a computation that first adapts the
interval to f and then moves the torsion at constant f.

Two conditions keep the static torque well defined, with the elastic stiffness
:math:`K = \partial T/\partial\Delta`. The sum of :math:`|df/d|T||` over the elements is
below 1, so that the torque of spring and elements increases with the torsion, also
while sliders slip back. And :math:`|df/d|T||\,K \le k`, so that both ends of the
interval of r increase with the torsion. Then, after a monotone path, r depends only on
the initial r and on the final state.

With a constant f, a steady cycle of amplitude X > f/k dissipates
:math:`4 f (X - f/k)`. In parallel with a spring K the loop is :math:`2 f/K` wide at
zero torque if the torsion between the tip and zero torque exceeds 2 f/k.

Source:
    Iwan (1966), "A distributed-element model for hysteresis and its steady-state
    dynamic response", J. Appl. Mech. 33, 893-900, for constant f. The interval that
    varies with the load makes the element a generalised play operator, see Visintin
    (1994), "Differential Models of Hysteresis", Springer, chapter III.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import InputError
from swgjoint.kernels import kernels
from swgjoint.typing import Array

MAX_ELEMENTS = 64
"""Largest number of elements, more than a measured loop can distinguish."""
MAX_POINTS = 64
"""Largest number of points of a yield curve."""


@dataclass(frozen=True, kw_only=True)
class Jenkin:
    """A spring in series with a slider: hysteresis that dissipates."""

    stiffness: float
    """Stiffness while the element sticks [N·m/rad]."""
    yield_torque: float
    """Torque at which the element slips, without load [N·m]."""
    yield_curve: tuple[tuple[float, float], ...] = ()
    """Further points of the yield torque: magnitude of the elastic torque, increasing
    from zero, and yield torque there, both [N·m]. The yield torque is linear between
    the points and constant beyond the last one."""

    def __post_init__(self) -> None:
        curve = tuple(tuple(point) for point in self.yield_curve)
        object.__setattr__(self, "yield_curve", curve)
        for key, unit in (("stiffness", "N·m/rad"), ("yield_torque", "N·m")):
            value = getattr(self, key)
            if curve and key == "yield_torque" and _is_number(value) and value == 0.0:
                continue
            # far above the values of any drive; products do not overflow
            if not (_is_number(value) and isfinite(value) and 1e-60 < value < 1e60):
                raise InputError(
                    f"hysteresis {key} {value!s:.40} {unit}; accepted: a finite number"
                    " > 0"
                )
        last = 0.0
        for point in curve:
            if len(point) != 2 or not all(
                _is_number(value) and 0.0 <= value < 1e60 for value in point
            ):
                raise InputError(
                    f"hysteresis yield_curve {point!s:.60} N·m; accepted: pairs of"
                    " finite numbers >= 0"
                )
            if point[0] <= last or len(curve) > MAX_POINTS:
                raise InputError(
                    f"hysteresis yield_curve at {point[0]:.6g} N·m; accepted: up to"
                    f" {MAX_POINTS} torques > 0 in increasing order"
                )
            last = point[0]

    @property
    def yield_torsion(self) -> float:
        """Torsion from rest to slip without load [rad]."""
        return self.yield_torque / self.stiffness

    @cached_property
    def _curve(self) -> Array:
        """Elastic torques and yield torques of all points [N·m]. Shape (2, n)."""
        return np.array([(0.0, self.yield_torque), *self.yield_curve]).T.copy()

    def yields(self, elastic: ArrayLike) -> Array:
        """Yield torque f at elastic torques of any shape [N·m].

        Args:
            elastic: Elastic torque T of the drive [N·m].
        """
        at, values = self._curve
        return np.asarray(np.interp(np.abs(elastic), at, values))

    def reach(self, elastic: ArrayLike) -> Array:
        """Yield torsion f/k at elastic torques of any shape [rad].

        Args:
            elastic: Elastic torque T of the drive [N·m].
        """
        return np.asarray(self.yields(elastic) / self.stiffness)

    def yield_slopes(self, elastic: ArrayLike) -> Array:
        """Slope of the yield torque over the magnitude of the elastic torque [-]."""
        at, values = self._curve
        slopes = np.append(np.diff(values) / np.diff(at), 0.0)
        interval = np.searchsorted(at, np.abs(elastic), side="right") - 1
        return np.asarray(slopes[interval])

    def with_torques_scaled(self, factor: float) -> Jenkin:
        """The element with all its torques multiplied by a factor [-]."""
        return Jenkin(
            stiffness=factor * self.stiffness,
            yield_torque=factor * self.yield_torque,
            yield_curve=tuple((at, factor * f) for at, f in self.yield_curve),
        )

    def constant_at(self, elastic: float) -> Jenkin | None:
        """The element with the constant yield torque that it has at one elastic torque.

        None if it yields there without any torque.

        Args:
            elastic: Elastic torque T [N·m].
        """
        if not self.yield_curve:
            return self
        torque = float(self.yields(elastic))
        if not torque:
            return None
        return Jenkin(stiffness=self.stiffness, yield_torque=torque)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def vary_with_load(elements: Sequence[Jenkin]) -> bool:
    """Whether the yield torque of an element depends on the load."""
    return any(element.yield_curve for element in elements)


def total_yield(elements: Sequence[Jenkin], elastic: float) -> float:
    """Sum of the yield torques [N·m].

    Args:
        elements: Jenkin elements of a drive.
        elastic: Elastic torque of the drive [N·m].
    """
    return sum(float(element.yields(elastic)) for element in elements)


def yield_table(elements: Sequence[Jenkin]) -> tuple[Array, Array]:
    """Yield torques of all elements at common elastic torques.

    Args:
        elements: Jenkin elements of a drive.

    Returns:
        Magnitudes of the elastic torque, increasing from zero [N·m], shape (m,), and
        yield torques there [N·m], shape (n_elements, m).
    """
    points = {at for element in elements for at, _ in element.yield_curve}
    at = np.array(sorted({0.0, *points}))
    return at, np.array([element.yields(at) for element in elements]).reshape(
        -1, at.size
    )


def sticking_stiffness(
    elements: Sequence[Jenkin], elastic: float | None = None
) -> float:
    """Stiffness of all elements that carry torque and stick [N·m/rad].

    Args:
        elements: Jenkin elements of a drive.
        elastic: Elastic torque of the drive [N·m]; None returns the largest value over
            all elastic torques.
    """
    if elastic is None:
        yields = yield_table(elements)[1]
        between = np.maximum(yields[:, :-1], yields[:, 1:])
        yields = np.concatenate([between, yields[:, -1:]], axis=1)
    else:
        yields = np.array([[element.yields(elastic)] for element in elements])
    stiffness = np.array([element.stiffness for element in elements])
    return float(np.max(stiffness @ (yields > 0.0), initial=0.0))


def check_elements(elements: Sequence[object], name: str) -> None:
    """Reject what is not a list of at most :data:`MAX_ELEMENTS` elements.

    Args:
        elements: Elements of a drive.
        name: Name of the drive, for messages.
    """
    if len(elements) > MAX_ELEMENTS or not all(isinstance(e, Jenkin) for e in elements):
        raise InputError(
            f"hysteresis of {name!r}; accepted: up to {MAX_ELEMENTS} Jenkin elements"
        )


def _yield_slopes(elements: Sequence[Jenkin]) -> Array:
    """Magnitudes of the slopes of all yield curves [-]. Shape (n_elements, m - 1)."""
    at, yields = yield_table(elements)
    return np.asarray(np.abs(np.diff(yields, axis=1) / np.diff(at)))


def accepted_stiffness(elements: Sequence[Jenkin]) -> float:
    """Largest stiffness of a drive with these yield curves, less round-off [N·m/rad].

    Args:
        elements: Jenkin elements whose yield torques depend on the load.
    """
    slopes = _yield_slopes(elements).max(axis=1)
    stiffness = np.array([element.stiffness for element in elements])
    return (1.0 - 1e-12) * float(np.min(stiffness / np.maximum(slopes, 1e-60)))


def check_loads(elements: Sequence[Jenkin], name: str, largest: float) -> None:
    """Reject yield torques that change too fast with the load, see above.

    Args:
        elements: Jenkin elements of a drive.
        name: Name of the drive, for messages.
        largest: Largest elastic stiffness K of the drive, or an upper bound that is at
            most :func:`accepted_stiffness` [N·m/rad].

    Raises:
        InputError: If one of the two conditions is not met.
    """
    slopes = _yield_slopes(elements)
    total = float(slopes.sum(axis=0).max())
    if not total < 1.0:
        raise InputError(
            f"hysteresis of {name!r}: slopes of the yield curves sum to {total:.4g};"
            " accepted: a sum below 1"
        )
    for element, slope in zip(elements, slopes.max(axis=1).tolist(), strict=True):
        if slope * largest > element.stiffness:
            raise InputError(
                f"hysteresis of {name!r}: an element of {element.stiffness:.4g} N·m/rad"
                f" whose yield curve has a slope of {slope:.4g}; accepted: at least the"
                f" slope times the largest stiffness of the map,"
                f" {slope * largest:.4g} N·m/rad"
            )


def stretches(torsion: Array, reach: ArrayLike) -> Array:
    r"""Stretch x - r of one element along a torsion history x [rad]. Shape (n,).

    The element starts relaxed at zero torsion. Every step clips r to an interval,

    .. math:: r_k = \min(\max(r_{k-1}, x_k - l_k), x_k + l_k) ,

    and clipping to several intervals in turn is clipping to one. The history is divided
    into parts whose intervals are computed all at once.

    Args:
        torsion: History of the torsion [rad]. Shape (n,).
        reach: Stretch l at which the slider of the element slips [rad]. Shape (n,), or
            one value.
    """
    x, count = np.asarray(torsion, float), len(torsion)
    if (native := kernels()) is not None and x.ndim == 1:
        result = np.empty(count)
        limit = np.ascontiguousarray(np.broadcast_to(reach, x.shape), dtype=float)
        native.stretches(np.ascontiguousarray(x), limit, result)
        return result
    parts = -(-count // (size := max(1, round(count**0.5))))
    # intervals by part and step in the part; those that fill the last part clip nothing
    low, high = np.full((2, parts * size), [[-np.inf], [np.inf]])
    low[:count], high[:count] = x - reach, x + reach
    low, high = low.reshape(parts, size), high.reshape(parts, size)
    for k in range(1, size):  # interval of all steps of the part so far
        here = low[:, k].copy(), high[:, k].copy()
        low[:, k] = np.clip(low[:, k - 1], *here)
        high[:, k] = np.clip(high[:, k - 1], *here)
    begins, rest = np.empty(parts), 0.0
    for p, (lowest, highest) in enumerate(zip(low[:, -1], high[:, -1], strict=True)):
        begins[p] = rest
        rest = min(max(rest, lowest), highest)
    return np.asarray(x - np.clip(begins[:, None], low, high).ravel()[:count])
