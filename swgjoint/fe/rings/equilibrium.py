r"""Equilibrium of the thin rings: Newton's method on the potential.

.. math:: \Pi = U_{rim} + U_{race} + \sum_j \tfrac25 K\langle -g_j\rangle^{5/2}
    + \sum_p \tfrac12 k_p\langle -g_p\rangle^2 + \sum_t \tfrac12 k_t\langle
    -g_t\rangle^2 + T\psi

with sums over balls j, contact points p between bore and race, and tooth contacts t; g
is a gap and :math:`\langle -g\rangle = \max(-g, 0)` the overlap. Every contact is
compliant, so the potential contains the conditions :math:`0 \le F \perp g + F/k \ge 0`,
and Newton's method with the tangent of the overlapping contacts is a primal-dual
active-set method for them. T is the torque on the output, and psi is the best-fit
rotation of the rim. Without friction the race is free to rotate; one coordinate of one
of its nodes is fixed to prevent this, and the reaction there is zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.rings.contacts import linearise
from swgjoint.fe.rings.model import ThinRing
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class ThinRingSolver:
    """Settings of Newton's method for the thin rings."""

    max_iterations: int = 80
    """Largest number of iterations."""
    shortest: float = 1e-3
    """Smallest fraction of a Newton step; steps are halved while the potential rises
    [-]."""
    full: int = 8
    """Number of first iterations in which the potential may rise if teeth carry load in
    the start. Whole steps find the points of contact sooner than descending ones."""
    step_tolerance: float = 3e-12
    """Displacement increment at which the iteration ends, as a fraction of the radius
    of the rim [-]."""
    stride: float = 0.1
    """Largest displacement increment of an iteration, as a fraction of the lobe height
    [-]."""
    anchor: float = 1e-11
    """Addition to the diagonal of the tangent, relative to its largest entry [-]. It
    keeps the tangent regular if no tooth holds the output, and it does not shift an
    equilibrium."""

    def __call__(
        self,
        model: ThinRing,
        start: ThinRingState,
        *,
        torque: float | None = None,
        rotation: float | None = None,
        teeth: bool = True,
    ) -> ThinRingState:
        """Equilibrium at the wave-generator angle of ``start``.

        Args:
            model: The rings.
            start: State from which the search starts.
            torque: Prescribed torque T on the output [N·m]; None if the rotation is
                prescribed.
            rotation: Prescribed rotation psi of the rim [rad]; the torque is then a
                result. None if the torque is prescribed.
            teeth: Whether the teeth can touch.

        Returns:
            The state with its outcome, whether it converged or not.

        Raises:
            ValueError: Unless exactly one of torque and rotation is prescribed.
        """
        if (torque is None) == (rotation is None):
            raise ValueError("torque, rotation: expected exactly one of them")
        state, history = start, list[float]()
        load = start.torque if torque is None else torque
        full = self.full if start.loaded_teeth else 0
        step, part, last = np.zeros(model.size), 0.0, np.inf
        for _ in range(self.max_iterations):
            tried = replace(state, q=state.q + part * step)
            tried, total, held = linearise(model, tried, teeth=teeth)
            psi, turn = rim_rotation(model, tried.q, start.rotation)
            potential = tried.energy + load * psi
            rises = potential - last > 1e-12 * abs(last) and len(history) > full
            if torque is not None and rises and part > self.shortest:
                part *= 0.5
                continue
            state, last = tried, potential
            right = np.stack([-total.gradient - load * turn, turn], axis=1)
            base, reach = total.solve(model.order, held, right, self.anchor).T
            compliance, change = float(turn @ reach), 0.0
            if rotation is not None:
                change = (psi + float(turn @ base) - rotation) / compliance
            step = base - change * reach
            size = _moved(step)
            history.append(size)
            if not np.isfinite(size):
                return replace(state, outcome=Outcome.DIVERGED, history=tuple(history))
            part = min(1.0, self.stride * model.lobe_height / max(size, 1e-300))
            load += part * change
            state = replace(state, rotation=psi, torque=load, compliance=compliance)
            if size < self.step_tolerance * model.rim.radius:
                parts = total.shares(reach)
                # this step is so small that its effect on the forces is negligible
                q = state.q + step
                return replace(
                    state,
                    q=q,
                    rotation=rim_rotation(model, q, psi)[0],
                    energy=state.energy + float(total.gradient @ step),
                    shares={k: value / compliance for k, value in parts.items()},
                    outcome=Outcome.CONVERGED,
                    history=tuple(history),
                )
        failed = Outcome.MAX_ITERATIONS
        return replace(state, outcome=failed, history=tuple(history))


def _moved(step: Array) -> float:
    """Largest displacement component of a node in a step [m]."""
    return float(np.abs(step.reshape(-1, 2, 2)[:, 0]).max())


def rim_rotation(model: ThinRing, q: Array, near: float) -> tuple[float, Array]:
    """Best-fit rotation of the rim's nodes [rad] and its gradient (size,) [rad/m].

    Args:
        model: The rings.
        q: Coordinates of rim and race (size,) [m].
        near: Rotation that selects the number of whole turns [rad]; the result differs
            from it by at most half a turn.
    """
    x0 = model.rim.reference[:, 0]
    x = q[: model.rim.size].reshape(-1, 2, 2)[:, 0]
    sine, cosine = float(np.sum(rotate_right_angle(x0) * x)), float(np.sum(x0 * x))
    gradient = np.zeros(model.size)
    rows = gradient[: model.rim.size].reshape(-1, 2, 2)
    rows[:, 0] = (cosine * rotate_right_angle(x0) - sine * x0) / (sine**2 + cosine**2)
    psi = float(np.arctan2(sine, cosine))
    return psi + 2.0 * np.pi * round((near - psi) / (2.0 * np.pi)), gradient
