r"""Equilibrium of the thin rings: Newton's method on the potential.

.. math:: \Pi = U_{rim} + U_{race} + \sum_j \tfrac25 K\langle -g_j\rangle^{5/2}
    + \sum_p \tfrac12 k_p\langle -g_p\rangle^2 + \sum_t \tfrac12 k_t\langle
    -g_t\rangle^2 + T\psi

over balls j, points p between bore and race, and tooth contacts t; g is a gap and
:math:`\langle\cdot\rangle` its overlap. Every contact yields, so the conditions
:math:`0 \le F \perp g + F/k \ge 0` are in the potential and Newton's method with the
tangent of the overlapping contacts is their primal-dual active set. psi is the best-fit
rotation of the rim. The race could turn in its place: one of its nodes is kept from
that, with a force that vanishes because nothing rubs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.rings.contacts import linearise
from swgjoint.fe.rings.model import ThinRing
from swgjoint.fe.rings.state import RingState
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class RingSolver:
    """Settings of the iteration."""

    max_iterations: int = 80
    shortest: float = 1e-3
    """Part of a Newton step down to which it is halved while the potential rises."""
    step_tolerance: float = 3e-12
    """Increment, relative to the radius of the rim, at which the iteration ends."""
    stride: float = 0.1
    """Longest move of one iteration, in lobe heights."""
    anchor: float = 1e-11
    """Part of the rim's stiffness that holds back, in every step, an output that no
    tooth holds; it does not shift an equilibrium."""

    def __call__(
        self,
        model: ThinRing,
        start: RingState,
        *,
        torque: float | None = None,
        rotation: float | None = None,
        teeth: bool = True,
    ) -> RingState:
        """Equilibrium at the wave-generator angle of ``start``.

        Args:
            model: The rings.
            start: Where to begin.
            torque: T on the output [N·m]; else ``rotation`` is held [rad] and the
                torque is what that takes.
            rotation: psi of the rim.
            teeth: Whether the teeth touch.
        """
        if (torque is None) == (rotation is None):
            raise ValueError("give a torque or a rotation")
        state, history = start, list[float]()
        load = start.torque if torque is None else torque
        step, part, last = np.zeros(model.size), 0.0, np.inf
        for _ in range(self.max_iterations):
            tried = replace(state, q=state.q + part * step)
            tried, total, held = linearise(model, tried, teeth=teeth)
            psi, turn = rim_rotation(model, tried.q, start.rotation)
            potential = tried.energy + load * psi
            rises = potential - last > 1e-12 * abs(last)
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
            state = replace(state, torque=load, compliance=compliance)
            if size < self.step_tolerance * model.rim.radius:
                parts = total.shares(reach)
                state = replace(
                    state,
                    q=state.q + step,
                    shares={k: value / compliance for k, value in parts.items()},
                )
                return _finished(model, state, Outcome.CONVERGED, history, teeth=teeth)
        return _finished(model, state, Outcome.MAX_ITERATIONS, history, teeth=teeth)


def _moved(step: Array) -> float:
    """Largest displacement of a node [m]."""
    return float(np.abs(step.reshape(-1, 2, 2)[:, 0]).max())


def rim_rotation(model: ThinRing, q: Array, near: float) -> tuple[float, Array]:
    """Best-fit rotation of the rim's nodes and its gradient.

    Of all that differ by whole turns the nearest to another, so that it has no jump
    within half a turn of where a search begins.
    """
    x0 = model.rim.reference[:, 0]
    x = q[: model.rim.size].reshape(-1, 2, 2)[:, 0]
    sine, cosine = float(np.sum(rotate_right_angle(x0) * x)), float(np.sum(x0 * x))
    gradient = np.zeros(model.size)
    rows = gradient[: model.rim.size].reshape(-1, 2, 2)
    rows[:, 0] = (cosine * rotate_right_angle(x0) - sine * x0) / (sine**2 + cosine**2)
    psi = float(np.arctan2(sine, cosine))
    return psi + 2.0 * np.pi * round((near - psi) / (2.0 * np.pi)), gradient


def _finished(
    model: ThinRing,
    state: RingState,
    outcome: Outcome,
    history: list[float],
    *,
    teeth: bool,
) -> RingState:
    """Forces and energy at the last positions."""
    state, _, _ = linearise(model, state, teeth=teeth)
    psi, _ = rim_rotation(model, state.q, state.rotation)
    return replace(state, rotation=psi, outcome=outcome, history=tuple(history))
