"""Equilibria of a design over torque and input angle, for its map."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.fe.continuation import Continuation, Unloaded
from swgjoint.fe.drive2d import can_halve, left_out, ring_model
from swgjoint.fe.state import State
from swgjoint.fe.tolerance_sampling import SMALL, sample_tolerances
from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design import Design
from swgjoint.gear.kinematics import angle_coefficients, periodicity
from swgjoint.gear.tolerances import has_errors, without_errors
from swgjoint.maps.catalogue import ratings_of
from swgjoint.maps.samples import MapSamples
from swgjoint.progress import Progress, silent

Array = NDArray[np.float64]

ANGLES = 96
"""Input positions over one pitch: contact events leave corners in the error, and 24
positions alias them into a tenth of the ripple, 48 into a few percent, 96 into 2 %."""
FAINT = 1e-8
"""Part of the torque that takes up a clearance, that acts at its ends: no stiffness is
zero."""
EVERY = 4
"""Of these positions are solved in the second pitch, too."""
LEVELS = (0.05, 0.15, 0.35, 0.65, 1.0)
"""Sampled torques, of both signs, as parts of the repeated peak torque."""
SYMMETRIC = ("elliptical", "simplified", "parabolic", "four_roller", "cosine")
"""Wave generators that are their own mirror image; the teeth always are."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rows:
    """Solved positions of each torque; the table grows position by position."""

    follow: Continuation
    small: float
    """Torque that takes up a clearance [N·m]."""
    tick: Callable[[], None]
    rest: list[Unloaded] = field(default_factory=list)
    states: dict[float, list[State]] = field(default_factory=dict)

    @property
    def free(self) -> bool:
        """Whether clearance leaves the output free without torque somewhere."""
        return any(one.sides is not None for one in self.rest)

    def start(self, torques: list[float]) -> None:
        """Load the first position from zero torque outwards until a solve fails."""
        state = self.follow.meshed(self.follow.deflected())
        if not state.outcome.ok:
            raise _no_rest(0.0, state)
        self._stand(self.follow.unloaded(state, self.small), 0.0)
        for sign in (1.0, -1.0):
            state = self._towards(sign)
            for torque in sorted((t for t in torques if t * sign > 0.0), key=abs):
                state = self.follow.to_torque(state, torque)
                if not state.outcome.ok:
                    break
                self.states[torque] = [state]
                self.tick()

    def advance(self, theta: float) -> None:
        """Add a position to every torque; drop those that fail and those beyond."""
        self._stand(self.follow.unloaded_to(self.rest[-1], theta), theta)
        lost = set()
        for torque in sorted(self.states, key=abs):
            if (torque > 0.0) not in lost:
                state = self.follow.to_angle(self.states[torque][-1], theta)
                if not state.outcome.ok:
                    state = self.follow.to_torque(self._towards(torque), torque)
                if state.outcome.ok:
                    self.states[torque].append(state)
                    self.tick()
                    continue
            lost.add(torque > 0.0)
            del self.states[torque]

    def tables(self, theta: Array) -> dict[float, Array]:
        """Output error, energy, tangent compliance, input torque of every torque.

        Shape (4, n) each. Clearance adds rows, see :func:`across_clearance`.
        """
        found = {torque: self._table(row, theta) for torque, row in self.states.items()}
        found[0.0] = self._table([one.state for one in self.rest], theta)
        if self.free:
            for side, sign in ((0, 1.0), (1, -1.0)):
                if not any(torque * sign > 0.0 for torque in self.states):
                    continue
                row = [
                    one.sides[side]
                    if one.sides is not None
                    else self.follow.to_torque(one.state, sign * self.small)
                    for one in self.rest
                ]
                taken_up = self._table(row, theta)
                begin, onset = across_clearance(found[0.0], taken_up, sign * self.small)
                found |= {sign * self.small: taken_up, begin: onset}
            # the same stiffness on both sides of the middle
            found[0.0][2] = onset[2]
        return found

    def _stand(self, unloaded: Unloaded, theta: float) -> None:
        if not unloaded.state.outcome.ok:
            raise _no_rest(theta, unloaded.state)
        self.rest.append(unloaded)
        self.tick()

    def _towards(self, torque: float) -> State:
        """Where a torque of this sign begins at the last position."""
        rest = self.rest[-1]
        if rest.sides is None:
            return rest.state
        return rest.sides[0 if torque > 0.0 else 1]

    def _table(self, states: list[State], theta: Array) -> Array:
        follow = self.follow
        rows = [
            (follow.output_angle(s), s.energy, s.compliance, follow.input_torque(s))
            for s in states
        ]
        values = np.array(rows).T
        values[0] -= theta / follow.ratio
        return values


def _no_rest(theta: float, state: State) -> ComputationError:
    return ComputationError(
        f"no equilibrium without torque at input angle {theta:g} rad:"
        f" {state.outcome.value}"
    )


def across_clearance(
    rest: Array, taken_up: Array, torque: float
) -> tuple[float, Array]:
    r"""Where the teeth begin to hold an output that is free without torque.

    From the middle of the clearance the torque rises to the :data:`FAINT` part of the
    one that takes it up; there the stiffness begins to grow, to K under that torque at
    :math:`\ell = 3 T / 2 K`. A linear spring would begin at T/K with the energy
    :math:`T^2 / 2 K`; a stiffness that grows steadily stores nearly that on this way.

    Args:
        rest: Output error, energy, compliance and input torque in the middle (4, n).
        taken_up: The same under ``torque`` (4, n).
        torque: A small one [N·m].

    Returns:
        Torque [N·m] and table (4, n) of the begin.
    """
    begin = FAINT * torque
    apart = taken_up[0] - rest[0]  # against the sign of the torque
    way = np.clip(1.0 - 1.5 * torque * taken_up[2] / -apart, 0.1, 1.0)
    onset = rest.copy()
    onset[0] += way * apart
    onset[1] -= 0.5 * begin * way * apart
    onset[2] = -way * apart / begin
    onset[3] += FAINT * (taken_up[3] - rest[3])
    return begin, onset


def _mirrored(values: Array) -> Array:
    """The same drive under the opposite torque, seen in a mirror.

    At -T and -theta: opposite error and input torque, same energy and compliance.
    """
    back = np.roll(values[:, ::-1], 1, axis=1)
    return np.asarray(back * np.array([-1.0, 1.0, 1.0, -1.0])[:, None])


def sample_map(
    design: Design, *, angles: int = ANGLES, progress: Progress = silent
) -> MapSamples:
    """Equilibria over one pitch and both signs of torque, by the nonlinear 2D model.

    One pitch suffices with perfect teeth, and with a symmetric wave generator the
    negative torques are the mirror image of the positive ones; both claims are checked
    at rated torque and recorded. Torques at which a solve fails, and those beyond, are
    left out, and the record says so. Manufacturing errors are superposed, see
    :mod:`swgjoint.fe.tolerance_sampling`.

    Args:
        design: The drive.
        angles: Input positions over one pitch of the fixed member.
        progress: Called with the stage, the solves done and their number.

    Raises:
        ComputationError: If the unloaded drive or small torques cannot be solved.
    """
    begin = time.perf_counter()
    drive, ratings = design.drive, ratings_of(design)
    cycles = periodicity(
        drive.layout, drive.teeth_flexspline, drive.teeth_circular_spline
    )
    perfect = without_errors(design)
    follow = Continuation(
        model=ring_model(perfect, half=can_halve(perfect), friction=False),
        ratio=design.ratio,
        layout=drive.layout,
    )
    symmetric = design.wave_generator.kind in SYMMETRIC
    parts = [part * ratings.repeated_peak for part in LEVELS]
    torques = parts if symmetric else [-t for t in parts[::-1]] + parts
    period = 2.0 * pi / cycles
    theta = period * np.arange(angles) / angles
    total, done = angles * (len(torques) + 1) + len(theta[::EVERY]), 0

    def tick() -> None:
        nonlocal done
        done += 1
        progress(f"{drive.name}: equilibria", min(done, total), total)

    rows = _Rows(follow=follow, small=SMALL * ratings.rated_torque, tick=tick)
    try:
        rows.start(torques)
        for angle in theta[1:]:
            rows.advance(float(angle))
        tables = rows.tables(theta)
    except ComputationError as failure:
        raise ComputationError(f"{drive.name}: {failure}") from failure

    truncated = len(rows.states) < len(torques)
    # a second pitch, at the torque next to rated
    if not rows.states:
        raise _too_few(design, parts)
    check = min(rows.states, key=lambda t: abs(t - ratings.rated_torque))
    state, second = rows.states[check][-1], []
    for angle in theta[::EVERY]:
        state = follow.to_angle(state, period + float(angle))
        ok = state.outcome.ok
        second.append(follow.output_angle(state) if ok else np.nan)
        tick()
    again = np.array(second) - (period + theta[::EVERY]) / design.ratio
    info: dict[str, Any] = {
        "second_pitch": {
            "torque_Nm": check,
            "largest_difference_rad": float(
                np.abs(again - tables[check][0, ::EVERY]).max()
            ),
            "peak_to_peak_rad": float(np.ptp(tables[check][0])),
        }
    }
    if symmetric:
        opposite = {-t: _mirrored(values) for t, values in tables.items() if t}
        solved = follow.to_torque(rows.rest[1].state, -check)
        there = follow.output_angle(solved) - theta[1] / design.ratio
        there -= opposite[-check][0, 1]
        info["mirror"] = {
            "torque_Nm": -check,
            "difference_rad": float(there) if solved.outcome.ok else None,
        }
        tables |= opposite

    used = np.array(sorted(tables))
    if used[0] >= 0.0 or used[-1] <= 0.0 or used.size < 5:
        raise _too_few(design, parts)
    error, energy, compliance, input_torque = np.array(
        [tables[t] for t in used]
    ).swapaxes(0, 1)
    cup = None if design.cup is None else cup_torsional_stiffness(design)
    if cup is not None:
        error = error - (used / cup)[:, None]
        energy = energy + (0.5 * used**2 / cup)[:, None]
        compliance = compliance + 1.0 / cup
    tolerances = None
    if has_errors(design):
        tolerances = sample_tolerances(
            design,
            repeated_peak=float(used[-1]),
            rated_torque=ratings.rated_torque,
            progress=progress,
        )
        if cup is not None:
            tolerances = tolerances.in_series(cup)
    # the pattern follows the gear angle that depends on the input alone, written so
    # that its phase grows with theta
    alpha, beta = angle_coefficients(drive.layout)
    return MapSamples(
        name=drive.name,
        level="2d",
        layout=drive.layout,
        teeth_flexspline=drive.teeth_flexspline,
        teeth_circular_spline=drive.teeth_circular_spline,
        ratings=ratings,
        damping_ratio=design.joint.damping_ratio,
        order=(cycles, 0) if alpha == (1, 0) else (0, cycles * beta[0]),
        input_angle=theta,
        torque=used,
        output_error=error,
        energy=energy,
        compliance=compliance,
        input_torque=input_torque,
        tolerances=tolerances,
        free=rows.free,
        info=info
        | {
            "design_hash": design.content_hash(),
            "label": {
                "model": "2d",
                "level": "nonlinear",
                "circular_spline": "elastic, outside "
                + design.circular_spline.outer_rim,
                "cup": None if cup is None else "closed-form torsion in series",
                "friction": "left out of the potential"
                if design.friction.tooth_coefficient
                else None,
                "tolerances": _named(design),
                "left_out": left_out(design),
            },
            "ratings_source": ratings.source,
            "truncated": truncated,
            "solves": done,
            "sampling_wall_s": time.perf_counter() - begin,
        },
    )


def _named(design: Design) -> dict[str, float] | None:
    """Errors of the drive, for the validity label."""
    values = design.tolerances.model_dump()
    return {k: v for k, v in values.items() if v} if has_errors(design) else None


def _too_few(design: Design, parts: list[float]) -> ComputationError:
    return ComputationError(
        f"{design.drive.name}: too few torques can be solved; the smallest is "
        f"{parts[0]:g} N·m of {parts[-1]:g} N·m repeated peak"
    )
