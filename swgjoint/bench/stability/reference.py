r"""Independent reference of the stability study: two-mass equations, by DOP853.

The equations of motion are

.. math::
    J\ddot\theta = -T(\Delta)\,(1/i + e_0'(\theta)) + T_l/i, \qquad
    J_l\ddot\psi = T(\Delta) - T_l

with :math:`\Delta = \theta/i + e_0(\theta) - \psi`. The spring law T is coded here
again, so that the reference uses neither the map nor the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np

from swgjoint.bench.stability.joint import (
    ERROR,
    HARDENING,
    ORDERS,
    RATIO,
    REACH,
    Joint,
    Start,
)
from swgjoint.errors import ComputationError
from swgjoint.typing import Array
from swgjoint.units import arcmin

WINDOW = 0.1
"""Longest duration of the comparison with a run [s]."""
PHASE = 100.0
"""Largest phase of the torsional vibration during the comparison [rad]."""


@dataclass(frozen=True, kw_only=True)
class TwoMassReference:
    """Solution of one joint from one start."""

    window: float
    """Duration of the comparison [s]."""
    link: Callable[[Array], Array]
    """Function that returns the link angle [rad] at times inside the window [s]."""

    def error(self, joint: Joint, start: Start, sub_steps: int) -> float | None:
        """Largest error of the link angle over the window [arcmin].

        Args:
            joint: Joint to run.
            start: Initial conditions of the reference.
            sub_steps: Number of equal parts of a time step.

        Returns:
            Error [arcmin]; None if the window contains fewer than four steps or the run
            diverged.
        """
        step = float(joint.model.opt.timestep)
        steps = int(self.window / step)
        if steps < 4:
            return None
        run = joint.run(
            start, duration=steps * step, sub_steps=sub_steps, samples=min(steps, 100)
        )
        if run.diverged:
            return None
        off = run.position[:, 1] - self.link(run.time)
        return float(np.abs(off).max() / arcmin)


def reference(
    stiffness: float, *, rotor: float, link: float, start: Start
) -> TwoMassReference:
    """Solve the two-mass equations.

    Args:
        stiffness: Stiffness of the drive at zero torque [N·m/rad].
        rotor: Rotor inertia [kg·m²].
        link: Link inertia [kg·m²].
        start: Initial torque, initial speed and load.

    Raises:
        ComputationError: If the integration fails.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    ratio = -float(RATIO)  # circular spline fixed
    cubic = stiffness * HARDENING / 3.0 / REACH**2
    top = stiffness * (1.0 + HARDENING)
    fastest = sqrt(top * (1.0 / (ratio**2 * rotor) + 1.0 / link))
    window = min(WINDOW, PHASE / fastest)

    def spring(s: float) -> float:
        inside = min(max(s, -REACH), REACH)
        return inside * (stiffness + cubic * inside**2) + top * (s - inside)

    def rates(_: float, y: Array) -> tuple[float, float, float, float]:
        theta, psi, theta_rate, psi_rate = y.tolist()
        error = ERROR * sum(cos(n * theta) for n in ORDERS)
        slope = -ERROR * sum(n * sin(n * theta) for n in ORDERS)
        torque = spring(theta / ratio + error - psi)
        return (
            theta_rate,
            psi_rate,
            (start.load / ratio - torque * (1.0 / ratio + slope)) / rotor,
            (torque - start.load) / link,
        )

    wound = brentq(lambda s: spring(s) - start.torque, -1.0, 1.0, xtol=1e-16)
    found = solve_ivp(
        rates,
        (0.0, window),
        [0.0, ERROR * len(ORDERS) - wound, start.speed, start.speed / ratio],
        method="DOP853",
        dense_output=True,
        rtol=1e-10,
        atol=1e-12,
    )
    if not found.success:
        raise ComputationError(f"reference of the stability study: {found.message}")
    return TwoMassReference(window=window, link=lambda t: np.asarray(found.sol(t)[1]))
