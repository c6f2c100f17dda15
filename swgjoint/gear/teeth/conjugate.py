"""Conjugate tooth profiles by the envelope method, for either member.

The circular spline is generated from the flexspline or vice versa. The generated flank
is the envelope of the moving flank of the other member (article on an 80:1 drive,
"Derivation of the conjugate circular spline profile"). The article uses the deflection
w = w_0 cos 2 theta, whereas this module uses the kinematics of
:mod:`swgjoint.gear.teeth.neutral_line`. Towards the root, a straight line leaves the
envelope, and a circular fillet joins this line to the root circle. Both keep clear of
the mating tip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.sections import Conjugate
from swgjoint.gear.teeth.blank import blank
from swgjoint.gear.teeth.conjugate_root import SHORTEST, RootBuilder, polar_angle
from swgjoint.gear.teeth.envelope import Envelope, EnvelopeRun
from swgjoint.gear.teeth.profile import TANGENCY_RAD, ToothProfile
from swgjoint.gear.teeth.segments import Piece, Point
from swgjoint.gear.teeth.smooth_curve import smooth_curve
from swgjoint.gear.teeth.tooth_motion import Receiver, ToothMotion, tooth_motions
from swgjoint.typing import Array
from swgjoint.units import deg

DEPARTURES = (45.0 * deg, 30.0 * deg, 20.0 * deg, 12.0 * deg)
"""Inclinations of the normal at which the flank may leave the envelope [rad].

The first inclination that permits a fillet of :data:`WANTED_FILLET` is used, otherwise
the one with the largest fillet. Narrow tooth spaces need a steep flank there, which has
a small inclination of its normal.
"""
WANTED_FILLET = 0.1
"""Desired radius of the fillet, as a multiple of the module [-]."""
SHARPEST = 0.1
"""Smallest usable radius of curvature of an edge path, as a multiple of the module
[-]."""
OVERLAP = 1e-9
"""Largest accepted overlap of the two rigid flanks [m]."""
NODES, EDGE_NODES, DENSE, SAMPLES = 41, 121, 161, 33
"""Numbers of nodes of a flank curve and of an edge path, of points that place the
nodes, and of samples of the inclination."""


def conjugate_profile(
    design: Design,
    member: str,
    given: ToothProfile,
    *,
    motions: tuple[ToothMotion, ...] | None = None,
) -> ToothProfile:
    """Profile of ``member`` that is conjugate to the profile of the other member.

    The pair has no backlash if the thickness coefficient c_P of ``member`` is 1. A
    smaller coefficient rotates the flank back by (1 - c_P) alpha_T / 2, as for other
    profiles, thesis (6.3).

    Args:
        design: The drive; the profile table of ``member`` affects only the root.
        member: ``flexspline`` or ``circular_spline``.
        given: Profile of the other member.
        motions: Motions of the teeth; None takes those on the neutral line.

    Raises:
        DesignError: If there is no conjugate tooth, in one line that names the key.
    """
    start = blank(design, member)
    receiver: Receiver = "circular_spline" if start.internal else "flexspline"
    envelope = Envelope(
        given=given,
        receiver=receiver,
        motions=motions or tooth_motions(design),
        tip=start.tip,
    )
    return _Builder(start, envelope).build()


class _Builder(RootBuilder):
    """Builds a complete flank from the branches of an envelope."""

    def build(self) -> ToothProfile:
        """Complete profile of the generated member."""
        start, envelope = self.start, self.envelope
        reach, floor = envelope.summit, envelope.floor
        if start.side * (reach - start.root) <= 0.0:
            limit = start.side * (start.pitch - reach) / start.module
            raise start.fault(
                "dedendum_coefficient",
                f"the other member reaches the root; accepted: > {limit:.4g}",
            )
        if start.side * (start.tip - floor) >= 0.0:
            limit = start.side * (floor - start.pitch) / start.module
            raise start.fault(
                "addendum_coefficient",
                "the tip reaches the root fillet of the other member; accepted: < "
                f"{limit:.4g}, or a larger dedendum_coefficient there",
            )
        runs = envelope.runs() if start.side * (start.tip - envelope.reach) > 0 else []
        if not runs:
            raise start.fault(
                "addendum_coefficient",
                "the flank of the other member does not reach the tip; accepted: a "
                "larger value",
            )
        runs = self._with_edge(runs)
        best: tuple[list[Piece], list[Piece], float] | None = None
        largest = 0.0
        for departure in DEPARTURES:
            flank = self._flank(runs, departure)
            root = None if flank is None else self._root(flank[1])
            if flank is None or root is None:
                continue
            radius = root[0][-1].radius
            if radius > largest:
                best, largest = (flank[0], *root), radius
            if largest >= WANTED_FILLET * start.module:
                break
        if best is None:
            assert isinstance(start.spec.profile, Conjugate)
            if start.spec.profile.root_radius_mm is not None:
                raise start.fault(
                    "profile.root_radius_mm",
                    "the fillet does not fit below the flank or interferes with the "
                    "path of the other member; accepted: a smaller radius",
                )
            raise start.fault(
                "dedendum_coefficient",
                "no fillet fits between flank and root; accepted: another value "
                f"above {start.side * (start.pitch - reach) / start.module:.4g}, or a "
                "wider tip of the other member",
            )
        pieces, below, end = best
        top = polar_angle(pieces[0].start)
        if top <= 0.0:
            raise start.fault(
                "addendum_coefficient",
                "the conjugate tooth is pointed; accepted: a smaller value",
            )
        pieces[0] = replace(pieces[0], edge=True)  # type: ignore[type-var]
        profile = start.profile(top, [*pieces, *below], end)
        if not self._sound(profile):
            raise self._split_fault()
        return profile

    def _sound(self, profile: ToothProfile) -> bool:
        """Whether the flank is regular and the other member does not overlap it.

        If the curvature of the wave generator is discontinuous, branches of the
        envelope may end or intersect within a piece. Such a flank is rejected.
        """
        for junction in profile.junctions():
            tangent = junction.edge or junction.corner < TANGENCY_RAD
            if junction.gap > 1e-12 or not tangent:
                return False
        s = np.linspace(*profile.contact_range, 1500)
        points, _, _ = profile.evaluate(s)
        chords = np.hypot(*np.diff(points, axis=0).T) / np.diff(s)
        if chords.max() > 1.001 or chords.min() < 0.3:  # a corner shortens them
            return False
        if (np.diff(profile.side * np.hypot(*points.T)) > 1e-15).any():
            return False
        gap, _, _ = profile.signed_distance(self._tips)
        return bool(gap.min() > -OVERLAP)

    # -- the flank ----------------------------------------------------------------

    def _with_edge(self, runs: list[EnvelopeRun]) -> list[EnvelopeRun]:
        """The runs, followed by the path of the edge if the flank starts at one."""
        low, last = self.envelope.given.contact_range[0], runs[-1]
        close = last.station[-1] - low < 0.05 * (runs[0].station[0] - low)
        if last.edge or not self.envelope.starts_at_edge or not close:
            return runs
        station, guess = np.array([low]), last.theta[-1:]
        theta = self.envelope.contact(last.motion, station, guess)
        edge = EnvelopeRun(motion=last.motion, station=station, theta=theta, edge=True)
        return [*runs, edge]

    def _trace(self, run: EnvelopeRun) -> Callable[[Array], tuple[Array, Array]]:
        """Function for points and normals of the generated tooth along a run.

        Its parameter is the arc length on the given flank or, for an edge, the position
        of the motion. The points are rotated for the backlash.
        """

        def trace(t: Array) -> tuple[Array, Array]:
            if run.edge:
                points, normals = self.envelope.trace_edge(run, t)
            else:
                points, normals, _ = self.envelope.trace(run, t)
            return points @ self.turn, normals @ self.turn

        return trace

    def _radius(self, trace: Callable[[Array], tuple[Array, Array]], t: float) -> float:
        points, _ = trace(np.array([t]))
        return float(np.hypot(points[0, 0], points[0, 1]))

    def _flank(
        self, runs: list[EnvelopeRun], departure: float
    ) -> tuple[list[Piece], tuple[Point, Array]] | None:
        """Pieces from the tip circle to the departure, and its point and normal.

        The flank leaves the envelope where the inclination of its normal exceeds
        ``departure`` [rad]. None if the flank is nowhere as steep as this.
        """
        from scipy.optimize import brentq

        start, envelope = self.start, self.envelope
        low = envelope.given.contact_range[0]
        pieces: list[Piece] = []
        first: float | None = None
        edge = False
        for k, run in enumerate(runs):
            trace = self._trace(run)
            values = run.theta if run.edge else run.station
            if first is None:  # intersection of the flank with the tip circle
                first = _crossing(
                    lambda t, trace=trace: self._radius(trace, t) - start.tip,  # type: ignore[misc]
                    float(values[0]),
                    float(values[0] - values[-1]) / len(values),
                )
            following = runs[k + 1] if k + 1 < len(runs) else None
            last = float(values[-1])
            next_first, next_edge = 0.0, False
            smooth = following is not None and self._runs_on(run, following, low)
            if following is None:
                if run.edge:
                    # the path ends at its summit, or earlier where it turns sharply
                    last = self._round_part(trace, first, self._summit(run, first))
            elif smooth:
                last = low
                _, _, theta = envelope.trace(run, np.array([low]))
                next_first = float(theta[0])
            else:
                last, next_first = self._meet(run, following)
                next_edge = True
            # leave the envelope where the inclination exceeds the departure angle,
            # below the steepest part of the flank

            def inclined(t: Array | float, trace=trace) -> Array:  # type: ignore[no-untyped-def]
                _, normals = trace(np.atleast_1d(t))
                angle = np.arctan2(start.side * normals[:, 1], normals[:, 0])
                return np.asarray(angle - departure)

            samples = np.linspace(first, last, SAMPLES)
            steep = np.flatnonzero(inclined(samples) < 0.0)
            if not steep.size and not pieces:
                return None
            leaves = not steep.size or steep[-1] < SAMPLES - 1
            if steep.size and leaves:
                a, b = samples[steep[-1]], samples[steep[-1] + 1]
                last = float(brentq(lambda t: inclined(t)[0], a, b, xtol=1e-13))
            elif leaves:
                last = first
            ends, _ = trace(np.array([first, last]))
            if pieces and np.hypot(*(ends[1] - ends[0])) < SHORTEST:
                last, leaves = first, True
            if last != first:
                pieces += self._curves(run, trace, first, last, edge)
            if leaves and not pieces:
                return None
            if leaves or following is None:
                points, normals = trace(np.array([last]))
                return pieces, ((float(points[0, 0]), float(points[0, 1])), normals[0])
            first, edge = next_first, next_edge
        raise AssertionError("a flank has at least one run")

    def _split_fault(self) -> DesignError:
        return self.start.fault(
            "profile.kind",
            "the envelope is not continuous under this wave generator; accepted: "
            "another profile or thickness_coefficient of the other member, or a "
            "smoother wave generator",
        )

    def _round_part(
        self, trace: Callable[[Array], tuple[Array, Array]], first: float, last: float
    ) -> float:
        """Position where the path of an edge turns too sharply, else ``last`` [rad]."""
        t = np.linspace(first, last, 401)
        points, normals = trace(t)
        turn = np.unwrap(np.arctan2(normals[:, 1], normals[:, 0]))
        walked = np.hypot(*np.diff(points, axis=0).T)
        sharp = np.abs(np.diff(turn)) * SHARPEST * self.start.module > walked
        return float(t[np.argmax(sharp)]) if sharp.any() else last

    def _summit(self, run: EnvelopeRun, first: float) -> float:
        """Position at which the edge is deepest in the space of the receiver [rad]."""
        from scipy.optimize import minimize_scalar

        trace, side = self._trace(run), self.start.side
        near = 0.2 * run.motion.half_range
        deepest = minimize_scalar(
            lambda t: side * self._radius(trace, t),
            bounds=(min(-near, first), max(near, first)),
            method="bounded",
            options={"xatol": 1e-9},
        )
        return float(deepest.x)

    def _runs_on(self, run: EnvelopeRun, following: EnvelopeRun, low: float) -> bool:
        """Whether a branch continues smoothly at its end into the path of the edge."""
        near = abs(run.station[-1] - low) < 0.05 * abs(run.station[0] - low)
        step = abs(following.theta[0] - run.theta[-1])
        return (
            following.edge
            and not run.edge
            and bool(near)
            and following.motion is run.motion
            and bool(step < 0.03 * run.motion.half_range)
        )

    def _meet(self, one: EnvelopeRun, two: EnvelopeRun) -> tuple[float, float]:
        """Parameters (stations or edge positions) at which two branches intersect."""
        from scipy.optimize import root

        first, second = self._trace(one), self._trace(two)
        module = self.start.module
        scale = np.array([0.01 if run.edge else module for run in (one, two)])

        def apart(x: Array) -> Array:
            a, _ = first(x[:1] * scale[0])
            b, _ = second(x[1:] * scale[1])
            return np.asarray((a - b)[0] / module)

        ends = (
            (one.theta if one.edge else one.station)[-1],
            (two.theta if two.edge else two.station)[0],
        )
        solution = root(apart, np.array(ends) / scale, tol=1e-13)
        values = solution.x * scale
        low, high = self.envelope.given.contact_range
        inside = [
            run.edge or low <= x <= high
            for run, x in zip((one, two), values, strict=True)
        ]
        if not np.abs(apart(solution.x)).max() < 1e-10 or not all(inside):
            raise self._split_fault()
        return float(values[0]), float(values[1])

    def _curves(
        self,
        run: EnvelopeRun,
        trace: Callable[[Array], tuple[Array, Array]],
        first: float,
        last: float,
        edge: bool,
    ) -> list[Piece]:
        """Smooth curves along a run, divided at the junctions of the given flank."""
        given = self.envelope.given
        names = [part.name for part in given.segments]
        cuts: list[float] = []
        if not run.edge:
            inner = given.stations
            inside = (inner < first - SHORTEST) & (inner > last + SHORTEST)
            cuts = sorted((float(s) for s in inner[inside]), reverse=True)
        ends = [first, *cuts, last]
        pieces: list[Piece] = []
        for a, b in pairwise(ends):
            name = "edge_path"
            if not run.edge:
                middle = 0.5 * (a + b)
                k = int(np.searchsorted(given.stations, middle)) - 1
                name = f"conjugate_{names[k]}"
            pieces.append(
                smooth_curve(
                    name,
                    trace,
                    a,
                    b,
                    self.start.side,
                    nodes=EDGE_NODES if run.edge else NODES,
                    dense=DENSE,
                    edge=edge and not pieces,
                )
            )
        return pieces


def _crossing(f: Callable[[float], float], guess: float, step: float) -> float:
    """Root of a monotonic function near a guess; the guess if no root is nearby."""
    from scipy.optimize import brentq

    low, high = guess - abs(step), guess + abs(step)
    for _ in range(8):
        if f(low) * f(high) <= 0.0:
            return float(brentq(f, low, high, xtol=1e-15))
        low, high = low - abs(step), high + abs(step)
    return guess
