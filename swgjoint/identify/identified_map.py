"""The map of an identified drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.identify.model import Model, lines_of
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.friction_fit import PRESLIDING, RELAXATION
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.torsion_law import potential_of_stiffness
from swgjoint.typing import Array

_PIECES = 16  # intervals of the cubic spring


def map_of(
    model: Model, values: Array, *, name: str, source: str
) -> tuple[DriveMap, tuple[str, ...]]:
    """The map with identified parameters, and notes on those that it cannot contain.

    Args:
        model: The fitted model.
        values: Parameter values in the order of ``model.unknowns``.
        name: Name of the map.
        source: Name of the log, recorded in the map.

    Returns:
        The map, and one note for each parameter that it cannot contain.
    """
    names = [x.name for x in model.unknowns]
    p = {name: float(v) for name, v in zip(names, values, strict=True)}
    orders = np.concatenate([np.zeros((1, 2), np.int64), model.orders])
    if model.spring == "cubic":
        knots, potential, ends = _cubic(model, p, len(orders))
    else:
        knots, stiffness = lines_of(model, p)
        potential, ends = potential_of_stiffness(
            knots, stiffness, n_harmonics=len(orders)
        )
    elements, no_element = _elements(p)
    friction, no_friction = _friction(p, source)
    drive = DriveMap(
        name=name,
        level="measurement",
        layout=model.layout,
        teeth_flexspline=model.teeth[0],
        teeth_circular_spline=model.teeth[1],
        torsion_knots=knots,
        orders=orders,
        potential=potential,
        end_stiffness=ends,
        kinematic_error=_error(model, orders, values, p["zero"]),
        ratings=model.ratings,
        hysteresis=elements,
        friction=friction,
        info={"source": f"identified from {source}", "missing": {}},
    )
    return drive, (*no_element, *no_friction)


def _error(
    model: Model, orders: NDArray[np.int64], values: Array, zero: float
) -> Array:
    """Amplitudes in the frame of the map, whose motor angle is zero at zero torsion."""
    a, b = np.vstack([np.zeros((1, 2)), model.amplitudes(values)]).T
    ahead = (orders @ np.array(angle_coefficients(model.layout)))[:, 0]
    cos, sin = (f(ahead * model.ratio * zero) for f in (np.cos, np.sin))
    return np.stack([a * cos - b * sin, a * sin + b * cos], axis=-1)


def _elements(p: Mapping[str, float]) -> tuple[tuple[Jenkin, ...], list[str]]:
    k = p.get("hysteresis_stiffness", 0.0)
    f = p.get("hysteresis_yield_torque", 0.0)
    if k > 0.0 and f > 0.0:
        return (Jenkin(stiffness=k, yield_torque=f),), []
    if "hysteresis_stiffness" not in p:
        return (), []
    return (), [
        f"the map has no hysteresis: the fit gave {f:.3g} N·m at {k:.3g} N·m/rad"
    ]


def _friction(p: Mapping[str, float], source: str) -> tuple[Friction | None, list[str]]:
    if "friction_coulomb" not in p:
        return None, []
    notes = [
        f"friction_{key} {p[f'friction_{key}']:.3g} is negative: the map omits it"
        for key in ("coulomb", "load", "viscous")
        if p[f"friction_{key}"] < 0.0
    ]
    rest = p["friction_coulomb"]
    if not rest > 0.0:
        return None, notes
    return Friction(
        stiffness=rest / PRESLIDING,
        damping=RELAXATION * rest / PRESLIDING,
        coulomb=rest,
        static=rest,
        viscous=max(p["friction_viscous"], 0.0),
        load=max(p["friction_load"], 0.0),
        source=f"identified from {source}; assumed: slip after {PRESLIDING:g} rad, no"
        " Stribeck part",
    ), notes


def _cubic(
    model: Model, p: Mapping[str, Any], n_harmonics: int
) -> tuple[Array, Array, Array]:
    """Knots over the torsion range of the log, exact quartics, and end stiffness."""
    reach = float(np.abs(model.torsion + p["zero"]).max())
    knots = np.linspace(-reach, reach, _PIECES + 1)
    energy = np.polynomial.Polynomial(
        [0.0, 0.0, 0.5 * p["stiffness"], 0.0, 0.25 * p["hardening"]]
    )
    potential = np.zeros((n_harmonics, 2, _PIECES, 5))
    for j, knot in enumerate(knots[:-1]):
        part = energy(np.polynomial.Polynomial([knot, 1.0])).coef
        potential[0, 0, j, : part.size] = part
    ends = np.zeros((n_harmonics, 2, 2))
    ends[0, 0] = energy.deriv(2)(knots[[0, -1]])
    return knots, potential, ends
