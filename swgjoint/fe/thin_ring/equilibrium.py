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

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from swgjoint.errors import Outcome
from swgjoint.fe.corotation import rotate, turned
from swgjoint.fe.thin_ring.facing import Facing, facing
from swgjoint.fe.thin_ring.model import ThinRing
from swgjoint.fe.tooth_contact import Contacts

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class RingState:
    """One equilibrium, or the start of the search for one."""

    q: Array
    """Coordinates of rim and race (size,) [m]."""
    ball_feet: Array
    """Places of the balls on the race."""
    bore_feet: Array
    """Places of the bore's points on the race."""
    alpha: float
    """Wave-generator angle [rad]."""
    phase: float = 0.0
    """Angle of ball 0 from the major axis at alpha = 0 [rad]."""
    torque: float = 0.0
    """T that the flexspline exerts on its load [N·m]."""
    rotation: float = 0.0
    """psi, of the rim, of any number of turns [rad]."""
    ball_force: Array | None = None
    """[N]. Shape (balls,)."""
    tooth_force: Array | None = None
    """Of every tooth contact [N]."""
    contacts: Contacts | None = None
    tooth_moment: float = 0.0
    """Moment of the tooth forces on the flexspline [N·m]."""
    ball_moment: float = 0.0
    """Moment of the ball forces on the race [N·m]."""
    wave_generator_torque: float = 0.0
    """External torque on the wave generator, what drives the cage included [N·m]."""
    energy: float = 0.0
    """Strain energy, contacts included [J]."""
    compliance: float = 0.0
    """-d psi / dT [rad/(N·m)]."""
    shares: Mapping[str, float] = field(default_factory=dict)
    """Parts of the compliance: rim and race, balls, bore (pressed by the race), teeth.

    Of the energy of a small twist, as a share of the whole; a contact that bends over
    under its force may have a negative one."""
    outcome: Outcome = Outcome.CONVERGED
    history: tuple[float, ...] = ()
    """Largest displacement increment of every iteration [m]."""

    @property
    def loaded_teeth(self) -> int:
        """Tooth contacts that carry load."""
        return 0 if self.tooth_force is None else len(self.tooth_force)


def at_rest(model: ThinRing, alpha: float, phase: float = 0.0) -> RingState:
    """Start of a search: both rings deflected by the lobes, not stretched.

    They have turned with the flexspline, however far: at the ideal ratio.
    """
    psi = alpha / model.ratio
    parts = []
    for ring in (model.rim, model.race):
        count, r, w0 = ring.elements, ring.radius, model.lobe_height
        phi = 2.0 * np.pi / count * np.arange(count)
        wave = 2.0 * (phi + psi - alpha)
        outward = np.stack([-np.sin(phi + psi), np.cos(phi + psi)], -1)
        along = turned(outward)
        w, v = w0 * np.cos(wave)[:, None], -0.5 * w0 * np.sin(wave)[:, None]
        place = (r + w) * outward + v * along
        # d/dphi: w' - v outwards, r + w + v' along
        dw, dv = -2.0 * w0 * np.sin(wave)[:, None], -w0 * np.cos(wave)[:, None]
        slope = (r + w + dv) * along + (dw - v) * outward
        parts.append(np.stack([place, slope * (2.0 * np.pi / count)], axis=1).ravel())
    centres, _, _ = model.balls(alpha, phase)
    share = model.race.elements / (2.0 * np.pi)
    angle = np.arctan2(-centres[:, 0], centres[:, 1]) - psi
    return RingState(
        q=np.concatenate(parts),
        ball_feet=np.mod(angle, 2.0 * np.pi) * share,
        bore_feet=model.bore.place.copy(),
        alpha=alpha,
        phase=phase,
        rotation=psi,
    )


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
            tried, total, held = _linearised(model, tried, teeth=teeth)
            psi, turn = _rotation(model, tried.q, start.rotation)
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

    def potential(self, model: ThinRing, state: RingState, torque: float) -> float:
        """Pi with the teeth in place [J]."""
        there, _, _ = _linearised(model, state, teeth=True)
        return there.energy + torque * _rotation(model, state.q, state.rotation)[0]


def _moved(step: Array) -> float:
    """Largest displacement of a node [m]."""
    return float(np.abs(step.reshape(-1, 2, 2)[:, 0]).max())


def _rotation(model: ThinRing, q: Array, near: float) -> tuple[float, Array]:
    """Best-fit rotation of the rim's nodes and its gradient.

    Of all that differ by whole turns the nearest to another, so that it has no jump
    within half a turn of where a search begins.
    """
    x0 = model.rim.reference[:, 0]
    x = q[: model.rim.size].reshape(-1, 2, 2)[:, 0]
    sine, cosine = float(np.sum(turned(x0) * x)), float(np.sum(x0 * x))
    gradient = np.zeros(model.size)
    rows = gradient[: model.rim.size].reshape(-1, 2, 2)
    rows[:, 0] = (cosine * turned(x0) - sine * x0) / (sine**2 + cosine**2)
    psi = float(np.arctan2(sine, cosine))
    return psi + 2.0 * np.pi * round((near - psi) / (2.0 * np.pi)), gradient


class _Sum:
    """Energy, gradient and Hessian of many small parts."""

    def __init__(self, size: int) -> None:
        self.energy = 0.0
        self.gradient = np.zeros(size)
        self._parts: list[tuple[str, Index, Array]] = []

    def add(
        self, name: str, dofs: Index, gradient: Array | None, hessian: Array
    ) -> None:
        """Parts with degrees of freedom (n, m), gradients (n, m), Hessians (n, m, m).

        The gradient is None where it has been counted.
        """
        if gradient is not None:
            self.gradient += np.bincount(
                dofs.ravel(), gradient.ravel(), len(self.gradient)
            )
        self._parts.append((name, dofs, hessian))

    def shares(self, way: Array) -> dict[str, float]:
        """Energy of the tangent along a displacement, twice, by part."""
        found: dict[str, float] = {}
        for name, dofs, hessian in self._parts:
            moved = way[dofs]
            value = float(np.einsum("ni,nij,nj->", moved, hessian, moved))
            found[name] = found.get(name, 0.0) + value
        return found

    def solve(self, order: Index, held: int, right: Array, anchor: float) -> Array:
        """Solve with one coordinate held and a part of the diagonal added.

        Args:
            order: Place of every coordinate in a narrow band.
            held: The coordinate that is held.
            right: Right-hand sides (size, n).
            anchor: Part of the largest diagonal entry.
        """
        size = len(order)
        rows, columns, values = [], [], []
        for _, dofs, hessian in self._parts:
            place, m = order[dofs], dofs.shape[1]
            rows.append(np.repeat(place, m, axis=1).ravel())
            columns.append(np.tile(place, (1, m)).ravel())
            values.append(hessian.ravel())
        row, column = np.concatenate(rows), np.concatenate(columns)
        band = int(np.abs(row - column).max())
        flat = (band + row - column) * size + column
        matrix = np.bincount(
            flat, np.concatenate(values), (2 * band + 1) * size
        ).reshape(2 * band + 1, size)
        largest = float(np.abs(matrix[band]).max())
        matrix[band] += anchor * largest
        # a spring far stiffer than anything else
        matrix[band, order[held]] += 1e6 * largest
        shuffled = np.empty_like(right)
        shuffled[order] = right
        solved = solve_banded((band, band), matrix, shuffled, check_finite=False)
        return np.asarray(solved[order])


def _linearised(
    model: ThinRing, state: RingState, *, teeth: bool
) -> tuple[RingState, _Sum, int]:
    """Forces and tangent at the last positions, and the coordinate that is held."""
    total = _Sum(model.size)
    first = model.rim.size
    rim, race = state.q[:first], state.q[first:]
    both = (("rim", model.rim, rim, 0), ("race", model.race, race, first))
    for name, ring, q, shift in both:
        gradient, hessian = ring.forces(q)
        total.energy += ring.energy(q)
        total.gradient[shift : shift + ring.size] += gradient
        total.add(name, ring.dofs + shift, None, hessian)
    state = _balls(model, state, race, total)
    state = _bore(model, state, rim, race, total)
    if teeth:
        state = _teeth(model, state, rim, total)
    else:
        state = replace(state, contacts=None, tooth_force=None, tooth_moment=0.0)
    # the tangential coordinate of race node 0, whichever axis it is nearer to
    node = race.reshape(-1, 2, 2)[0, 0]
    held = first + (0 if abs(node[1]) > abs(node[0]) else 1)
    total.gradient[held] = 0.0
    return replace(state, energy=total.energy), total, held


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedBalls:
    """Hertz contact of the balls, which sit on the cam, with the race."""

    seen: Facing
    overlap: Array
    """[m]. Shape (balls,)."""
    force: Array
    """Q (balls,) [N]."""
    push: Array
    """Forces on the race (balls, 2) [N]."""
    moment: float
    """On the race [N·m]."""
    input_torque: float
    """Power per speed of the wave generator that moves the balls [N·m]."""
    cage_torque: float
    """Power per speed of the cage against the cam [N·m]."""

    @property
    def resultant(self) -> Array:
        """Force on the race (2,) [N]."""
        return np.asarray(self.push.sum(axis=0))


def race_on_balls(model: ThinRing, state: RingState, race: Array) -> PressedBalls:
    """Balls of a state under a race with given coordinates."""
    centre, d_centre, d_phase = model.balls(state.alpha, state.phase)
    seen = facing(model.race, race, centre, state.ball_feet, inside=True)
    bearing = model.bearing
    reach = 0.5 * (bearing.ball_diameter + bearing.race_thickness)
    overlap = np.maximum(reach - seen.distance, 0.0)
    force = model.ball_constant * overlap**1.5
    push = -force[:, None] * seen.normal  # outwards
    foot = centre - seen.distance[:, None] * seen.normal
    return PressedBalls(
        seen=seen,
        overlap=overlap,
        force=force,
        push=push,
        moment=float(np.sum(turned(foot) * push)),
        input_torque=float(np.sum(push * d_centre)),
        cage_torque=float(np.sum(push * d_phase)),
    )


def _balls(model: ThinRing, state: RingState, race: Array, total: _Sum) -> RingState:
    pressed = race_on_balls(model, state, race)
    on = np.flatnonzero(pressed.overlap > 0.0)
    near, overlap, force = pressed.seen.chosen(on), pressed.overlap, pressed.force
    slope = 1.5 * model.ball_constant * np.sqrt(overlap[on])
    total.energy += 0.4 * float(force @ overlap)
    _press(
        total, "balls", near, near.by_ring, near.dofs + model.rim.size, force[on], slope
    )
    return replace(
        state,
        ball_feet=pressed.seen.place,
        ball_force=force,
        ball_moment=pressed.moment,
        wave_generator_torque=pressed.input_torque,
    )


def _bore(
    model: ThinRing, state: RingState, rim: Array, race: Array, total: _Sum
) -> RingState:
    """Unilateral contact of the rim's bore with the race."""
    points = model.bore.points(rim)[0]
    seen = facing(model.race, race, points, state.bore_feet, inside=False)
    overlap = 0.5 * model.bearing.race_thickness - seen.distance
    on = np.flatnonzero(overlap > 0.0)
    near, k = seen.chosen(on), model.press_per_point
    force = k * overlap[on]
    dofs, rows, bend = model.bore.chosen(on).rows(rim, near)
    both = np.concatenate([dofs, near.dofs + model.rim.size], axis=1)
    # the turn of the section has a row of its own
    by_both = np.zeros((len(on), 4, 16))
    by_both[:, :2, :8], by_both[:, 3, :8] = rows[:, :2], rows[:, 2]
    by_both[:, :3, 8:] = near.by_ring
    total.energy += 0.5 * float(force @ overlap[on])
    _press(total, "bore", near, by_both, both, force, np.full(len(on), k), bend)
    return replace(state, bore_feet=seen.place)


def _teeth(model: ThinRing, state: RingState, rim: Array, total: _Sum) -> RingState:
    """Contact of the flanks."""
    nodes = rim.reshape(-1, 2, 2)[:: model.nodes_per_tooth]
    foot, slope = nodes[:, 0], nodes[:, 1]
    contacts, angle = model.teeth.seen(foot, slope)
    rows, second = model.teeth.rows(contacts, foot, slope, angle)
    k = model.teeth.stiffness
    force = -k * contacts.gap
    j = contacts.sector
    dofs = 4 * model.nodes_per_tooth * j[:, None] + np.arange(4)
    total.energy += -0.5 * float(force @ contacts.gap)
    hessian = k * rows[:, :, None] * rows[:, None, :] - force[:, None, None] * second
    total.add("teeth", dofs, -force[:, None] * rows, hessian)
    point = rotate(contacts.point, angle[j])
    push = force[:, None] * rotate(contacts.normal, angle[j])
    return replace(
        state,
        contacts=contacts,
        tooth_force=force,
        tooth_moment=float(np.sum(turned(point) * push)),
    )


def _press(
    total: _Sum,
    name: str,
    seen: Facing,
    rows: Array,
    dofs: Index,
    force: Array,
    stiffness: Array,
    bend: Array | None = None,
) -> None:
    r"""Add contacts of normal force F and tangent k.

    Gradient :math:`-F\,dg`, Hessian :math:`k\,dg\,dg - F\,d^2g`.

    Args:
        total: Where to.
        name: Of the part.
        seen: The points.
        rows: u_n, u_t, beta and perhaps a turn by the coordinates (n, 3 or 4, m).
        dofs: These coordinates (n, m).
        force: F (n,) [N].
        stiffness: k (n,) [N/m].
        bend: Factor of that turn squared in n . d2p (n,).
    """
    count = rows.shape[1]
    form = np.zeros((len(force), count, count))
    form[:, :3, :3] = -force[:, None, None] * seen.bends()
    form[:, 0, 0] += stiffness
    if bend is not None:
        form[:, 3, 3] -= force * bend
    hessian = np.swapaxes(rows, 1, 2) @ (form @ rows)
    total.add(name, dofs, -force[:, None] * rows[:, 0], hessian)


def _finished(
    model: ThinRing,
    state: RingState,
    outcome: Outcome,
    history: list[float],
    *,
    teeth: bool,
) -> RingState:
    """Forces and energy at the last positions."""
    state, _, _ = _linearised(model, state, teeth=teeth)
    psi, _ = _rotation(model, state.q, state.rotation)
    return replace(state, rotation=psi, outcome=outcome, history=tuple(history))
