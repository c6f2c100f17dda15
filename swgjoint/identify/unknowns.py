"""Unknown parameters of an identification, with initial values and scales."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swgjoint.identify.log import mean_rate
from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.identify.model import Model

SPRINGS = {
    "three_lines": ("K1", "K2", "K3"),
    "cubic": ("stiffness", "hardening"),
}
"""Names of the stiffness parameters by type of spring."""
_LEAST = 1e-6  # lower bounds of an element, relative to the scales of its parameters


@dataclass(frozen=True, kw_only=True)
class ModelParameter:
    """One unknown parameter of the model; numbers are in its ``unit``."""

    name: str
    unit: str
    start: float
    """Initial value of the search."""
    scale: float
    """Typical size; a change by it affects the torques about as much as for others."""
    least: float = -np.inf
    """Lower bound."""


def unknowns_of(model: Model) -> list[ModelParameter]:
    """Unknowns in the order of all value arrays; they start from a linear spring."""
    K, i = model.mean_stiffness, abs(model.ratio)
    x = 0.5 * float(np.ptp(model.torsion))
    T = K * x
    rate = spread(mean_rate(model.torsion, model.step))

    def slope(name: str) -> ModelParameter:
        return ModelParameter(name=name, unit="N·m/rad", start=K, scale=K)

    unknowns = [slope(name) for name in model.slopes]
    if model.spring == "cubic":
        cubic = ModelParameter(
            name="hardening", unit="N·m/rad³", start=0.0, scale=K / x**2
        )
        unknowns[1] = cubic
    zero = -float(np.mean(model.torsion))
    unknowns += [
        ModelParameter(name="zero", unit="rad", start=zero, scale=x),
        ModelParameter(name="damping", unit="N·m·s/rad", start=0.0, scale=T / rate),
    ]
    if model.hysteresis:
        # the yield torsion is f/k: bounds exclude -k and -f, equivalent to k and f
        unknowns += [
            ModelParameter(
                name="hysteresis_stiffness",
                unit="N·m/rad",
                start=0.5 * K,
                scale=K,
                least=_LEAST * K,
            ),
            ModelParameter(
                name="hysteresis_yield_torque",
                unit="N·m",
                start=0.02 * T,
                scale=T,
                least=_LEAST * T,
            ),
        ]
    unknowns += [
        ModelParameter(name=f"error_{p}_{q}_{part}", unit="rad", start=0.0, scale=x)
        for p, q in model.orders
        for part in ("cos", "sin")
    ]
    if model.skew:
        skew = ModelParameter(
            name="link_skew",
            unit="s",
            start=model.first_skew,
            scale=x / spread(model.link_rate),
        )
    if model.samples.motor_torque is None:
        return [*unknowns, skew] if model.skew else unknowns
    at_motor, speed = T / i, spread(model.relative_rate)
    unknowns += [
        ModelParameter(
            name="friction_coulomb", unit="N·m", start=0.01 * at_motor, scale=at_motor
        ),
        ModelParameter(name="friction_load", unit="-", start=0.0, scale=1.0),
        ModelParameter(
            name="friction_viscous", unit="N·m·s/rad", start=0.0, scale=at_motor / speed
        ),
    ]
    if model.rotor_inertia is None:
        inertia = at_motor / spread(model.motor_acceleration)
        unknowns.append(
            ModelParameter(name="rotor_inertia", unit="kg·m²", start=0.0, scale=inertia)
        )
    return [*unknowns, skew] if model.skew else unknowns


def spread(values: Array) -> float:
    """Standard deviation of values, at least 1e-12."""
    return max(float(np.std(values)), 1e-12)
