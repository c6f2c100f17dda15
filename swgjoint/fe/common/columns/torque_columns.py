"""Refinement of columns of equilibria in torque and angle, and the table of a map."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from swgjoint.fe.common.clearance import FAINT, add_clearance
from swgjoint.fe.common.columns.angle_columns import AngleColumn, SolvedColumns
from swgjoint.fe.common.columns.torque_choice import (
    Ripple,
    common_torques,
    no_ripple,
    periodic,
    torque_beyond,
    unseen_parts,
)
from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.layout_angles import AnyState
from swgjoint.fe.common.load_path import LoadPath, least_certain
from swgjoint.maps.fit.between_angles import (
    doubt_between,
    even_steps,
    finer_steps,
    spread_evenly,
    steps_to_divide,
)
from swgjoint.maps.fit.contact_corners import ContactCorners
from swgjoint.maps.samples import FullSolves
from swgjoint.typing import Array

POTENTIAL_WAVES = 1.0
"""Assumed number of waves per pitch of the error of the complementary potential [-].
The derivative of this error with respect to the angle is an error of the input torque.
"""
LEAST_PEAK = 0.05
"""Lower bound of the peak-to-peak values by which errors are divided, as a fraction of
the largest peak-to-peak value over the torques [-]."""
WORST = 0.5
"""Fraction of the largest estimated error above which intervals are divided together
with the worst one [-]."""
AHEAD = 0.4
"""Range of a prediction of contact changes in either direction, as a fraction of the
largest torque [-]. It exceeds the distance between neighbouring common torques."""


@dataclass(kw_only=True, eq=False)
class ColumnGrid(SolvedColumns[AnyState]):
    """Columns of equilibria that are refined until they predict a map well enough."""

    ripple: Ripple = no_ripple
    """Lower bounds of the peak-to-peak values by which errors are divided."""

    def path(
        self, column: AngleColumn[AnyState], sign: float
    ) -> tuple[LoadPath, tuple[Array, Array]]:
        """Load curve of a column for one sign of the torque.

        For negative torques it is the curve of the mirrored drive.

        Args:
            column: Column of equilibria.
            sign: Sign of the torques, 1.0 or -1.0.

        Returns:
            The curve; the solved torques and the input torques [N·m] of the drive, or
            of the mirrored drive.
        """
        common = [*self.levels, *self.beyond]
        outward: list[float] = sorted(
            (t for t in common if t * sign > 0.0 and t in column.states), key=abs
        )
        # the curve of a free output starts when its clearance is taken up
        first = 0.0 if column.rest.sides is None else sign * self.small
        torque = sign * np.array([first, *outward])
        known = column.paths.get(sign)
        if known is not None and np.array_equal(known[0].torque, torque):
            return known
        states: list[AnyState] = [column.start_towards(sign)]
        states += [column.states[t] for t in outward]
        top = abs(outward[-1])
        figures = np.array([self.figures(s, column.theta) for s in states])
        error, energy, compliance, moment = figures.T
        curve = LoadPath(
            torque=torque,
            output_error=sign * error,
            energy=energy,
            compliance=compliance,
            changes=tuple(self._changes(column, state, sign, top) for state in states),
        )
        column.paths[sign] = curve, (torque, sign * moment)
        return column.paths[sign]

    def _changes(
        self, column: AngleColumn[AnyState], state: AnyState, sign: float, top: float
    ) -> ContactChanges | None:
        """Contact changes that a state of a column predicts, for :meth:`path`."""
        # the drive at rest serves both signs
        if state.torque not in column.changes:
            low, high = state.torque - AHEAD * top, state.torque + AHEAD * top
            found = self.follow.predicted_changes(state, low, high)
            column.changes[state.torque] = found
        changes = column.changes[state.torque]
        return changes.mirror() if changes is not None and sign < 0.0 else changes

    def largest_miss(
        self, count: int, others: list[AngleColumn[AnyState]], torques: Iterable[float]
    ) -> float:
        """Largest error at other angles, as a fraction of the peak-to-peak value [-].

        It is the larger one of the errors of output error and input torque, which is
        predicted as the derivative of the complementary potential by the angle.

        Args:
            count: Number of equally spaced columns, which predict the others together
                with those between them.
            others: Columns at other angles.
            torques: Torques at which to compare [N·m].
        """
        worst, columns, own = 0.0, self.all_columns(count), self.parts(count)
        even = even_steps(own, count)
        parts = np.array([one.theta for one in others]) / self.period
        for torque in torques:
            if torque == 0.0 and self.free:
                continue
            if torque and any(torque not in one.states for one in others):
                continue
            error, energy = self._curves_at(columns, torque)
            potential = spread_evenly(own, energy + torque * error, even)
            error = spread_evenly(own, error, even)
            there, _, _, moment = self._row(others, torque)
            predicted, _ = periodic(error, parts)
            _, slope = periodic(
                potential, np.concatenate([parts, np.arange(even) / even])
            )
            moments = slope / self.period + torque / self.follow.ratio
            predicted_moment, own_moment = np.split(moments, [len(parts)])
            triples = (error, there, predicted), (own_moment, moment, predicted_moment)
            for triple, least in zip(triples, self.ripple(torque), strict=True):
                sampled, truth, estimate = triple
                height = max(least, np.ptp(np.concatenate([sampled, truth])))
                worst = max(worst, float(np.abs(estimate - truth).max() / height))
        return worst

    def _curves_at(
        self, columns: list[AngleColumn[AnyState]], torque: float
    ) -> tuple[Array, Array]:
        """Output error [rad] and energy [J] of columns on their curves, each (n,)."""
        if torque == 0.0 or all(torque in one.states for one in columns):
            error, energy, _, _ = self._row(columns, torque)
            return error, energy
        sign = math.copysign(1.0, torque)
        table = [self.path(one, sign)[0].evaluate_at([abs(torque)]) for one in columns]
        error, energy, _ = np.array(table)[:, :, 0].T
        return sign * error, energy

    def _row(self, columns: list[AngleColumn[AnyState]], torque: float) -> Array:
        """Values of columns at a torque that all of them have (4, n)."""
        states = [c.states[torque] if torque else c.rest.state for c in columns]
        return np.array(
            [self.figures(s, c.theta) for s, c in zip(states, columns, strict=True)]
        ).T

    def peaks(self, count: int, sign: float) -> tuple[Array, Array, Array]:
        """Peak-to-peak values of output error and input torque over the angle.

        Args:
            count: Number of columns.
            sign: Sign of the torques, 1.0 or -1.0.

        Returns:
            Magnitudes of the torques [N·m], and the peak-to-peak values of output error
            [rad] and input torque [N·m] at them, each (n,).
        """
        curves = [self.path(column, sign)[0] for _, column in self.chosen(count)]
        first = max(curve.torque[0] for curve in curves)
        top = max(abs(t) for t in self.levels if t * sign > 0.0)
        torque = np.linspace(first, top, 49)
        tables = np.array([curve.evaluate_at(torque) for curve in curves])
        errors = tables[:, 0]
        potential = tables[:, 1] + torque * errors
        _, slope = periodic(potential, np.arange(count) / count)
        moments = slope / self.period
        heights = []
        for table, least in zip(
            (errors, moments), self.ripple(sign * torque), strict=True
        ):
            height = np.ptp(table, axis=0)
            height = np.maximum(np.maximum(height, least), LEAST_PEAK * height.max())
            # with two angles the derivative vanishes and gives no reference for errors
            heights.append(np.where(height > 0.0, height, np.inf))
        return torque, heights[0], heights[1]

    def divide(self, count: int, most: int, goal: float) -> float:
        """Add common torques until the estimated errors between them meet a goal.

        All angles get the same torques. The error of the curves between the torques
        then changes slowly from angle to angle and has almost no effect on the input
        torque, which is a derivative with respect to the angle.

        Args:
            count: Number of columns.
            most: Largest total number of solves.
            goal: Goal for the largest estimated error, as a fraction of the
                peak-to-peak value [-].

        Returns:
            Largest remaining estimate, as a fraction of the peak-to-peak value [-].
        """
        while True:
            wanted = self._doubts(count)
            worst = max((part for part, _ in wanted), default=0.0)
            limit = max(goal, WORST * worst)
            chosen = sorted((w for w in wanted if w[0] > limit), reverse=True)
            each = count + len(self.between)
            chosen = chosen[: max(0, (most - self.solves) // each)]
            if not chosen:
                return worst
            for _, torque in chosen:
                self._add_torque(count, torque)

    def _doubts(self, count: int) -> list[tuple[float, float]]:
        """Estimated errors of the intervals between common torques.

        Intervals in which a solve has failed are omitted.

        Returns:
            For each interval the estimated error, as a fraction of the peak-to-peak
            value [-], and the torque at which to divide the interval [N·m].
        """
        wanted: list[tuple[float, float]] = []
        columns = self.all_columns(count)
        wave_number = POTENTIAL_WAVES * (2.0 * np.pi / self.period)
        waves = wave_number * finer_steps(self.parts(count), count)
        for sign in self.signs:
            at, error, moment = self.peaks(count, sign)
            parts, places = [], []
            for column, wave in zip(columns, waves, strict=True):
                curve, _ = self.path(column, sign)
                of_error, of_potential = curve.doubt
                there = curve.division
                parts.append(
                    np.maximum(
                        of_error / np.interp(there, at, error),
                        wave * of_potential / np.interp(there, at, moment),
                    )
                )
                places.append(there)
            weights, ends = np.array(parts) + 1e-12, curve.torque
            torques = np.average(places, axis=0, weights=weights)
            tried = sign * np.array([t for t in self.failed if t * sign > 0.0])
            for j, torque in enumerate(torques):
                if not ((tried > ends[j]) & (tried < ends[j + 1])).any():
                    wanted.append((float(weights[:, j].max()), sign * float(torque)))
        return wanted

    def _add_torque(self, count: int, torque: float) -> None:
        """Solve one more torque in every column; it is dropped if a column fails."""
        columns = self.all_columns(count)
        for k, column in enumerate(columns):
            # start from the previous angles if there are any within the pitch
            self._more(column, [torque], columns[:k])
            if torque in column.failed:
                self.failed.append(torque)
                return
        self.levels = sorted([*self.levels, torque])

    def corners(self, count: int) -> dict[float, ContactCorners]:
        """Contact changes between ``count`` columns, by sign of the torque."""
        columns, angle = self.all_columns(count), self.period * self.parts(count)
        found = {}
        for sign in self.signs:
            paths = [self.path(one, sign)[0] for one in columns]
            changes, doubt = [p.contact_changes for p in paths], least_certain(paths)
            found[sign] = ContactCorners.from_changes(
                angle, self.period, changes, doubt
            )
        return found

    def divide_angles(self, count: int, most: int, goal: float) -> bool:
        """Add columns where contacts change between the angles.

        Args:
            count: Number of equally spaced columns.
            most: Largest total number of solves.
            goal: Goal for the largest estimated error between the angles, as a fraction
                of the peak-to-peak value [-].

        Returns:
            Whether columns were added.
        """
        if most <= self.solves:
            return False
        while True:
            columns, parts = self.all_columns(count), self.parts(count)
            doubt = np.zeros(parts.size)
            for sign in self.signs:
                at, *heights = self.peaks(count, sign)
                # between solved torques, errors of the curves would count as corners
                for torque in (t for t in self.levels if t * sign > 0.0):
                    error, energy, _, _ = self._row(columns, torque)
                    values = np.stack([error, energy + torque * error])
                    height = [np.interp(abs(torque), at, one) for one in heights]
                    found = doubt_between(parts, self.period, values, height)
                    doubt = np.maximum(doubt, found)
            left = (most - self.solves) // (1 + len(self.levels))
            divided = steps_to_divide(parts, doubt, goal, count, left)
            if not divided:
                return bool(self.between)
            for place in np.round(np.array(divided) * self.finest, 6).tolist():
                self.columns[place] = self._column(place)
                self.between = sorted([*self.between, place])

    def go_beyond(self, count: int) -> None:
        """Solve one torque of each sign beyond the largest one in every column.

        A map ends at the torsion that the output reaches at the stiffest angle. Under
        the additional torque this torsion equals that at the softest angle under the
        largest torque, so that the map covers all torques up to the largest one at
        every angle. If one of the solves fails, the map ends at the largest torque.
        """
        columns = self.all_columns(count)
        for sign in self.signs:
            top = max((t for t in self.levels if t * sign > 0.0), key=abs)
            rest = self._row(columns, 0.0)[0]
            error, _, compliance, _ = self._row(columns, top)
            torque = torque_beyond(top, rest - error, compliance)
            for k, column in enumerate(columns):
                self._more(column, [torque], columns[:k])
                if torque in column.failed:
                    break
            else:
                self.beyond.append(torque)

    def unseen(self, others: list[AngleColumn[AnyState]], count: int) -> FullSolves:
        """Validation equilibria at other angles, at zero torque and at other torques.

        Args:
            others: Columns at these angles.
            count: Number of validation torques of one sign.
        """
        rows = []
        for column in others:
            theta, torques = column.theta, []
            for sign in self.signs:
                top = max(abs(t) for t in self.levels if t * sign > 0.0)
                torques += [sign * top * part for part in unseen_parts(count)]
            self._more(column, torques)
            solved = {t: column.states[t] for t in torques if t in column.states}
            for torque, state in ({0.0: column.rest.state} | solved).items():
                error, _, _, moment = self.figures(state, theta)
                rows.append((theta, torque, error, moment))
        return FullSolves.from_rows(rows)

    def tables(
        self, count: int, most: int, faint: float = FAINT
    ) -> tuple[dict[float, Array], set[float]]:
        """Tables of the map by torque, at equally spaced angles.

        If clearance leaves the output free, rows are added at its ends, see
        :func:`~swgjoint.fe.common.clearance.add_clearance`.

        Args:
            count: Number of columns.
            most: Largest number of torques of one sign in addition to the solved ones.
            faint: Torque at the ends of the clearance as a fraction of the torque that
                takes it up [-].

        Returns:
            Values (4, n_angles) by torque [N·m], and the torques solved in all columns.
        """
        columns, parts = self.all_columns(count), self.parts(count)
        rest = np.array([self.figures(c.rest.state, c.theta) for c in columns]).T
        table = {0.0: rest}
        for sign in self.signs:
            paths = [self.path(column, sign) for column in columns]
            own = {abs(t) for t in [*self.levels, *self.beyond] if t * sign > 0.0}
            least = self.small if self.free else 0.0
            at, heights, _ = self.peaks(count, sign)
            curves = [curve for curve, _ in paths]
            torque = common_torques(curves, own, least, most, (at, heights))
            if self.free:
                torque = np.concatenate([[least], torque])
            values = np.array(
                [
                    np.vstack([curve.evaluate_at(torque), np.interp(torque, *solved)])
                    for curve, solved in paths
                ]
            )  # (n_columns, 4, n)
            values *= np.array([sign, 1.0, 1.0, sign])[:, None]
            table |= {sign * float(t): values[:, :, j].T for j, t in enumerate(torque)}
        if self.free:
            add_clearance(table, self.signs, self.small, faint)
        even = even_steps(parts, count)
        table = {t: spread_evenly(parts, row.T, even).T for t, row in table.items()}
        return table, {0.0, *self.levels, *self.beyond}
